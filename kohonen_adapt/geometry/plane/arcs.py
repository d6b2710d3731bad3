"""Refinement on recognised arcs, and polygons that may be coarse arcs."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, IntsPair
from kohonen_adapt.geometry.circles import sphere_through
from kohonen_adapt.geometry.plane.chains import circles_of, on_chains
from kohonen_adapt.geometry.plane.cutting import CLOSE, FEWEST, Points, as_complex, as_rows, turning_angles
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.outline import Outline
from kohonen_adapt.geometry.plane.polylines import (
    CORNER,
    constrained_facets,
    joints_of,
    trace_facets,
)
from kohonen_adapt.geometry.plane.recognition import trace_across_junctions
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.kernels.triangle.arrays import ROUND, STRAIGHT
from kohonen_adapt.mesh.curved import is_second_order, refined
from kohonen_adapt.mesh.host import facets_opposite
from kohonen_adapt.mesh.measures import signed_area

__all__ = ["SHARPEST", "PossibleArc", "naming", "possible_arcs", "refined_on_arcs"]

CIRCULAR = 1e-6  # maximum distance of a corner from the circle, relative to the radius
SHARPEST = np.deg2rad(75.0)  # maximum turn at a corner: a pentagon turns by 72 degrees, a square by 90
SHARPEST_CUT = np.deg2rad(
    55.0
)  # with radial sides at the corners, because a hexagon turns into these by 60 degrees, too
STRAIGHTEST = np.deg2rad(0.1)  # minimum turn: finer polygons differ less from their circle than meshes need
FACETS = 3  # minimum number of facets: any three nodes are on a circle


def refined_on_arcs(mesh: MeshTri) -> tuple[MeshTri, MeshTri] | None:
    """Return two uniform refinements of a mesh, with arcs as chords and round.

    New nodes on recognised arcs between elements stay on the chords in the first mesh and lie on the circle in the
    second. Arcs of the outer boundary are round in both meshes, because boundary conditions may need a circle. Returns
    None if no interface is an arc, or if an element would be inverted.
    """
    movable = MovableMesh.of(mesh, Rules())
    elements, chains = movable.triangulation.elements, movable.constraints.chains
    e, k = np.nonzero(on_chains(elements.chain, chains.shape == ROUND))
    chain = np.full(mesh.facets.shape[1], -1)
    chain[facets_opposite(mesh, elements.node)[e, k]] = elements.chain[e, k]
    finer = refined(mesh)
    middle, facet = halves_of_facets(mesh, finer) if is_second_order(mesh) else midpoints_of_facets(mesh)
    middle, facet = middle[chain[facet] >= 0], facet[chain[facet] >= 0]
    circles = circles_of(chains)
    inside = mesh.f2t[1, facet] >= 0
    radial = as_complex(finer.doflocs[:, middle].T) - circles.centre[chain[facet]]
    on_circle = as_rows(circles.centre[chain[facet]] + circles.radius[chain[facet]] * radial / np.abs(radial)).T
    chords, arcs = finer.doflocs.copy(), finer.doflocs.copy()
    chords[:, middle[~inside]] = on_circle[:, ~inside]
    arcs[:, middle] = on_circle
    pair = replace(finer, doflocs=chords), replace(finer, doflocs=arcs)
    inverted = [np.any(signed_area(each) * signed_area(finer) <= 0.0) for each in pair]
    return pair if inside.any() and not any(inverted) else None


def midpoints_of_facets(mesh: MeshTri) -> IntsPair:
    facet = np.arange(mesh.facets.shape[1])
    return mesh.nvertices + facet, facet  # scikit-fem numbers the new nodes of a refined mesh so


def halves_of_facets(mesh: MeshTri, finer: MeshTri) -> IntsPair:
    half = np.flatnonzero(finer.facets[0] < mesh.nvertices)
    return finer.nvertices + half, finer.facets[1, half] - mesh.nvertices


class PossibleArc(NamedTuple):
    names: list[str]  # names of boundaries that contain the polygon
    nodes: int
    turn: float  # largest turn at a corner in radians
    centre: tuple[float, float]
    radius: float
    is_cut: bool  # True if other boundaries or interfaces end in the polygon

    def advice(self) -> str:
        at = "({:.9g}, {:.9g})".format(*self.centre)
        key, called, first = naming(self.names, "lines")
        return (
            f"{called} has {self.nodes} nodes on a circle of radius {self.radius:.6g} about {at} and turns by up to "
            f"{np.rad2deg(self.turn):.3g} degrees at each. It is treated as a polygon, with new nodes on its sides. If "
            f'it is a circle, {first}adapt with curves={{"{key}": ka.Arc({at}, {self.radius:.9g})}}, in a case '
            f'adapt.curves.{key} = {{curve = "arc", centre = [{at[1:-1]}], radius = {self.radius:.9g}}}.'
        )


def naming(names: list[str], group: str) -> tuple[str, str, str]:
    # the name to write, the subject of a sentence, and the step before for a boundary without a name
    if names:
        return names[0], f"boundary '{names[0]}'", ""
    return "NAME", "a boundary without a name", f"name it (by a group of {group}) and "


def possible_arcs(movable: MovableMesh) -> Iterator[PossibleArc]:
    triangulation, outline = movable.triangulation, movable.outline
    facets = constrained_facets(triangulation.mesh, triangulation.elements)
    position = triangulation.position
    joints = joints_of(facets, position, np.ones(len(facets.element), bool))
    chain = triangulation.elements.chain[facets.element, facets.corner]
    alone = np.bincount(chain, minlength=len(outline.straight)) == 1
    single = (alone & (outline.constraints.chains.shape == STRAIGHT) & (outline.curve_index < 0))[chain]
    whole = trace_facets(facets, joints, outline.pinned), FACETS, False
    across = trace_across_junctions(facets.nodes, position, outline.pinned, SHARPEST_CUT), FEWEST - 1, True
    seen = set[int]()
    for polylines, fewest, is_cut in (whole, across):
        for first, last in zip(polylines.start[:-1].tolist(), (polylines.start[1:] - 1).tolist(), strict=True):
            rows = polylines.facet[first:last]
            if last - first < fewest or not single[rows].all() or not seen.isdisjoint(rows.tolist()):
                continue
            nodes = polylines.node[first : last + 1]
            sides = facets.sides.items()
            names = [name for name, side in sides if np.all(side[rows] > 0)]
            if found := possible_arc(position, nodes, names, is_cut):
                seen.update(rows.tolist())
                yield found
    rest = np.flatnonzero(single & ~np.isin(np.arange(len(single)), list(seen)))
    for own, centre, radius, turn in separate_sides(as_complex(position[facets.nodes[rest]]), centres_of_arcs(outline)):
        names = [name for name, side in facets.sides.items() if np.all(side[rest[own]] > 0)]
        count = len(np.unique(facets.nodes[rest[own]]))
        yield PossibleArc(names, count, turn, centre, radius, is_cut=True)


def centres_of_arcs(outline: Outline) -> Points:
    centre = circles_of(outline.constraints.chains).centre[outline.on_circles]
    step = CIRCULAR / np.abs(outline.constraints.chains.curvature).max(initial=1e-300)
    return centre[np.unique(np.round(as_rows(centre) / step), axis=0, return_index=True)[1]]


def separate_sides(ends: Points, centres: Points) -> Iterator[tuple[Ints, tuple[float, float], float, float]]:
    # Sides, as the tips of teeth, with both ends on a circle about a centre of arcs, and with gaps of less than half
    # their length. Yields indices of at least three sides, centre, radius and the turn from side to side.
    for centre in centres.tolist():
        z = ends - centre
        radius, middle = np.abs(z), np.angle(z.sum(axis=1))
        half = 0.5 * np.abs(np.angle(z[:, 1] * z[:, 0].conj()))
        on = np.flatnonzero((np.ptp(radius, axis=1) <= CIRCULAR * radius[:, 0]) & (2.0 * half < CORNER))
        on = on[np.argsort(radius[on, 0], kind="stable")]
        circle = np.cumsum(np.diff(radius[on, 0], prepend=0.0) > CIRCULAR * radius[on, 0])
        on = on[np.lexsort((middle[on], circle))]
        turn = np.diff(middle[on])
        same = np.diff(np.sort(circle)) == 0
        gap = turn - half[on[1:]] - half[on[:-1]]
        linked = same & (gap > STRAIGHTEST) & (gap <= half[on[1:]])
        cuts = np.flatnonzero(~linked) + 1
        for rows, turns in zip(np.split(on, cuts), np.split(np.append(turn, 0.0), cuts), strict=True):
            if len(rows) >= FACETS:
                yield rows, (centre.real, centre.imag), float(radius[rows, 0].mean()), float(turns[:-1].max())


def possible_arc(position: Floats, nodes: Ints, names: list[str], is_cut: bool) -> PossibleArc | None:
    turns = turning_angles(as_complex(position[nodes]))
    x = position[nodes[: -1 if nodes[0] == nodes[-1] else None]]
    turn = float(np.abs(turns).max())
    one_way = abs(np.sign(turns).sum()) == len(turns)
    circle = sphere_through(x, min(CIRCULAR, CLOSE * turn**2 / 8.0))
    if circle is None or not one_way or not STRAIGHTEST < turn < SHARPEST:
        return None
    return PossibleArc(names, len(x), turn, tuple(circle[0].tolist()), circle[1], is_cut)
