"""Vectors and symmetric matrices as tuples of numbers.

Vectors have two or three components, matrices are (xx, xy, yy) or (xx, xy, xz, yy, yz, zz). Sums and multiples of both
are the same functions. numba compiles the branch for the number of components.
"""

import math

from kohonen_adapt.kernels.numba.compilation import inner_kernel

ZERO = (0.0, 0.0, 0.0)
ZEROS = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # matrix


@inner_kernel
def point(position, v):
    return position[v, 0], position[v, 1], position[v, 2]


@inner_kernel
def xy(position, v):
    return position[v, 0], position[v, 1]


@inner_kernel
def matrix(shape, v):
    return shape[v, 0], shape[v, 1], shape[v, 2], shape[v, 3], shape[v, 4], shape[v, 5]


@inner_kernel
def put(position, v, x):
    if len(x) == 2:
        position[v, 0], position[v, 1] = x
    else:
        position[v, 0], position[v, 1], position[v, 2] = x


@inner_kernel
def add_to(position, v, x):
    if len(x) == 2:
        put(position, v, plus(xy(position, v), x))
    else:
        put(position, v, plus(point(position, v), x))


@inner_kernel
def from_to(x, position, v):
    if len(x) == 2:
        return position[v, 0] - x[0], position[v, 1] - x[1]
    return position[v, 0] - x[0], position[v, 1] - x[1], position[v, 2] - x[2]


@inner_kernel
def between(position, a, b):
    return from_to(point(position, a), position, b)


@inner_kernel
def midpoint(position, a, b):
    return times(0.5, plus(point(position, a), point(position, b)))


@inner_kernel
def times(s, a):
    if len(a) == 2:
        return s * a[0], s * a[1]
    if len(a) == 3:
        return s * a[0], s * a[1], s * a[2]
    return s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5]


@inner_kernel
def plus_times(a, s, b):
    """Return a + s b."""
    if len(a) == 2:
        return a[0] + s * b[0], a[1] + s * b[1]
    if len(a) == 3:
        return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2], a[3] + s * b[3], a[4] + s * b[4], a[5] + s * b[5]


@inner_kernel
def plus(a, b):
    return plus_times(a, 1.0, b)


@inner_kernel
def minus(a, b):
    return plus_times(a, -1.0, b)


@inner_kernel
def weighted(s, a, t, b):
    return plus_times(times(s, a), t, b)


@inner_kernel
def combined(s, a, t, b, u, c):
    return plus_times(weighted(s, a, t, b), u, c)


@inner_kernel
def divided(a, s):
    if len(a) == 2:
        return a[0] / s, a[1] / s
    return a[0] / s, a[1] / s, a[2] / s


@inner_kernel
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] if len(a) == 2 else a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_kernel
def squared_distance(position, v, x):
    offset = from_to(x, position, v)
    return dot(offset, offset)


@inner_kernel
def mapped(factor, x):
    """Return the product of an upper triangular matrix and a vector."""
    if len(x) == 2:
        a, b, c = factor
        return a * x[0] + b * x[1], c * x[1]
    a, b, c, d, e, f = factor
    return a * x[0] + b * x[1] + c * x[2], d * x[1] + e * x[2], f * x[2]


@inner_kernel
def plus_dot(s, a, b):
    """Return s + a . b, summed from the left."""
    partial = s + a[0] * b[0] + a[1] * b[1]
    return partial if len(a) == 2 else partial + a[2] * b[2]


@inner_kernel
def plus_cross(c, a, b):
    """Return c + a x b, summed from the left."""
    return c[0] + a[1] * b[2] - a[2] * b[1], c[1] + a[2] * b[0] - a[0] * b[2], c[2] + a[0] * b[1] - a[1] * b[0]


@inner_kernel
def norm(a):
    return math.sqrt(dot(a, a))


@inner_kernel
def cross(a, b):
    """Return the vector product, in the plane its length with a sign."""
    if len(a) == 2:
        return a[0] * b[1] - a[1] * b[0]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner_kernel
def turned(a):
    """Return a vector of the plane turned counter-clockwise by a right angle."""
    return -a[1], a[0]


@inner_kernel
def cofactors(a, b, c):
    return cross(b, c), cross(c, a), cross(a, b)


@inner_kernel
def product(matrix, a):
    xx, xy, xz, yy, yz, zz = matrix
    return xx * a[0] + xy * a[1] + xz * a[2], xy * a[0] + yy * a[1] + yz * a[2], xz * a[0] + yz * a[1] + zz * a[2]


@inner_kernel
def determinant(matrix):
    xx, xy, xz, yy, yz, zz = matrix
    return xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)


@inner_kernel
def plus_square(m, s, a):
    """Return m + s a a^T."""
    b = times(s, a)
    if len(a) == 2:
        return plus(m, (b[0] * a[0], b[0] * a[1], b[1] * a[1]))
    return plus(m, (b[0] * a[0], b[0] * a[1], b[0] * a[2], b[1] * a[1], b[1] * a[2], b[2] * a[2]))


@inner_kernel
def plus_products(m, a, b):
    """Return m + a b^T + b a^T."""
    return (
        m[0] + 2.0 * a[0] * b[0], m[1] + a[0] * b[1] + a[1] * b[0], m[2] + a[0] * b[2] + a[2] * b[0],
        m[3] + 2.0 * a[1] * b[1], m[4] + a[1] * b[2] + a[2] * b[1], m[5] + 2.0 * a[2] * b[2],
    )  # fmt: skip


@inner_kernel
def gram(x, y, z):
    """Return the products of three vectors."""
    return dot(x, x), dot(x, y), dot(x, z), dot(y, y), dot(y, z), dot(z, z)
