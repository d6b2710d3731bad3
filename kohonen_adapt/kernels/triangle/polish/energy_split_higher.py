"""Gains of edge splits by functionals of order 2 or 3.

A split keeps the function, a polynomial on each half. Then the functional is minimised over the value of the new
node, the coefficients of the sides at the node and the bubbles of the elements around. On an edge with Dirichlet
values, which are linear, the value of the node and the coefficients of the edge are kept.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import BLOCK, COARSE_BLOCK, VALUE
from kohonen_adapt.kernels.triangle.geometry import corner_of, corner_towards, ends_of
from kohonen_adapt.kernels.triangle.polish.by_points import gather_offsets, is_valid, put_offsets
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING
from kohonen_adapt.kernels.triangle.polish.descend_higher import (
    BUBBLE,
    EVEN,
    ODD,
    add_curved,
    clear_derivatives,
    factorise,
    gather_coefficients,
    put_coefficients,
    reference_value,
    solve_upper,
)
from kohonen_adapt.kernels.triangle.surgery import gather_around, may_split, midpoint
from kohonen_adapt.kernels.vectors import from_to, xy

# Edge ab, between the corners c and d, is split at p. A row has the indices among a, b, c, d of the ends of the sides
# opposite to corners 2 and 1 of the elements (p, c, a), (p, b, c), (p, d, b) and (p, a, d).
ENDS = ((2, 0), (1, 2), (3, 1), (0, 3))


@inner_kernel
def number_split(block, degrees, both, is_dirichlet):
    dof, sign = block.dof, block.sign
    rows, halves = 4 if both else 2, 2 if is_dirichlet else 0
    count = 1 + degrees * ((4 if both else 3) - halves)
    for j in range(rows):
        for i in range(dof.shape[1]):
            dof[j, i], sign[j, i] = -1, 1.0
        dof[j, 0] = 0
        for side in range(1, 3 if degrees > 0 else 1):
            s = ENDS[j][2 - side] - halves  # sides to a and b precede sides to c and d
            dof[j, EVEN + side] = 1 + degrees * s if s >= 0 else -1
            if degrees == 2 and s >= 0:
                dof[j, ODD + side], sign[j, ODD + side] = 2 + 2 * s, 1.0 if side == 2 else -1.0
        if degrees == 2:
            dof[j, BUBBLE] = count
            count += 1
    block.unknowns[0] = count


@inner_kernel
def halve_coefficients(descent, e, k, own, row):
    halves, local, part = descent.reference.halves, descent.block.local, descent.block.part
    gather_coefficients(descent.elements.node, descent.trial.value, descent.modes, e, k, own, part)
    for half in range(2):
        for i in range(part.shape[0]):
            total = 0.0
            for other in range(part.shape[0]):
                total += halves[half, i, other] * part[other]
            local[row + half, i] = total


@inner_kernel
def value_on(descent, e, own):
    node, position, block = descent.elements.node, descent.position, descent.block
    x = xy(position, node[e, 0])
    a, b = from_to(x, position, node[e, 1]), from_to(x, position, node[e, 2])
    gather_coefficients(node, descent.trial.value, descent.modes, e, 0, own, block.part)
    gather_offsets(descent.shapes, e, 0, block.offset[4])
    if not is_valid(block.offset[4], a, b):
        return -np.inf
    return add_curved(descent, e, 0, block.part, block.offset[4], x, a, b, VALUE)[1]


@inner_kernel
def derivatives_of_split(descent, e, k, x, wanted):
    node, position, block = descent.elements.node, descent.position, descent.block
    clear_derivatives(block)
    magnitude = total = 0.0
    at, corner = e, k
    row = 0
    while at >= 0:
        a, b = from_to(x, position, node[at, (corner + 1) % 3]), from_to(x, position, node[at, (corner + 2) % 3])
        c = from_to(x, position, node[at, corner])
        block.offset[row : row + 2] = 0.0
        for i in range(2):
            block.offset[row, 0, i] = descent.shapes.offset[at, (corner + 2) % 3, i]
            block.offset[row + 1, 0, i] = descent.shapes.offset[at, (corner + 1) % 3, i]
        if not (is_valid(block.offset[row], c, a) and is_valid(block.offset[row + 1], b, c)):
            return magnitude, np.inf
        after, offset = row + 1, block.offset
        one = add_curved(descent, at, row, block.local[row], offset[row], x, c, a, wanted)
        two = add_curved(descent, at, after, block.local[after], offset[after], x, b, c, wanted)
        magnitude, total = magnitude + one[0] + two[0], total + one[1] + two[1]
        other = np.int64(descent.elements.neighbour[at, corner])
        corner = corner_towards(descent.elements.neighbour, other, at) if other >= 0 else 0
        at, row = other if row == 0 else np.int64(-1), row + 2
    return magnitude, total


@inner_kernel
def gain_of_split(descents, e, k, x):
    """Return the decrease of the functionals by a split, or 0 if negligible.

    The best coefficients of the halves are left in `Block.local`, relative to `reference_value` of the first node of
    the edge. In nonlinear materials they are approximated by one step of Newton's method.
    """
    gain, magnitude = 0.0, 0.0
    for i in range(descents.terms):
        decrease, more = change_by_split(descents.primal if i == 0 else descents.dual, e, k, x)
        gain, magnitude = gain + decrease, magnitude + more
    return gain if gain > ROUNDING * magnitude else 0.0


@inner_kernel
def change_by_split(descent, e, k, x):
    block, is_dirichlet = descent.block, descent.modes.dirichlet[e, k]
    other = np.int64(descent.elements.neighbour[e, k])
    own = reference_value(descent, np.int64(descent.elements.node[e, (k + 1) % 3]))
    first = 1 if is_dirichlet else 0  # first free unknown
    special, nonlinear = descent.shapes.special[e], descent.trial.laws.number[e] >= 0
    unsplit = 0.0
    if other >= 0:
        special |= descent.shapes.special[other]
        nonlinear |= descent.trial.laws.number[other] >= 0
    if special or nonlinear:
        unsplit = value_on(descent, e, own) + (value_on(descent, other, own) if other >= 0 else 0.0)
    halve_coefficients(descent, e, k, own, 0)
    if other >= 0:
        halve_coefficients(descent, other, corner_towards(descent.elements.neighbour, other, e), own, 2)
    number_split(block, descent.modes.side.shape[2], other >= 0, is_dirichlet)
    magnitude, before = derivatives_of_split(descent, e, k, x, COARSE_BLOCK if nonlinear else BLOCK)
    if not before < np.inf:
        return -np.inf, magnitude
    solved, square = factorise(block, first)
    if not solved:
        return -np.inf, magnitude
    solve_upper(block, first, (0.0, 0.0))
    for j in range(4 if other >= 0 else 2):
        for i in range(block.local.shape[1]):
            if block.dof[j, i] >= first:
                block.local[j, i] += block.sign[j, i] * block.correction[block.dof[j, i]]
    # The halves of curved elements, or of elements at the axis, need not contain the function, and new quadrature
    # points change the energy of a law. The gain is therefore relative to the value before the split.
    if nonlinear:
        return unsplit - derivatives_of_split(descent, e, k, x, VALUE)[1], magnitude
    return 0.5 * square + (unsplit - before if special else 0.0), magnitude


@inner_kernel
def weigh_splits(mesh, descents, offers, floor, first, last):
    elements, inner, fixed, given = (
        mesh.elements,
        mesh.constraints.inner,
        descents.primal.trial.fixed,
        descents.primal.modes.dirichlet,
    )
    for e in range(first, last):
        for k in range(3):
            offers.gain[e, k] = 0.0
            c, known = np.int64(elements.chain[e, k]), given[e, k]
            if elements.neighbour[e, k] >= e or (not offers.open[c] if c >= 0 else known):  # the outer boundary is -1
                continue
            a, b = ends_of(elements.node, e, k)
            if not known and fixed[a] and fixed[b] and (inner[a] or inner[b]):
                continue
            x, _ = midpoint(mesh, c, a, b)
            gain = gain_of_split(descents, e, k, x)
            if gain > 0.0 and may_split(mesh, e, k, floor, x):
                offers.gain[e, k] = gain


@inner_kernel
def outer_given(descent, e, k):
    given, other = descent.modes.dirichlet, np.int64(descent.elements.neighbour[e, k])
    if other < 0:
        return given[e, (k + 2) % 3], given[e, (k + 1) % 3], False, False
    j = corner_towards(descent.elements.neighbour, other, e)
    return given[e, (k + 2) % 3], given[e, (k + 1) % 3], given[other, (j + 2) % 3], given[other, (j + 1) % 3]


@inner_kernel
def put_split(mesh, descent, p, a, b, given):
    node, modes, around, local = mesh.elements.node, descent.modes, mesh.scratch.around, descent.block.local
    for i in range(gather_around(mesh, p, around)):
        f = np.int64(around[i])
        k = corner_of(node, f, p)
        one, two = ends_of(node, f, k)
        row = 0 if two == a else 1 if one == b else 2 if two == b else 3
        put_coefficients(modes, f, k, local[row])
        put_offsets(descent.shapes, f, k, descent.block.offset[row])
        modes.dirichlet[f, k] = given[row]
        modes.dirichlet[f, (k + 1) % 3] = modes.dirichlet[f, (k + 2) % 3] = False
        modes.dirichlet[f, (k + 1 + row % 2) % 3] = descent.trial.fixed[p]  # the half of the edge
