"""Exchange of splits for collapses by functionals of order 2 or 3.

The method is that of `energy_recycle`, with the new coefficients eliminated. A collapse leaves new sides straight.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import BLOCK, COARSE_BLOCK, VALUE
from kohonen_adapt.kernels.triangle.geometry import corner_of, ends_of, row_beside, rows_with
from kohonen_adapt.kernels.triangle.polish.by_points import gather_offsets, is_valid, put_offsets
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING
from kohonen_adapt.kernels.triangle.polish.descend_higher import (
    BUBBLE,
    EVEN,
    ODD,
    add_curved,
    clear_derivatives,
    derivatives,
    factorise,
    gather_coefficients,
    number_block,
    put_coefficients,
    reference_value,
    solve_upper,
)
from kohonen_adapt.kernels.triangle.polish.energy_recycle import lock_around, lock_edge, merge_target, next_collapse
from kohonen_adapt.kernels.triangle.polish.energy_split_higher import (
    gain_of_split,
    outer_given,
    put_split,
    weigh_splits,
)
from kohonen_adapt.kernels.triangle.surgery import collapse, collapsed_quality, midpoint, split
from kohonen_adapt.kernels.vectors import cross, from_to, squared_distance, xy

# Squared length over the shortest of a node, from which an edge is not collapsed: seldom the cheapest, and costs take
# most of the time of a recycling.
FAR = 2.0


@inner_kernel
def number_merged(descent, v, w, removed):
    elements, star, modes, block = descent.elements, descent.star, descent.modes, descent.block
    dof, sign = block.dof, block.sign
    degrees, begin = modes.side.shape[2], star.start[v]
    sides = 0
    for row in range(begin, star.start[v + 1]):
        j, e = row - begin, np.int64(star.element[row])
        k = corner_of(elements.node, e, v)
        for i in range(dof.shape[1]):
            dof[j, i], sign[j, i] = -1, 1.0
        if star.ahead[row] == w or star.behind[row] == w:
            continue
        for side in range(1, 3 if degrees > 0 else 1):
            other, s = star.ahead[row] if side == 2 else star.behind[row], 0
            if modes.dirichlet[e, (k + side) % 3] or row_beside(removed, other) >= 0:
                continue
            while s < sides and block.far_end[s] != other:
                s += 1
            if s == sides:
                block.far_end[s] = other
                sides += 1
            dof[j, EVEN + side] = degrees * s
            if degrees == 2:
                dof[j, ODD + side], sign[j, ODD + side] = 1 + 2 * s, 1.0 if side == 2 else -1.0
    count = degrees * sides
    if degrees == 2:
        for row in range(begin, star.start[v + 1]):
            if star.ahead[row] != w and star.behind[row] != w:
                dof[row - begin, BUBBLE] = count
                count += 1
    block.unknowns[0] = count
    for i in range(count):
        block.correction[i] = 0.0


@inner_kernel
def merged_coefficients(descent, v, w, removed, row, own):
    elements, star, modes, block = descent.elements, descent.star, descent.modes, descent.block
    e, j = np.int64(star.element[row]), row - star.start[v]
    part, degrees = block.part, modes.side.shape[2]
    k = corner_of(elements.node, e, v)
    gather_coefficients(elements.node, descent.trial.value, modes, e, k, own, part)
    part[0] = descent.trial.value[w] - own
    for side in range(1, 3):
        other = star.ahead[row] if side == 2 else star.behind[row]
        known = row_beside(removed, other)
        for d in range(degrees):
            i = EVEN + 3 * d + side
            part[i] = 0.0
            if block.dof[j, i] >= 0:
                part[i] = block.sign[j, i] * block.correction[block.dof[j, i]]
            elif known >= 0:
                f = np.int64(star.element[known])
                part[i] = modes.side[f, corner_of(elements.node, f, v), d]
    if degrees == 2:
        part[BUBBLE] = block.correction[block.dof[j, BUBBLE]]


@inner_kernel
def merged_offsets(descent, v, removed, row, offset):
    shapes, star, node = descent.shapes, descent.star, descent.elements.node
    e = np.int64(star.element[row])
    gather_offsets(shapes, e, corner_of(node, e, v), offset)
    for side in range(1, 3):
        known = row_beside(removed, star.ahead[row] if side == 2 else star.behind[row])
        for i in range(2):
            offset[side, i] = 0.0
            if known >= 0:
                f = np.int64(star.element[known])
                offset[side, i] = shapes.offset[f, corner_of(node, f, v), i]


@inner_kernel
def derivatives_of_merged(descent, v, w, removed, own, wanted):
    position, star, block = descent.position, descent.star, descent.block
    x, total = xy(position, w), 0.0
    clear_derivatives(block)
    for row in range(star.start[v], star.start[v + 1]):
        e, i, k = np.int64(star.element[row]), np.int64(star.ahead[row]), np.int64(star.behind[row])
        if i == w or k == w:
            continue
        a, b = from_to(x, position, i), from_to(x, position, k)
        if not cross(a, b) > 0.0:
            return np.inf
        merged_coefficients(descent, v, w, removed, row, own)
        merged_offsets(descent, v, removed, row, block.offset[4])
        if not is_valid(block.offset[4], a, b):
            return np.inf
        total += add_curved(descent, e, row - star.start[v], block.part, block.offset[4], x, a, b, wanted)[1]
    return total


@inner_kernel
def merged_functional(descent, v, w, own):
    """Return the minimum of the functional around `v` merged into `w`.

    The value is inf if an element is inverted. The minimiser is left in `Block.correction`. In nonlinear materials the
    minimum is approximated by one step of Newton's method.
    """
    block, removed = descent.block, rows_with(descent.star, v, w)
    number_merged(descent, v, w, removed)
    nonlinear = descent.trial.nonlinear[v]
    total = derivatives_of_merged(descent, v, w, removed, own, COARSE_BLOCK if nonlinear else BLOCK)
    if not total < np.inf:
        return np.inf
    solved, square = factorise(block, 0)
    if not solved:
        return np.inf
    solve_upper(block, 0, (0.0, 0.0))
    if nonlinear:
        return derivatives_of_merged(descent, v, w, removed, own, VALUE)
    return total - 0.5 * square


@inner_kernel
def merged_functionals(descents, v, w):
    total = 0.0
    for i in range(descents.terms):
        descent = descents.primal if i == 0 else descents.dual
        total += merged_functional(descent, v, w, descent.block.own[0])
    return total


@inner_kernel
def weigh_collapses(mesh, descents, offers, most, floor, first, last):
    position, star = mesh.position, descents.primal.star
    for v in range(first, last):
        offers.cost[v] = np.inf
        if not offers.removable[v]:
            continue
        before, least = 0.0, most
        shortest = np.inf
        for row in range(star.start[v], star.start[v + 1]):
            shortest = min(shortest, squared_distance(position, v, xy(position, star.ahead[row])))
        for i in range(descents.terms):
            descent = descents.primal if i == 0 else descents.dual
            number_block(descent, v)
            magnitude, total = derivatives(descent, v, xy(position, v), VALUE)[:2]
            before += total - ROUNDING * magnitude
        for j in range(star.start[v], star.start[v + 1]):
            for i in range(2):
                w = merge_target(mesh, star, v, j, i)
                if w < 0 or squared_distance(position, v, xy(position, w)) > FAR * shortest:
                    continue
                cost = merged_functionals(descents, v, w) - before
                # after the cost, because the checks take longer
                if cost < least and collapsed_quality(mesh, v, w, np.inf, floor) > 0.0:
                    offers.cost[v], offers.into[v], least = cost, w, cost


@kernel
def weigh_higher(mesh, descents, offers, most, floor, first, last, edges):
    # one kernel, because both branches share code that is compiled once
    if edges:
        weigh_splits(mesh, descents, offers, floor, first, last)
    else:
        weigh_collapses(mesh, descents, offers, most, floor, first, last)


@kernel
def exchange_higher(mesh, descents, offers, edges, nodes, floor):
    elements, locked = mesh.elements, offers.locked
    pairs, decrease, at = 0, 0.0, 0
    for edge in edges:
        e, k = edge // 3, edge % 3
        if not lock_edge(mesh, e, k, locked):
            continue
        gain = offers.gain[e, k]
        at = next_collapse(mesh, offers, nodes, at, gain, floor)
        if at < 0:
            return pairs, decrease  # later edges gain less
        v = nodes[at]
        w, at = np.int64(offers.into[v]), at + 1
        decrease += gain - offers.cost[v]
        lock_around(mesh, v, locked)
        for i in range(descents.terms):
            put_merged(descents.primal if i == 0 else descents.dual, v, w)
        collapse(mesh, v, w)
        a, b = ends_of(elements.node, e, k)
        x, parameter = midpoint(mesh, np.int64(elements.chain[e, k]), a, b)
        gain_of_split(descents, e, k, x)
        given, known = outer_given(descents.primal, e, k), descents.primal.modes.dirichlet[e, k]
        p = split(mesh, e, k, x, parameter)
        for i in range(descents.terms):
            descent = descents.primal if i == 0 else descents.dual
            descent.trial.value[p] = reference_value(descent, a) + descent.block.local[0, 0]
            descent.trial.fixed[p] = known
            put_split(mesh, descent, p, a, b, given)
        lock_around(mesh, p, locked)
        pairs += 1
    return pairs, decrease


@inner_kernel
def put_merged(descent, v, w):
    star, modes, node = descent.star, descent.modes, descent.elements.node
    own, offset = reference_value(descent, v), descent.block.offset[4]
    removed = rows_with(star, v, w)
    merged_functional(descent, v, w, own)
    for row in range(star.start[v], star.start[v + 1]):
        a, b = star.ahead[row], star.behind[row]
        e = np.int64(star.element[row])
        if a != w and b != w:
            merged_coefficients(descent, v, w, removed, row, own)
            k = corner_of(node, e, v)
            put_coefficients(modes, e, k, descent.block.part)
            merged_offsets(descent, v, removed, row, offset)
            put_offsets(descent.shapes, e, k, offset)
            for side in range(1, 3):
                known = row_beside(removed, a if side == 2 else b)
                if known >= 0:
                    f = np.int64(star.element[known])
                    modes.dirichlet[e, (k + side) % 3] = modes.dirichlet[f, corner_of(node, f, v)]
