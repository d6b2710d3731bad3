"""Edge flips that decrease functionals of order 2 or 3.

The coefficients inside the two elements are eliminated before and after a flip.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import BLOCK, COARSE_BLOCK, CONSTANTS, VALUE
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.connectivity import corner_towards, corners_around
from kohonen_adapt.kernels.triangle.flip import flip_edge, may_flip
from kohonen_adapt.kernels.triangle.geometry import orientation
from kohonen_adapt.kernels.triangle.polish.by_points import gather_bends, put_bends, valid_at
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING
from kohonen_adapt.kernels.triangle.polish.descend_higher import (
    BUBBLE,
    EVEN,
    ODD,
    add_bent,
    add_element,
    clear,
    factorise,
    gather,
    solve_upper,
    value_near,
)
from kohonen_adapt.kernels.triangle.polish.flip_linear import mark_beside
from kohonen_adapt.kernels.triangle.polish.varying_source import with_source

NEAR = 0.25  # of twice the decrease of a step by few points: more than another step takes off


@kernel
def descend_flips_higher(descents, floor, gainful, first, last, marks):
    position, elements, gain, flips = descents.one.position, descents.one.elements, 0.0, 0
    for e in range(first, last):
        gainful[e] &= not marks
        for k in range(3):
            other = np.int64(elements.neighbour[e, k])
            if gainful[e] == marks or other < e or elements.chain[e, k] >= 0:
                continue
            lowered = gain_of_flip(descents, e, k, other)
            if marks:
                gainful[e] = lowered > 0.0
            elif lowered > 0.0 and may_flip(position, elements, e, k, other, floor):
                flip_with_modes(descents, e, k, other)
                gain += lowered
                flips += 1
                mark_beside(elements, e, gainful)
                mark_beside(elements, other, gainful)
    return gain, flips


@inner_kernel
def flip_with_modes(descents, e, k, other):
    elements, shapes, bend = descents.one.elements, descents.one.shapes, descents.one.block.bend
    j = corner_towards(elements.neighbour, other, e)
    k1, j1 = (k + 1) % 3, (j + 1) % 3
    for i in range(descents.number):
        descent = descents.one if i == 0 else descents.other
        modes, local = descent.modes, descent.block.local
        modes.given[e, k], modes.given[other, j] = modes.given[other, j1], modes.given[e, k1]
        modes.given[e, k1] = modes.given[other, j1] = False
        put(modes, e, k1, local[2])
        put(modes, other, j1, local[3])
    flip_edge(elements, e, k)
    if shapes.special[e] or shapes.special[other]:
        put_bends(shapes, e, k1, bend[2])
        put_bends(shapes, other, j1, bend[3])


@inner_kernel
def put(modes, e, k, local):
    degrees = modes.side.shape[2]
    for i in range(3):
        for d in range(degrees):
            modes.side[e, (k + i) % 3, d] = local[EVEN + 3 * d + i]
    if degrees == 2:
        modes.bubble[e] = local[BUBBLE]


@inner_kernel
def gain_of_flip(descents, e, k, other):
    """Return the decrease of the functionals by a flip, or 0 if negligible.

    Rows 2 and 3 of `Block.local` then contain the coefficients of the flipped elements (p, s, r) and (q, r, s).
    """
    gain, size = 0.0, 0.0
    for i in range(descents.number):
        lowered, sized = change_by_flip(descents.one if i == 0 else descents.other, e, k, other)
        gain, size = gain + lowered, size + sized
    return gain if gain > ROUNDING * size else 0.0


@inner_kernel
def change_by_flip(descent, e, k, other):
    elements, position, local = descent.elements, descent.position, descent.block.local
    p, q, r, s = corners_around(elements.node, e, k, other)
    if not (area_of(position, r, p, s) > 0.0 and area_of(position, s, q, r) > 0.0):
        return 0.0, 0.0
    own, value, modes = value_near(descent, r), descent.trial.value, descent.modes
    gather(elements.node, value, modes, e, k, own, local[0])
    j = corner_towards(elements.neighbour, other, e)
    gather(elements.node, value, modes, other, j, own, local[1])
    turn(local, modes.side.shape[2])
    special = descent.shapes.special[e] or descent.shapes.special[other]
    if special:
        gather_bends(descent.shapes, e, k, descent.block.bend[0])
        gather_bends(descent.shapes, other, j, descent.block.bend[1])
        turn_bends(descent.block.bend)
        if not (
            valid_at(position, descent.block.bend[2], p, s, r) and valid_at(position, descent.block.bend[3], q, r, s)
        ):
            return 0.0, 0.0
    size, before, square = step_of_pair(descent, e, 0, special, p, q, r, s, BLOCK)
    before -= 0.5 * square
    if descent.trial.laws.number[e] >= 0:
        more, after = best_of_bent_pair(descent, e, 2, special, before, s, r, p, q)
    else:
        more, after, square = step_of_pair(descent, e, 2, special, s, r, p, q, BLOCK)
        after -= 0.5 * square
    return before - after, size + more


@inner_kernel
def area_of(position, a, b, c):
    return orientation(position[a, 0], position[a, 1], position[b, 0], position[b, 1], position[c, 0], position[c, 1])


@inner_kernel
def turn(local, degrees):
    for one in range(2):
        this, that, new = local[one], local[1 - one], local[2 + one]
        new[:] = 0.0
        new[0], new[1 + one], new[2 - one] = local[0][1 + one], local[1][0], local[0][0]
        for d in range(degrees):
            i = EVEN + 3 * d
            new[i + 1], new[i + 2] = this[i + 2], that[i + 1]


@inner_kernel
def turn_bends(bend):
    for one in range(2):
        for c in range(2):
            bend[2 + one, 0, c] = 0.0
            bend[2 + one, 1, c], bend[2 + one, 2, c] = bend[one, 2, c], bend[1 - one, 1, c]


@inner_kernel
def step_of_pair(descent, e, row, special, p, q, r, s, wanted):
    """Change the inner coefficients of (r, p, q) and (s, q, p) by a Newton step.

    The coefficients of the elements are in this row of `Block.local` and the next one. If an element is `special`, the
    curves of the sides are in the same rows of `Block.bend`. Returns the sum of magnitudes, the functional before the
    step, and twice what the step takes off a quadratic functional.
    """
    block = descent.block
    number_pair(block, descent.modes.side.shape[2])
    size, total = derivatives_of_pair(descent, e, row, special, p, q, r, s, wanted)
    solved, square = factorise(block, 0)
    if solved:
        solve_upper(block, 0, 0.0, 0.0)
        change_pair(block, block.local, row)
    return size, total, square


@inner_kernel
def best_of_bent_pair(descent, e, row, special, target, p, q, r, s):
    """Change inner coefficients as `step_of_pair` does in nonlinear material; return the magnitudes and the functional.

    The first step has few quadrature points; a second step, with all, follows if the functional may fall to `target`.
    """
    square = step_of_pair(descent, e, row, special, p, q, r, s, COARSE_BLOCK)[2]
    size, total = derivatives_of_pair(descent, e, row, special, p, q, r, s, VALUE)
    if total - target < NEAR * square:
        step_of_pair(descent, e, row, special, p, q, r, s, BLOCK)
        size, total = derivatives_of_pair(descent, e, row, special, p, q, r, s, VALUE)
    return size, total


@inner_kernel
def number_pair(block, degrees):
    place, sign = block.place, block.sign
    block.unknowns[0] = 4 if degrees == 2 else degrees
    for j in range(2):
        for i in range(place.shape[1]):
            place[j, i], sign[j, i] = -1, 1.0
        if degrees > 0:
            place[j, EVEN] = 0
        if degrees == 2:
            place[j, ODD], place[j, BUBBLE] = 1, 2 + j
    if degrees == 2:
        sign[1, ODD] = -1.0


@inner_kernel
def derivatives_of_pair(descent, e, row, special, p, q, r, s, wanted):
    block = descent.block
    clear(block)
    size, total = 0.0, 0.0
    for j in range(2):
        v, a, b = (r, p, q) if j == 0 else (s, q, p)
        x, y = descent.position[v, 0], descent.position[v, 1]
        ax, ay = descent.position[a, 0] - x, descent.position[a, 1] - y
        bx, by = descent.position[b, 0] - x, descent.position[b, 1] - y
        local = block.local[row + j]
        if special:
            part = add_bent(descent, e, j, local, block.bend[row + j], x, y, ax, ay, bx, by, wanted)
        else:
            part = add_element(descent.trial, descent.reference, block, e, j, local, ax, ay, bx, by, wanted)
            if descent.trial.data.shape[1] > CONSTANTS:
                bend = block.bend[row + j]
                part = with_source(part, descent, e, j, local, np.bool_(False), bend, x, y, ax, ay, bx, by, wanted)
        size, total = size + part[0], total + part[1]
    return size, total


@inner_kernel
def change_pair(block, local, row):
    for j in range(2):
        for i in range(EVEN, local.shape[1]):
            if block.place[j, i] >= 0:
                local[row + j, i] += block.sign[j, i] * block.still[block.place[j, i]]
