"""Nodes that stay where they are, with reasons in words."""

import re
from collections.abc import Callable, Mapping

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask, Texts, unique_pairs
from kohonen_adapt.checks import listed
from kohonen_adapt.geometry.movable import Movable
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.polylines import CORNER
from kohonen_adapt.geometry.rules import Pinned, pinned_nodes
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.mesh.measures import angles_between
from kohonen_adapt.mesh.tetrahedralization import faces_of

__all__ = ["names_at", "of_boundaries", "reasons_in_plane", "reasons_in_space", "with_pins", "without_turns"]

TURN = re.compile(r"(, | at a turn of )[\d.e-]+ degrees")


def reasons_in_plane(movable: MovableMesh) -> list[str]:
    ends, chain = constrained_edges(movable)
    order = np.argsort(ends.ravel(), kind="stable")
    start = np.searchsorted(ends.ravel()[order], np.arange(movable.nnodes + 1))

    def reason(v: int) -> str:
        rows, side = np.divmod(order[start[v] : start[v + 1]], 2)
        others = ends[rows, 1 - side]
        names = names_at(movable, v, chain[rows])
        small = ""
        if movable.constraints.periodic.partner[v] >= 0:
            small = f"periodic pair on {names}, whose other node cannot slide"
        elif not movable.outline.straight[chain[rows]].all():
            small = f"end of a curve of {names}"
        return corner_text(movable.triangulation.position, v, others, names, small)

    return reasons_of(movable, movable.outline.pinned, reason)


def reasons_of(movable: Movable, pinned: Mask, reason: Callable[[int], str]) -> list[str]:
    held = movable.held_nodes | pinned
    return ["" if not held[v] else "pinned" if pinned[v] else reason(v) for v in range(movable.nnodes)]


def constrained_edges(movable: MovableMesh) -> IntsPair:
    """Return the nodes (f, 2) and the curve segment (f,) of every constrained edge."""
    elements = movable.triangulation.elements
    e, k = np.nonzero(elements.chain >= 0)
    ends = ascending(*elements.ends(e, k))
    first = np.unique(keys_of(ends, movable.nnodes), return_index=True)[1]
    return ends[:, first].T, elements.chain[e, k][first]


def names_at(movable: MovableMesh, v: int, chain: Ints) -> str:
    if found := boundaries_with(movable, chain):
        return found
    star = movable.triangulation.star
    names = movable.subdomains_of(
        movable.triangulation.elements.region[star.element[star.start[v] : star.start[v + 1]]]
    )
    return f"subdomain{'s' * (len(names) > 1)} {listed(names)}" if names else "the outer boundary"


def boundaries_with(movable: Movable, parts: Ints) -> str:
    names = [name for name, side in movable.part_names.items() if np.any(side[parts])]
    return f"{'boundary' if len(names) == 1 else 'boundaries'} {listed(names)}" if names else ""


def corner_text(position: Floats, v: int, others: Ints, names: str, small: str) -> str:
    if len(others) > 2:
        return f"junction of {len(others)} boundaries and interfaces at {names}"
    if len(others) < 2:
        return f"end of {names}"
    turn = angles_between(position[v] - position[others[0]], position[others[1]] - position[v])
    if turn >= CORNER:
        return f"corner of {names}, {np.rad2deg(turn):.3g} degrees"
    return small or f"no curve of {names} is recognised at a turn of {np.rad2deg(turn):.3g} degrees; use `curves`"


def reasons_in_space(movable: MovableSolid) -> list[str]:
    elements = movable.tetrahedralization.elements
    e, k = np.nonzero(elements.patch >= 0)
    node, patch = unique_pairs(faces_of(elements, e, k).ravel(), np.repeat(elements.patch[e, k], 3))
    start = np.searchsorted(node, np.arange(movable.nnodes + 1))

    def reason(v: int) -> str:
        patches = patch[start[v] : start[v + 1]]
        what = "rim of a sheet that is neither straight nor an arc"
        if len(patches) > 1:
            what = f"corner of {'an edge between two' if len(patches) == 2 else len(patches)} faces"
        return what + of_boundaries(movable, patches)

    return reasons_of(movable, movable.freedom.pinned, reason)


def of_boundaries(movable: MovableSolid, patches: Ints) -> str:
    found = boundaries_with(movable, patches)
    return f" of {found}" if found else ""


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
def without_turns(why: Texts) -> Texts:
    texts, number = np.unique(why, return_inverse=True)
    return np.array([TURN.sub("", text) for text in texts.tolist()], np.str_)[number]
