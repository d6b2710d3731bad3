"""Energy of nonlinear laws by tables, and elimination of unknowns.

A table has the energy density W and its derivative over s = |grad u|^2, with `STEPS` equal steps in every octave of s.
Between two steps a cubic interpolates both. Below the table W is a parabola, above the table W is linear in s.
"""

import math
from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.numba.array_types import I1, R3
from kohonen_adapt.kernels.numba.compilation import inner_kernel, record

STEPS = 2048  # of a table in every octave of |grad u|^2
LEAST_CURVE = -0.4  # least d2W/ds2 as a fraction of (dW/ds) / s; at -0.5 the field strength is constant
DENSITY, RATE = 0, 1  # of `Laws.table`


@record
class Laws(NamedTuple):
    """Nonlinear laws as tables of the energy density W over s = |grad u|^2."""

    number: I1  # (m,): index of the law of every element, -1 for none
    first: int  # the tables begin at s = 2^(first - 1)
    table: R3  # (laws, rows, 2): W and dW/ds at the steps


@inner_kernel
def energy_density(laws, law, s):
    """Return W, dW/ds and d2W/ds2 at s = |grad u|^2 >= 0.

    The second derivative is of first order only, for the steps of Newton's method.
    """
    table = laws.table
    last = table.shape[1] - 1
    mantissa, exponent = math.frexp(s)
    octave = np.int64(exponent) - laws.first
    if octave < 0 or not s > 0.0:
        begin = math.ldexp(0.5, laws.first)
        rate = table[law, 0, RATE]
        chord = table[law, 0, DENSITY] / begin
        curve = (rate - chord) / begin
        return (2.0 * chord - rate + curve * s) * s, 2.0 * chord - rate + 2.0 * curve * s, 2.0 * curve
    if octave >= last // STEPS or s == math.inf:  # gradients of a flat triangle are unbounded
        end = math.ldexp(0.5, laws.first + last // STEPS)
        return table[law, last, DENSITY] + table[law, last, RATE] * (s - end), table[law, last, RATE], 0.0
    place = (2.0 * mantissa - 1.0) * STEPS
    step = np.int64(place)
    i = octave * STEPS + step
    width, t = 0.5 / STEPS * (s / mantissa), place - step  # a power of 2
    low, low_rate = table[law, i, DENSITY], table[law, i, RATE]
    high, high_rate = table[law, i + 1, DENSITY], table[law, i + 1, RATE]
    chord = (high - low) / width
    second, third = 3.0 * chord - 2.0 * low_rate - high_rate, low_rate + high_rate - 2.0 * chord
    rate = low_rate + t * (2.0 * second + 3.0 * t * third)
    curve = max((high_rate - low_rate) / width, LEAST_CURVE * rate / s)
    return low + width * t * (low_rate + t * (second + t * third)), rate, curve


@inner_kernel
def eliminate(stiffness, rest, mixed, columns, first, count):
    """Replace the stiffness from row `first` up to `count` by a triangular factor L.

    The stiffness is ``L^T L``. `rest` and the first `columns` columns of `mixed` are multiplied by L^-T. Return True if
    the stiffness is positive definite, and the squared norm of the new `rest`.
    """
    # The last unknown first: eliminating the first, the value of the node, would fill the sparse stiffness.
    square = 0.0
    for k in range(count - 1, first - 1, -1):
        diagonal = stiffness[k, k]
        if not diagonal > 0.0:
            return False, 0.0
        diagonal = math.sqrt(diagonal)
        inverse = 1.0 / diagonal
        stiffness[k, k] = diagonal
        rest[k] *= inverse
        square += rest[k] * rest[k]
        for d in range(columns):
            mixed[k, d] *= inverse
        for i in range(first, k):
            stiffness[k, i] *= inverse
            factor = stiffness[k, i]
            if factor == 0.0:
                continue
            rest[i] -= factor * rest[k]
            for d in range(columns):
                mixed[i, d] -= factor * mixed[k, d]
            for j in range(first, i + 1):
                stiffness[i, j] -= factor * stiffness[k, j]
    return True, square


@inner_kernel
def clear(block, count):
    for i in range(count):
        block.rest[i] = 0.0
        block.mixed[i] = 0.0
        for j in range(i + 1):
            block.stiffness[i, j] = 0.0


@inner_kernel
def substitute(stiffness, values, first, count):
    for i in range(first, count):
        value = values[i]
        for k in range(first, i):
            value -= stiffness[i, k] * values[k]
        values[i] = value / stiffness[i, i]
