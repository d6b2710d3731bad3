"""Edge flips that decrease functionals of order 2 or 3.

The coefficients inside the two elements are eliminated before and after a flip.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import BLOCK, COARSE_BLOCK, CONSTANTS, VALUE
from kohonen_adapt.kernels.triangle.flip import flip_edge, mark_neighbours, may_flip
from kohonen_adapt.kernels.triangle.geometry import corner_towards, corners_around, twice_area
from kohonen_adapt.kernels.triangle.polish.by_points import gather_offsets, put_offsets, valid_at
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING
from kohonen_adapt.kernels.triangle.polish.descend_higher import (
    BUBBLE,
    EVEN,
    ODD,
    add_curved,
    add_element,
    clear_derivatives,
    factorise,
    gather_coefficients,
    put_coefficients,
    reference_value,
    solve_upper,
)
from kohonen_adapt.kernels.triangle.polish.varying import with_source
from kohonen_adapt.kernels.vectors import from_to, xy

NEAR = 0.25  # of twice the decrease of a step by few points: more than another step takes off


@kernel
def descend_flips_higher(descents, floor, gainful, first, last, marks):
    position, elements = descents.primal.position, descents.primal.elements
    gain, flips = 0.0, 0
    for e in range(first, last):
        gainful[e] &= not marks
        for k in range(3):
            other = np.int64(elements.neighbour[e, k])
            if gainful[e] == marks or other < e or elements.chain[e, k] >= 0:
                continue
            decrease = gain_of_flip(descents, e, k, other)
            if marks:
                gainful[e] = decrease > 0.0
            elif decrease > 0.0 and may_flip(position, elements, e, k, other, floor):
                flip_with_modes(descents, e, k, other)
                gain += decrease
                flips += 1
                mark_neighbours(elements, e, gainful)
                mark_neighbours(elements, other, gainful)
    return gain, flips


@inner_kernel
def flip_with_modes(descents, e, k, other):
    elements, shapes, offset = descents.primal.elements, descents.primal.shapes, descents.primal.block.offset
    j = corner_towards(elements.neighbour, other, e)
    k1, j1 = (k + 1) % 3, (j + 1) % 3
    for i in range(descents.terms):
        descent = descents.primal if i == 0 else descents.dual
        modes, local = descent.modes, descent.block.local
        modes.dirichlet[e, k], modes.dirichlet[other, j] = modes.dirichlet[other, j1], modes.dirichlet[e, k1]
        modes.dirichlet[e, k1] = modes.dirichlet[other, j1] = False
        put_coefficients(modes, e, k1, local[2])
        put_coefficients(modes, other, j1, local[3])
    flip_edge(elements, e, k)
    if shapes.special[e] or shapes.special[other]:
        put_offsets(shapes, e, k1, offset[2])
        put_offsets(shapes, other, j1, offset[3])


@inner_kernel
def gain_of_flip(descents, e, k, other):
    """Return the decrease of the functionals by a flip, or 0 if negligible.

    Rows 2 and 3 of `Block.local` then contain the coefficients of the flipped elements (p, s, r) and (q, r, s).
    """
    gain, magnitude = 0.0, 0.0
    for i in range(descents.terms):
        decrease, more = change_by_flip(descents.primal if i == 0 else descents.dual, e, k, other)
        gain, magnitude = gain + decrease, magnitude + more
    return gain if gain > ROUNDING * magnitude else 0.0


@inner_kernel
def change_by_flip(descent, e, k, other):
    elements, position, local = descent.elements, descent.position, descent.block.local
    p, q, r, s = corners_around(elements.node, e, k, other)
    if not (twice_area(position, r, p, s) > 0.0 and twice_area(position, s, q, r) > 0.0):
        return 0.0, 0.0
    own = reference_value(descent, r)
    value, modes = descent.trial.value, descent.modes
    gather_coefficients(elements.node, value, modes, e, k, own, local[0])
    j = corner_towards(elements.neighbour, other, e)
    gather_coefficients(elements.node, value, modes, other, j, own, local[1])
    turn_coefficients(local, modes.side.shape[2])
    special = descent.shapes.special[e] or descent.shapes.special[other]
    if special:
        gather_offsets(descent.shapes, e, k, descent.block.offset[0])
        gather_offsets(descent.shapes, other, j, descent.block.offset[1])
        turn_offsets(descent.block.offset)
        if not (
            valid_at(position, descent.block.offset[2], p, s, r)
            and valid_at(position, descent.block.offset[3], q, r, s)
        ):
            return 0.0, 0.0
    magnitude, before, square = step_of_pair(descent, e, 0, special, (p, q, r, s), BLOCK)
    before -= 0.5 * square
    if descent.trial.laws.number[e] >= 0:
        more, after = best_of_nonlinear_pair(descent, e, 2, special, before, (s, r, p, q))
    else:
        more, after, square = step_of_pair(descent, e, 2, special, (s, r, p, q), BLOCK)
        after -= 0.5 * square
    return before - after, magnitude + more


@inner_kernel
def turn_coefficients(local, degrees):
    for one in range(2):
        this, that, new = local[one], local[1 - one], local[2 + one]
        new[:] = 0.0
        new[0], new[1 + one], new[2 - one] = local[0][1 + one], local[1][0], local[0][0]
        for d in range(degrees):
            i = EVEN + 3 * d
            new[i + 1], new[i + 2] = this[i + 2], that[i + 1]


@inner_kernel
def turn_offsets(offset):
    for i in range(2):
        for c in range(2):
            offset[2 + i, 0, c] = 0.0
            offset[2 + i, 1, c], offset[2 + i, 2, c] = offset[i, 2, c], offset[1 - i, 1, c]


@inner_kernel
def step_of_pair(descent, e, row, special, nodes, wanted):
    """Update the coefficients inside two adjacent triangles to lower the energy.

    For `nodes` (p, q, r, s) the triangles are (r, p, q) and (s, q, p). The coefficients of the common side pq and of
    both bubbles change by one step of Newton's method. All other coefficients are held.

    Parameters
    ----------
    e
        Element with the data of both triangles, which are in one region.
    row
        Row of `Block.local` with the coefficients of the first triangle. The next row is the second triangle's.
    special
        True if the same rows of `Block.offset` have midside offsets, or the mesh is around an axis.
    wanted
        BLOCK, or COARSE_BLOCK for few quadrature points.

    Returns
    -------
    magnitude, total, square
        Sum of magnitudes of all terms, functional before the step, and twice the decrease by the step. The decrease is
        exact if the functional is quadratic.
    """
    block = descent.block
    number_pair(block, descent.modes.side.shape[2])
    magnitude, total = derivatives_of_pair(descent, e, row, special, nodes, wanted)
    solved, square = factorise(block, 0)
    if solved:
        solve_upper(block, 0, (0.0, 0.0))
        change_pair(block, block.local, row)
    return magnitude, total, square


@inner_kernel
def best_of_nonlinear_pair(descent, e, row, special, target, nodes):
    """Compute the minimum over inner coefficients in nonlinear materials.

    The first step of `step_of_pair` has few quadrature points, a second step with all points follows if the functional
    may fall to `target`. Return the sum of magnitudes and the functional.
    """
    square = step_of_pair(descent, e, row, special, nodes, COARSE_BLOCK)[2]
    magnitude, total = derivatives_of_pair(descent, e, row, special, nodes, VALUE)
    if total - target < NEAR * square:
        step_of_pair(descent, e, row, special, nodes, BLOCK)
        magnitude, total = derivatives_of_pair(descent, e, row, special, nodes, VALUE)
    return magnitude, total


@inner_kernel
def number_pair(block, degrees):
    dof, sign = block.dof, block.sign
    block.unknowns[0] = 4 if degrees == 2 else degrees
    for j in range(2):
        for i in range(dof.shape[1]):
            dof[j, i], sign[j, i] = -1, 1.0
        if degrees > 0:
            dof[j, EVEN] = 0
        if degrees == 2:
            dof[j, ODD], dof[j, BUBBLE] = 1, 2 + j
    if degrees == 2:
        sign[1, ODD] = -1.0


@inner_kernel
def derivatives_of_pair(descent, e, row, special, nodes, wanted):
    block, (p, q, r, s) = descent.block, nodes
    clear_derivatives(block)
    magnitude, total = 0.0, 0.0
    for j in range(2):
        v, i, k = (r, p, q) if j == 0 else (s, q, p)
        x = xy(descent.position, v)
        local, offset = block.local[row + j], block.offset[row + j]
        a, b = from_to(x, descent.position, i), from_to(x, descent.position, k)
        if special:
            part = add_curved(descent, e, j, local, offset, x, a, b, wanted)
        else:
            part = add_element(descent.trial, descent.reference, block, e, j, local, a, b, wanted)
            if descent.trial.data.shape[1] > CONSTANTS:
                part = with_source(part, descent, e, j, local, np.bool_(False), offset, x, a, b, wanted)
        magnitude, total = magnitude + part[0], total + part[1]
    return magnitude, total


@inner_kernel
def change_pair(block, local, row):
    for j in range(2):
        for i in range(EVEN, local.shape[1]):
            if block.dof[j, i] >= 0:
                local[row + j, i] += block.sign[j, i] * block.correction[block.dof[j, i]]
