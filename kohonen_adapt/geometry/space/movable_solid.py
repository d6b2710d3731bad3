"""Tetrahedral mesh as arrays, with the constraints on its nodes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTet

from kohonen_adapt.arrays import Array, Floats, Int8s, Ints, Mask, copied
from kohonen_adapt.geometry.movable import Movable, arrays_of, settings_of
from kohonen_adapt.geometry.rules import Rules, checked_surfaces, pinned_nodes
from kohonen_adapt.geometry.space.midsides import NO_EDGES, InputEdges, offsets_on_surfaces
from kohonen_adapt.geometry.space.patches import Patches, constrained_faces, edges_of, on_their_patches, seams_of
from kohonen_adapt.geometry.space.projection import (
    distances_from_faces,
    move_to_targets,
    projected_positions,
    samples_of,
    volume_cut_off,
)
from kohonen_adapt.geometry.space.recognition import patches_of
from kohonen_adapt.geometry.space.ridges import freedom_of, ridges_of
from kohonen_adapt.kernels.arrays import KernelMesh, Metric
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    INSIDE,
    ON_PATCH,
    ON_RIDGE,
    PLANE,
    ROUND_METRIC,
    Constraints,
    Freedom,
    Surfaces,
)
from kohonen_adapt.log import logger
from kohonen_adapt.mesh.adjacency import write_on_both_sides
from kohonen_adapt.mesh.cells import FACES
from kohonen_adapt.mesh.curved import is_second_order, with_midside_offsets
from kohonen_adapt.mesh.shapes import round_shapes
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization, faces_of

__all__ = ["MovableSolid", "metric_of", "with_round_edges"]


# The arrays that change when nodes move: (m, ...) by element, the others (n, ...) by node.
BY_ELEMENT = ("tetrahedra.node", "tetrahedra.neighbour", "tetrahedra.region", "tetrahedra.patch")
STATE_NAMES = ("position", "shape", *BY_ELEMENT, "freedom.number", "freedom.place", "freedom.pinned")


@dataclass(kw_only=True)
class MovableSolid(Movable):
    """Tetrahedral mesh as arrays, with the constraints on its nodes.

    Attributes
    ----------
    tetrahedralization
        Nodes and elements, with the patch of every constrained face.
    surfaces
        Positions of patches and ridges, constant.
    freedom
        Constraint of every node.
    patches
        Names and front of every patch.
    input_edges
        Curved edges of the input on surfaces that are not recognised, whose nodes are held.
    """

    state_names = STATE_NAMES
    by_element = BY_ELEMENT
    curved_parts = "surfaces", "faces"
    least_in_polish = 0.05

    tetrahedralization: Tetrahedralization
    surfaces: Surfaces
    freedom: Freedom
    patches: Patches
    input_edges: InputEdges = NO_EDGES

    @classmethod
    def of(cls, mesh: MeshTet, rules: Rules, curved: bool | None = None) -> "MovableSolid":
        """Return a mesh as arrays with the constraints of `rules`.

        `curved` requests curved edges in the output; None requests them if the input is a `MeshTet2`. Curved edges of
        the input on patches that are recognised as plane keep their nodes, and edges inside regions are straightened.
        """
        tet = Tetrahedralization.of(mesh)
        settings = settings_of(rules, tet)
        pinned = pinned_nodes(tet.mesh, rules.pinned)
        faces = constrained_faces(tet.mesh, tet.elements)
        edges = edges_of(faces, tet.nnodes)
        surfaces = checked_surfaces(mesh, rules.surfaces)
        patches = patches_of(faces, seams_of(faces, edges, tet.position), tet.position, surfaces)
        wanted = is_second_order(mesh) if curved is None else curved
        input_edges = NO_EDGES
        if wanted and is_second_order(mesh):
            input_edges = InputEdges.of(mesh, faces, patches)
            pinned[cKDTree(tet.position).query(input_edges.ends.reshape(-1, 3))[1]] = True
        ridges = ridges_of(edges, patches, on_their_patches(faces.nodes, patches, tet.position))
        elements = tet.elements
        write_on_both_sides(elements.patch, elements.neighbour, faces.element, faces.corner, patches.of_face)
        freedom = freedom_of(faces, patches, ridges, pinned, tet.position)
        shapes = patches.shape, patches.origin, patches.axis, patches.size
        there = Surfaces(*shapes, ridges.meets, *ridges.curves, samples_of(faces, patches, tet.position))
        curved_output = bool(wanted) and (len(input_edges.ends) > 0 or bool(np.any(patches.shape != PLANE)))
        return cls(
            tetrahedralization=tet,
            surfaces=there,
            freedom=freedom,
            patches=patches,
            input_edges=input_edges,
            curved=curved_output,
            **settings,
        )

    @property
    def tessellation(self) -> Tetrahedralization:
        return self.tetrahedralization

    def kernel_mesh(self) -> KernelMesh:
        tet = self.tetrahedralization
        constraints = Constraints(self.freedom, self.surfaces, inner_nodes(tet), self.metric)
        return KernelMesh(tet.position, tet.elements, tet.star, constraints)

    @property
    def metric(self) -> Metric:
        return metric_of(self.shape, self.relief)

    def mesh(self) -> MeshTet:
        if not self.curved:
            return self.straight_mesh()
        mesh, straight, count = self.curved_mesh()
        if straight.any():
            logger.info(
                "%d of %d edges on curved surfaces stay straight, because curved ones would fold elements.",
                *(np.count_nonzero(straight), count),
            )
        return mesh

    def curved_mesh(self) -> tuple[MeshTet, Mask, int]:
        # and the edges on curved surfaces that stay straight, (nedges,), and the number of all
        mesh = self.straight_mesh()
        offset, flat = offsets_on_surfaces(mesh, self.tetrahedralization.elements, self.patches, self.input_edges)
        curved = with_midside_offsets(mesh, offset) if offset.any() else mesh
        return curved, flat, int(np.count_nonzero(flat | offset.any(axis=0)))

    @property
    def part_names(self) -> Mapping[str, Int8s]:
        return self.patches.names

    @property
    def part_of_facets(self) -> Ints:
        return self.tetrahedralization.elements.patch

    def are_left(self, element: Ints, corner: Ints) -> Mask:
        tet = self.tetrahedralization
        patch = tet.elements.patch[element, corner]
        nodes = faces_of(tet.elements, element, corner)
        return self.patches.in_front(patch, tet.elements.region[element], tet.position, nodes)

    def copy(self) -> "MovableSolid":
        tet, shape = self.tetrahedralization.copy(), self.shape.copy()
        return replace(self, tetrahedralization=tet, freedom=copied(self.freedom), shape=shape)

    def records(self) -> dict[str, Any]:
        tet = self.tetrahedralization
        loose = SimpleNamespace(position=tet.position, shape=self.shape)
        return {"": loose, "tetrahedra": tet.elements, "freedom": self.freedom}

    def ranges(self, n: int, m: int) -> dict[str, tuple[int, int]]:
        return {
            "tetrahedra.node": (-1, n),
            "tetrahedra.neighbour": (-1, m),
            "tetrahedra.region": (0, int(self.tetrahedralization.region_of_input.max()) + 1),
            "tetrahedra.patch": (-1, len(self.surfaces.shape)),
            "freedom.number": (HELD, INSIDE + 1),
        }

    def check_state(self, state: Mapping[str, Array]) -> None:
        super().check_state(state)
        node, number, place = (state[name] for name in ("tetrahedra.node", "freedom.number", "freedom.place"))
        if np.any(node[node[:, 0] >= 0] < 0):
            raise ValueError("tetrahedra.node has elements without all of their corners")
        for kind, count in ((ON_RIDGE, len(self.surfaces.ridge_shape)), (ON_PATCH, len(self.surfaces.shape))):
            if np.any((number == kind) & ((place < 0) | (place >= count))):
                raise ValueError(f"freedom.place has numbers from {place.min()} to {place.max()}")

    def set_arrays(self, state: Mapping[str, Array]) -> None:
        tet = self.tetrahedralization
        tet.set_arrays(state["position"], tet.elements._replace(**arrays_of("tetrahedra", state)))
        self.freedom, self.shape = self.freedom._replace(**arrays_of("freedom", state)), state["shape"]

    def project_nodes(self) -> None:
        tet = self.tetrahedralization
        target = projected_positions(tet.position, self.surfaces, self.freedom, self.patches)
        tet.position[:] = move_to_targets(tet.position, tet.elements, target, self.euclidean_floor)

    def sagitta(self) -> float:
        tet = self.tetrahedralization
        if self.curved:
            return 0.0
        return float(distances_from_faces(tet.position, tet.elements, self.patches).max(initial=0.0))

    def cut_off(self) -> float:
        tet = self.tetrahedralization
        return 0.0 if self.curved else volume_cut_off(tet.position, tet.elements, self.patches)

    def farthest_part(self) -> str:
        tet = self.tetrahedralization
        p = int(np.argmax(distances_from_faces(tet.position, tet.elements, self.patches)))
        if names := self.name_of(p):
            return names
        e, k = np.argwhere(tet.elements.patch == p)[0]
        x = tet.position[tet.elements.node[e, FACES[k]]].mean(axis=0)
        return f"one without a name, with a face near ({', '.join(f'{place:.4g}' for place in x)})"

    @property
    def held_nodes(self) -> Mask:
        return self.freedom.number == HELD


def metric_of(shape: Floats, relief: float) -> Metric:
    return ROUND_METRIC if np.array_equal(shape, round_shapes(len(shape), 3)) else Metric(shape, relief)


def inner_nodes(tet: Tetrahedralization) -> Mask:
    used = tet.used
    node, region = tet.elements.node[used], tet.elements.region[used]
    one = np.full(tet.nnodes, -1, np.int32)
    one[node] = region[:, None]
    inner = np.ones(tet.nnodes, bool)
    inner[node[one[node] != region[:, None]]] = False
    return inner


def with_round_edges(mesh: MeshTet) -> MeshTet:
    # with the nodes inside edges on the curved surfaces that are recognised
    movable = MovableSolid.of(mesh, Rules(), curved=True)
    return movable.curved_mesh()[0] if movable.curved else mesh
