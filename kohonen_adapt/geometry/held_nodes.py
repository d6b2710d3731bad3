"""Nodes that stay where they are, with reasons in words."""

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.polylines import CORNER
from kohonen_adapt.geometry.rules import Pinned, pinned_nodes
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import HELD as HELD_IN_SPACE
from kohonen_adapt.kernels.triangle.arrays import HELD
from kohonen_adapt.mesh.names import named_sets

__all__ = ["names_at", "of_boundaries", "reasons_in_plane", "reasons_in_space", "with_pins", "without_turns"]

TURN = re.compile(r"(, | at a turn of )[\d.e-]+ degrees")


def reasons_in_plane(movable: MovableMesh) -> list[str]:
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


def reasons_in_space(movable: MovableSolid) -> list[str]:
    found, elements = [""] * movable.nnodes, movable.tetrahedralization.elements
    e, k = np.nonzero(elements.patch >= 0)
    node = elements.node[e[:, None], (k[:, None] + [1, 2, 3]) % 4]
    pairs = np.unique(np.stack([node.ravel(), np.repeat(elements.patch[e, k], 3)], axis=1), axis=0)
    start = np.searchsorted(pairs[:, 0], np.arange(movable.nnodes + 1))
    for v in np.flatnonzero((movable.freedom.number == HELD_IN_SPACE) | movable.freedom.pinned).tolist():
        patches = pairs[start[v] : start[v + 1], 1]
        where = of_boundaries(movable, patches)
        if movable.freedom.pinned[v]:
            found[v] = "pinned"
        elif len(patches) > 2:
            found[v] = f"corner of {len(patches)} faces{where}"
        elif len(patches) == 2:
            found[v] = f"corner of an edge between two faces{where}"
        else:
            found[v] = f"rim of a sheet that is neither straight nor an arc{where}"
    return found


def of_boundaries(movable: MovableSolid, patches: Ints) -> str:
    names = [name for name, side in movable.patches.names.items() if np.any(side[patches])]
    return f" of {'boundary' if len(names) == 1 else 'boundaries'} {listed(names)}" if names else ""


def with_pins(reasons: list[str], mesh: Mesh, pinned: Pinned, points: Mapping[str, Ints] | None = None) -> list[str]:
    # `points` belong to the problem. Nodes of `reasons` beyond the mesh belong to missing layers.
    entries = [pinned] if isinstance(pinned, str) else list(pinned)
    numbers = [entry for entry in entries if not isinstance(entry, str)]
    found = dict.fromkeys(np.flatnonzero(pinned_nodes(mesh, numbers)).tolist(), "pinned by number")
    for name in (entry for entry in entries if isinstance(entry, str)):
        kind = "boundary" if name in (mesh.boundaries or {}) else "subdomain"
        found |= dict.fromkeys(np.flatnonzero(pinned_nodes(mesh, [name])).tolist(), f"pinned by {kind} {name!r}")
    for name, nodes in (points or {}).items():
        found |= dict.fromkeys(nodes.tolist(), f"point {name!r} of the problem")
    return [found.get(node, reason) for node, reason in enumerate(reasons[: mesh.nvertices])]


# Angles differ from node to node.
def without_turns(why: NDArray[np.str_]) -> NDArray[np.str_]:
    texts, number = np.unique(why, return_inverse=True)
    return np.array([TURN.sub("", text) for text in texts.tolist()], dtype=np.str_)[number]
