"""Triangle mesh as arrays, with the constraints on its nodes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Array, Floats, Int8s, Ints, Mask
from kohonen_adapt.geometry.movable import Movable, arrays_of, settings_of
from kohonen_adapt.geometry.plane.layers import set_levels
from kohonen_adapt.geometry.plane.midsides import (
    MIN_JACOBIAN,
    area_cut_off,
    offsets_on_curves,
    offsets_with_free_sides,
)
from kohonen_adapt.geometry.plane.outline import Outline, run_along
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.kernels.arrays import KernelMesh, Metric
from kohonen_adapt.kernels.threads import LIGHT, even_cuts, shared
from kohonen_adapt.kernels.triangle.arrays import HELD, Constraints, Elements
from kohonen_adapt.kernels.triangle.flip import flip_edges, mark_non_delaunay
from kohonen_adapt.mesh.curved import is_second_order, offsets_of_sides, with_midside_offsets
from kohonen_adapt.mesh.host import facets_opposite
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["BY_ELEMENT", "STATE_NAMES", "MovableMesh", "with_state"]

FLIPS = 2_000_000  # per compiled call, so that Ctrl-C takes effect within half a second

# The arrays that change when nodes move: (m, ...) by element, the others (n, ...) by node.
BY_ELEMENT = ("elements.node", "elements.neighbour", "elements.region", "elements.chain")
STATE_NAMES = (
    *("position", "shape", "pinned", *BY_ELEMENT, "elements.level", "twins.partner", "twins.motion"),
    *("constraints.kind", "constraints.chain", "constraints.parameter", "constraints.inner"),
)

FLAT = 1e-6  # distance of a midside node from its curve, relative to the mesh, up to which the side is exact


@dataclass(kw_only=True)
class MovableMesh(Movable):
    """Triangle mesh as arrays, with the constraints on its nodes.

    Attributes
    ----------
    triangulation
        Nodes and elements, with the levels that preserve layers.
    outline
        Constraints on the nodes of boundaries and interfaces, and the boundary names.
    """

    state_names = STATE_NAMES
    by_element = BY_ELEMENT
    curved_parts = "curves", "facets"
    least_in_polish = 0.1

    triangulation: Triangulation
    outline: Outline

    @classmethod
    def of(cls, mesh: MeshTri, rules: Rules, curved: bool | None = None) -> "MovableMesh":
        """Return a mesh as arrays with the constraints of `rules`.

        `curved` requests curved sides in the output; None requests them if the input is a `MeshTri2`. Curved sides that
        are on no boundary or interface are straightened.
        """
        triangulation = Triangulation.of(mesh)
        settings = settings_of(rules, triangulation)
        second_order = is_second_order(mesh)
        outline = Outline.of(triangulation, rules, offsets_of_sides(mesh) if second_order else None)
        set_levels(triangulation, outline.constraints, rules.layers)
        curved_output = (second_order if curved is None else curved) and not outline.straight.all()
        return cls(triangulation=triangulation, outline=outline, curved=curved_output, **settings)

    @property
    def constraints(self) -> Constraints:
        return self.outline.constraints

    @property
    def tessellation(self) -> Triangulation:
        return self.triangulation

    def kernel_mesh(self) -> KernelMesh:
        tri = self.triangulation
        constraints = self.constraints._replace(metric=Metric(self.shape, self.relief))
        return KernelMesh(tri.position, tri.elements, tri.star, constraints)

    def mesh(self, least: float = MIN_JACOBIAN) -> MeshTri:
        return self._with_offsets(self.midside_offsets(least))

    def mesh_with_free_sides(self) -> MeshTri:
        """Return the mesh with exact sides on curves."""
        return self._with_offsets(offsets_with_free_sides(self.triangulation, self.constraints))

    def flattened(self, mesh: MeshTri) -> float:
        """Return the largest distance of midside nodes of a mesh from their curves."""
        exact, found = offsets_of_sides(self.mesh(-np.inf)), offsets_of_sides(mesh)
        distance = float(np.hypot(*np.where(exact.any(axis=0), exact - found, 0.0)).max())
        return distance if distance > FLAT * np.ptp(mesh.doflocs, axis=1).max() else 0.0

    def _with_offsets(self, offsets: Floats) -> MeshTri:
        mesh = self.straight_mesh()
        if not self.curved:
            return mesh
        facet, of_facet = facets_opposite(mesh, self.triangulation.elements.node), np.zeros((2, mesh.facets.shape[1]))
        of_facet[:, facet] = np.moveaxis(offsets, 2, 0)
        return with_midside_offsets(mesh, of_facet)

    def midside_offsets(self, least: float = MIN_JACOBIAN) -> Floats:
        """Return the midside offsets of all sides, (m, 3, 2), 0 unless `curved`."""
        if not self.curved:
            return np.zeros((*self.triangulation.elements.node.shape, 2))
        return offsets_on_curves(self.triangulation, self.constraints, least)

    def copy(self) -> "MovableMesh":
        own = self.triangulation.copy(), self.outline.copy(), self.shape.copy()
        return replace(self, triangulation=own[0], outline=own[1], shape=own[2])

    def records(self) -> dict[str, Any]:
        loose = SimpleNamespace(position=self.triangulation.position, shape=self.shape, pinned=self.outline.pinned)
        elements, constraints = self.triangulation.elements, self.constraints
        return {"": loose, "elements": elements, "constraints": constraints, "twins": constraints.periodic}

    def set_arrays(self, state: Mapping[str, Array]) -> None:
        tri = self.triangulation
        elements, self.outline.constraints = with_state(tri.elements, self.constraints, state)
        tri.set_arrays(state["position"], elements)
        self.outline.pinned, self.shape = state["pinned"], state["shape"]

    def ranges(self, n: int, m: int) -> dict[str, tuple[int, int]]:
        chains, motions = len(self.constraints.chains.length), len(self.constraints.periodic.motions)
        return {
            "elements.node": (0, n),
            "elements.neighbour": (-1, m),
            "elements.region": (0, len(self.triangulation.elements.layered)),
            "elements.chain": (-1, chains),
            "constraints.chain": (-1, chains),
            "twins.partner": (-1, n),
            "twins.motion": (-1, motions),
        }

    def project_nodes(self) -> None:
        self.outline.project_nodes(self.triangulation, self.euclidean_floor)

    def flip(self) -> int:
        if not self.flips:
            return 0
        tri = self.triangulation
        m = len(self.triangulation.elements.node)
        doubtful, stack, waiting = np.empty(m, bool), np.empty(m, np.int32), np.zeros(m, bool)

        metric, cuts = Metric(self.shape, self.relief), even_cuts(m, LIGHT)
        total, flips = 0, FLIPS
        while flips >= FLIPS:
            shared(lambda _, *rows: mark_non_delaunay(tri.position, tri.elements, self.shape, *rows, doubtful), cuts)
            flips = flip_edges(tri.position, tri.elements, metric, self.floor, doubtful, stack, waiting, FLIPS)
            total += flips
            if flips:
                tri.refill_star()
        return total

    def sagitta(self) -> float:
        return 0.0 if self.curved else self.outline.farthest(self.triangulation)[0]

    def cut_off(self) -> float:
        return 0.0 if self.curved else area_cut_off(self.triangulation, self.constraints)

    def farthest_part(self) -> str:
        return self.name_of(self.outline.farthest(self.triangulation)[1]) or "none"

    @property
    def part_names(self) -> Mapping[str, Int8s]:
        return self.outline.names

    @property
    def part_of_facets(self) -> Ints:
        return self.triangulation.elements.chain

    def are_left(self, element: Ints, corner: Ints) -> Mask:
        return run_along(self.triangulation, self.constraints, element, corner)

    @property
    def held_nodes(self) -> Mask:
        return self.constraints.kind == HELD


def with_state(
    elements: Elements, constraints: Constraints, state: Mapping[str, Array]
) -> tuple[Elements, Constraints]:
    periodic = constraints.periodic._replace(**arrays_of("twins", state))
    constraints = constraints._replace(periodic=periodic, **arrays_of("constraints", state))
    return elements._replace(**arrays_of("elements", state)), constraints
