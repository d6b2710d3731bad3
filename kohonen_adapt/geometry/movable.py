"""Mesh as arrays that change when nodes move, with the constraints on its nodes."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from skfem import Mesh
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Array, Floats, Int8s, Ints, Mask, padded, ranks
from kohonen_adapt.checks import check_state, listed
from kohonen_adapt.geometry.rules import Rules, check_for, euclidean_floor_of, floor_of
from kohonen_adapt.mesh.host import facets_opposite, set_boundaries
from kohonen_adapt.mesh.names import LEFT, boundary_of, named_sets, turned
from kohonen_adapt.mesh.shapes import are_round, round_shapes
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = [
    "Movable",
    "Recycled",
    "arrays_of",
    "element_order",
    "reordered_state",
    "settings_of",
    "unchanged",
]


@dataclass(kw_only=True)
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
    flips
        True if edges may flip, in space if elements may be swapped.
    least
        Minimum Euclidean quality beside a metric, in which `floor` is measured; equal to `floor` if that is Euclidean.
    shape
        Shapes of the metric at the nodes, (n, 3), in space (n, 6).
    in_metric
        True if the shapes are not round.
    curved
        True if `mesh` returns curved elements: curved sides are requested, and a part of the boundary is curved.
    """

    state_names: ClassVar[tuple[str, ...]]
    by_element: ClassVar[tuple[str, ...]]
    curved_parts: ClassVar[tuple[str, str]]
    least_in_polish: ClassVar[float]

    floor: float
    flips: bool
    least: float
    shape: Floats
    in_metric: bool = False
    curved: bool = False

    @property
    @abstractmethod
    def tessellation(self) -> Triangulation | Tetrahedralization: ...

    @property
    @abstractmethod
    def held_nodes(self) -> Mask: ...

    @property
    @abstractmethod
    def part_names(self) -> Mapping[str, Int8s]:
        """Orientation of each boundary name on the curve segments or patches."""

    @property
    @abstractmethod
    def part_of_facets(self) -> Ints:
        """Curve segment or patch of the facet opposite to each corner, (m, d + 1)."""

    @abstractmethod
    def are_left(self, element: Ints, corner: Ints) -> Mask:
        """Return True for elements to the left of curve segments, or in front of patches."""

    @abstractmethod
    def mesh(self) -> Mesh: ...

    @abstractmethod
    def records(self) -> dict[str, Any]:
        """Return the records by name, and loose arrays under an empty name."""

    @abstractmethod
    def ranges(self, n: int, m: int) -> dict[str, tuple[int, int]]:
        """Return the bounds of the values by array, for n nodes and m elements."""

    @abstractmethod
    def set_arrays(self, state: Mapping[str, Array]) -> None: ...

    @abstractmethod
    def sagitta(self) -> float:
        """Return the largest distance of a curved part from its facets."""

    @abstractmethod
    def cut_off(self) -> float: ...  # area or volume between elements and their curved parts, on both sides

    @abstractmethod
    def farthest_part(self) -> str:
        """Return the name of the part at this distance from its facets."""

    def start(self) -> Mesh:
        return self.mesh() if self.curved else self.input_mesh

    def straight_mesh(self) -> Mesh:
        mesh = self.tessellation.to_mesh()
        used = self.tessellation.used
        boundaries = self.input_mesh.boundaries
        if boundaries is not None:
            facet = facets_opposite(mesh, self.tessellation.elements.node[used])
            part = self.part_of_facets[used]
            found = {}
            for name, manner in self.part_names.items():
                own = np.append(manner, 0)[part]
                on_left = None
                e, k = np.nonzero(own)
                if isinstance(boundaries[name], OrientedBoundary):
                    on_left = turned(own[e, k], self.are_left(used[e], k)) == LEFT
                found[name] = boundary_of(mesh, facet, e, k, on_left)
            set_boundaries(mesh, found)
        return mesh

    def name_of(self, part: int) -> str:
        # The regions beside a part are listed if the part has no name.
        found = [name for name, manner in self.part_names.items() if manner[part]]
        if found:
            return f"boundary {' + '.join(map(repr, found))}"
        found = self.subdomains_of(self.tessellation.elements.region[np.any(self.part_of_facets == part, axis=1)])
        return listed(found) if found else ""

    def subdomains_of(self, regions: Ints) -> list[str]:
        sets = named_sets(self.input_mesh.subdomains)
        region = self.tessellation.region_of_input
        return [name for name, rows in sets.items() if np.isin(regions, region[rows]).any()]

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

    def state(self) -> dict[str, Array]:
        records = self.records()
        split = {name: name.rpartition(".") for name in self.state_names}
        return {name: getattr(records[record], field) for name, (record, _, field) in split.items()}

    def padded_state(self, nodes: int, elements: int, unused: Mapping[str, Any]) -> dict[str, Array]:
        rows = {name: elements if name in self.by_element else nodes for name in self.state_names}
        return {name: padded(array, rows[name], unused.get(name, -1)) for name, array in self.state().items()}

    def restore(self, state: Mapping[str, Array]) -> None:
        self.check_state(state)
        self.set_arrays({name: state[name].copy() for name in self.state_names})
        self.in_metric = not are_round(self.shape)

    def check_state(self, state: Mapping[str, Array]) -> None:
        n, m = len(state.get("position", ())), len(state.get(self.by_element[0], ()))
        rows = {name: m if name in self.by_element else n for name in self.state_names}
        check_state(self.state(), state, rows, self.ranges(n, m))


def arrays_of(record: str, state: Mapping[str, Array]) -> dict[str, Any]:
    return {name.removeprefix(f"{record}."): array for name, array in state.items() if name.startswith(f"{record}.")}


def settings_of(rules: Rules, tessellation: Triangulation | Tetrahedralization) -> dict[str, Any]:
    """Return the fields of a `Movable` that `rules` determine, after a check."""
    dim = tessellation.cell.dim
    check_for(rules, dim)
    floor, least = floor_of(rules, dim), euclidean_floor_of(rules, dim)
    return {"floor": floor, "least": least, "flips": rules.flips, "shape": round_shapes(tessellation.nnodes, dim)}


def reordered_state(
    state: Mapping[str, Array], nodes: Ints, elements: Ints, by_element: Sequence[str]
) -> dict[str, Array]:
    """Return the arrays of some nodes and elements, in their order.

    The first two of `by_element` are the nodes and the neighbours of elements.
    """
    found = {name: np.take(array, elements if name in by_element else nodes, axis=0) for name, array in state.items()}
    node, neighbour = by_element[:2]
    for name, order, like in (
        (node, nodes, "position"),
        ("twins.partner", nodes, "position"),
        (neighbour, elements, node),
    ):
        if name in found:
            found[name] = np.append(ranks(order, len(state[like])), np.int32(-1))[found[name]]
    return found


def element_order(node: Ints, node_index: Ints) -> Ints:
    return np.argsort(node_index[node].min(axis=1), kind="stable")


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

    def followed_by(self, origins: Any, rows: Ints, splits: int, collapses: int) -> "Recycled":
        """Return the changes including a further step.

        The step has left `rows` of the nodes with `origins`.
        """
        counts = self.splits + splits, self.collapses + collapses
        return Recycled(origins.old[rows], origins.start_element[rows], *counts)


def unchanged(mesh: Triangulation | Tetrahedralization) -> Recycled:
    star = mesh.star
    return Recycled(np.arange(mesh.nnodes, dtype=np.int32), star.element[star.start[:-1]], 0, 0)
