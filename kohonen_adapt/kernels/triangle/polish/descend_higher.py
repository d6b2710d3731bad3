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
    dof, sign, degrees = block.dof, block.sign, modes.side.shape[2]
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
def add_element(trial, reference, block, e, j, local, ax, ay, bx, by, wanted):
    """Add the derivatives of element `e` to the block and return its functional.

    Parameters
    ----------
    j
        Row of the block with the unknowns of the element.
    local
        Coefficients of the element, shape (functions,), beginning at the node that moves.
    ax, ay, bx, by
        Vectors from that node to the next two corners, counter-clockwise.
    wanted
        VALUE, BLOCK or POSITION. Derivatives beyond the level `wanted` are undefined.

    Returns
    -------
    magnitude, total, by_x, by_y, xx, xy, yy
        Sum of magnitudes of all terms, functional, and its derivatives by the position of the node.
    """
    ex, ey, doubled, load, mean = bx - ax, by - ay, ax * by - ay * bx, 6.0 * trial.data[e, SIXTH_SOURCE], 0.0
    if trial.laws.number[e] >= 0:
        part = add_by_law(trial, reference, block, e, j, local, ax, ay, bx, by, wanted)
    else:
        part = add_linear(trial, reference, block, e, j, local, ax, ay, bx, by, wanted)
    magnitude, total, by_x, by_y, xx, xy, yy = part
    if load != 0.0:
        for i in range(reference.slope.shape[1]):
            mean += reference.mean[i] * local[i]
            if wanted > VALUE and block.dof[j, i] >= 0:
                pulled = load * block.sign[j, i] * reference.mean[i]
                block.rest[block.dof[j, i]] -= pulled * doubled
                block.mixed[block.dof[j, i], 0] += pulled * ey
                block.mixed[block.dof[j, i], 1] -= pulled * ex
        by_x += load * mean * ey
        by_y -= load * mean * ex
        magnitude += abs(load * mean * doubled)
        total -= load * mean * doubled
    return magnitude, total, by_x, by_y, xx, xy, yy


@inner_kernel
def add_linear(trial, reference, block, e, j, local, ax, ay, bx, by, wanted):
    # With means of products of gradients, because sums over the quadrature points would take several times as long.
    dof, sign, product, mean = block.dof, block.sign, reference.product, reference.mean_slope
    ex, ey, doubled, functions = bx - ax, by - ay, ax * by - ay * bx, mean.shape[0]
    inverse = 1.0 / doubled
    weight, flux_x, flux_y = (
        inverse * trial.data[e, HALF_COEFFICIENT],
        trial.data[e, HALF_FLUX_X],
        trial.data[e, HALF_FLUX_Y],
    )
    aa, ab, bb = ax * ax + ay * ay, ax * bx + ay * by, bx * bx + by * by
    first, cross, second, slope_1, slope_2 = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(functions):
        one, both, two = 0.0, 0.0, 0.0
        for other in range(functions):
            one += product[i, other, 0] * local[other]
            both += product[i, other, 1] * local[other]
            two += product[i, other, 2] * local[other]
        first, cross, second = first + local[i] * one, cross + local[i] * both, second + local[i] * two
        slope_1, slope_2 = slope_1 + local[i] * mean[i, 0], slope_2 + local[i] * mean[i, 1]
        row = dof[j, i]
        if wanted == VALUE or row < 0:
            continue
        dot, turn = aa * two - ab * both + bb * one, mean[i, 0] - mean[i, 1]
        along_a, along_b = weight * (both - 2.0 * two), weight * (2.0 * one - both)
        flow = flux_y * (mean[i, 1] * ax - mean[i, 0] * bx) - flux_x * (mean[i, 1] * ay - mean[i, 0] * by)
        fall = weight * inverse * dot
        block.rest[row] += sign[j, i] * (weight * dot - flow)
        block.mixed[row, 0] += sign[j, i] * (along_a * ax - along_b * bx + fall * ey - flux_y * turn)
        block.mixed[row, 1] += sign[j, i] * (along_a * ay - along_b * by - fall * ex + flux_x * turn)
        for other in range(i + 1):
            column = dof[j, other]
            if column >= 0:
                entry = aa * product[i, other, 2] - ab * product[i, other, 1] + bb * product[i, other, 0]
                block.stiffness[max(row, column), min(row, column)] += weight * sign[j, i] * sign[j, other] * entry
    difference = slope_1 - slope_2
    push_x, push_y = flux_x * (slope_2 * ay - slope_1 * by), flux_y * (slope_2 * ax - slope_1 * bx)
    square, turned = aa * second - ab * cross + bb * first, first - cross + second  # means of n.n and (G1 - G2)^2
    to_a, to_b = 0.5 * cross - second, first - 0.5 * cross
    nx, ny = to_a * ax - to_b * bx, to_a * ay - to_b * by  # means of (G1 - G2) n
    half_square, energy = 0.5 * inverse * square, 0.5 * weight * square
    total = energy - push_y + push_x
    by_x = weight * (nx + half_square * ey) - difference * flux_y
    by_y = weight * (ny - half_square * ex) + difference * flux_x
    rate = inverse * inverse * square
    xx = weight * (turned + 2.0 * inverse * ey * nx + ey * ey * rate)
    xy = weight * (inverse * (ey * ny - ex * nx) - ex * ey * rate)
    yy = weight * (turned - 2.0 * inverse * ex * ny + ex * ex * rate)
    return energy + abs(push_x) + abs(push_y), total, by_x, by_y, xx, xy, yy


@inner_kernel
def add_curved(descent, e, j, local, offset, x, y, ax, ay, bx, by, wanted):
    if descent.shapes.around or is_curved(offset):
        part = add_by_points(descent, e, j, local, offset, x, ax, ay, bx, by, wanted)
    else:
        part = add_element(descent.trial, descent.reference, descent.block, e, j, local, ax, ay, bx, by, wanted)
    if descent.trial.data.shape[1] > CONSTANTS:
        return with_source(part, descent, e, j, local, np.bool_(True), offset, x, y, ax, ay, bx, by, wanted)
    return part


@inner_kernel
def derivatives(descent, v, x, y, wanted):
    """Return the sum of `add_element` over the star of node `v` moved to (x, y)."""
    position, star, block, local = descent.position, descent.star, descent.block, descent.block.local[0]
    node, own = descent.elements.node, block.own[0]
    clear_derivatives(block)
    magnitude, total, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    begin = star.start[v]
    for row in range(begin, star.start[v + 1]):
        e, a, b = np.int64(star.element[row]), star.ahead[row], star.behind[row]
        k = corner_of(node, e, v)
        gather_coefficients(node, descent.trial.value, descent.modes, e, k, own, local)
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        if descent.shapes.special[e]:
            gather_offsets(descent.shapes, e, k, block.offset[0])
            part = add_by_points(descent, e, row - begin, local, block.offset[0], x, ax, ay, bx, by, wanted)
        else:
            part = add_element(descent.trial, descent.reference, block, e, row - begin, local, ax, ay, bx, by, wanted)
        if descent.trial.data.shape[1] > CONSTANTS:
            special = descent.shapes.special[e]
            part = with_source(
                part, descent, e, row - begin, local, special, block.offset[0], x, y, ax, ay, bx, by, wanted
            )
        magnitude, total, by_x, by_y = magnitude + part[0], total + part[1], by_x + part[2], by_y + part[3]
        xx, xy, yy = xx + part[4], xy + part[5], yy + part[6]
    return magnitude, total, by_x, by_y, xx, xy, yy


@inner_kernel
def stays_valid(descent, v, x, y):
    position, star, offset = descent.position, descent.star, descent.block.offset[0]
    for row in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[row]), star.ahead[row], star.behind[row]
        if descent.shapes.special[e]:
            gather_offsets(descent.shapes, e, corner_of(descent.elements.node, e, v), offset)
            ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
            if not (is_valid(offset, ax, ay, bx, by) and valid_at(position, offset, v, a, b)):
                return False
    return True


@inner_kernel
def factorise(block, first):
    return eliminate(block.stiffness, block.rest, block.mixed, 2, first, block.unknowns[0])


@inner_kernel
def solve_upper(block, first, step_x, step_y):
    mixed, count = block.mixed, block.unknowns[0]
    for i in range(first, count):
        block.correction[i], block.response[i] = -block.rest[i], -step_x * mixed[i, 0] - step_y * mixed[i, 1]
    substitute(block.stiffness, block.correction, first, count)
    substitute(block.stiffness, block.response, first, count)


@inner_kernel
def change_block(descent, v, first, times, length):
    trial, modes, star, block = descent.trial, descent.modes, descent.star, descent.block
    dof, begin, degrees = block.dof, star.start[v], modes.side.shape[2]
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
