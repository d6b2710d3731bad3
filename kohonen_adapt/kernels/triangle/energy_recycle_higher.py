"""Weigh splits of edges against collapses for functions of order 2 or 3, new coefficients eliminated; do both in pairs.

As in `energy_recycle.py`. A split keeps the function, a polynomial in every half, and then lowers the functional over
the value of the new node, the sides at it and the bubbles around it, where values are given along the edge, and are
linear, over the others of these. A collapse leaves sides that begin straight.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import OWN, SLIDING
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.by_points import gather_bends, is_valid, put_bends
from kohonen_adapt.kernels.triangle.connectivity import corner_of, corner_towards, opposite_side
from kohonen_adapt.kernels.triangle.descend import ROUNDING
from kohonen_adapt.kernels.triangle.descend_higher import (
    BUBBLE,
    EVEN,
    ODD,
    add_bent,
    clear,
    derivatives,
    factorise,
    gather,
    number_block,
    solve_upper,
    value_near,
)
from kohonen_adapt.kernels.triangle.energy_recycle import cheapest_left, lock_around
from kohonen_adapt.kernels.triangle.flip_higher import put
from kohonen_adapt.kernels.triangle.geometry import orientation
from kohonen_adapt.kernels.triangle.surgery import (
    collapse,
    collapsed_quality,
    gather_around,
    may_split,
    midpoint,
    split,
)

# An edge ab is split at p, between corners c and d: the ends of the sides opposite to the corners 2 and 1 of the
# elements (p, c, a), (p, b, c), (p, d, b) and (p, a, d) beside p, as places among a, b, c, d.
ENDS = ((2, 0), (1, 2), (3, 1), (0, 3))


@inner_kernel
def number_split(block, degrees, both, known):
    """Number the unknowns of a split, the value of its node first, but none on an edge that is `known`; how many."""
    place, sign, rows, halves = block.place, block.sign, 4 if both else 2, 2 if known else 0
    count = 1 + degrees * ((4 if both else 3) - halves)
    for j in range(rows):
        for i in range(place.shape[1]):
            place[j, i], sign[j, i] = -1, 1.0
        place[j, 0] = 0
        for side in range(1, 3 if degrees > 0 else 1):
            s = ENDS[j][2 - side] - halves  # those of the ends of the edge come first
            place[j, EVEN + side] = 1 + degrees * s if s >= 0 else -1
            if degrees == 2 and s >= 0:
                place[j, ODD + side], sign[j, ODD + side] = 2 + 2 * s, 1.0 if side == 2 else -1.0
        if degrees == 2:
            place[j, BUBBLE] = count
            count += 1
    return count


@inner_kernel
def halve_coefficients(descent, e, k, own, row):
    """Restrict the function on e to its halves, its edge opposite to corner k split, in this row and the next one."""
    halves, local, part = descent.reference.halves, descent.block.local, descent.block.part
    gather(descent.elements.node, descent.trial.value, descent.modes, e, k, own, part)
    for half in range(2):
        for i in range(part.shape[0]):
            total = 0.0
            for other in range(part.shape[0]):
                total += halves[half, i, other] * part[other]
            local[row + half, i] = total


@inner_kernel
def value_on(descent, e, own):
    """The functional of e as it is, for values relative to `own`; -inf if its sides are bent less than they would."""
    node, position, block = descent.elements.node, descent.position, descent.block
    a, b, x, y = node[e, 1], node[e, 2], position[node[e, 0], 0], position[node[e, 0], 1]
    ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
    block.place[0] = -1
    gather(node, descent.trial.value, descent.modes, e, 0, own, block.part)
    gather_bends(descent.shapes, e, 0, block.bend[4])
    if not is_valid(block.bend[4], ax, ay, bx, by):
        return -np.inf
    return add_bent(descent, e, 0, block.part, block.bend[4], x, ax, ay, bx, by)[1]


@inner_kernel
def derivatives_of_split(descent, e, k, x, y, count):
    """Sum of magnitudes and value of the functional of the halves, whose coefficients stand in `Block.local`."""
    node, position, block = descent.elements.node, descent.position, descent.block
    clear(block, count)
    size, total, at, corner, row = 0.0, 0.0, e, k, 0
    while at >= 0:
        c, a, b = node[at, corner], node[at, (corner + 1) % 3], node[at, (corner + 2) % 3]
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        cx, cy = position[c, 0] - x, position[c, 1] - y
        block.bend[row : row + 2] = 0.0
        for i in range(2):
            block.bend[row, 0, i] = descent.shapes.bend[at, (corner + 2) % 3, i]
            block.bend[row + 1, 0, i] = descent.shapes.bend[at, (corner + 1) % 3, i]
        if not (is_valid(block.bend[row], cx, cy, ax, ay) and is_valid(block.bend[row + 1], bx, by, cx, cy)):
            return size, np.inf
        after, bend = row + 1, block.bend
        one = add_bent(descent, at, row, block.local[row], bend[row], x, cx, cy, ax, ay)
        two = add_bent(descent, at, after, block.local[after], bend[after], x, bx, by, cx, cy)
        size, total = size + one[0] + two[0], total + one[1] + two[1]
        other = np.int64(descent.elements.neighbour[at, corner])
        corner = corner_towards(descent.elements.neighbour, other, at) if other >= 0 else 0
        at, row = other if row == 0 else np.int64(-1), row + 2
    return size, total


@inner_kernel
def gain_of_split(descent, e, k, x, y, own):
    """What a split of the edge opposite to corner k of e at (x, y) gains, 0 if that is rounding.

    The best coefficients of the halves are left in `Block.local`; in nonlinear material those after one step of
    Newton's method. Values are relative to `own`. Halves of an element with curved sides, or at an axis, need not have
    its function, and in nonlinear material their points find another energy of it: there it gains over what was.
    """
    block, other, known = descent.block, np.int64(descent.elements.neighbour[e, k]), descent.modes.given[e, k]
    first = 1 if known else 0  # of the unknowns that are free
    special, bent, was = descent.shapes.special[e], descent.trial.laws.number[e] >= 0, 0.0
    if other >= 0:
        special |= descent.shapes.special[other]
        bent |= descent.trial.laws.number[other] >= 0
    if special or bent:
        was = value_on(descent, e, own) + (value_on(descent, other, own) if other >= 0 else 0.0)
    halve_coefficients(descent, e, k, own, 0)
    if other >= 0:
        halve_coefficients(descent, other, corner_towards(descent.elements.neighbour, other, e), own, 2)
    count = number_split(block, descent.modes.side.shape[2], other >= 0, known)
    size, before = derivatives_of_split(descent, e, k, x, y, count)
    if not before < np.inf:
        return 0.0
    solved, square = factorise(block, first, count)
    if not solved:
        return 0.0
    solve_upper(block, first, count, 0.0, 0.0)
    for j in range(4 if other >= 0 else 2):
        for i in range(block.local.shape[1]):
            if block.place[j, i] >= first:
                block.local[j, i] += block.sign[j, i] * block.still[block.place[j, i]]
    gain = 0.5 * square
    if bent:
        gain = before - derivatives_of_split(descent, e, k, x, y, count)[1]
    if special or bent:
        gain += was - before
    return gain if gain > ROUNDING * size else 0.0


@kernel
def weigh_splits_higher(mesh, descent, offers, floor, first, last):
    """Work out what a split of every edge of the elements `first` to `last` gains, 0 where none is allowed."""
    elements, inner, fixed = mesh.elements, mesh.constraints.inner, descent.trial.fixed
    for e in range(first, last):
        for k in range(3):
            offers.gain[e, k] = 0.0
            c, known = np.int64(elements.chain[e, k]), descent.modes.given[e, k]
            if elements.neighbour[e, k] >= e or (not offers.open[c] if c >= 0 else known):  # the outer boundary is -1
                continue
            a, b = np.int64(elements.node[e, (k + 1) % 3]), np.int64(elements.node[e, (k + 2) % 3])
            if not known and fixed[a] and fixed[b] and (inner[a] or inner[b]):
                continue
            x, y, _ = midpoint(mesh, c, a, b)
            gain = gain_of_split(descent, e, k, x, y, value_near(descent, a))
            if gain > 0.0 and may_split(mesh, e, k, floor, x, y):
                offers.gain[e, k] = gain


@inner_kernel
def number_merged(descent, v, w):
    """Number the sides between w and the nodes around v, were v merged into w, and bubbles; returns how many.

    Of sides that are given, or are there already, opposite to v, nothing is unknown.
    """
    elements, star, modes, block = descent.elements, descent.star, descent.modes, descent.block
    place, sign, degrees, begin, spokes = block.place, block.sign, modes.side.shape[2], star.start[v], 0
    for row in range(begin, star.start[v + 1]):
        j, e = row - begin, np.int64(star.element[row])
        k = corner_of(elements.node, e, v)
        for i in range(place.shape[1]):
            place[j, i], sign[j, i] = -1, 1.0
        if star.ahead[row] == w or star.behind[row] == w:
            continue
        for side in range(1, 3 if degrees > 0 else 1):
            other, s = star.ahead[row] if side == 2 else star.behind[row], 0
            if modes.given[e, (k + side) % 3] or opposite_side(star, v, w, other) >= 0:
                continue
            while s < spokes and block.spoke[s] != other:
                s += 1
            if s == spokes:
                block.spoke[s] = other
                spokes += 1
            place[j, EVEN + side] = degrees * s
            if degrees == 2:
                place[j, ODD + side], sign[j, ODD + side] = 1 + 2 * s, 1.0 if side == 2 else -1.0
    count = degrees * spokes
    if degrees == 2:
        for row in range(begin, star.start[v + 1]):
            if star.ahead[row] != w and star.behind[row] != w:
                place[row - begin, BUBBLE] = count
                count += 1
    return count


@inner_kernel
def merged_coefficients(descent, v, w, row, own, times):
    """The coefficients of an element of the star of v, were it merged into w, in `Block.part`: w first.

    The unknown ones are so many times `Block.still`.
    """
    elements, star, modes, block = descent.elements, descent.star, descent.modes, descent.block
    e, j, part, degrees = np.int64(star.element[row]), row - star.start[v], block.part, modes.side.shape[2]
    k = corner_of(elements.node, e, v)
    gather(elements.node, descent.trial.value, modes, e, k, own, part)
    part[0] = descent.trial.value[w] - own
    for side in range(1, 3):
        other = star.ahead[row] if side == 2 else star.behind[row]
        known = opposite_side(star, v, w, other)
        for d in range(degrees):
            i = EVEN + 3 * d + side
            part[i] = 0.0
            if block.place[j, i] >= 0:
                part[i] = times * block.sign[j, i] * block.still[block.place[j, i]]
            elif known >= 0:
                gone = np.int64(star.element[known])
                part[i] = modes.side[gone, corner_of(elements.node, gone, v), d]
    if degrees == 2:
        part[BUBBLE] = times * block.still[block.place[j, BUBBLE]]


@inner_kernel
def merged_bends(descent, v, w, row, bend):
    """The bends of the sides of that element, w first."""
    shapes, star, node = descent.shapes, descent.star, descent.elements.node
    e = np.int64(star.element[row])
    gather_bends(shapes, e, corner_of(node, e, v), bend)
    for side in range(1, 3):
        known = opposite_side(star, v, w, star.ahead[row] if side == 2 else star.behind[row])
        for i in range(2):
            bend[side, i] = 0.0
            if known >= 0:
                gone = np.int64(star.element[known])
                bend[side, i] = shapes.bend[gone, corner_of(node, gone, v), i]


@inner_kernel
def derivatives_of_merged(descent, v, w, own, count, times):
    """Value of the functional around v, were it merged into w, and the derivatives in the block; inf if overturned."""
    position, star, block = descent.position, descent.star, descent.block
    x, y, total = position[w, 0], position[w, 1], 0.0
    clear(block, count)
    for row in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[row]), np.int64(star.ahead[row]), np.int64(star.behind[row])
        if a == w or b == w:
            continue
        if not orientation(x, y, position[a, 0], position[a, 1], position[b, 0], position[b, 1]) > 0.0:
            return np.inf
        merged_coefficients(descent, v, w, row, own, times)
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        merged_bends(descent, v, w, row, block.bend[4])
        if not is_valid(block.bend[4], ax, ay, bx, by):
            return np.inf
        total += add_bent(descent, e, row - star.start[v], block.part, block.bend[4], x, ax, ay, bx, by)[1]
    return total


@inner_kernel
def merged_functional(descent, v, w, own):
    """The least functional around v, were it merged into w, inf where an element is overturned.

    Leaves the best unknowns in `Block.still`; beside nonlinear material those after one step of Newton's method.
    """
    block, count = descent.block, number_merged(descent, v, w)
    total = derivatives_of_merged(descent, v, w, own, count, 0.0)
    if not total < np.inf:
        return np.inf
    solved, square = factorise(block, 0, count)
    if not solved:
        return np.inf
    solve_upper(block, 0, count, 0.0, 0.0)
    if descent.trial.bent[v]:
        return derivatives_of_merged(descent, v, w, own, count, 1.0)
    return total - 0.5 * square


@kernel
def weigh_collapses_higher(mesh, descent, offers, most, floor, first, last):
    """Work out the least cost below `most` of a collapse of each of the nodes `first` to `last`."""
    position, elements, constraints, star = mesh.position, mesh.elements, mesh.constraints, descent.star
    for v in range(first, last):
        offers.cost[v] = np.inf
        if not offers.removable[v]:
            continue
        own, count, least = value_near(descent, v), number_block(descent, v), most
        size, before = derivatives(descent, v, own, count, position[v, 0], position[v, 1])[:2]
        before -= ROUNDING * size
        sliding = constraints.kind[v] == SLIDING
        for j in range(star.start[v], star.start[v + 1]):
            e = np.int64(star.element[j])
            k = corner_of(elements.node, e, v)
            for i in range(2):
                w = np.int64(star.behind[j] if i else star.ahead[j])
                c = elements.chain[e, (k + 2 - i) % 3]
                # everyone around a free node is ahead of it once; along a chain there are two
                if c != constraints.chain[v, OWN] if sliding else i == 1:
                    continue
                cost = merged_functional(descent, v, w, own) - before
                # the checks take longer
                if cost < least and collapsed_quality(mesh, v, w, np.inf, floor) > 0.0:
                    offers.cost[v], offers.into[v], least = cost, w, cost


@kernel
def exchange_higher(mesh, descent, offers, edges, nodes, floor):
    """Split edges, the largest gain first, each for the cheapest collapse that is left, while that costs less.

    As `exchange` does; coefficients are put in where elements changed. Returns how many pairs, and what they took off.
    """
    elements, trial, locked, pairs, lowered, at = mesh.elements, descent.trial, offers.locked, 0, 0.0, 0
    for edge in edges:
        e, k = edge // 3, edge % 3
        other = np.int64(elements.neighbour[e, k])
        if locked[e] or (other >= 0 and locked[other]):
            continue
        locked[e], gain = True, offers.gain[e, k]
        locked[other if other >= 0 else e] = True
        at = cheapest_left(mesh, offers, nodes, at, gain, floor)
        if at < 0:
            return pairs, lowered  # what follows gains less
        v = nodes[at]
        w, at = np.int64(offers.into[v]), at + 1
        lowered += gain - offers.cost[v]
        lock_around(mesh, v, locked)
        put_merged(descent, v, w)
        collapse(mesh, v, w)
        a, b = np.int64(elements.node[e, (k + 1) % 3]), np.int64(elements.node[e, (k + 2) % 3])
        x, y, parameter = midpoint(mesh, np.int64(elements.chain[e, k]), a, b)
        own = value_near(descent, a)
        gain_of_split(descent, e, k, x, y, own)
        given, known = outer_given(descent, e, k), descent.modes.given[e, k]
        p = split(mesh, e, k, x, y, parameter)
        trial.value[p], trial.fixed[p] = own + descent.block.local[0, 0], known
        put_split(mesh, descent, p, a, b, given)
        lock_around(mesh, p, locked)
        pairs += 1
    return pairs, lowered


@inner_kernel
def put_merged(descent, v, w):
    """Put the best coefficients into the elements that are left when v goes into w, while they still have v."""
    star, modes, node = descent.star, descent.modes, descent.elements.node
    own, bend = value_near(descent, v), descent.block.bend[4]
    merged_functional(descent, v, w, own)
    for row in range(star.start[v], star.start[v + 1]):
        a, b, e = star.ahead[row], star.behind[row], np.int64(star.element[row])
        if a != w and b != w:
            merged_coefficients(descent, v, w, row, own, 1.0)
            k = corner_of(node, e, v)
            put(modes, e, k, descent.block.part)
            merged_bends(descent, v, w, row, bend)
            put_bends(descent.shapes, e, k, bend)
            for side in range(1, 3):
                known = opposite_side(star, v, w, a if side == 2 else b)
                if known >= 0:
                    gone = np.int64(star.element[known])
                    modes.given[e, (k + side) % 3] = modes.given[gone, corner_of(node, gone, v)]


@inner_kernel
def outer_given(descent, e, k):
    """Whether the sides ca, bc, db and ad around the edge opposite to corner k of e are given; see `ENDS`."""
    given, other = descent.modes.given, np.int64(descent.elements.neighbour[e, k])
    if other < 0:
        return given[e, (k + 2) % 3], given[e, (k + 1) % 3], False, False
    j = corner_towards(descent.elements.neighbour, other, e)
    return given[e, (k + 2) % 3], given[e, (k + 1) % 3], given[other, (j + 2) % 3], given[other, (j + 1) % 3]


@inner_kernel
def put_split(mesh, descent, p, a, b, given):
    """Put the coefficients of `Block.local` into the elements around the new node p between a and b."""
    node, modes, around, local = mesh.elements.node, descent.modes, mesh.scratch.around, descent.block.local
    for i in range(gather_around(mesh, p, around)):
        f = np.int64(around[i])
        k = corner_of(node, f, p)
        one, two = node[f, (k + 1) % 3], node[f, (k + 2) % 3]
        row = 0 if two == a else 1 if one == b else 2 if two == b else 3
        put(modes, f, k, local[row])
        put_bends(descent.shapes, f, k, descent.block.bend[row])
        modes.given[f, k], modes.given[f, (k + 1) % 3], modes.given[f, (k + 2) % 3] = given[row], False, False
        modes.given[f, (k + 1 + row % 2) % 3] = descent.trial.fixed[p]  # the half of the edge
