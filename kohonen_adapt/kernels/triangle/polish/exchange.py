"""Exchange of splits for collapses by functionals.

The gain of a split is the decrease by the best unknowns at the new node. A split keeps the function, a polynomial on
each half, and on an edge with Dirichlet values, which are linear, the value of the node and the coefficients of the
edge are kept. The cost of a collapse is the increase on the elements around the node, with all other values held and
the new sides straight, after the new coefficients are eliminated. Every operation locks the elements that change. As no
two operations share an element, the functional falls by the sum of all gains less the sum of all costs.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.triangle.arrays import BLOCK, COARSE_BLOCK, OWN, ROWS, SLIDING, VALUE, WITH
from kohonen_adapt.kernels.triangle.geometry import corner_of, ends_of
from kohonen_adapt.kernels.triangle.polish import linear
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING
from kohonen_adapt.kernels.triangle.polish.patch import derivatives, may_centre, minimise, number_unknowns, term_of
from kohonen_adapt.kernels.triangle.polish.rows import (
    gather_beside,
    gather_halves,
    gather_merged,
    gather_star,
    put_row,
    reference_value,
)
from kohonen_adapt.kernels.triangle.surgery import (
    collapse,
    collapsed_quality,
    gather_around,
    may_split,
    midpoint,
    split,
)
from kohonen_adapt.kernels.vectors import squared_distance, xy

# Squared length over the shortest of a node, from which an edge is not collapsed: seldom the cheapest, and costs take
# most of the time of a recycling. In closed form costs take less time than checks.
FAR = 2.0

change_by_linear_split, linear_merged = linear.change_by_split, linear.merged


@kernel
def weigh(mesh, descents, higher, offers, most, floor, first, last, edges):
    """Compute the gains of splits by elements, or the costs of collapses by nodes.

    Elements or nodes are those from `first` to `last`, and costs are below `most`.
    """
    # one kernel, because both branches share code that is compiled once
    if edges:
        weigh_splits(mesh, descents, higher, offers, floor, first, last)
    else:
        weigh_collapses(mesh, descents, higher, offers, most, floor, first, last)


@inner_kernel
def weigh_splits(mesh, descents, higher, offers, floor, first, last):
    elements, inner, fixed = mesh.elements, mesh.constraints.inner, descents.primal.trial.fixed
    for e in range(first, last):
        for k in range(3):
            offers.gain[e, k] = 0.0
            c = elements.chain[e, k]
            known = is_dirichlet(descents.primal, higher, e, k)
            if elements.neighbour[e, k] >= e or (not offers.open[c] if c >= 0 else known):  # the outer boundary is -1
                continue
            a, b = ends_of(elements.node, e, k)
            if not known and fixed[a] and fixed[b] and (inner[a] or inner[b]):
                continue  # between Dirichlet nodes inside a region the values of the user are not available
            x, _ = midpoint(mesh, c, a, b)
            gain = gain_of_split(descents, higher, e, k, x)
            if gain > 0.0 and may_split(mesh, e, k, floor, x):
                offers.gain[e, k] = gain


@inner_kernel
def is_dirichlet(descent, higher, e, k):
    if len(higher) == 0:
        return False
    return descent.modes.dirichlet[e, k]


@inner_kernel
def gain_of_split(descents, higher, e, k, x):
    """Return the decrease of the functionals by a split, or 0 if negligible.

    The rows of the block are then the halves. In nonlinear materials their coefficients are approximated by one step of
    Newton's method.
    """
    gain, magnitude = 0.0, 0.0
    for i in range(descents.terms):
        descent = term_of(descents, i)
        if len(higher) == 0:
            decrease, more = change_by_linear_split(descent, e, k, x)
        else:
            decrease, more = change_by_split(descent, e, k, x)
        gain, magnitude = gain + decrease, magnitude + more
    return gain if gain > ROUNDING * magnitude else 0.0


@inner_kernel
def change_by_split(descent, e, k, x):
    known = descent.modes.dirichlet[e, k]
    v, other = ends_of(descent.elements.node, e, k)[0], descent.elements.neighbour[e, k]
    special = descent.shapes.special[e]
    nonlinear = descent.trial.laws.number[e] >= 0
    unsplit = 0.0
    if other >= 0:
        special |= descent.shapes.special[other]
        nonlinear |= descent.trial.laws.number[other] >= 0
    if special or nonlinear:
        gather_beside(descent, e, k, reference_value(descent, v))
        unsplit = -np.inf
        if may_centre(descent, xy(descent.position, v)):
            unsplit = derivatives(descent, xy(descent.position, v), VALUE)[1]
    gather_halves(descent, e, k)
    number_unknowns(descent, not known)
    if not may_centre(descent, x):
        return -np.inf, 0.0
    solved, magnitude, before, square = minimise(descent, 1 if known else 0, x, COARSE_BLOCK if nonlinear else BLOCK)
    if not solved:
        return -np.inf, magnitude
    # The halves of curved elements, or of elements at the axis, need not contain the function, and new quadrature
    # points change the energy of a law. The gain is therefore relative to the value before the split.
    if nonlinear:
        return unsplit - derivatives(descent, x, VALUE)[1], magnitude
    return 0.5 * square + (unsplit - before if special else 0.0), magnitude


@inner_kernel
def weigh_collapses(mesh, descents, higher, offers, most, floor, first, last):
    position, star = mesh.position, descents.primal.star
    for v in range(first, last):
        offers.cost[v] = np.inf
        if not offers.removable[v]:
            continue
        before, least = 0.0, most
        farthest = np.inf
        if len(higher) > 0:
            for row in rows_of(star, v):
                farthest = min(farthest, FAR * squared_distance(position, v, xy(position, star.ahead[row])))
        for i in range(descents.terms):
            before += least_around(term_of(descents, i), higher, v)
        for j in rows_of(star, v):
            for i in range(2):
                w = merge_target(mesh, star, v, j, i)
                if w < 0 or squared_distance(position, v, xy(position, w)) > farthest:
                    continue
                cost = -before
                for term in range(descents.terms):
                    cost += merged(term_of(descents, term), higher, v, w)
                # after the cost, because the checks take longer
                if cost < least and collapsed_quality(mesh, v, w, np.inf, floor) > 0.0:
                    offers.cost[v], offers.into[v], least = cost, w, cost


@inner_kernel
def merge_target(mesh, star, v, j, i):
    # every neighbour of a free node is `ahead` once; a sliding node has two neighbours on its curve
    e = star.element[j]
    constraints = mesh.constraints
    chain = mesh.elements.chain[e, (corner_of(mesh.elements.node, e, v) + 2 - i) % 3]
    if chain != constraints.chain[v, OWN] if constraints.kind[v] == SLIDING else i == 1:
        return -1
    return star.behind[j] if i else star.ahead[j]


@inner_kernel
def least_around(descent, higher, v):
    """Return the functional around node `v`, reduced by the rounding error."""
    position = descent.position
    if len(higher) == 0:
        part = linear.around(position, descent.star, descent.trial, WITH, v, xy(position, v), 0.0)
        return part[1] - ROUNDING * part[0]
    gather_star(descent, v)
    magnitude, total = derivatives(descent, xy(position, v), VALUE)[:2]
    return total - ROUNDING * magnitude


@inner_kernel
def merged(descent, higher, v, w):
    """Return the minimum of the functional around `v` merged into `w`.

    The value is inf if an element is inverted. The rows of the block are then the remaining elements. In nonlinear
    materials the minimum is approximated by one step of Newton's method.
    """
    x = xy(descent.position, w)
    nonlinear = descent.trial.nonlinear[v]
    if len(higher) == 0:
        return linear_merged(descent.position, descent.star, descent.trial, v, w)
    gather_merged(descent, v, w)
    if not may_centre(descent, x):
        return np.inf
    number_unknowns(descent, False)
    solved, _, total, square = minimise(descent, 1, x, COARSE_BLOCK if nonlinear else BLOCK)
    if not solved:
        return np.inf
    return derivatives(descent, x, VALUE)[1] if nonlinear else total - 0.5 * square


@inner_kernel
def lock_edge(mesh, e, k, locked):
    other = mesh.elements.neighbour[e, k]
    if locked[e] or (other >= 0 and locked[other]):
        return False
    locked[e] = locked[other if other >= 0 else e] = True
    return True


@inner_kernel
def lock_around(mesh, v, locked):
    around = mesh.scratch.around
    for i in range(gather_around(mesh, v, around)):
        locked[around[i]] = True


@inner_kernel
def is_locked(mesh, v, locked):
    around = mesh.scratch.around
    for i in range(gather_around(mesh, v, around)):
        if locked[around[i]]:
            return True
    return False


@inner_kernel
def next_collapse(mesh, offers, nodes, at, gain, floor):
    while at < len(nodes) and gain > offers.cost[nodes[at]]:
        v = nodes[at]
        w = offers.into[v]
        if not is_locked(mesh, v, offers.locked) and collapsed_quality(mesh, v, w, np.inf, floor) > 0.0:
            return at
        at += 1
    return -1


@kernel
def exchange(mesh, descents, higher, offers, edges, nodes, floor):
    """Split edges in exchange for cheaper collapses.

    `edges` are 3 e + k by decreasing gain, and `nodes` are by increasing cost. The values of new nodes are stored in
    the trials. Return the number of pairs and the decrease of the functional.
    """
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
        w = offers.into[v]
        at += 1
        decrease += gain - offers.cost[v]
        lock_around(mesh, v, locked)
        for i in range(descents.terms if len(higher) > 0 else 0):
            put_merged(term_of(descents, i), higher, v, w)
        collapse(mesh, v, w)
        a, b = ends_of(elements.node, e, k)
        x, parameter = midpoint(mesh, elements.chain[e, k], a, b)
        gain_of_split(descents, higher, e, k, x)
        known = is_dirichlet(descents.primal, higher, e, k)
        p = split(mesh, e, k, x, parameter)
        for i in range(descents.terms):
            descent = term_of(descents, i)
            descent.trial.value[p] = descent.block.own[0] + descent.block.local[0, 0]
            descent.trial.fixed[p] = known
            if len(higher) > 0:
                put_halves(mesh, descent, p)
        lock_around(mesh, p, locked)
        pairs += 1
    return pairs, decrease


@inner_kernel
def put_merged(descent, higher, v, w):
    merged(descent, higher, v, w)
    for j in range(descent.block.size[ROWS]):
        e = descent.block.element[j]
        put_row(descent, j, e, corner_of(descent.elements.node, e, v))


@inner_kernel
def put_halves(mesh, descent, p):
    node, around, end = mesh.elements.node, mesh.scratch.around, descent.block.end
    for i in range(gather_around(mesh, p, around)):
        e = around[i]
        k = corner_of(node, e, p)
        for j in range(descent.block.size[ROWS]):
            if end[j, 1] == node[e, (k + 1) % 3] and end[j, 2] == node[e, (k + 2) % 3]:
                put_row(descent, j, e, k)
