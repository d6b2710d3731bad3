"""Derive Ritz functionals of functions of order 2 or 3 by the position of a node and by what changes with it.

On an element (v, a, b), counter-clockwise with doubled area D, whose functions have the gradients (g1, g2) on the
reference triangle, u = sum U_i phi_i has at a quadrature point of weight w

    n = G2 (a - x_v) - G1 (b - x_v),    G = sum U_i g_i,    J grad u = n / D up to sign,

affine in the position of v as of order 1, so that the derivatives of `descend.py` hold at every point with the share w
of the element, and those by a coefficient U_i have e_i = g2_i (a - x_v) - g1_i (b - x_v) in place of dn / dw. What
changes with a node is one block: its value, the coefficients of its sides, and the bubbles of its elements. They are
eliminated by Cholesky's method, so that a node moves to where the least value over all of them is lower. Of two
functions whose functionals are added up, a solution and the dual one of a goal, each has its block: they meet in the
position alone, so that what is left of either once its block is eliminated adds up, too.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.arrays import (
    CONSTANTS,
    HALF_COEFFICIENT,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    SIXTH_SOURCE,
    VALUE,
    Block,
    Constraints,
    Descent,
    Elements,
    Modes,
    Points,
    Reference,
    Shapes,
    Star,
    Trials,
)
from kohonen_adapt.kernels.compilation import inner_kernel
from kohonen_adapt.kernels.records import record
from kohonen_adapt.kernels.triangle.by_law import add_by_law
from kohonen_adapt.kernels.triangle.by_points import add_by_points, gather_bends, is_curved, is_valid, valid_at
from kohonen_adapt.kernels.triangle.connectivity import corner_of
from kohonen_adapt.kernels.triangle.varying_source import with_source

EVEN, ODD, BUBBLE = 3, 6, 9  # the first functions of each kind


@record
class Descents(NamedTuple):
    """The functions of whose functionals the sum is lowered: one, or a solution and the dual one of a goal."""

    one: Descent
    other: Descent  # of linear material
    number: int  # 1 if the other is not there, else 2

    @classmethod
    def of(
        cls,
        mesh: tuple[np.ndarray, Elements, Star, Constraints],
        trials: Trials,
        modes: Sequence[Modes],
        shapes: tuple[Reference, Points, Shapes],
        most: int,
    ) -> "Descents":
        """Those of one or two functions on a mesh, with room for so many elements around a node."""
        one, other = (Block.of(most, shapes[0].slope.shape[1]) for _ in trials)
        first = Descent(*mesh, trials.one, modes[0], *shapes, one)
        second = Descent(*mesh, trials.other, modes[-1], *shapes, other)
        return cls(first, second, 2 if len(trials.other.value) else 1)


@inner_kernel
def number_block(descent, v):
    """Number the unknowns of the block of v, its own value first, in all elements around it."""
    elements, star, modes, block = descent.elements, descent.star, descent.modes, descent.block
    place, sign, degrees = block.place, block.sign, modes.side.shape[2]
    begin, spokes = star.start[v], 0
    for row in range(begin, star.start[v + 1]):
        j, e = row - begin, np.int64(star.element[row])
        k = corner_of(elements.node, e, v)
        for i in range(place.shape[1]):
            place[j, i], sign[j, i] = -1, 1.0
        place[j, 0] = 0
        for side in range(1, 3 if degrees > 0 else 1):  # (b, v) is opposite to corner 1, (v, a) to corner 2
            if modes.given[e, (k + side) % 3]:
                continue
            other, s = star.ahead[row] if side == 2 else star.behind[row], 0
            while s < spokes and block.spoke[s] != other:
                s += 1
            if s == spokes:
                block.spoke[s] = other
                spokes += 1
            place[j, EVEN + side] = 1 + degrees * s
            if degrees == 2:
                place[j, ODD + side], sign[j, ODD + side] = 2 + 2 * s, 1.0 if side == 2 else -1.0
    count = 1 + degrees * spokes
    if degrees == 2:
        for j in range(star.start[v + 1] - begin):
            place[j, BUBBLE] = count
            count += 1
    block.unknowns[0], block.own[0] = count, value_near(descent, v)


@inner_kernel
def value_near(descent, v):
    """What values around v are taken relative to: the one there, but 0 around an axis, where no constant is a function.

    What that adds to the load depends on the area of a star, or of two elements, which is the same before and after.
    """
    return 0.0 if descent.shapes.around else descent.trial.value[v]


@inner_kernel
def gather(node, value, modes, e, k, own, local):
    """The coefficients of e, turned so that its corner k comes first, relative to the value `own`."""
    degrees = modes.side.shape[2]
    for i in range(3):
        corner = (k + i) % 3
        local[i] = value[node[e, corner]] - own
        for d in range(degrees):
            local[EVEN + 3 * d + i] = modes.side[e, corner, d]
    if degrees == 2:
        local[BUBBLE] = modes.bubble[e]


@inner_kernel
def clear(block):
    """Set the derivatives by the unknowns to zero."""
    for i in range(block.unknowns[0]):
        block.rest[i] = block.mixed[i, 0] = block.mixed[i, 1] = 0.0
        for j in range(i + 1):
            block.stiffness[i, j] = 0.0


@inner_kernel
def add_element(trial, reference, block, e, j, local, ax, ay, bx, by, wanted):
    """Add the derivatives of e by the unknowns of the block, numbered in its row j, and of its first corner's position.

    Returns (sum of magnitudes, value, by x, y, by xx, xy, yy). What is not `wanted` need not hold.
    """
    ex, ey, doubled, load, mean = bx - ax, by - ay, ax * by - ay * bx, 6.0 * trial.data[e, SIXTH_SOURCE], 0.0
    if trial.laws.number[e] >= 0:
        part = add_by_law(trial, reference, block, e, j, local, ax, ay, bx, by, wanted)
    else:
        part = add_linear(trial, reference, block, e, j, local, ax, ay, bx, by, wanted)
    size, total, by_x, by_y, xx, xy, yy = part
    if load != 0.0:
        for i in range(reference.slope.shape[1]):
            mean += reference.mean[i] * local[i]
            if wanted > VALUE and block.place[j, i] >= 0:
                pulled = load * block.sign[j, i] * reference.mean[i]
                block.rest[block.place[j, i]] -= pulled * doubled
                block.mixed[block.place[j, i], 0] += pulled * ey
                block.mixed[block.place[j, i], 1] -= pulled * ex
        by_x += load * mean * ey
        by_y -= load * mean * ex
        size += abs(load * mean * doubled)
        total -= load * mean * doubled
    return size, total, by_x, by_y, xx, xy, yy


@inner_kernel
def add_linear(trial, reference, block, e, j, local, ax, ay, bx, by, wanted):
    """Add the derivatives of e, of linear material, without its source.

    Returns the same as `add_element`.
    """
    place, sign, across, slope = block.place, block.sign, block.across, reference.slope
    size, total, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    functions, ex, ey = slope.shape[1], bx - ax, by - ay
    doubled = ax * by - ay * bx
    inverse, half = 1.0 / doubled, trial.data[e, HALF_COEFFICIENT]
    flux_x, flux_y = trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y]
    for q in range(reference.plain):
        share, along, aside = reference.weight[q], 0.0, 0.0
        for i in range(functions):
            along += local[i] * slope[q, i, 0]
            aside += local[i] * slope[q, i, 1]
        difference = along - aside
        nx, ny = aside * ax - along * bx, aside * ay - along * by
        qx, qy = inverse * nx, inverse * ny
        weight = share * half * inverse
        energy = 0.5 * weight * (nx * nx + ny * ny)
        # derivatives of n by x, y less q times those of the doubled area
        x_x, x_y = difference + qx * ey, qy * ey
        y_x, y_y = -qx * ex, difference - qy * ex
        push = share * (flux_y * nx - flux_x * ny)
        size += energy + abs(push)
        total += energy - push
        half_square = 0.5 * (qx * nx + qy * ny)
        by_x += weight * (difference * nx + half_square * ey) - share * difference * flux_y
        by_y += weight * (difference * ny - half_square * ex) + share * difference * flux_x
        xx += weight * (x_x * x_x + x_y * x_y)
        xy += weight * (x_x * y_x + x_y * y_y)
        yy += weight * (y_x * y_x + y_y * y_y)
        for i in range(functions if wanted > VALUE else 0):
            row = place[j, i]
            if row < 0:
                continue
            g1, g2 = sign[j, i] * slope[q, i, 0], sign[j, i] * slope[q, i, 1]
            ix, iy = g2 * ax - g1 * bx, g2 * ay - g1 * by
            across[i, 0], across[i, 1] = ix, iy
            block.rest[row] += weight * (ix * nx + iy * ny) - share * (flux_y * ix - flux_x * iy)
            turn = g1 - g2
            block.mixed[row, 0] += weight * (x_x * ix + x_y * iy + nx * turn) - share * flux_y * turn
            block.mixed[row, 1] += weight * (y_x * ix + y_y * iy + ny * turn) + share * flux_x * turn
            for other in range(i + 1):
                column = place[j, other]
                if column >= 0:
                    product = weight * (ix * across[other, 0] + iy * across[other, 1])
                    block.stiffness[max(row, column), min(row, column)] += product
    return size, total, by_x, by_y, xx, xy, yy


@inner_kernel
def add_bent(descent, e, j, local, bend, x, y, ax, ay, bx, by, wanted):
    """Add the derivatives of an element in the place of e, its first corner at (x, y), its sides curved by `bend`."""
    if descent.shapes.around or is_curved(bend):
        part = add_by_points(descent, e, j, local, bend, x, ax, ay, bx, by, wanted)
    else:
        part = add_element(descent.trial, descent.reference, descent.block, e, j, local, ax, ay, bx, by, wanted)
    if descent.trial.data.shape[1] > CONSTANTS:
        return with_source(part, descent, e, j, local, np.bool_(True), bend, x, y, ax, ay, bx, by, wanted)
    return part


@inner_kernel
def derivatives(descent, v, x, y, wanted):
    """The functional of the star of v, were it at (x, y), with all derivatives by its position and its block.

    Returns (sum of magnitudes, value, by x, y, by xx, xy, yy). What is not `wanted` need not hold.
    """
    position, star, block, local = descent.position, descent.star, descent.block, descent.block.local[0]
    node, own = descent.elements.node, block.own[0]
    clear(block)
    size, total, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    begin = star.start[v]
    for row in range(begin, star.start[v + 1]):
        e, a, b = np.int64(star.element[row]), star.ahead[row], star.behind[row]
        k = corner_of(node, e, v)
        gather(node, descent.trial.value, descent.modes, e, k, own, local)
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        if descent.shapes.special[e]:
            gather_bends(descent.shapes, e, k, block.bend[0])
            part = add_by_points(descent, e, row - begin, local, block.bend[0], x, ax, ay, bx, by, wanted)
        else:
            part = add_element(descent.trial, descent.reference, block, e, row - begin, local, ax, ay, bx, by, wanted)
        if descent.trial.data.shape[1] > CONSTANTS:
            special = descent.shapes.special[e]
            part = with_source(
                part, descent, e, row - begin, local, special, block.bend[0], x, y, ax, ay, bx, by, wanted
            )
        size, total, by_x, by_y = size + part[0], total + part[1], by_x + part[2], by_y + part[3]
        xx, xy, yy = xx + part[4], xy + part[5], yy + part[6]
    return size, total, by_x, by_y, xx, xy, yy


@inner_kernel
def stays_valid(descent, v, x, y):
    """Whether the elements around v with curved sides have a positive Jacobian, and would with v at (x, y)."""
    position, star, bend = descent.position, descent.star, descent.block.bend[0]
    for row in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[row]), star.ahead[row], star.behind[row]
        if descent.shapes.special[e]:
            gather_bends(descent.shapes, e, corner_of(descent.elements.node, e, v), bend)
            ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
            if not (is_valid(bend, ax, ay, bx, by) and valid_at(position, bend, v, a, b)):
                return False
    return True


@inner_kernel
def factorise(block, first):
    """Factorise the stiffness of the unknowns from `first` on, and solve with the lower factor; False without one.

    `rest` and `mixed` become L^-1 of what they were. Returns whether it went, and the square of the new `rest`.
    """
    stiffness, rest, mixed, square = block.stiffness, block.rest, block.mixed, 0.0
    for i in range(first, block.unknowns[0]):
        for j in range(first, i):
            product = stiffness[i, j]
            for k in range(first, j):
                product -= stiffness[i, k] * stiffness[j, k]
            product /= stiffness[j, j]
            stiffness[i, j] = product
            rest[i] -= product * rest[j]
            mixed[i, 0] -= product * mixed[j, 0]
            mixed[i, 1] -= product * mixed[j, 1]
        diagonal = stiffness[i, i]
        for k in range(first, i):
            diagonal -= stiffness[i, k] * stiffness[i, k]
        if not diagonal > 0.0:
            return False, 0.0
        diagonal = math.sqrt(diagonal)
        stiffness[i, i] = diagonal
        rest[i] /= diagonal
        mixed[i, 0] /= diagonal
        mixed[i, 1] /= diagonal
        square += rest[i] * rest[i]
    return True, square


@inner_kernel
def solve_upper(block, first, along_x, along_y):
    """Solve for the change of the unknowns where the node stays, `still`, and what a step (x, y) adds, `follow`."""
    stiffness, count = block.stiffness, block.unknowns[0]
    for i in range(count - 1, first - 1, -1):
        still, follow = -block.rest[i], -along_x * block.mixed[i, 0] - along_y * block.mixed[i, 1]
        for k in range(i + 1, count):
            still -= stiffness[k, i] * block.still[k]
            follow -= stiffness[k, i] * block.follow[k]
        block.still[i], block.follow[i] = still / stiffness[i, i], follow / stiffness[i, i]


@inner_kernel
def change_block(descent, v, first, still, follow):
    """Add these multiples of `still` and `follow` to the unknowns of the block, wherever they stand."""
    trial, modes, star, block = descent.trial, descent.modes, descent.star, descent.block
    place, begin, degrees = block.place, star.start[v], modes.side.shape[2]
    if first == 0:
        trial.value[v] += still * block.still[0] + follow * block.follow[0]
    for row in range(begin, star.start[v + 1]):
        j, e = row - begin, np.int64(star.element[row])
        k = corner_of(descent.elements.node, e, v)
        for side in range(1, 3):
            for d in range(degrees):
                i = EVEN + 3 * d + side
                if place[j, i] >= 0:
                    change = still * block.still[place[j, i]] + follow * block.follow[place[j, i]]
                    modes.side[e, (k + side) % 3, d] += block.sign[j, i] * change
        if degrees == 2:
            modes.bubble[e] += still * block.still[place[j, BUBBLE]] + follow * block.follow[place[j, BUBBLE]]
