"""Mesh as arrays that change when nodes move, with the constraints on its nodes."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask, padded
from kohonen_adapt.checks import check_state, listed
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.mesh.shapes import are_round, round_shapes
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Movable", "Recycled", "Work", "arrays_of", "names_beside", "shown", "unchanged"]


class Movable(ABC):
    """Mesh as arrays, with the constraints on its nodes.

    The Kohonen map, recycling, transport and the polish change the arrays in place.

    Attributes
    ----------
    state_names
        Names of the arrays that change when nodes move. The array "record.field" is a field of one of `records`.
    by_element
        Names of the arrays with a row per element; all others have a row per node.
    curved_parts
        Words for curved parts of the boundary and for their facets in messages.
    least_in_polish
        Minimum Euclidean quality that the polish may leave in a metric with min_quality="auto".
    floor
        Minimum quality after a change, or the worst quality before the change if that is lower.
    least
        Minimum Euclidean quality beside a metric, in which `floor` is measured; equal to `floor` if that is Euclidean.
    shape
        Shapes of the metric at the nodes, (n, 3), in space (n, 6).
    in_metric
        True if the shapes are not round.
    """

    state_names: ClassVar[tuple[str, ...]]
    by_element: ClassVar[tuple[str, ...]]
    curved_parts: ClassVar[tuple[str, str]]
    least_in_polish: ClassVar[float]

    floor: float
    least: float
    shape: Floats
    in_metric: bool = False

    @property
    @abstractmethod
    def tessellation(self) -> Triangulation | Tetrahedralization: ...

    @property
    @abstractmethod
    def held_nodes(self) -> Mask: ...

    @abstractmethod
    def records(self) -> dict[str, Any]:
        """Return the records by name, and loose arrays under an empty name."""

    @abstractmethod
    def ranges(self, n: int, m: int) -> dict[str, tuple[int, int]]:
        """Return the bounds of the values by array, for n nodes and m elements."""

    @abstractmethod
    def set_arrays(self, state: Mapping[str, NDArray[Any]]) -> None: ...

    @abstractmethod
    def sagitta(self) -> float:
        """Return the largest distance of a curved part from its facets."""

    @abstractmethod
    def cut_off(self) -> float: ...  # area or volume between elements and their curved parts, on both sides

    @abstractmethod
    def farthest_part(self) -> str:
        """Return the name of the part at this distance from its facets."""

    def measure_by(self, shape: Floats | None) -> None:
        # shapes of the metric at the nodes, None for round ones
        self.in_metric = shape is not None
        self.shape = round_shapes(self.nnodes, self.tessellation.position.shape[1]) if shape is None else shape

    @property
    def euclidean_floor(self) -> float:
        return self.least if self.in_metric else self.floor

    @property
    def polish_floor(self) -> float:
        # The energy stretches elements of a metric further than pays off on the next mesh: `python -m benchmarks
        # anisotropy` has the errors.
        return min(self.floor, max(self.least, self.least_in_polish)) if self.in_metric else self.floor

    @property
    def relief(self) -> float:
        # of Euclidean quality, see `Metric`
        return self.floor / self.least if self.in_metric and self.least < self.floor else 1.0

    @property
    def nnodes(self) -> int:
        return self.tessellation.nnodes

    @property
    def input_mesh(self) -> Mesh:
        return self.tessellation.mesh

    def state(self) -> dict[str, NDArray[Any]]:
        records = self.records()
        split = {name: name.rpartition(".") for name in self.state_names}
        return {name: getattr(records[record], field) for name, (record, _, field) in split.items()}

    def padded_state(self, nodes: int, elements: int, unused: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        rows = {name: elements if name in self.by_element else nodes for name in self.state_names}
        return {name: padded(array, rows[name], unused.get(name, -1)) for name, array in self.state().items()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        self.check_state(state)
        self.set_arrays({name: state[name].copy() for name in self.state_names})
        self.in_metric = not are_round(self.shape)

    def check_state(self, state: Mapping[str, NDArray[Any]]) -> None:
        n, m = len(state.get("position", ())), len(state.get(self.by_element[0], ()))
        rows = {name: m if name in self.by_element else n for name in self.state_names}
        check_state(self.state(), state, rows, self.ranges(n, m))


def names_beside(
    tessellation: Triangulation | Tetrahedralization, names: Mapping[str, NDArray[np.int8]], part: int, regions: Ints
) -> str:
    # Returns an empty string if neither has a name.
    found = [name for name, manner in names.items() if manner[part]]
    if found:
        return f"boundary {' + '.join(map(repr, found))}"
    region_of_input, beside = tessellation.region_of_input, set(regions.tolist())
    sets = named_sets(tessellation.mesh.subdomains).items()
    found = [name for name, rows in sets if beside & set(region_of_input[rows].tolist())]
    return listed(found) if found else ""


def arrays_of(record: str, state: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    return {name.removeprefix(f"{record}."): array for name, array in state.items() if name.startswith(f"{record}.")}


@dataclass(frozen=True)
class Recycled:
    """Changes of a triangulation by recycling, in one or more steps.

    Attributes
    ----------
    old
        Index of every node before recycling, -1 for a new node, shape (n,).
    start_element
        Element of the triangulation before recycling that is near each node, shape (n,).
    splits, collapses
        Number of edge splits and of edge collapses.
    """

    old: Ints
    start_element: Ints
    splits: int
    collapses: int


def unchanged(mesh: Triangulation | Tetrahedralization) -> Recycled:
    star = mesh.star
    return Recycled(np.arange(mesh.nnodes, dtype=np.int32), star.element[star.start[:-1]], 0, 0)


def shown(title: str, form: str) -> dict[str, str]:
    return {"title": title, "form": form}


@dataclass(frozen=True, kw_only=True)
class Work:
    quantization_errors: tuple[float, ...] = field(default=(), repr=False)
    max_displacement: float = 0.0
    moved: int = 0
    unmoved: int = 0
    refused_by_quality: int = 0
    refused_by_reach: int = 0
    held_in_polish: int = 0
    why_still: str = ""
    polish_gain: float = field(default=0.0, metadata=shown("gain of polish", "#.2g"))
    splits: int = field(default=0, metadata=shown("splits", "d"))
    collapses: int = field(default=0, metadata=shown("collapses", "d"))
