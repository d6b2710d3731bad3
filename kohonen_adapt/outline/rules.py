"""What the nodes of a mesh may do, as it is handed from the loop to the map."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from kohonen_adapt.arrays import Ints
from kohonen_adapt.outline.curves import Curve

__all__ = ["Limits"]


@dataclass(frozen=True)
class Limits:
    """The options of `relocate` that every pass has in common."""

    topology: str = "flip"
    min_quality: float = 0.3
    pinned: Sequence[int | str] | Ints | str = ()
    curves: Mapping[str, Curve] | None = None
    periodic: Sequence[tuple[str, str]] = ()
    layers: Mapping[str, int] | None = None
