"""Exchange of splits for collapses by functionals of P1 functions.

The gain of a split is the decrease by the best value at the new node. The cost of a collapse is the increase on
the elements around the node, with all other values held. Every operation locks the elements that change. As no two
operations share an element, the functional falls by the sum of all gains less the sum of all costs.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import OWN, SIXTH_SOURCE, SLIDING
from kohonen_adapt.kernels.triangle.geometry import corner_of, corner_towards, ends_of, orientation
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING, triangle_parabola
from kohonen_adapt.kernels.triangle.surgery import (
    collapse,
    collapsed_quality,
    gather_around,
    may_split,
    midpoint,
    split,
)
from kohonen_adapt.kernels.vectors import xy


@inner_kernel
def halves_parabola(mesh, trial, e, k, x, own, w):
    node = mesh.elements.node
    (a, b), c = ends_of(node, e, k), np.int64(node[e, k])
    one, one_by_w, one_by_ww = triangle_parabola(mesh.position, trial, e, c, a, x, own, w)
    two, two_by_w, two_by_ww = triangle_parabola(mesh.position, trial, e, b, c, x, own, w)
    return abs(one) + abs(two), one + two, one_by_w + two_by_w, one_by_ww + two_by_ww


@inner_kernel
def split_parabola(mesh, trial, e, k, x, own, w):
    magnitude, total, slope, stiffness = halves_parabola(mesh, trial, e, k, x, own, w)
    other = np.int64(mesh.elements.neighbour[e, k])
    if other >= 0:
        j = np.int64(corner_towards(mesh.elements.neighbour, other, e))
        more, c, r, s = halves_parabola(mesh, trial, other, j, x, own, w)
        magnitude, total = magnitude + more, total + c
        slope, stiffness = slope + r, stiffness + s
    return magnitude, total, slope, stiffness


@inner_kernel
def best_of_split(mesh, trial, e, k, x):
    a, b = ends_of(mesh.elements.node, e, k)
    own = 0.5 * (trial.value[a] + trial.value[b])
    magnitude, before, slope, stiffness = split_parabola(mesh, trial, e, k, x, own, 0.0)
    gain, w = 0.5 * slope * slope / stiffness, -slope / stiffness
    if trial.nonlinear[a] or trial.nonlinear[b]:
        gain = before - split_parabola(mesh, trial, e, k, x, own, w)[1]
    return magnitude, gain, own + w


@inner_kernel
def gain_of_split(mesh, trials, e, k, x):
    magnitude, gain, value = best_of_split(mesh, trials.primal, e, k, x)
    dual_value = 0.0
    if trials.dual.value.shape[0] > 0:
        dual_magnitude, dual_gain, dual_value = best_of_split(mesh, trials.dual, e, k, x)
        magnitude, gain = magnitude + dual_magnitude, gain + dual_gain
    return gain if gain > ROUNDING * magnitude else 0.0, value, dual_value


@kernel
def weigh_splits(mesh, trials, offers, floor, first, last):
    elements, inner, fixed = mesh.elements, mesh.constraints.inner, trials.primal.fixed
    node = elements.node
    for e in range(first, last):
        for k in range(3):
            offers.gain[e, k] = 0.0
            c = np.int64(elements.chain[e, k])
            if elements.neighbour[e, k] >= e or (c >= 0 and not offers.open[c]):  # the outer boundary is -1
                continue
            a, b = ends_of(node, e, k)
            if fixed[a] and fixed[b] and (inner[a] or inner[b]):
                continue  # between Dirichlet nodes inside a region the values of the user are not available
            x, _ = midpoint(mesh, c, a, b)
            gain, _, _ = gain_of_split(mesh, trials, e, k, x)
            if gain > 0.0 and may_split(mesh, e, k, floor, x):
                offers.gain[e, k] = gain


@inner_kernel
def merged_functional(position, star, trial, v, w):
    x, own = xy(position, w), trial.value[w]
    total = 0.0
    shift = 3.0 * (own - trial.value[v])  # of the load, because all values are relative to the value of v
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[j]), np.int64(star.ahead[j]), np.int64(star.behind[j])
        if a == w or b == w:
            continue
        doubled = orientation(x, xy(position, a), xy(position, b))
        if not doubled > 0.0:
            return np.inf
        part, _, _ = triangle_parabola(position, trial, e, a, b, x, own, 0.0)
        total += part - shift * doubled * trial.data[e, SIXTH_SOURCE]
    return total


@inner_kernel
def star_functional(position, star, trial, v):
    total, magnitude = 0.0, 0.0
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[j]), np.int64(star.ahead[j]), np.int64(star.behind[j])
        part, _, _ = triangle_parabola(position, trial, e, a, b, xy(position, v), trial.value[v], 0.0)
        total += part
        magnitude += abs(part)
    return total - ROUNDING * magnitude


@inner_kernel
def merge_target(mesh, star, v, j, i):
    # every neighbour of a free node is `ahead` once; a sliding node has two neighbours on its curve
    e, constraints = np.int64(star.element[j]), mesh.constraints
    chain = mesh.elements.chain[e, (corner_of(mesh.elements.node, e, v) + 2 - i) % 3]
    if chain != constraints.chain[v, OWN] if constraints.kind[v] == SLIDING else i == 1:
        return np.int64(-1)
    return np.int64(star.behind[j] if i else star.ahead[j])


@kernel
def weigh_collapses(mesh, star, trials, offers, most, floor, first, last):
    position, has_dual = mesh.position, trials.dual.value.shape[0] > 0
    for v in range(first, last):
        offers.cost[v] = np.inf
        if not offers.removable[v]:
            continue
        before, least = star_functional(position, star, trials.primal, v), most
        if has_dual:
            before += star_functional(position, star, trials.dual, v)
        for j in range(star.start[v], star.start[v + 1]):
            for i in range(2):
                w = merge_target(mesh, star, v, j, i)
                if w < 0:
                    continue
                after = merged_functional(position, star, trials.primal, v, w)
                if has_dual:
                    after += merged_functional(position, star, trials.dual, v, w)
                cost = after - before
                # after the cost, because the checks take longer
                if cost < least and collapsed_quality(mesh, v, w, np.inf, floor) > 0.0:
                    offers.cost[v], offers.into[v], least = cost, w, cost


@inner_kernel
def lock_edge(mesh, e, k, locked):
    other = np.int64(mesh.elements.neighbour[e, k])
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
        w = np.int64(offers.into[v])
        if not is_locked(mesh, v, offers.locked) and collapsed_quality(mesh, v, w, np.inf, floor) > 0.0:
            return at
        at += 1
    return -1


@kernel
def exchange(mesh, trials, offers, edges, nodes, floor):
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
        w = np.int64(offers.into[v])
        at += 1
        decrease += gain - offers.cost[v]
        lock_around(mesh, v, locked)
        collapse(mesh, v, w)
        a, b = ends_of(elements.node, e, k)
        x, parameter = midpoint(mesh, np.int64(elements.chain[e, k]), a, b)
        _, value, other_value = gain_of_split(mesh, trials, e, k, x)
        p = split(mesh, e, k, x, parameter)
        trials.primal.value[p], trials.primal.fixed[p] = value, False
        if trials.dual.value.shape[0] > 0:
            trials.dual.value[p], trials.dual.fixed[p] = other_value, False
        lock_around(mesh, p, locked)
        pairs += 1
    return pairs, decrease
