"""Nearest sample of a surface in a k-d tree without a stack.

The children of row i are rows 2 i + 1 and 2 i + 2 (complete trees), with cuts across x, y and z in turn. The
next step follows from the previous row (Wald, "A Stack-Free Traversal Algorithm for Left-Balanced k-d Trees",
2022).
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel


@inner_kernel
def nearest_sample(samples, p, x, y, z):
    point, root, rows = samples.point, np.int64(samples.start[p]), samples.start[p + 1] - samples.start[p]
    here, before, depth, found, least = np.int64(0), np.int64(-1), 0, root, np.inf
    while here >= 0:
        above = (here + 1) // 2 - 1
        if here >= rows:
            here, before, depth = above, here, depth - 1
            continue
        row = root + here
        dx, dy, dz = x - point[row, 0], y - point[row, 1], z - point[row, 2]
        if before < here:
            squared = dx * dx + dy * dy + dz * dz
            if squared < least:
                found, least = row, squared
        distance = dx if depth % 3 == 0 else dy if depth % 3 == 1 else dz
        near = 2 * here + (2 if distance > 0.0 else 1)
        far = 4 * here + 3 - near
        if before < here:
            onward = near
        elif before == near and distance * distance < least:
            onward = far
        else:
            onward = above
        depth += -1 if onward == above else 1
        here, before = onward, here
    return found
