"""Recycling of nodes by splits and collapses of edges.

Nodes that carry too little of the density are removed, and nodes are added where nodes carry too much. On periodic
boundaries both facets of a pair are split, or both nodes of a pair are removed, or neither. Facets of pairs are few, so
their loops are interpreted here. Desired edge lengths follow from the density and the number of nodes: in the metric of
the density equilateral triangles with one node per unit area have edges of squared length 2 / sqrt(3).
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.movable import Recycled, unchanged
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import Surgery
from kohonen_adapt.kernels.heap import Heap
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.triangle.arrays import SLIDING, OpenMesh
from kohonen_adapt.kernels.triangle.geometry import spread_starts
from kohonen_adapt.kernels.triangle.recycle import fill_heaps, recycle
from kohonen_adapt.kernels.triangle.surgery import (
    collapse,
    collapsed_quality,
    find_edge,
    gather_around,
    may_split,
    midpoint,
    split,
)
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["RATIO", "recycle_nodes", "recycle_pairs", "starts_of"]

RATIO = 2.2  # ratio of the longest to the shortest edge in the metric; below 2, splits and collapses alternate forever
ROUNDS = 2  # number of rounds: a forbidden collapse may be allowed after changes nearby
TURNS = 4  # rounds of collapses and splits apart, in a metric
TURNED = 1.0 / 3.0  # fraction of the nodes, exchanged in one round
FEW_MISFITS = 0.1  # fraction of edges of another length than desired, up to which no turn follows
BETTER = 0.8  # a turn that leaves more of this fraction is the last
SETTLED = 0.01  # fraction of nodes: a round with fewer splits is the last
SPARE = 8  # spare rows of nodes for every facet of a pair
SPLITS = 100_000  # splits per compiled call, so that Ctrl-C takes effect within half a second
EQUILATERAL = 2.0 / np.sqrt(3.0)  # squared edge length times nodes per area
PAIR_ROUNDS = 6  # number of rounds of collapses and of splits: neighbours of changed nodes have to wait
SAME = 1e-9  # maximum distance of a segment from its image, relative to the size of the mesh


def recycle_nodes(
    movable: MovableMesh, density: Floats, target: int, pairs: bool, longest: Floats | None = None
) -> Recycled:
    """Split the longest edges and collapse the shortest until they are similar.

    Lengths are measured in the metric ``density dx'S dx`` with the shapes S of the mesh. `density`, shape (nnodes,), is
    the wanted number of nodes per area up to a factor. `target` is the final number of nodes. With `pairs`, splits and
    collapses continue at this number. The area between facets and curves must not grow, except where facets are no
    longer than `longest`, shape (nnodes,).
    """
    movable.project_nodes()
    done = unchanged(movable.triangulation)
    if movable.constraints.chains.paired.any():
        row, density, done = recycled_pairs(movable, density, target, pairs, done)
        longest = None if longest is None else np.where(row >= 0, longest[row], 0.0)
    missing = target - movable.nnodes
    turns = TURNS if pairs and movable.in_metric else 0
    surgery = Surgery.on(movable, density, max(target, movable.nnodes), done, movable.relief)
    if longest is not None:
        limits = surgery.mesh.origins.longest[: movable.nnodes]
        np.maximum(limits, longest, out=limits)
    splits, collapses = exchange(surgery.mesh, movable.floor, missing, RATIO if pairs else np.inf)
    before = np.inf
    for _ in range(turns):
        now = misfits(surgery.mesh, target)
        if now < FEW_MISFITS or now > BETTER * before:
            break
        more, fewer = turn(surgery.mesh, movable.floor, int(TURNED * target))
        splits, collapses = splits + more, collapses + fewer
        before = now
    if not splits and not collapses:
        return done
    rows, _ = surgery.write_back(movable, renumbered=pairs)
    return done.followed_by(surgery.mesh.origins, rows, splits, collapses)


def recycled_pairs(
    movable: MovableMesh, density: Floats, target: int, both: bool, done: Recycled
) -> tuple[Ints, Floats, Recycled]:
    on_pairs = np.append(movable.constraints.chains.paired, False)[movable.triangulation.elements.chain]
    spacious = movable.nnodes + SPARE * int(np.count_nonzero(on_pairs))
    surgery = Surgery.on(movable, density, spacious, done, movable.relief)
    surgery.mesh.origins.is_new[:] = False
    splits, collapses = recycle_pairs(surgery.mesh, target, both, movable.floor)
    origins = surgery.mesh.origins
    if not splits and not collapses:
        return np.arange(movable.nnodes), density, done
    rows, _ = surgery.write_back(movable)
    movable.flip()
    row = np.where(origins.is_new[rows], -1, rows)
    return row, origins.density[rows], done.followed_by(origins, rows, splits, collapses)


def exchange(mesh: OpenMesh, floor: float, missing: int, ratio: float) -> tuple[int, int]:
    rows = len(mesh.elements.node)
    # capacity for all edges twice: a mesh has three edges for two elements, and boundaries
    heaps = Heap.of(4 * rows + 8), Heap.of(4 * rows + 8)
    splits = collapses = 0
    for _ in range(ROUNDS):
        fill_heaps(mesh, *heaps)
        at_first, finished = splits, False
        mesh.origins.is_new[:] = False
        while not finished:
            left = max(0, missing - splits) if missing > 0 else min(0, missing + collapses - splits)
            more, fewer, finished = recycle(mesh, *heaps, left, ratio, floor, SPLITS)
            splits, collapses = splits + more, collapses + fewer
        if splits - at_first <= SETTLED * len(mesh.position):
            break
    return splits, collapses


def turn(mesh: OpenMesh, floor: float, nodes: int) -> tuple[int, int]:
    # Collapse first and split then: no pair can be exchanged where all edges of one direction are too long and all of
    # another too short.
    _, removed = exchange(mesh, floor, -nodes, np.inf)
    added, _ = exchange(mesh, floor, removed, np.inf)
    more, fewer = exchange(mesh, floor, removed - added, RATIO)
    return added + more, removed + fewer


def misfits(mesh: OpenMesh, target: int) -> float:
    # fraction of edges whose squared length differs from the desired one by more than `RATIO`
    node = mesh.elements.node[mesh.elements.node[:, 0] >= 0]
    a = node
    b = np.roll(node, 1, axis=1)
    length = squared_lengths(mesh, a, b) / desired_length(mesh, target)
    return float(np.mean((length > RATIO) | (length < 1.0 / RATIO)))


def starts_of(before: Triangulation, recycled: Recycled) -> Ints:
    """Return a present node near every element of the mesh before, (m,)."""
    if not recycled.splits and not recycled.collapses:
        return before.elements.node[:, 0]
    now = np.full(before.nnodes, -1, np.int32)
    survivors = np.flatnonzero(recycled.old >= 0)
    now[recycled.old[survivors]] = survivors
    starts = now[before.elements.node].max(axis=1)
    spread_starts(before.elements, starts, np.empty(len(starts), np.int32))
    return starts


class Facets(NamedTuple):
    element: Ints  # (f, 2) element of the facet and of its image
    start: Ints  # (f, 2)
    end: Ints  # (f, 2)
    chain: Ints  # (f, 2)
    motion: Ints  # (f,) motion of the facet onto its image


def recycle_pairs(mesh: OpenMesh, target: int, both: bool, floor: float) -> tuple[int, int]:
    # Squared lengths may differ by a factor `RATIO`. Without `both` no node is removed, and nodes are added up to
    # `target`. Returns the numbers of nodes added and removed.
    wanted = desired_length(mesh, target)
    splits = collapses = 0
    available = int(mesh.pool.height[0]) // 2 - 1
    if not both:
        available = min(available, (target - int(np.count_nonzero(mesh.pool.anchor >= 0))) // 2)
    for _ in range(PAIR_ROUNDS if both else 0):
        collapses += collapse_short(mesh, facets_of_pairs(mesh), wanted / RATIO, wanted * RATIO, floor)
    for _ in range(PAIR_ROUNDS):
        splits += split_long(mesh, facets_of_pairs(mesh), wanted * RATIO, floor, available - splits)
    return 2 * splits, 2 * collapses


def desired_length(mesh: OpenMesh, target: int) -> float:
    node = mesh.elements.node[mesh.elements.node[:, 0] >= 0]
    areas = 0.5 * TRIANGLE.determinant(mesh.position.T[:, node.T])
    return float(EQUILATERAL * np.sum(areas * mesh.origins.density[node].mean(axis=1)) / target)


def facets_of_pairs(mesh: OpenMesh) -> Facets:
    elements, position, periodic = mesh.elements, mesh.position, mesh.constraints.periodic
    on_pairs = np.append(mesh.constraints.chains.paired, False)[elements.chain]
    e, k = np.nonzero(on_pairs & (elements.node[:, :1] >= 0))
    ends = np.stack(elements.ends(e, k), axis=1)
    chain = elements.chain[e, k]
    nodes = np.unique(ends)
    tree = cKDTree(position[nodes])
    near = SAME * float(np.ptp(position[nodes], axis=0).max())
    key = keys_of(ascending(*ends.T), len(position))
    order = np.argsort(key)
    parts = []
    for m in range(0, len(periodic.motions), 2):
        turn, shift = periodic.motions[m, :, :2], periodic.motions[m, :, 2]
        distance, found = tree.query(position[ends] @ turn.T + shift)
        image = nodes[found]
        # A motion may also map a part of a circle to a part of the same side, whose nodes are no partners.
        partners = (periodic.motion[ends] == m) & (periodic.partner[ends] == image)
        same = np.all((distance < near) & (partners | (periodic.partner[ends] < 0)), axis=1)
        place = np.searchsorted(key[order], keys_of(ascending(*image.T), len(position)))
        other = order[np.minimum(place, len(order) - 1)]
        same &= (keys_of(ascending(*image.T), len(position)) == key[other]) & (chain[other] != chain)
        here = np.flatnonzero(same)
        sides = np.stack([here, other[here]], axis=1)
        start, end = (np.stack([ends[here, i], image[here, i]], axis=1) for i in range(2))
        parts.append(Facets(e[sides], start, end, chain[sides], np.full(len(here), m)))
    return Facets(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def lengths(mesh: OpenMesh, facets: Facets) -> Floats:
    return squared_lengths(mesh, facets.start, facets.end).max(axis=1)


def squared_lengths(mesh: OpenMesh, start: Ints, end: Ints) -> Floats:
    chord = mesh.position[start] - mesh.position[end]
    density, shape = mesh.origins.density, mesh.metric.shape
    xx, xy, yy = np.moveaxis(0.5 * (shape[start] + shape[end]), -1, 0)
    squared = xx * chord[..., 0] ** 2 + yy * chord[..., 1] ** 2 + 2.0 * xy * chord[..., 0] * chord[..., 1]
    return squared * np.sqrt(density[start] * density[end])


def collapse_short(mesh: OpenMesh, facets: Facets, least: float, longest: float, floor: float) -> int:
    length, changed = lengths(mesh, facets), set[int]()
    count = 0
    for i in np.argsort(length, kind="stable"):
        ends = facets.start[i], facets.end[i]
        if length[i] >= least or changed & {int(v) for pair in ends for v in pair}:
            continue
        directions = [
            (v, w, merged_quality(mesh, v, w, facets.chain[i], longest, floor)) for v, w in (ends, ends[::-1])
        ]
        v, w, quality = max(directions, key=lambda chord: chord[2])
        if quality < 0.0:
            continue
        merge, around = interpreted(collapse), interpreted(gather_around)
        for gone, left in zip(v.tolist(), w.tolist(), strict=True):
            rows = mesh.scratch.around[: around(mesh, gone, mesh.scratch.around)]
            changed |= set(mesh.elements.node[rows].ravel().tolist())
            mesh.constraints.periodic.partner[gone] = mesh.constraints.periodic.motion[gone] = -1
            merge(mesh, gone, left)
        count += 1
    return count


def merged_quality(mesh: OpenMesh, v: Ints, w: Ints, chain: Ints, longest: float, floor: float) -> float:
    """Return the worst quality after collapses of v (2,) into w (2,) on both sides.

    The quality is negative if a collapse is not allowed.
    """
    constraints, periodic = mesh.constraints, mesh.constraints.periodic
    slides = (constraints.kind[v] == SLIDING) & (constraints.own_chain[v] == chain)
    if not slides.all() or periodic.partner[v[0]] != v[1] or periodic.partner[v[1]] != v[0]:
        return -1.0
    around = interpreted(gather_around)
    stars = []
    for node in v.tolist():
        rows = mesh.scratch.around[: around(mesh, node, mesh.scratch.around)]
        stars.append(set(mesh.elements.node[rows].ravel().tolist()))
    if stars[0] & stars[1]:
        return -1.0  # overlapping stars: the first collapse would change the quality of the second
    quality, partner = interpreted(collapsed_quality), periodic.partner[v].copy()
    periodic.partner[v] = -1  # a node with a partner could not collapse alone
    worst = min(quality(mesh, one, other, longest, floor) for one, other in zip(v.tolist(), w.tolist(), strict=True))
    periodic.partner[v] = partner
    return float(worst)


def split_long(mesh: OpenMesh, facets: Facets, longest: float, floor: float, available: int) -> int:
    length = lengths(mesh, facets)
    count = 0
    find, middle, may, make = (interpreted(loop) for loop in (find_edge, midpoint, may_split, split))
    periodic = mesh.constraints.periodic
    for i in np.argsort(-length, kind="stable"):
        chain = facets.chain[i]
        if length[i] <= longest or count >= available or facets.element[i, 0] == facets.element[i, 1]:
            continue
        ends = list(zip(facets.start[i].tolist(), facets.end[i].tolist(), strict=True))
        sides = [find(mesh, a, b) for a, b in ends]  # a split nearby may have given the facet another element
        midpoints = [middle(mesh, int(c), a, b) for c, (a, b) in zip(chain, ends, strict=True)]
        if not all(may(mesh, e, k, floor, x) for (e, k), (x, _) in zip(sides, midpoints, strict=True)):
            continue
        new = [make(mesh, e, k, x, at) for (e, k), (x, at) in zip(sides, midpoints, strict=True)]
        mesh.constraints.parameter[new] = midpoints[0][1]
        periodic.partner[new], periodic.motion[new] = new[::-1], [facets.motion[i], facets.motion[i] + 1]
        count += 1
    return count
