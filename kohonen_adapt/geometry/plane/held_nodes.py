"""Reasons for which nodes of triangles stay where they are."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.polylines import CORNER
from kohonen_adapt.kernels.triangle.arrays import HELD
from kohonen_adapt.mesh.names import named_sets

__all__ = ["names_at", "reasons_in_plane"]


def reasons_in_plane(movable: MovableMesh) -> list[str]:
    """Return the reason for every node, an empty string for nodes that move or slide."""
    found = [""] * movable.nnodes
    ends, chain = constrained_edges(movable)
    order = np.argsort(ends.ravel(), kind="stable")
    start = np.searchsorted(ends.ravel()[order], np.arange(movable.nnodes + 1))
    for v in np.flatnonzero(movable.constraints.kind == HELD).tolist():
        rows, side = np.divmod(order[start[v] : start[v + 1]], 2)
        if movable.outline.pinned[v]:
            found[v] = "pinned"
            continue
        others, names = ends[rows, 1 - side], names_at(movable, v, chain[rows])
        if movable.constraints.periodic.partner[v] >= 0:
            small = f"periodic pair on {names}, whose other node cannot slide"
        elif not movable.outline.straight[chain[rows]].all():
            small = f"end of a curve of {names}"
        else:
            small = ""
        found[v] = corner_text(movable.triangulation.position, v, others, names, small)
    return found


def constrained_edges(movable: MovableMesh) -> tuple[Ints, Ints]:
    """Return the nodes (f, 2) and the curve segment (f,) of every constrained edge."""
    elements = movable.triangulation.elements
    e, k = np.nonzero(elements.chain >= 0)
    ends = np.sort(np.stack(elements.ends(e, k), axis=1), axis=1)
    ends, first = np.unique(ends, axis=0, return_index=True)
    return ends, elements.chain[e, k][first]


def names_at(movable: MovableMesh, v: int, chain: Ints) -> str:
    names = [name for name, orientation in movable.outline.names.items() if np.any(orientation[chain])]
    if names:
        return f"{'boundary' if len(names) == 1 else 'boundaries'} {listed(names)}"
    triangulation = movable.triangulation
    star = triangulation.star
    around = triangulation.elements.region[star.element[star.start[v] : star.start[v + 1]]]
    sets = named_sets(movable.input_mesh.subdomains)
    names = [name for name, rows in sets.items() if np.isin(around, triangulation.region_of_input[rows]).any()]
    return f"subdomain{'s' * (len(names) > 1)} {listed(names)}" if names else "the outer boundary"


def corner_text(position: Floats, v: int, others: Ints, names: str, small: str) -> str:
    if len(others) > 2:
        return f"junction of {len(others)} boundaries and interfaces at {names}"
    if len(others) < 2:
        return f"end of {names}"
    one, two = position[v] - position[others[0]], position[others[1]] - position[v]
    turn = abs(np.arctan2(one[0] * two[1] - one[1] * two[0], one @ two))
    if turn >= CORNER:
        return f"corner of {names}, {np.rad2deg(turn):.3g} degrees"
    return small or f"no curve of {names} is recognised at a turn of {np.rad2deg(turn):.3g} degrees; use `curves`"
