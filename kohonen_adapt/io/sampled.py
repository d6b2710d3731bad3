"""Fields on triangles as a file has them, before they are put on a mesh."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["Field", "Sampled"]


@dataclass(frozen=True)
class Field:
    """One field.

    Attributes
    ----------
    name
        As the file has it.
    nodal
        Whether it is on nodes, else on triangles.
    values
        (nodes or triangles, components), of any type.
    """

    name: str
    nodal: bool
    values: NDArray[Any]


@dataclass(frozen=True)
class Sampled:
    """Triangles with fields.

    Attributes
    ----------
    points
        (n, 2 or 3).
    triangles
        (m, 3): rows of `points`.
    fields
        All that the file has; names may come again.
    """

    points: Floats
    triangles: Ints
    fields: list[Field]
