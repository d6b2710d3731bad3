"""Derivatives of functionals of order 2 and 3 around a centre.

On an element (v, a, b), counter-clockwise with doubled area D, the functions have gradients g = (g1, g2) on the
reference triangle. At a quadrature point of weight w the function u = sum U_i phi_i satisfies

    n = G2 (a - x_v) - G1 (b - x_v),    G = sum U_i g_i,    J grad u = n / D up to sign,

where J turns by a right angle. As at order 1, n is affine in x_v, so the derivatives of `linear` hold at every point
with the fraction w of the element. Derivatives by a coefficient U_i have e_i = g2_i (a - x_v) - g1_i (b - x_v) in
place of dn / dw.

The unknowns of a `Block` are eliminated by Cholesky's method, so a node moves to where the minimum over the block is
lower. A primal and a dual function have a block each. The blocks couple only through the position, so the functionals
are added after elimination.
"""

from kohonen_adapt.kernels.functionals import clear, eliminate, substitute
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import (
    CONSTANTS,
    HALF_COEFFICIENT,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    POSITION,
    ROWS,
    SIXTH_SOURCE,
    UNKNOWNS,
    VALUE,
)
from kohonen_adapt.kernels.triangle.polish.by_points import add_by_points, is_valid
from kohonen_adapt.kernels.triangle.polish.varying import with_source
from kohonen_adapt.kernels.vectors import (
    ZERO,
    add_to,
    combined,
    cross,
    dot,
    from_to,
    minus,
    plus,
    plus_times,
    point,
    times,
    turned,
    weighted,
    xy,
)

EVEN, ODD, BUBBLE = 3, 6, 9  # index of the first function of each kind


@inner_kernel
def term_of(descents, i):
    return descents.primal if i == 0 else descents.dual


@inner_kernel
def number_unknowns(descent, has_value):
    """Number the unknowns of the block, from 1 without a value at the centre."""
    block = descent.block
    degrees = descent.modes.side.shape[2]
    dof, sign = block.dof, block.sign
    rows = block.size[ROWS]
    sides = 0
    for j in range(rows):
        for i in range(dof.shape[1]):
            dof[j, i], sign[j, i] = -1, 1.0
        dof[j, 0] = 0 if has_value else -1
        for side in range(1, 3 if degrees > 0 else 1):  # from the end behind, opposite to corner 1, and ahead
            if block.held[j, side]:
                continue
            other = block.end[j, 3 - side]
            s = 0
            while s < sides and block.far_end[s] != other:
                s += 1
            if s == sides:
                block.far_end[s] = other
                sides += 1
            dof[j, EVEN + side] = 1 + degrees * s
            if degrees == 2:
                dof[j, ODD + side] = 2 + 2 * s
                sign[j, ODD + side] = 1.0 if side == 2 else -1.0
    count = 1 + degrees * sides
    if degrees == 2:
        for j in range(rows):
            dof[j, BUBBLE] = count
            count += 1
    block.size[UNKNOWNS] = count


@inner_kernel
def may_centre(descent, x):
    """Return True if the triangles around x have positive Jacobian determinants."""
    block, position = descent.block, descent.position
    for j in range(block.size[ROWS]):
        a, b = from_to(x, position, block.end[j, 1]), from_to(x, position, block.end[j, 2])
        if not (cross(a, b) > 0.0 and is_valid(block.offset[j], a, b)):
            return False
    return True


@inner_kernel
def derivatives(descent, x, wanted):
    """Add the derivatives of all rows to the block and return the functional.

    The centre is at x. Derivatives beyond the level `wanted` (VALUE, COARSE_BLOCK, BLOCK or POSITION) are undefined.

    Returns
    -------
    magnitude, total, gradient, hessian
        Sum of magnitudes of all terms, functional, and its derivatives (x, y) and (xx, xy, yy) by the position of the
        centre.
    """
    position, block = descent.position, descent.block
    clear(block, block.size[UNKNOWNS] if wanted > VALUE else 0)
    magnitude = total = 0.0
    gradient = (0.0, 0.0)
    hessian = ZERO
    for j in range(block.size[ROWS]):
        a, b = from_to(x, position, block.end[j, 1]), from_to(x, position, block.end[j, 2])
        if block.special[j] or descent.trial.laws.number[block.element[j]] >= 0:
            part = add_by_points(descent, j, x, a, b, wanted)
        else:
            part = add_linear(descent.trial, descent.reference, block, j, a, b, wanted)
        if descent.trial.data.shape[1] > CONSTANTS:
            part = with_source(part, descent, j, x, a, b, wanted)
        magnitude, total = magnitude + part[0], total + part[1]
        gradient, hessian = plus(gradient, part[2]), plus(hessian, part[3])
    return magnitude, total, gradient, hessian


@inner_kernel
def add_linear(trial, reference, block, j, a, b, wanted):
    # With means of products of gradients, because sums over the quadrature points would take several times as long.
    e, local = block.element[j], block.local[j]
    dof, sign, product, mean = block.dof, block.sign, reference.product, reference.mean_slope
    edge = minus(b, a)
    functions = mean.shape[0]
    doubled = cross(a, b)
    inverse = 1.0 / doubled
    inwards = turned(edge)
    load = 6.0 * trial.data[e, SIXTH_SOURCE]
    weight = inverse * trial.data[e, HALF_COEFFICIENT]
    flux = (trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y])
    aa, ab, bb = dot(a, a), dot(a, b), dot(b, b)
    first = both = second = slope_1 = slope_2 = level = 0.0
    for i in range(functions):
        terms = ZERO  # sums of products of gradients, (11, 12 + 21, 22)
        for other in range(functions):
            terms = plus_times(terms, local[other], point(product[i], other))
        first, both, second = plus_times((first, both, second), local[i], terms)
        slope_1, slope_2 = slope_1 + local[i] * mean[i, 0], slope_2 + local[i] * mean[i, 1]
        level += local[i] * reference.mean[i]
        row = dof[j, i]
        if wanted == VALUE or row < 0:
            continue
        one, two = terms[0], terms[2]
        along, turn = aa * two - ab * terms[1] + bb * one, mean[i, 0] - mean[i, 1]
        flow = cross(weighted(mean[i, 1], a, -mean[i, 0], b), flux)
        pulled = load * reference.mean[i]
        block.rest[row] += sign[j, i] * (weight * along - flow - pulled * doubled)
        if wanted == POSITION:
            along_a, along_b = weight * (terms[1] - 2.0 * two), weight * (2.0 * one - terms[1])
            mixed = combined(along_a, a, -along_b, b, -weight * inverse * along - pulled, inwards)
            add_to(block.mixed, row, times(sign[j, i], plus_times(mixed, turn, turned(flux))))
        for other in range(i + 1):
            column = dof[j, other]
            if column >= 0:
                entry = aa * product[i, other, 2] - ab * product[i, other, 1] + bb * product[i, other, 0]
                block.stiffness[max(row, column), min(row, column)] += weight * sign[j, i] * sign[j, other] * entry
    difference = slope_1 - slope_2
    m = weighted(slope_2, a, -slope_1, b)
    push = cross(m, flux)
    pull = load * level * doubled
    square, squared = aa * second - ab * both + bb * first, first - both + second  # means of n.n and (G1 - G2)^2
    energy = 0.5 * weight * square
    magnitude, total = energy + abs(push) + abs(pull), energy - push - pull
    if wanted < POSITION:
        return magnitude, total, (0.0, 0.0), ZERO
    n = weighted(0.5 * both - second, a, 0.5 * both - first, b)  # mean of (G1 - G2) n
    half_square = 0.5 * inverse * square
    gradient = plus_times(times(weight, plus_times(n, -half_square, inwards)), difference, turned(flux))
    gradient = plus_times(gradient, -load * level, inwards)
    rate, (ex, ey) = inverse * inverse * square, edge
    xx = weight * (squared + 2.0 * inverse * ey * n[0] + ey * ey * rate)
    yy = weight * (squared - 2.0 * inverse * ex * n[1] + ex * ex * rate)
    off_diagonal = weight * (inverse * (ey * n[1] - ex * n[0]) - ex * ey * rate)
    return magnitude, total, gradient, (xx, off_diagonal, yy)


@inner_kernel
def factorise(block, first, wanted):
    columns = 2 if wanted == POSITION else 0
    return eliminate(block.stiffness, block.rest, block.mixed, columns, first, block.size[UNKNOWNS])


@inner_kernel
def correct(block, first):
    for i in range(first, block.size[UNKNOWNS]):
        block.correction[i] = -block.rest[i]
    substitute(block.stiffness, block.correction, first, block.size[UNKNOWNS])


@inner_kernel
def respond(block, first, step):
    for i in range(first, block.size[UNKNOWNS]):
        block.response[i] = -dot(step, xy(block.mixed, i))
    substitute(block.stiffness, block.response, first, block.size[UNKNOWNS])


@inner_kernel
def change(block, first, step, length):
    """Add `length` times `Block.correction` or `Block.response` to the coefficients."""
    dof = block.dof
    for j in range(block.size[ROWS]):
        for i in range(dof.shape[1]):
            row = dof[j, i]
            if row >= first:
                block.local[j, i] += block.sign[j, i] * (length * step[row])


@inner_kernel
def minimise(descent, first, x, wanted):
    """Change the unknowns from `first` on by one step of Newton's method.

    Returns
    -------
    solved, magnitude, before, square
        True if the step exists, sum of magnitudes of all terms, functional before the step, and twice the decrease by
        the step. The decrease is exact if the functional is quadratic.
    """
    magnitude, before = derivatives(descent, x, wanted)[:2]
    solved, square = factorise(descent.block, first, wanted)
    if solved:
        correct(descent.block, first)
        change(descent.block, first, descent.block.correction, 1.0)
    return solved, magnitude, before, square
