"""Detection of polygons that may be arcs with too few nodes."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kohonen_adapt.geometry.plane.cutting import fitted_circle, turning_angles
from kohonen_adapt.geometry.plane.facets import constrained_facets, joints_of, trace_facets
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.polylines import without_noise
from kohonen_adapt.kernels.arrays import STRAIGHT

__all__ = ["PossibleArc", "possible_arcs"]

CIRCULAR = 1e-6  # maximum distance of a corner from the circle, relative to the radius
SHARPEST = np.deg2rad(75.0)  # maximum turn at a corner: a pentagon turns by 72 degrees, a square by 90
FACETS = 3  # minimum number of facets: any three nodes are on a circle


class PossibleArc(NamedTuple):
    """Polygon whose corners lie on a circle."""

    names: list[str]  # names of boundaries that contain the polygon
    nodes: int
    turn: float  # largest turn at a corner in radians
    centre: tuple[float, float]
    radius: float


def possible_arcs(movable: MovableMesh) -> Iterator[PossibleArc]:
    """Yield polygons of boundaries and interfaces whose corners lie on a circle."""
    triangulation, outline = movable.triangulation, movable.outline
    facets, position = constrained_facets(triangulation), triangulation.position
    joints = joints_of(facets, position, np.ones(len(facets.element), dtype=bool))
    polylines = trace_facets(facets, joints, outline.pinned)
    chain = triangulation.elements.chain[facets.element, facets.corner]
    alone = np.bincount(chain, minlength=len(outline.straight)) == 1
    single = (alone & (outline.constraints.chains.shape == STRAIGHT) & (outline.curve_index < 0))[chain]
    for first, last in zip(polylines.start[:-1].tolist(), (polylines.start[1:] - 1).tolist(), strict=True):
        rows = polylines.facet[first:last]
        if last - first < FACETS or not single[rows].all():
            continue
        turns = turning_angles(position, polylines.node[first : last + 1])
        nodes = (
            polylines.node[first:last]
            if polylines.node[first] == polylines.node[last]
            else polylines.node[first : last + 1]
        )
        x, y, radius = without_noise(np.array([fitted_circle(position, nodes, 0, len(nodes) - 1)]))[0].tolist()
        distance = np.abs(np.hypot(*(position[nodes] - (x, y)).T) - radius)
        one_way = abs(np.sign(turns).sum()) == len(turns) and np.abs(turns).max() < SHARPEST
        if one_way and distance.max() <= CIRCULAR * radius:
            names = [name for name, side in facets.sides.items() if np.all(side[rows] > 0)]
            yield PossibleArc(names, len(nodes), float(np.abs(turns).max()), (x, y), radius)
