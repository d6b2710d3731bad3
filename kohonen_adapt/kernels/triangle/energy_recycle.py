"""Weigh splits of edges against collapses by what they do to a functional, and do both in pairs.

A split gains what the best value of its node takes off, a collapse costs what the elements around it then have more
than before, all other values held. Elements that one of them changes are locked for the others: as no two share an
element, the functional falls by the sum of all gains less the sum of all costs.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import OWN, SIXTH_SOURCE, SLIDING
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.connectivity import corner_of, corner_towards
from kohonen_adapt.kernels.triangle.descend import ROUNDING, triangle_parabola
from kohonen_adapt.kernels.triangle.geometry import orientation
from kohonen_adapt.kernels.triangle.surgery import (
    collapse,
    collapsed_quality,
    gather_around,
    may_split,
    midpoint,
    split,
)


@inner_kernel
def halves_parabola(mesh, trial, e, k, x, y, own, w):
    """The functional of e, its edge opposite to corner k split at (x, y), in the change w of the value there from own.

    Returns (sum of magnitudes, value, by w, by ww).
    """
    node = mesh.elements.node
    a, b, c = np.int64(node[e, (k + 1) % 3]), np.int64(node[e, (k + 2) % 3]), np.int64(node[e, k])
    one, one_by_w, one_by_ww = triangle_parabola(mesh.position, trial, e, c, a, x, y, own, w)
    two, two_by_w, two_by_ww = triangle_parabola(mesh.position, trial, e, b, c, x, y, own, w)
    return abs(one) + abs(two), one + two, one_by_w + two_by_w, one_by_ww + two_by_ww


@inner_kernel
def split_parabola(mesh, trial, e, k, x, y, own, w):
    """The same of both elements at the edge."""
    size, total, slope, stiffness = halves_parabola(mesh, trial, e, k, x, y, own, w)
    other = np.int64(mesh.elements.neighbour[e, k])
    if other >= 0:
        j = np.int64(corner_towards(mesh.elements.neighbour, other, e))
        more, c, r, s = halves_parabola(mesh, trial, other, j, x, y, own, w)
        size, total, slope, stiffness = size + more, total + c, slope + r, stiffness + s
    return size, total, slope, stiffness


@inner_kernel
def best_of_split(mesh, trial, e, k, x, y):
    """Sum of magnitudes, what the best value of a new node at (x, y) takes off one functional, and this value.

    In nonlinear material it is the value after one step of Newton's method.
    """
    a, b = np.int64(mesh.elements.node[e, (k + 1) % 3]), np.int64(mesh.elements.node[e, (k + 2) % 3])
    own = 0.5 * (trial.value[a] + trial.value[b])
    size, before, slope, stiffness = split_parabola(mesh, trial, e, k, x, y, own, 0.0)
    gain, w = 0.5 * slope * slope / stiffness, -slope / stiffness
    if trial.bent[a] or trial.bent[b]:
        gain = before - split_parabola(mesh, trial, e, k, x, y, own, w)[1]
    return size, gain, own + w


@inner_kernel
def gain_of_split(mesh, trials, e, k, x, y):
    """What the best values of a new node at (x, y) take off, 0 if that is rounding, and these values."""
    size, gain, value = best_of_split(mesh, trials.one, e, k, x, y)
    other = 0.0
    if trials.other.value.shape[0] > 0:
        sized, more, other = best_of_split(mesh, trials.other, e, k, x, y)
        size, gain = size + sized, gain + more
    return gain if gain > ROUNDING * size else 0.0, value, other


@kernel
def weigh_splits(mesh, trials, offers, floor, first, last):
    """Work out what a split of every edge of the elements `first` to `last` gains, 0 where none is allowed."""
    elements, inner, fixed = mesh.elements, mesh.constraints.inner, trials.one.fixed
    node = elements.node
    for e in range(first, last):
        for k in range(3):
            offers.gain[e, k] = 0.0
            c = np.int64(elements.chain[e, k])
            if elements.neighbour[e, k] >= e or (c >= 0 and not offers.open[c]):  # the outer boundary is -1
                continue
            a, b = np.int64(node[e, (k + 1) % 3]), np.int64(node[e, (k + 2) % 3])
            if fixed[a] and fixed[b] and (inner[a] or inner[b]):
                continue  # given inside a region: who knows what between them
            x, y, _ = midpoint(mesh, c, a, b)
            gain, _, _ = gain_of_split(mesh, trials, e, k, x, y)
            if gain > 0.0 and may_split(mesh, e, k, floor, x, y):
                offers.gain[e, k] = gain


@inner_kernel
def merged_functional(position, star, trial, v, w):
    """The functional of what is left around v when it has gone into w, inf where an element is overturned.

    Values are taken relative to v's.
    """
    x, y, own, total = position[w, 0], position[w, 1], trial.value[w], 0.0
    shift = 3.0 * (own - trial.value[v])
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[j]), np.int64(star.ahead[j]), np.int64(star.behind[j])
        if a == w or b == w:
            continue
        doubled = orientation(x, y, position[a, 0], position[a, 1], position[b, 0], position[b, 1])
        if not doubled > 0.0:
            return np.inf
        part, _, _ = triangle_parabola(position, trial, e, a, b, x, y, own, 0.0)
        total += part - shift * doubled * trial.data[e, SIXTH_SOURCE]
    return total


@inner_kernel
def star_functional(position, star, trial, v):
    """The functional around v, relative to its value, less what may be rounding of it."""
    total, size = 0.0, 0.0
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[j]), np.int64(star.ahead[j]), np.int64(star.behind[j])
        part, _, _ = triangle_parabola(position, trial, e, a, b, position[v, 0], position[v, 1], trial.value[v], 0.0)
        total += part
        size += abs(part)
    return total - ROUNDING * size


@kernel
def weigh_collapses(mesh, star, trials, offers, most, floor, first, last):
    """Work out the least cost below `most` of a collapse of each of the nodes `first` to `last`."""
    position, elements, constraints = mesh.position, mesh.elements, mesh.constraints
    two = trials.other.value.shape[0] > 0
    for v in range(first, last):
        offers.cost[v] = np.inf
        if not offers.removable[v]:
            continue
        before, least, sliding = star_functional(position, star, trials.one, v), most, constraints.kind[v] == SLIDING
        if two:
            before += star_functional(position, star, trials.other, v)
        for j in range(star.start[v], star.start[v + 1]):
            e = np.int64(star.element[j])
            k = corner_of(elements.node, e, v)
            for i in range(2):
                w = np.int64(star.behind[j] if i else star.ahead[j])
                c = elements.chain[e, (k + 2 - i) % 3]
                # everyone around a free node is ahead of it once; along a chain there are two
                if c != constraints.chain[v, OWN] if sliding else i == 1:
                    continue
                after = merged_functional(position, star, trials.one, v, w)
                if two:
                    after += merged_functional(position, star, trials.other, v, w)
                cost = after - before
                # the checks take longer
                if cost < least and collapsed_quality(mesh, v, w, np.inf, floor) > 0.0:
                    offers.cost[v], offers.into[v], least = cost, w, cost


@inner_kernel
def lock_around(mesh, v, locked):
    """Lock the elements around v."""
    around = mesh.scratch.around
    for i in range(gather_around(mesh, v, around)):
        locked[around[i]] = True


@inner_kernel
def is_locked(mesh, v, locked):
    """Whether an element around v is locked."""
    around = mesh.scratch.around
    for i in range(gather_around(mesh, v, around)):
        if locked[around[i]]:
            return True
    return False


@inner_kernel
def cheapest_left(mesh, offers, nodes, at, gain, floor):
    """The first place from `at` on of a node that may still be collapsed; -1 where none costs less than the gain."""
    while at < len(nodes) and gain > offers.cost[nodes[at]]:
        v = nodes[at]
        w = np.int64(offers.into[v])
        if not is_locked(mesh, v, offers.locked) and collapsed_quality(mesh, v, w, np.inf, floor) > 0.0:
            return at
        at += 1
    return -1


@kernel
def exchange(mesh, trials, offers, edges, nodes, floor):
    """Split edges, the largest gain first, each for the cheapest collapse that is left, while that costs less.

    `edges` are 3 e + k, in order of their gains, `nodes` in order of their costs; values of new nodes are put into the
    trials. Returns how many pairs, and what they took off the functional.
    """
    elements, locked, pairs, lowered, at = mesh.elements, offers.locked, 0, 0.0, 0
    for edge in edges:
        e, k = edge // 3, edge % 3
        other = np.int64(elements.neighbour[e, k])
        if locked[e] or (other >= 0 and locked[other]):
            continue
        locked[e] = True
        if other >= 0:
            locked[other] = True
        gain = offers.gain[e, k]
        at = cheapest_left(mesh, offers, nodes, at, gain, floor)
        if at < 0:
            return pairs, lowered  # what follows gains less
        v = nodes[at]
        w = np.int64(offers.into[v])
        at += 1
        lowered += gain - offers.cost[v]
        lock_around(mesh, v, locked)
        collapse(mesh, v, w)
        a, b = np.int64(elements.node[e, (k + 1) % 3]), np.int64(elements.node[e, (k + 2) % 3])
        x, y, parameter = midpoint(mesh, np.int64(elements.chain[e, k]), a, b)
        _, value, other_value = gain_of_split(mesh, trials, e, k, x, y)
        p = split(mesh, e, k, x, y, parameter)
        trials.one.value[p], trials.one.fixed[p] = value, False
        if trials.other.value.shape[0] > 0:
            trials.other.value[p], trials.other.fixed[p] = other_value, False
        lock_around(mesh, p, locked)
        pairs += 1
    return pairs, lowered
