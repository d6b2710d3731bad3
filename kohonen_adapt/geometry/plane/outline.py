"""Constraints of boundaries and interfaces on the nodes of a triangulation.

Boundaries and interfaces are cut at corners into curve segments (`chains`).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.movable import names_beside
from kohonen_adapt.geometry.plane.chains import (
    chains_of,
    find_parameters,
    on_lines_and_arcs,
    pair_chains,
    parameters_of,
    points_on,
    signed_distances,
)
from kohonen_adapt.geometry.plane.curves import Curve, curve_of_facets, projected
from kohonen_adapt.geometry.plane.pairs import Pairs, find_pairs
from kohonen_adapt.geometry.plane.polylines import (
    BY_MIDSIDES,
    Facets,
    Joints,
    Polylines,
    Segments,
    constrained_facets,
    cut_into_segments,
    joints_of,
    trace_facets,
)
from kohonen_adapt.geometry.plane.recognition import (
    arcs_across_junctions,
    joints_on_curves,
    midsides_of,
    with_arcs_across_junctions,
)
from kohonen_adapt.geometry.plane.spline import Spline
from kohonen_adapt.geometry.rules import Rules, checked_curves, pinned_nodes
from kohonen_adapt.kernels.triangle.arrays import (
    FREE,
    HELD,
    JUNCTION,
    OTHER,
    OWN,
    ROUND,
    SLIDING,
    STRAIGHT,
    TABLED,
    Constraints,
    PeriodicPairs,
)
from kohonen_adapt.kernels.triangle.chains import farthest_from_facets, look_up
from kohonen_adapt.kernels.triangle.geometry import move_to_targets
from kohonen_adapt.mesh.adjacency import write_on_both_sides
from kohonen_adapt.mesh.host import facets_opposite, set_boundaries
from kohonen_adapt.mesh.names import boundary_of, turned
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Outline"]

STILL = 1e-13  # distance from the curve below which nodes are not moved, relative to the size of the mesh


@dataclass
class Outline:
    """Constraints of boundaries and interfaces on the nodes of a triangulation.

    Attributes
    ----------
    constraints
        Kernel arrays, which change when nodes slide or when a corner passes to another node.
    names
        Orientation of each name on the curve segments, 0 (absent), UNORIENTED, LEFT or RIGHT, shape (c,).
    pinned
        Mask (n,) of nodes pinned by the user.
    curves
        User-defined curves by boundary name.
    curve_index
        Index in `curves` of every curve segment, negative for none, shape (c,).
    """

    constraints: Constraints
    names: dict[str, NDArray[np.int8]]
    pinned: Mask
    curves: dict[str, Curve]
    curve_index: Ints

    @classmethod
    def of(cls, triangulation: Triangulation, rules: Rules, offset: Floats | None = None) -> "Outline":
        # Curved facets, arcs and splines are recognised by `offset`, shape (2, nfacets), the offsets of midside nodes
        # from the midpoints of the chords.
        pinned = pinned_nodes(triangulation.mesh, rules.pinned)
        curves = with_circles(checked_curves(triangulation.mesh, rules.curves))
        facets = constrained_facets(triangulation.mesh, triangulation.elements)
        pairs = find_pairs(triangulation, facets, rules.periodic)
        midsides = midsides_of(facets, triangulation, offset)
        curve = midsides.curve_index(curve_of_facets(facets.sides, len(facets.element), curves))
        joints = joints_of(facets, triangulation.position, on_lines_and_arcs(curve, curves), midsides.offset)
        joints, circle = joints_on_curves(joints, midsides, curve)
        if not midsides.any_curved:
            circle = arcs_across_junctions(facets, triangulation.position, curve, curves, pinned, pairs)
        polylines, segments, sliding = cut_in_pairs(triangulation, facets, joints, pairs, pinned, curve, curves, circle)
        chains = chains_of(triangulation.position, polylines, segments, curves, midsides.offset)
        chain = np.empty(len(facets.element), dtype=np.int32)
        chain[polylines.facet[segments.slots]] = segments.of_slot
        elements = triangulation.elements
        write_on_both_sides(elements.chain, elements.neighbour, facets.element, facets.corner, chain)
        occupied = pinned.copy()
        occupied[facets.nodes[pairs.facet >= 0]] = True
        constraints = Constraints(
            kind=kinds_of(facets, sliding, pinned),
            chain=chains_of_nodes(facets, joints, chain, sliding, occupied & ~sliding, rules.flips),
            parameter=np.zeros(triangulation.nnodes),
            inner=inner_nodes(triangulation),
            chains=chains,
            periodic=periodic_pairs_of(triangulation, facets, pairs),
        )
        find_parameters(triangulation.position, constraints, polylines.node, segments.first, segments.last)
        match_pairs(constraints, pairs, chain)
        first = polylines.facet[segments.first]
        along = runs_along(triangulation, constraints, facets.element[first], facets.corner[first])
        names = {name: turned(side[first], along) for name, side in facets.sides.items()}
        return cls(constraints, names, pinned, curves, segments.curve)

    def copy(self) -> "Outline":
        names_of_arrays = ("kind", "chain", "parameter", "inner")  # curve segments and periodic pairs do not change
        arrays = {name: getattr(self.constraints, name).copy() for name in names_of_arrays}
        return replace(self, constraints=self.constraints._replace(**arrays))

    def project_nodes(self, triangulation: Triangulation, floor: float) -> None:
        kind, chain, chains = self.constraints.kind, self.constraints.own_chain, self.constraints.chains
        curved = (chains.shape != STRAIGHT) | (self.curve_index >= 0)
        nodes = np.flatnonzero((kind == SLIDING) & curved[chain])
        if not len(nodes):
            return
        target = np.empty((len(nodes), 2))
        look_up(self.constraints, nodes, target)
        for number, (name, curve) in enumerate(self.curves.items()):
            on = (self.curve_index == number)[chain[nodes]] & (chains.shape == TABLED)[chain[nodes]]
            if on.any():
                target[on] = projected(curve, triangulation.position[nodes[on]], name)
        tolerance = STILL * np.max(np.ptp(triangulation.position, axis=0))
        move_to_targets(triangulation.position, triangulation.star, nodes, target, tolerance, floor)

    def sagitta(self, triangulation: Triangulation) -> float:
        return farthest_from_facets(triangulation.position, triangulation.elements, self.constraints)[0]

    def farthest_curve(self, triangulation: Triangulation) -> str:
        _, c = farthest_from_facets(triangulation.position, triangulation.elements, self.constraints)
        regions = triangulation.elements.region[np.any(triangulation.elements.chain == c, axis=1)]
        return names_beside(triangulation, self.names, c, regions) or "none"

    @property
    def straight(self) -> Mask:
        return self.constraints.chains.shape == STRAIGHT

    @property
    def on_circles(self) -> Mask:
        return self.constraints.chains.shape == ROUND

    def nodes_by_freedom(self) -> dict[str, Mask]:
        kind, (one, other) = self.constraints.kind, self.constraints.chain.T
        held, jumps = kind == HELD, (other >= 0) | (one == JUNCTION)
        return {
            "free": kind == FREE,
            "sliding": kind == SLIDING,
            "at corners": held & jumps,
            "fixed": held & ~jumps,
        }

    def points_on(self, chain: Ints, parameter: Floats) -> Floats:
        return points_on(self.constraints, chain, parameter)

    def with_boundaries(self, mesh: MeshTri, triangulation: Triangulation) -> MeshTri:
        if triangulation.mesh.boundaries is None:
            return mesh
        facet = facets_opposite(mesh, triangulation.elements.node)
        set_boundaries(mesh, {name: self._boundary(mesh, facet, triangulation, name) for name in self.names})
        return mesh

    def _boundary(self, mesh: MeshTri, facet: Ints, triangulation: Triangulation, name: str) -> Ints:
        chain = triangulation.elements.chain
        manner = np.append(self.names[name], 0)
        element, corner = np.nonzero((chain >= 0) & manner[chain].astype(bool))

        def side(e: Ints, k: Ints) -> NDArray[np.int8]:
            return turned(manner[chain[e, k]], runs_along(triangulation, self.constraints, e, k))

        oriented = isinstance(triangulation.mesh.boundaries[name], OrientedBoundary)
        return boundary_of(mesh, facet, element, corner, side if oriented else None)


def with_circles(curves: dict[str, Curve]) -> dict[str, Curve]:
    arcs = {name: curve.as_arc() for name, curve in curves.items() if isinstance(curve, Spline)}
    return curves | {name: arc for name, arc in arcs.items() if arc is not None}


def cut_in_pairs(
    triangulation: Triangulation,
    facets: Facets,
    joints: Joints,
    pairs: Pairs,
    pinned: Mask,
    curve: Ints,
    curves: dict[str, Curve],
    circle: Floats,
) -> tuple[Polylines, Segments, Mask]:
    # Returns polylines, segments, and the mask (n,) of nodes inside segments, which slide. A node whose partner
    # cannot slide ends its segment.
    paired = np.flatnonzero(pairs.partner >= 0)
    if np.any(((curve >= 0) | ((curve == BY_MIDSIDES) & np.isnan(circle[:, 0]))) & (pairs.facet >= 0)):
        raise ValueError(
            "a periodic boundary cannot have a curve, too: its pieces must be straight or arcs of circles, which need "
            "none. Leave its curve out, or draw its midside nodes to their chords."
        )
    stops = pinned.copy()
    while True:
        polylines, segments = cut_into_segments(
            triangulation.position, trace_facets(facets, joints, stops), curve, curves, circle
        )
        segments = with_arcs_across_junctions(polylines, segments, circle)
        sliding = np.zeros(triangulation.nnodes, dtype=bool)
        sliding[polylines.node[segments.slots]] = True
        sliding[polylines.node[np.stack([segments.first, segments.last])[:, ~segments.closed]]] = False
        unmatched = paired[sliding[paired] & ~sliding[pairs.partner[paired]]]
        if len(unmatched) == 0:
            return polylines, segments, sliding
        stops[unmatched] = True


def periodic_pairs_of(triangulation: Triangulation, facets: Facets, pairs: Pairs) -> PeriodicPairs:
    region = triangulation.elements.region
    there = np.full((len(pairs.motions), region.max() + 1), -1, dtype=np.int32)
    rows = np.flatnonzero((pairs.facet >= 0) & np.append(pairs.continues, False)[pairs.facet_motion])
    there[pairs.facet_motion[rows], region[facets.element[rows]]] = region[facets.element[pairs.facet[rows]]]
    return PeriodicPairs(pairs.partner, pairs.motion, pairs.motions, there)


def match_pairs(constraints: Constraints, pairs: Pairs, chain: Ints) -> None:
    rows = np.flatnonzero(pairs.facet >= 0)
    mate, motion = (np.full(len(constraints.chains.length), -1) for _ in range(2))
    mate[chain[rows]], motion[chain[rows]] = chain[pairs.facet[rows]], pairs.facet_motion[rows]
    pair_chains(constraints.chains, mate, motion, pairs.motions)
    v = np.flatnonzero((constraints.kind == SLIDING) & (pairs.motion >= 0) & (pairs.motion % 2 == 0))
    constraints.parameter[pairs.partner[v]] = constraints.parameter[v]


def kinds_of(facets: Facets, sliding: Mask, pinned: Mask) -> NDArray[np.int8]:
    kind = np.full(len(sliding), FREE, dtype=np.int8)
    kind[facets.nodes] = HELD
    kind[pinned] = HELD
    kind[sliding] = SLIDING
    return kind


def chains_of_nodes(
    facets: Facets, joints: Joints, chain: Ints, sliding: Mask, occupied: Mask, junctions: bool
) -> NDArray[np.int32]:
    """Return the two curve segments of every node, -1 for none, shape (n, 2).

    Both columns of a sliding node hold its segment. A corner of two segments holds both, and a corner of three holds
    JUNCTION if `junctions`. Nodes of the mask `occupied`, shape (n,), hold -1, because no other node may take over
    their corner: pinned nodes, and nodes of periodic boundaries that do not slide.
    """
    chains = np.full((len(sliding), 2), -1, dtype=np.int32)
    chains[joints.node] = chain[joints.facets]
    if junctions:
        chains[np.bincount(facets.nodes.ravel(), minlength=len(chains)) == 3, OWN] = JUNCTION
    chains[occupied] = -1
    chains[(chains[:, OWN] == chains[:, OTHER]) & ~sliding] = -1  # the corner of a loop has no second segment
    return chains


def inner_nodes(triangulation: Triangulation) -> Mask:
    elements = triangulation.elements
    inner = np.ones(triangulation.nnodes, dtype=bool)
    across = elements.neighbour
    e, k = np.nonzero((across < 0) | (elements.region[across] != elements.region[:, None]))
    inner[np.concatenate(elements.ends(e, k))] = False
    return inner


def runs_along(triangulation: Triangulation, constraints: Constraints, element: Ints, corner: Ints) -> Mask:
    ends, chain = triangulation.elements.ends(element, corner), triangulation.elements.chain[element, corner]
    start, end = (parameters_of(triangulation.position, constraints, chain, node) for node in ends)
    return signed_distances(constraints.chains, chain, start, end) > 0.0
