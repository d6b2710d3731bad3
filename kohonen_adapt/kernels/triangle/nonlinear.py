"""Look up the energy density W of nonlinear laws, and improve a node's value by Newton's method.

W is a function of s = |grad u|^2. Of a triangle with doubled area D its energy is D W / 2, with the rate dW/ds, half of
the secant coefficient, in place of a constant; convex in the values, as W is in |grad u|.
"""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import DENSITY, HALF_COEFFICIENT, HALF_FLUX_X, HALF_FLUX_Y, RATE, SIXTH_SOURCE
from kohonen_adapt.kernels.compilation import inner_kernel, kernel

STEPS = 2048  # of a table in every octave of s
TRIES = 4  # of a Newton step of a value, each half of the one before
LEAST_BEND = -0.4  # of rate / s: at -0.5 the field strength would not rise any more


@kernel
def stored(laws, law, s):
    """W, dW/ds and d2W/ds2 at s >= 0; the last to first order, for the steps of Newton's method."""
    table = laws.table
    last = table.shape[1] - 1
    begin = math.ldexp(0.5, laws.first)
    end = math.ldexp(begin, last // STEPS)
    if not s > begin:
        rate, chord = table[law, 0, RATE], table[law, 0, DENSITY] / begin
        bend = (rate - chord) / begin
        return (2.0 * chord - rate + bend * s) * s, 2.0 * chord - rate + 2.0 * bend * s, 2.0 * bend
    if s >= end:  # of a flat triangle without bound
        return table[law, last, DENSITY] + table[law, last, RATE] * (s - end), table[law, last, RATE], 0.0
    mantissa, exponent = math.frexp(s)
    place = (2.0 * mantissa - 1.0) * STEPS
    step = np.int64(place)
    i = (np.int64(exponent) - laws.first) * STEPS + step
    width, t = math.ldexp(0.5 / STEPS, exponent), place - step
    low, low_rate, high, high_rate = (
        table[law, i, DENSITY],
        table[law, i, RATE],
        table[law, i + 1, DENSITY],
        table[law, i + 1, RATE],
    )
    chord = (high - low) / width
    second, third = 3.0 * chord - 2.0 * low_rate - high_rate, low_rate + high_rate - 2.0 * chord
    rate = low_rate + t * (2.0 * second + 3.0 * t * third)
    bend = max((high_rate - low_rate) / width, LEAST_BEND * rate / s)
    return low + width * t * (low_rate + t * (second + t * third)), rate, bend


@kernel
def parabola(position, star, trial, v, x, y, w):
    """The functional of the star with v at (x, y) and its value changed by w, and its two derivatives by w: (c, r, k).

    The value is relative to v's own, as of `derivatives`.
    """
    own = trial.value[v]
    c, r, k = 0.0, 0.0, 0.0
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = star.element[j], star.ahead[j], star.behind[j]
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        alpha, beta = trial.value[a] - own, trial.value[b] - own
        ex, ey = bx - ax, by - ay
        doubled = ax * by - ay * bx
        load, flux_x, flux_y = (
            doubled * trial.data[e, SIXTH_SOURCE],
            trial.data[e, HALF_FLUX_X],
            trial.data[e, HALF_FLUX_Y],
        )
        nx, ny = beta * ax - alpha * bx + w * ex, beta * ay - alpha * by + w * ey
        along, square, law = ex * nx + ey * ny, nx * nx + ny * ny, trial.laws.number[e]
        weight = trial.data[e, HALF_COEFFICIENT] / doubled
        energy = 0.5 * weight * square
        if law >= 0:
            density, rate, bend = stored(trial.laws, law, square / (doubled * doubled))
            energy, weight = 0.5 * doubled * density, rate / doubled
            k += 2.0 * bend * along * along / (doubled * doubled * doubled)
        c += energy - load * (alpha + beta + w) - flux_y * nx + flux_x * ny
        r += weight * along - load - flux_y * ex + flux_x * ey
        k += weight * (ex * ex + ey * ey)
    return c, r, k


@inner_kernel
def improve_value(position, star, trial, v):
    """Change the value of v by Newton's step, or half as far until the functional does not rise."""
    x, y = position[v, 0], position[v, 1]
    c, r, k = parabola(position, star, trial, v, x, y, 0.0)
    w = -r / k
    for _ in range(TRIES):
        if parabola(position, star, trial, v, x, y, w)[0] <= c:
            trial.value[v] += w
            return
        w *= 0.5


@inner_kernel
def least_parabola(position, star, trial, v, x, y, w, given):
    """A parabola c + r w + k w^2 / 2 with the least value that is found from w for v at (x, y), and at its place.

    It is the better one of w and of one step of Newton's method from there; where the value is given that of w.
    """
    c, r, k = parabola(position, star, trial, v, x, y, w)
    if given:
        return c, 0.0, 0.0
    further = w - r / k
    value = parabola(position, star, trial, v, x, y, further)[0]
    if value < c:
        c, w = value, further
    return c + 0.5 * k * w * w, -k * w, k


@inner_kernel
def stored_in(laws, law, ax, ay, u, bx, by, v):
    """int W over the triangle (0, a, b) for the values 0, u, v."""
    nx, ny, doubled = v * ax - u * bx, v * ay - u * by, ax * by - ay * bx
    return 0.5 * doubled * stored(laws, law, (nx * nx + ny * ny) / (doubled * doubled))[0]
