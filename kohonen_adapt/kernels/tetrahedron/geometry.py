"""Measure tetrahedra: volumes, and qualities as their cubes, which need no roots."""

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel

FLAT = 1e-18  # cube of a quality: an element that is made must be better than this


@inner_kernel
def six_volumes(position, a, b, c, d):
    """Six times the signed volume."""
    ax, ay, az = position[a, 0], position[a, 1], position[a, 2]
    ux, uy, uz = position[b, 0] - ax, position[b, 1] - ay, position[b, 2] - az
    vx, vy, vz = position[c, 0] - ax, position[c, 1] - ay, position[c, 2] - az
    wx, wy, wz = position[d, 0] - ax, position[d, 1] - ay, position[d, 2] - az
    return ux * (vy * wz - vz * wy) + uy * (vz * wx - vx * wz) + uz * (vx * wy - vy * wx)


@inner_kernel
def cubed_quality(position, a, b, c, d):
    """Cube of the quality 12 (3 V)^(2/3) / (sum of squared edges), with the sign of the volume."""
    ax, ay, az = position[a, 0], position[a, 1], position[a, 2]
    return cubed_quality_at(position, ax, ay, az, b, c, d)


@inner_kernel
def cubed_quality_at(position, x, y, z, b, c, d):
    """The same with the first corner at (x, y, z)."""
    ux, uy, uz = position[b, 0] - x, position[b, 1] - y, position[b, 2] - z
    vx, vy, vz = position[c, 0] - x, position[c, 1] - y, position[c, 2] - z
    wx, wy, wz = position[d, 0] - x, position[d, 1] - y, position[d, 2] - z
    volume = ux * (vy * wz - vz * wy) + uy * (vz * wx - vx * wz) + uz * (vx * wy - vy * wx)
    squares = 3.0 * (
        (ux * ux + uy * uy + uz * uz) + (vx * vx + vy * vy + vz * vz) + (wx * wx + wy * wy + wz * wz)
    ) - 2.0 * (
        (ux * vx + uy * vy + uz * vz) + (ux * wx + uy * wy + uz * wz) + (vx * wx + vy * wy + vz * wz)
    )  # of all six edges
    return 432.0 * volume * abs(volume) / (squares * squares * squares)


@inner_kernel
def ways_along(position, p, q, r):
    """The ways u and v from node p to two others, u x v, and 3 (|u|^2 + |v|^2) - 2 u . v.

    That is what tetrahedra on the triangle have in common.
    """
    px, py, pz = position[p, 0], position[p, 1], position[p, 2]
    ux, uy, uz = position[q, 0] - px, position[q, 1] - py, position[q, 2] - pz
    vx, vy, vz = position[r, 0] - px, position[r, 1] - py, position[r, 2] - pz
    across = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    squares = 3.0 * ((ux * ux + uy * uy + uz * uz) + (vx * vx + vy * vy + vz * vz))
    return (ux, uy, uz), (vx, vy, vz), across, squares - 2.0 * (ux * vx + uy * vy + uz * vz)


@inner_kernel
def cubed_quality_on(ways, way, side):
    """Cube of the quality of the tetrahedron of a triangle, as `ways_along` has it, and the node at the end of a `way`
    from its first one, on the `side` to which u x v points (1) or on the other (-1); 0 where it is flat or overturned.
    """
    (ux, uy, uz), (vx, vy, vz), (nx, ny, nz), squares = ways
    wx, wy, wz = way
    volume = side * (wx * nx + wy * ny + wz * nz)
    if not volume > 0.0:
        return 0.0
    squares += 3.0 * (wx * wx + wy * wy + wz * wz) - 2.0 * (wx * (ux + vx) + wy * (uy + vy) + wz * (uz + vz))
    return 432.0 * volume * volume / (squares * squares * squares)


@inner_kernel
def sum_of_squares(ux, uy, uz, vx, vy, vz, wx, wy, wz):
    """Of the lengths of the six edges of the tetrahedron that three vectors span."""
    x, y, z = ux + vx + wx, uy + vy + wy, uz + vz + wz
    own = (ux * ux + uy * uy + uz * uz) + (vx * vx + vy * vy + vz * vz) + (wx * wx + wy * wy + wz * wz)
    return 4.0 * own - (x * x + y * y + z * z)


@inner_kernel
def element_quality(position, node, e):
    """Cube of the quality of element e."""
    return cubed_quality(position, node[e, 0], node[e, 1], node[e, 2], node[e, 3])


@inner_kernel
def element_volumes(position, node, e):
    """Six times the volume of element e."""
    return six_volumes(position, node[e, 0], node[e, 1], node[e, 2], node[e, 3])


@inner_kernel
def allowed(after, before, floor):
    """Whether a change may leave that worst quality: the floor, or what was there; all of them cubed."""
    return after > FLAT and after >= min(floor, before)


@inner_kernel
def star_quality(position, star, v, x, y, z, least):
    """Worst cubed quality around v were it at (x, y, z), or any below `least` as soon as one is found."""
    worst = 2.0
    for j in range(star.start[v], star.start[v + 1]):
        quality = cubed_quality_at(position, x, y, z, star.link[j, 0], star.link[j, 1], star.link[j, 2])
        if not quality >= worst:
            worst = quality
            if not worst >= least:
                return worst
    return worst


@inner_kernel
def squared_distance(position, a, b):
    """Squared length of the edge ab."""
    dx, dy, dz = position[a, 0] - position[b, 0], position[a, 1] - position[b, 1], position[a, 2] - position[b, 2]
    return dx * dx + dy * dy + dz * dz


@inner_kernel
def rounded(length):
    """To 24 bits, so that lengths which only rounding tells apart are the same (Dekker's split)."""
    spread = length * (2.0**29 + 1.0)
    return np.float64(spread - (spread - length))
