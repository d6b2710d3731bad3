"""Derivatives of functionals of order 2 and 3 by a node and its unknowns.

On an element (v, a, b), counter-clockwise with doubled area D, the functions have gradients g = (g1, g2) on the
reference triangle. At a quadrature point of weight w the function u = sum U_i phi_i satisfies

    n = G2 (a - x_v) - G1 (b - x_v),    G = sum U_i g_i,    J grad u = n / D up to sign,

where J turns by a right angle. As at order 1, n is affine in x_v, so the derivatives of `descend` hold at every point
with the fraction w of the element. Derivatives by a coefficient U_i have e_i = g2_i (a - x_v) - g1_i (b - x_v) in
place of dn / dw.

The unknowns that change with a node form one block: the value of the node, the coefficients of its sides and the
bubbles of its elements. Cholesky's method eliminates the block, so a node moves to where the minimum over the
block is lower. A primal and a dual function have a block each. The blocks couple only through the position, so the
functionals are added after elimination.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.arrays import KernelMesh, Modes
from kohonen_adapt.kernels.functionals import eliminate, substitute
from kohonen_adapt.kernels.numba.compilation import inner_kernel, record
from kohonen_adapt.kernels.triangle.arrays import (
    CONSTANTS,
    HALF_COEFFICIENT,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    SIXTH_SOURCE,
    VALUE,
    Block,
    Descent,
    Points,
    Reference,
    Shapes,
    Trials,
)
from kohonen_adapt.kernels.triangle.geometry import corner_of
from kohonen_adapt.kernels.triangle.polish.by_points import (
    add_by_law,
    add_by_points,
    gather_offsets,
    is_curved,
    is_valid,
    valid_at,
)
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


@record
class Descents(NamedTuple):
    primal: Descent
    dual: Descent  # in linear materials
    terms: int  # 1 without a dual function, else 2

    @classmethod
    def of(
        cls,
        mesh: KernelMesh,
        trials: Trials,
        modes: Sequence[Modes],
        shapes: tuple[Reference, Points, Shapes],
    ) -> "Descents":
        most = int(np.diff(mesh.star.start).max())
        primal, dual = (Block.of(most, shapes[0].slope.shape[1]) for _ in trials)
        first = Descent(*mesh, trials.primal, modes[0], *shapes, primal)
        second = Descent(*mesh, trials.dual, modes[-1], *shapes, dual)
        return cls(first, second, 2 if len(trials.dual.value) else 1)


@inner_kernel
def number_block(descent, v):
    elements, star, modes, block = descent.elements, descent.star, descent.modes, descent.block
    dof, sign = block.dof, block.sign
    degrees = modes.side.shape[2]
    begin, sides = star.start[v], 0
    for row in range(begin, star.start[v + 1]):
        j, e = row - begin, np.int64(star.element[row])
        k = corner_of(elements.node, e, v)
        for i in range(dof.shape[1]):
            dof[j, i], sign[j, i] = -1, 1.0
        dof[j, 0] = 0
        for side in range(1, 3 if degrees > 0 else 1):  # (b, v) is opposite to corner 1, (v, a) to corner 2
            if modes.dirichlet[e, (k + side) % 3]:
                continue
            other, s = star.ahead[row] if side == 2 else star.behind[row], 0
            while s < sides and block.far_end[s] != other:
                s += 1
            if s == sides:
                block.far_end[s] = other
                sides += 1
            dof[j, EVEN + side] = 1 + degrees * s
            if degrees == 2:
                dof[j, ODD + side], sign[j, ODD + side] = 2 + 2 * s, 1.0 if side == 2 else -1.0
    count = 1 + degrees * sides
    if degrees == 2:
        for j in range(star.start[v + 1] - begin):
            dof[j, BUBBLE] = count
            count += 1
    block.unknowns[0], block.own[0] = count, reference_value(descent, v)


@inner_kernel
def reference_value(descent, v):
    # An offset of all values only adds a constant to the functional of the star, because the star, or
    # the pair of elements, has a constant area. Around an axis constants are no functions of the space.
    return 0.0 if descent.shapes.around else descent.trial.value[v]


@inner_kernel
def gather_coefficients(node, value, modes, e, k, own, local):
    degrees = modes.side.shape[2]
    for i in range(3):
        corner = (k + i) % 3
        local[i] = value[node[e, corner]] - own
        for d in range(degrees):
            local[EVEN + 3 * d + i] = modes.side[e, corner, d]
    if degrees == 2:
        local[BUBBLE] = modes.bubble[e]


@inner_kernel
def put_coefficients(modes, e, k, local):
    degrees = modes.side.shape[2]
    for i in range(3):
        for d in range(degrees):
            modes.side[e, (k + i) % 3, d] = local[EVEN + 3 * d + i]
    if degrees == 2:
        modes.bubble[e] = local[BUBBLE]


@inner_kernel
def clear_derivatives(block):
    for i in range(block.unknowns[0]):
        block.rest[i] = block.mixed[i, 0] = block.mixed[i, 1] = 0.0
        for j in range(i + 1):
            block.stiffness[i, j] = 0.0


@inner_kernel
def add_element(trial, reference, block, e, j, local, a, b, wanted):
    """Add the derivatives of element `e` to the block and return its functional.

    Parameters
    ----------
    j
        Row of the block with the unknowns of the element.
    local
        Coefficients of the element, shape (functions,), beginning at the node that moves.
    a, b
        Vectors from that node to the next two corners, counter-clockwise.
    wanted
        VALUE, BLOCK or POSITION. Derivatives beyond the level `wanted` are undefined.

    Returns
    -------
    magnitude, total, gradient, hessian
        Sum of magnitudes of all terms, functional, and its derivatives (x, y) and (xx, xy, yy) by the position of the
        node.
    """
    inwards, doubled = turned(minus(b, a)), cross(a, b)
    load, mean = 6.0 * trial.data[e, SIXTH_SOURCE], 0.0
    if trial.laws.number[e] >= 0:
        part = add_by_law(trial, reference, block, e, j, local, a, b, wanted)
    else:
        part = add_linear(trial, reference, block, e, j, local, a, b, wanted)
    magnitude, total, gradient, hessian = part
    if load != 0.0:
        for i in range(reference.slope.shape[1]):
            mean += reference.mean[i] * local[i]
            if wanted > VALUE and block.dof[j, i] >= 0:
                pulled = load * block.sign[j, i] * reference.mean[i]
                block.rest[block.dof[j, i]] -= pulled * doubled
                add_to(block.mixed, block.dof[j, i], times(-pulled, inwards))
        gradient = plus_times(gradient, -load * mean, inwards)
        magnitude += abs(load * mean * doubled)
        total -= load * mean * doubled
    return magnitude, total, gradient, hessian


@inner_kernel
def add_linear(trial, reference, block, e, j, local, a, b, wanted):
    # With means of products of gradients, because sums over the quadrature points would take several times as long.
    dof, sign, product, mean = block.dof, block.sign, reference.product, reference.mean_slope
    edge, functions = minus(b, a), mean.shape[0]
    inverse, inwards = 1.0 / cross(a, b), turned(edge)
    weight, flux = inverse * trial.data[e, HALF_COEFFICIENT], (trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y])
    aa, ab, bb = dot(a, a), dot(a, b), dot(b, b)
    first = both = second = slope_1 = slope_2 = 0.0
    for i in range(functions):
        terms = ZERO  # sums of products of gradients, (11, 12 + 21, 22)
        for other in range(functions):
            terms = plus_times(terms, local[other], point(product[i], other))
        first, both, second = plus_times((first, both, second), local[i], terms)
        slope_1, slope_2 = slope_1 + local[i] * mean[i, 0], slope_2 + local[i] * mean[i, 1]
        row = dof[j, i]
        if wanted == VALUE or row < 0:
            continue
        one, two = terms[0], terms[2]
        along, turn = aa * two - ab * terms[1] + bb * one, mean[i, 0] - mean[i, 1]
        along_a, along_b = weight * (terms[1] - 2.0 * two), weight * (2.0 * one - terms[1])
        flow = cross(weighted(mean[i, 1], a, -mean[i, 0], b), flux)
        block.rest[row] += sign[j, i] * (weight * along - flow)
        mixed = combined(along_a, a, -along_b, b, -weight * inverse * along, inwards)
        add_to(block.mixed, row, times(sign[j, i], plus_times(mixed, turn, turned(flux))))
        for other in range(i + 1):
            column = dof[j, other]
            if column >= 0:
                entry = aa * product[i, other, 2] - ab * product[i, other, 1] + bb * product[i, other, 0]
                block.stiffness[max(row, column), min(row, column)] += weight * sign[j, i] * sign[j, other] * entry
    difference, m = slope_1 - slope_2, weighted(slope_2, a, -slope_1, b)
    push_x, push_y = flux[0] * m[1], flux[1] * m[0]
    square, squared = aa * second - ab * both + bb * first, first - both + second  # means of n.n and (G1 - G2)^2
    n = weighted(0.5 * both - second, a, 0.5 * both - first, b)  # mean of (G1 - G2) n
    half_square, energy = 0.5 * inverse * square, 0.5 * weight * square
    gradient = plus_times(times(weight, plus_times(n, -half_square, inwards)), difference, turned(flux))
    rate, (ex, ey) = inverse * inverse * square, edge
    xx = weight * (squared + 2.0 * inverse * ey * n[0] + ey * ey * rate)
    yy = weight * (squared - 2.0 * inverse * ex * n[1] + ex * ex * rate)
    off_diagonal = weight * (inverse * (ey * n[1] - ex * n[0]) - ex * ey * rate)
    return energy + abs(push_x) + abs(push_y), energy - push_y + push_x, gradient, (xx, off_diagonal, yy)


@inner_kernel
def add_curved(descent, e, j, local, offset, x, a, b, wanted):
    if descent.shapes.around or is_curved(offset):
        part = add_by_points(descent, e, j, local, offset, x, a, b, wanted)
    else:
        part = add_element(descent.trial, descent.reference, descent.block, e, j, local, a, b, wanted)
    if descent.trial.data.shape[1] > CONSTANTS:
        return with_source(part, descent, e, j, local, np.bool_(True), offset, x, a, b, wanted)
    return part


@inner_kernel
def derivatives(descent, v, x, wanted):
    """Return the sum of `add_element` over the star of node `v` moved to x."""
    position, star, block = descent.position, descent.star, descent.block
    local = descent.block.local[0]
    node, own = descent.elements.node, block.own[0]
    clear_derivatives(block)
    magnitude = total = 0.0
    gradient, hessian = (0.0, 0.0), ZERO
    begin = star.start[v]
    for row in range(begin, star.start[v + 1]):
        e, j = np.int64(star.element[row]), row - begin
        k, special = corner_of(node, e, v), descent.shapes.special[e]
        gather_coefficients(node, descent.trial.value, descent.modes, e, k, own, local)
        a, b = from_to(x, position, star.ahead[row]), from_to(x, position, star.behind[row])
        if special:
            gather_offsets(descent.shapes, e, k, block.offset[0])
            part = add_by_points(descent, e, j, local, block.offset[0], x, a, b, wanted)
        else:
            part = add_element(descent.trial, descent.reference, block, e, j, local, a, b, wanted)
        if descent.trial.data.shape[1] > CONSTANTS:
            part = with_source(part, descent, e, j, local, special, block.offset[0], x, a, b, wanted)
        magnitude, total = magnitude + part[0], total + part[1]
        gradient, hessian = plus(gradient, part[2]), plus(hessian, part[3])
    return magnitude, total, gradient, hessian


@inner_kernel
def stays_valid(descent, v, x):
    position, star = descent.position, descent.star
    offset = descent.block.offset[0]
    for row in range(star.start[v], star.start[v + 1]):
        e = np.int64(star.element[row])
        i, k = star.ahead[row], star.behind[row]
        if descent.shapes.special[e]:
            gather_offsets(descent.shapes, e, corner_of(descent.elements.node, e, v), offset)
            a, b = from_to(x, position, i), from_to(x, position, k)
            if not (is_valid(offset, a, b) and valid_at(position, offset, v, i, k)):
                return False
    return True


@inner_kernel
def factorise(block, first):
    return eliminate(block.stiffness, block.rest, block.mixed, 2, first, block.unknowns[0])


@inner_kernel
def solve_upper(block, first, step):
    count = block.unknowns[0]
    for i in range(first, count):
        block.correction[i], block.response[i] = -block.rest[i], -dot(step, xy(block.mixed, i))
    substitute(block.stiffness, block.correction, first, count)
    substitute(block.stiffness, block.response, first, count)


@inner_kernel
def change_block(descent, v, first, times, length):
    trial, modes, star, block = descent.trial, descent.modes, descent.star, descent.block
    dof = block.dof
    begin, degrees = star.start[v], modes.side.shape[2]
    if first == 0:
        trial.value[v] += times * block.correction[0] + length * block.response[0]
    for row in range(begin, star.start[v + 1]):
        j, e = row - begin, np.int64(star.element[row])
        k = corner_of(descent.elements.node, e, v)
        for side in range(1, 3):
            for d in range(degrees):
                i = EVEN + 3 * d + side
                if dof[j, i] >= 0:
                    change = times * block.correction[dof[j, i]] + length * block.response[dof[j, i]]
                    modes.side[e, (k + side) % 3, d] += block.sign[j, i] * change
        if degrees == 2:
            modes.bubble[e] += times * block.correction[dof[j, BUBBLE]] + length * block.response[dof[j, BUBBLE]]
