"""Cholesky elimination of the unknowns that change with a node."""

import math

from kohonen_adapt.kernels.numba.compilation import inner_kernel


@inner_kernel
def eliminate(stiffness, rest, mixed, columns, first, count):
    """Replace the stiffness from row `first` up to `count` by its Cholesky factor L.

    `rest` and the first `columns` columns of `mixed` are multiplied by L^-1. Return True if the stiffness is positive
    definite, and the squared norm of the new `rest`.
    """
    square = 0.0
    for i in range(first, count):
        for j in range(first, i):
            product = stiffness[i, j]
            for k in range(first, j):
                product -= stiffness[i, k] * stiffness[j, k]
            product /= stiffness[j, j]
            stiffness[i, j] = product
            rest[i] -= product * rest[j]
            for d in range(columns):
                mixed[i, d] -= product * mixed[j, d]
        diagonal = stiffness[i, i]
        for k in range(first, i):
            diagonal -= stiffness[i, k] * stiffness[i, k]
        if not diagonal > 0.0:
            return False, 0.0
        diagonal = math.sqrt(diagonal)
        stiffness[i, i] = diagonal
        rest[i] /= diagonal
        for d in range(columns):
            mixed[i, d] /= diagonal
        square += rest[i] * rest[i]
    return True, square


@inner_kernel
def substitute_back(stiffness, values, first, count):
    for i in range(count - 1, first - 1, -1):
        value = values[i]
        for k in range(i + 1, count):
            value -= stiffness[k, i] * values[k]
        values[i] = value / stiffness[i, i]
