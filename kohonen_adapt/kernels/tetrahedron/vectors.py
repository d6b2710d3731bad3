"""Vectors, and symmetric matrices (xx, xy, xz, yy, yz, zz), as tuples."""

from kohonen_adapt.kernels.numba.compilation import inner_kernel


@inner_kernel
def between(position, a, b):
    return position[b, 0] - position[a, 0], position[b, 1] - position[a, 1], position[b, 2] - position[a, 2]


@inner_kernel
def from_to(x, position, v):
    return position[v, 0] - x[0], position[v, 1] - x[1], position[v, 2] - x[2]


@inner_kernel
def minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inner_kernel
def plus(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inner_kernel
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_kernel
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner_kernel
def product(matrix, a):
    xx, xy, xz, yy, yz, zz = matrix
    return xx * a[0] + xy * a[1] + xz * a[2], xy * a[0] + yy * a[1] + yz * a[2], xz * a[0] + yz * a[1] + zz * a[2]


@inner_kernel
def determinant(matrix):
    xx, xy, xz, yy, yz, zz = matrix
    return xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
