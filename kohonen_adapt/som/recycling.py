"""Recycling of nodes by splits and collapses of edges.

Nodes that carry too little of the density are removed, and nodes are added where nodes carry too much.
"""

import numpy as np
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import Surgery
from kohonen_adapt.geometry.recycled import Recycled, unchanged
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.arrays import OpenMesh
from kohonen_adapt.kernels.heap import Heap
from kohonen_adapt.kernels.triangle.connectivity import spread_starts
from kohonen_adapt.kernels.triangle.recycle import fill_heaps, recycle
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.paired_recycling import recycle_pairs

__all__ = ["recycle_nodes", "starts_in_space", "starts_of"]

RATIO = 2.2  # ratio of the longest to the shortest edge in the metric; below 2, splits and collapses alternate forever
ROUNDS = 2  # number of rounds: a forbidden collapse may be allowed after changes nearby
SETTLED = 0.01  # fraction of nodes: a round with fewer splits is the last
SPARE = 8  # spare rows of nodes for every facet of a pair
SPLITS = 100_000  # splits per compiled call, so that Ctrl-C takes effect within half a second


def recycle_nodes(
    movable: MovableMesh, density: Floats, target: int, pairs: bool, longest: Floats | None = None
) -> Recycled:
    """Split the longest edges and collapse the shortest until they are similar.

    Lengths are measured in the metric ``density |dx|^2``. `density`, shape (nnodes,), is the wanted number of nodes per
    area up to a factor. `target` is the final number of nodes. With `pairs`, splits and collapses continue at this
    number. The area between facets and curves must not grow, except where facets are no longer than `longest`, shape
    (nnodes,).
    """
    movable.project_nodes()
    done = unchanged(movable.triangulation)
    if movable.constraints.chains.paired.any():
        row, density, done = recycled_pairs(movable, density, target, pairs, done)
        longest = None if longest is None else np.where(row >= 0, longest[row], 0.0)
    missing = target - movable.nnodes
    surgery = Surgery.on(movable, density, max(target, movable.nnodes), done)
    if longest is not None:
        limits = surgery.mesh.origins.longest[: movable.nnodes]
        np.maximum(limits, longest, out=limits)
    splits, collapses = exchange(surgery.mesh, movable.floor, missing, RATIO if pairs else np.inf)
    if not splits and not collapses:
        return done
    rows, _ = surgery.write_back(movable, renumbered=pairs)
    counts = done.splits + splits, done.collapses + collapses
    return Recycled(surgery.mesh.origins.old[rows], surgery.mesh.origins.start_element[rows], *counts)


def recycled_pairs(
    movable: MovableMesh, density: Floats, target: int, both: bool, done: Recycled
) -> tuple[Ints, Floats, Recycled]:
    on_pairs = np.append(movable.constraints.chains.paired, False)[movable.triangulation.elements.chain]
    surgery = Surgery.on(movable, density, movable.nnodes + SPARE * int(np.count_nonzero(on_pairs)), done)
    surgery.mesh.origins.is_new[:] = False
    splits, collapses = recycle_pairs(surgery.mesh, target, both, RATIO, movable.floor)
    origins = surgery.mesh.origins
    if not splits and not collapses:
        return np.arange(movable.nnodes), density, done
    rows, _ = surgery.write_back(movable)
    movable.flip()
    counts = done.splits + splits, done.collapses + collapses
    row = np.where(origins.is_new[rows], -1, rows)
    return row, origins.density[rows], Recycled(origins.old[rows], origins.start_element[rows], *counts)


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


def starts_of(before: Triangulation, recycled: Recycled) -> Ints:
    """Return a present node near every element of the mesh before, (m,)."""
    if not recycled.splits and not recycled.collapses:
        return before.elements.node[:, 0]
    now = np.full(before.nnodes, -1, dtype=np.int32)
    survivors = np.flatnonzero(recycled.old >= 0)
    now[recycled.old[survivors]] = survivors
    starts = now[before.elements.node].max(axis=1)
    spread_starts(before.elements, starts, np.empty(len(starts), dtype=np.int32))
    return starts


def starts_in_space(before: MovableSolid, now: MovableSolid) -> Ints:
    middle, old = before.tetrahedralization.centroids(), before.tetrahedralization.elements.region
    node, region = now.tetrahedralization.elements.node, now.tetrahedralization.elements.region
    starts = np.empty(len(middle), dtype=np.int32)
    for number in range(int(old.max()) + 1):
        nodes = np.unique(node[region == number])
        nearest = cKDTree(now.tetrahedralization.position[nodes]).query(middle[old == number])[1]
        starts[old == number] = nodes[nearest]
    return starts
