"""Constraints of boundaries and interfaces on the nodes of a triangulation.

Boundaries and interfaces are cut at corners into curve segments (`chains`).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Int8s, Int32s, Ints, Mask
from kohonen_adapt.geometry.plane.chains import (
    chains_of,
    find_parameters,
    on_chains,
    on_lines_and_arcs,
    pair_chains,
    points_on,
    spans_of,
)
from kohonen_adapt.geometry.plane.curves import Curve, curve_of_facets, projected
from kohonen_adapt.geometry.plane.midsides import offsets_from_chords
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
    Midsides,
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
    OTHER,
    OWN,
    ROUND,
    SLIDING,
    STRAIGHT,
    TABLED,
    Constraints,
    PeriodicPairs,
)
from kohonen_adapt.kernels.triangle.chains import look_up
from kohonen_adapt.kernels.triangle.guard import move_to_targets
from kohonen_adapt.mesh.adjacency import write_on_both_sides
from kohonen_adapt.mesh.names import turned
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Outline", "run_along"]

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
    names: dict[str, Int8s]
    pinned: Mask
    curves: dict[str, Curve]
    curve_index: Ints

    @classmethod
    def of(cls, triangulation: Triangulation, rules: Rules, offset: Floats | None = None) -> "Outline":
        # Curved facets, arcs and splines are recognised by `offset`, shape (2, nfacets), the offsets of midside nodes
        # from the midpoints of the chords.
        mesh, position, elements = triangulation.mesh, triangulation.position, triangulation.elements
        pinned, curves = pinned_nodes(mesh, rules.pinned), with_circles(checked_curves(mesh, rules.curves))
        facets = constrained_facets(mesh, elements)
        pairs = find_pairs(triangulation, facets, rules.periodic)
        found = segmented(triangulation, facets, pairs, pinned, curves, offset)
        polylines, segments = found.polylines, found.segments
        chain = np.empty(len(facets.element), np.int32)
        chain[polylines.facet[segments.slots]] = segments.of_slot
        write_on_both_sides(elements.chain, elements.neighbour, facets.element, facets.corner, chain)
        occupied = pinned.copy()
        occupied[facets.nodes[pairs.facet >= 0]] = True
        occupied &= ~found.sliding
        constraints = Constraints(
            kind=kinds_of(facets, found.sliding, pinned),
            chain=chains_of_nodes(found.joints, chain, found.sliding, occupied),
            parameter=np.zeros(triangulation.nnodes),
            inner=inner_nodes(triangulation),
            chains=chains_of(position, polylines, segments, curves, found.midsides.offset),
            periodic=PeriodicPairs(pairs.partner, pairs.motion, pairs.motions),
        )
        find_parameters(position, constraints, polylines.node, segments)
        match_pairs(constraints, pairs, chain)
        first = polylines.facet[segments.first]
        along = run_along(triangulation, constraints, facets.element[first], facets.corner[first])
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
        metric = self.constraints.metric
        move_to_targets(triangulation.position, triangulation.star, metric, nodes, target, tolerance, floor)

    def farthest(self, triangulation: Triangulation) -> tuple[float, int]:
        """Return the largest distance of a curve segment from its facets, and its index."""
        chain = triangulation.elements.chain
        e, k = np.nonzero(on_chains(chain, ~self.straight))
        squared = np.sum(offsets_from_chords(triangulation, self.constraints, e, k) ** 2, axis=1)
        if not squared.any():
            return 0.0, -1
        first = np.argmax(squared)
        return float(np.sqrt(squared[first])), int(chain[e[first], k[first]])

    @property
    def straight(self) -> Mask:
        return self.constraints.chains.shape == STRAIGHT

    @property
    def on_circles(self) -> Mask:
        return self.constraints.chains.shape == ROUND

    def nodes_by_freedom(self) -> dict[str, Mask]:
        kind, other = self.constraints.kind, self.constraints.chain[:, OTHER]
        held = kind == HELD
        jumps = other >= 0
        return {
            "free": kind == FREE,
            "sliding": kind == SLIDING,
            "at corners": held & jumps,
            "fixed": held & ~jumps,
        }

    def points_on(self, chain: Ints, parameter: Floats) -> Floats:
        return points_on(self.constraints, chain, parameter)


def with_circles(curves: dict[str, Curve]) -> dict[str, Curve]:
    arcs = {name: curve.as_arc() for name, curve in curves.items() if isinstance(curve, Spline)}
    return curves | {name: arc for name, arc in arcs.items() if arc is not None}


class Segmented(NamedTuple):
    """Facets joined into polylines and cut into curve segments."""

    midsides: Midsides
    joints: Joints
    polylines: Polylines
    segments: Segments
    sliding: Mask  # (n,) nodes inside segments, which slide


def segmented(
    triangulation: Triangulation,
    facets: Facets,
    pairs: Pairs,
    pinned: Mask,
    curves: dict[str, Curve],
    offset: Floats | None,
) -> Segmented:
    # A node whose partner cannot slide ends its segment.
    position = triangulation.position
    paired = np.flatnonzero(pairs.partner >= 0)
    stops = pinned.copy()
    midsides = midsides_of(facets, triangulation, offset)
    curve = midsides.curve_index(curve_of_facets(facets.sides, len(facets.element), curves))
    joints = joints_of(facets, position, on_lines_and_arcs(curve, curves), midsides.offset)
    joints, circle = joints_on_curves(joints, midsides, curve)
    if not midsides.any_curved:
        circle = arcs_across_junctions(facets, position, curve, curves, pinned, pairs)
    if np.any(((curve >= 0) | ((curve == BY_MIDSIDES) & np.isnan(circle[:, 0]))) & (pairs.facet >= 0)):
        raise ValueError(
            "a periodic boundary cannot have a curve, too: its pieces must be straight or arcs of circles, which need "
            "none. Leave its curve out, or draw its midside nodes to their chords."
        )
    while True:
        polylines, segments = cut_into_segments(position, trace_facets(facets, joints, stops), curve, curves, circle)
        segments = with_arcs_across_junctions(polylines, segments, circle)
        sliding = np.zeros(triangulation.nnodes, bool)
        sliding[polylines.node[segments.slots]] = True
        sliding[polylines.node[np.stack([segments.first, segments.last])[:, ~segments.closed]]] = False
        unmatched = paired[sliding[paired] & ~sliding[pairs.partner[paired]]]
        if len(unmatched) == 0:
            return Segmented(midsides, joints, polylines, segments, sliding)
        stops[unmatched] = True


def match_pairs(constraints: Constraints, pairs: Pairs, chain: Ints) -> None:
    rows = np.flatnonzero(pairs.facet >= 0)
    mate, motion = (np.full(len(constraints.chains.length), -1) for _ in range(2))
    mate[chain[rows]], motion[chain[rows]] = chain[pairs.facet[rows]], pairs.facet_motion[rows]
    pair_chains(constraints.chains, mate, motion, pairs.motions)
    v = np.flatnonzero((constraints.kind == SLIDING) & (pairs.motion >= 0) & (pairs.motion % 2 == 0))
    constraints.parameter[pairs.partner[v]] = constraints.parameter[v]


def kinds_of(facets: Facets, sliding: Mask, pinned: Mask) -> Int8s:
    kind = np.full(len(sliding), FREE, np.int8)
    kind[facets.nodes] = HELD
    kind[pinned] = HELD
    kind[sliding] = SLIDING
    return kind


def chains_of_nodes(joints: Joints, chain: Ints, sliding: Mask, occupied: Mask) -> Int32s:
    """Return the two curve segments of every node, -1 for none, shape (n, 2).

    Both columns of a sliding node hold its segment, and a corner of two segments holds both. Nodes of the mask
    `occupied`, shape (n,), hold -1, because no other node may take over their corner: pinned nodes, and nodes of
    periodic boundaries that do not slide.
    """
    chains = np.full((len(sliding), 2), -1, np.int32)
    chains[joints.node] = chain[joints.facets]
    chains[occupied] = -1
    chains[(chains[:, OWN] == chains[:, OTHER]) & ~sliding] = -1  # the corner of a loop has no second segment
    return chains


def inner_nodes(triangulation: Triangulation) -> Mask:
    elements = triangulation.elements
    inner = np.ones(triangulation.nnodes, bool)
    e, k = np.nonzero(np.append(elements.region, np.int32(-1))[elements.neighbour] != elements.region[:, None])
    inner[np.concatenate(elements.ends(e, k))] = False
    return inner


def run_along(triangulation: Triangulation, constraints: Constraints, element: Ints, corner: Ints) -> Mask:
    elements = triangulation.elements
    chain = elements.chain[element, corner]
    ends = elements.ends(element, corner)
    return spans_of(triangulation.position, constraints, chain, ends)[1] > 0.0
