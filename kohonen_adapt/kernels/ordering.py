"""Order of nodes along a space-filling curve, divided into parts for threads."""

import numpy as np
from numpy.random import Generator

from kohonen_adapt.arrays import Floats, Int32s, Int64s, Ints, IntsPair, Mask
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.threads import even_cuts, shared

BITS = 20  # per coordinate
MARGIN = 0.0173  # fraction of the extent of a mesh
FEW = 2_000  # points per thread, at least


def along_curve(points: Floats, margin: float = MARGIN) -> Int64s:
    """Return the order of points (k, 2) or (k, 3) along Hilbert's curve, shape (k,).

    The square or cube of the curve exceeds the extent of the points by `margin`, so that rounding errors do not decide
    the order of nodes of regular meshes.
    """
    keys = np.empty(len(points), np.int64)
    # column by column, which is many times faster
    low, high = (np.array([bound(column) for column in points.T]) for bound in (np.min, np.max))
    size = max(np.max(high - low), np.finfo(float).tiny)
    fill_keys = hilbert_keys if points.shape[1] == 2 else hilbert_keys_in_space

    def fill(thread: int, first: int, last: int) -> None:
        fill_keys(points[first:last], low - margin * size, (1.0 + 3.0 * margin) * size, keys[first:last])

    shared(fill, even_cuts(len(points), FEW))
    return np.argsort(keys, kind="stable")


def parts_along(order: Int32s, rows: int, parts: int) -> Int32s:
    """Return the part of each row, shape (rows,), by equal stretches of `order`.

    Rows that are not in `order` are in part 0.
    """
    part = np.zeros(rows, np.int32)
    part[order] = np.arange(len(order), dtype=np.int64) * parts // len(order)
    return part


@inner_kernel
def cell_along(points, t, origin, size, axis):
    cells = 1 << BITS
    return min(cells - 1, max(0, int((points[t, axis] - origin[axis]) / size * cells)))


@kernel
def hilbert_keys(points, origin, size, keys):
    cells = 1 << BITS
    for t in range(points.shape[0]):
        x, y = cell_along(points, t, origin, size, 0), cell_along(points, t, origin, size, 1)
        key = 0
        half = cells >> 1
        while half > 0:
            right, upper = 1 if x & half else 0, 1 if y & half else 0
            key = 4 * key + ((3 * right) ^ upper)
            x, y = x & (half - 1), y & (half - 1)
            if upper == 0:
                if right == 1:
                    x, y = half - 1 - x, half - 1 - y
                x, y = y, x
            half >>= 1
        keys[t] = key


@kernel
def hilbert_keys_in_space(points, origin, size, keys):
    """Compute the positions (n,) of points along Hilbert's curve in a cube.

    J. Skilling, "Programming the Hilbert curve", AIP Conf. Proc. 707 (2004): from the largest octants down, the bits of
    the coordinates are transformed by the inverse motions of the curve in each octant, and read as a Gray code.
    """
    cells = 1 << BITS
    for t in range(points.shape[0]):
        x, y = cell_along(points, t, origin, size, 0), cell_along(points, t, origin, size, 1)
        z = cell_along(points, t, origin, size, 2)
        half = cells >> 1
        while half > 1:
            lower = half - 1
            if x & half:
                x ^= lower
            if y & half:
                x ^= lower
            else:
                different = (x ^ y) & lower
                x, y = x ^ different, y ^ different
            if z & half:
                x ^= lower
            else:
                different = (x ^ z) & lower
                x, z = x ^ different, z ^ different
            half >>= 1
        y ^= x
        z ^= y
        key, odd = 0, 0
        half = cells >> 1
        while half > 0:
            # where a bit of z is set, all lower bits of the three change
            right = (1 if x & half else 0) ^ odd
            upper = (1 if y & half else 0) ^ odd
            front = (1 if z & half else 0) ^ odd
            key = 8 * key + 4 * right + 2 * upper + front
            if z & half:
                odd ^= 1
            half >>= 1
        keys[t] = key


@kernel
def mark_interior(start, link, part, rings, interior, queue):
    """Mark the nodes (n,) surrounded by `rings` rings of nodes of the same part (n,).

    `start` and `link` are those of the star, `queue` (n,) is scratch.
    """
    last = 0
    for v in range(part.shape[0]):
        interior[v] = True
        for row in range(start[v], start[v + 1]):
            for k in range(link.shape[1]):
                if part[link[row, k]] != part[v]:
                    interior[v] = False
        if not interior[v]:
            queue[last] = v
            last += 1
    first = 0
    for _ in range(rings - 1):
        end = last
        for j in range(first, last):
            v = queue[j]
            for row in range(start[v], start[v + 1]):
                for k in range(link.shape[1]):
                    other = link[row, k]
                    if interior[other]:
                        interior[other] = False
                        queue[end] = other
                        end += 1
        first, last = last, end


@kernel
def swap_each(order, first, second):
    for i in range(first.shape[0]):
        order[first[i]], order[second[i]] = order[second[i]], order[first[i]]


def sorted_into_tiles(winners: Ints, rank: Ints, interior: Mask, tiles: int) -> IntsPair:
    """Sort training points by the tile of the winner, interior winners first.

    Returned are the cuts and the order. The winners of ``order[cuts[i] : cuts[i + 1]]`` are in tile i, in the interior
    for i < tiles and otherwise not in the interior of tile ``i - tiles``. Tiles are equal stretches of the curve, on
    which node v has the position ``rank[v]``.
    """
    tile = rank[winners].astype(np.int64) * tiles // len(rank) + np.where(interior[winners], 0, tiles)
    order = np.argsort(tile.astype(np.min_scalar_type(2 * tiles)), kind="stable")  # the shortest type is the fastest
    return np.append(0, np.cumsum(np.bincount(tile, minlength=2 * tiles))), order.astype(np.int32)


def shuffle(cuts: Ints, order: Ints, rng: Generator) -> None:
    count = np.maximum(np.diff(cuts) - 1, 0)
    stretch = np.repeat(np.arange(len(count)), count)
    last = cuts[stretch + 1] - 1 - (np.arange(len(stretch)) - (np.cumsum(count) - count)[stretch])
    swap_each(order, last, rng.integers(cuts[stretch], last + 1))
