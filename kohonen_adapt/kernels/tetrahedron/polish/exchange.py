"""Recycling by energy on tetrahedra, with splits and collapses in pairs.

As in `kernels/triangle/polish/exchange.py`, the gain of a split is the decrease of the functional at the best
value of the new node, and the cost of a collapse is the increase of the functional around the node, with all other
values fixed. At order 2, with `quadratic`, both are per unknown. On tetrahedra every pair is evaluated again before the
exchange, because almost every exchange changes the gains of other pairs.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, MOST, UNKNOWNS
from kohonen_adapt.kernels.tetrahedron.geometry import (
    FLAT,
    allowed,
    corner_of,
    cubed_quality,
    cubed_quality_at,
    element_quality,
    gather_around,
    list_neighbours,
    list_shell,
)
from kohonen_adapt.kernels.tetrahedron.polish.cavity_order2 import energy_of_old, solve_unknowns, store_new
from kohonen_adapt.kernels.tetrahedron.polish.energy import source_along
from kohonen_adapt.kernels.tetrahedron.polish.exchange_order1 import (
    energy_merged,
    gain_of_split,
    other_corners,
)
from kohonen_adapt.kernels.tetrahedron.polish.exchange_order2 import energy_merged_order2, gain_of_split_order2
from kohonen_adapt.kernels.tetrahedron.polish.slivers import UNMOVED, slivers_of
from kohonen_adapt.kernels.tetrahedron.polish.star import EDGE_OF
from kohonen_adapt.kernels.tetrahedron.recycle import holds_edge
from kohonen_adapt.kernels.tetrahedron.surgery import (
    NOWHERE,
    UNLIMITED,
    collapse,
    prepare_collapse,
    prepare_split,
    split,
)
from kohonen_adapt.kernels.tetrahedron.swap import energy_of
from kohonen_adapt.kernels.tetrahedron.waiting import enter_made
from kohonen_adapt.kernels.vectors import midpoint, put

SHRUNK = 0.8  # smallest gain of a split, relative to its first evaluation
SCRATCH_ROWS = 64  # free rows of nodes that remain for `weigh_splits` at order 2
DRIFT, AT = 0, 1  # columns of `state`: unknowns added so far, and position in the list of collapses


@inner_kernel
def gain_at(mesh, trial, quadratic, shell, count, a, b, p):
    """Return the gain of a split of ab, its unknowns, value, and True if given.

    At order 2 the position of node p must be set, and the value is that before the correction of the unknowns.
    """
    if quadratic is None:
        gain, value = gain_of_split(mesh, trial, shell, count, a, b)
        return gain, 1, value, False
    gain, unknowns, given = gain_of_split_order2(mesh, quadratic, shell, count, a, b, p)
    return gain, unknowns, trial.value[p], given


@kernel
def weigh_splits(mesh, trial, quadratic, offers, p, floor, nodes):
    """Compute the gains of splits of edges from nodes, at order 2 per unknown.

    Each edge belongs to its node of lower number. Its gain is stored at the first element with that edge in the list of
    elements around the node, and is 0 if the split is not allowed. Row p of the positions is scratch of order 2.
    """
    node, cavity = mesh.elements.node, mesh.cavity
    for v in nodes:
        count = gather_around(mesh, v, cavity.old)
        for j in range(list_neighbours(mesh, v, cavity.old, count)):
            w = cavity.made[j]
            if w < v:
                continue
            gain, unknowns = 1.0, 1
            shell = list_shell(mesh, cavity.old, count, w, cavity.around_other)
            if quadratic is None:  # before the checks, which are slower
                if trial.fixed[v] and trial.fixed[w] and (offers.lone[v] or offers.lone[w]):
                    continue  # Dirichlet values between both nodes are unknown
                gain, _ = gain_of_split(mesh, trial, cavity.around_other, shell, v, w)
            if not (gain > 0.0 and is_open(mesh, offers, shell, v, w) and halves_allowed(mesh, shell, v, w, floor)):
                continue
            if quadratic is not None:
                put(mesh.position, p, midpoint(mesh.position, v, w))
                gain, unknowns, _ = gain_of_split_order2(mesh, quadratic, cavity.around_other, shell, v, w, p)
            e = cavity.around_other[0]
            offers.gain[e, EDGE_OF[corner_of(node, e, v), corner_of(node, e, w)]] = max(0.0, gain / unknowns)


@inner_kernel
def cheapest_collapse(mesh, trial, quadratic, v, most, floor):
    """Return the least cost per unknown of a collapse of v, target, cost, unknowns.

    The cost per unknown is below `most`. Returned are inf and -1 if no collapse is allowed.
    """
    freedom, into = mesh.freedom, NOWHERE
    cheapest, least_cost = most, 0.0
    saved = 0
    count = gather_around(mesh, v, mesh.cavity.old)
    before, worst = energy_around(mesh, trial, quadratic, v, count)
    neighbours, least = list_neighbours(mesh, v, mesh.cavity.old, count), max(FLAT, min(floor, worst))
    for i in range(neighbours if neighbours < UNKNOWNS else 0):
        w = mesh.cavity.made[i]
        if freedom.number[w] == INSIDE and freedom.number[v] != INSIDE:
            continue
        if quadratic is None:
            after = energy_merged(mesh, trial, v, w, count, least)
            unknowns = 1
        else:
            after, unknowns = energy_merged_order2(mesh, quadratic, v, w, count, neighbours, least)
        cost = after - before
        # cost first, because the checks are slower
        if unknowns < 1 or not cost < cheapest * unknowns:
            continue
        if prepare_collapse(mesh, v, w, floor, UNLIMITED)[0] > 0.0:
            cheapest = cost / unknowns
            into = w
            least_cost, saved = cost, unknowns
    return (cheapest if into >= 0 else np.inf), into, least_cost, saved


@inner_kernel
def energy_around(mesh, trial, quadratic, v, count):
    # Return the functional and the worst quality of the elements `cavity.old` around v.
    total, worst = 0.0, 2.0
    node = mesh.elements.node
    if quadratic is not None:
        total = energy_of_old(mesh, quadratic, mesh.cavity.old, count, v, v)[1]
    for i in range(count):
        e = mesh.cavity.old[i]
        worst = min(worst, element_quality(mesh.position, node, e))
        if quadratic is None:
            total += energy_of(mesh, trial, node, e, mesh.elements.region[e], v, v)[0]
            total += slivers_of(mesh.position, mesh.elements, mesh.surfaces, trial, e, UNMOVED)[0]
    return total, worst


@kernel
def weigh_collapses(mesh, trial, quadratic, offers, most, floor, nodes):
    for v in nodes:
        offers.cost[v] = np.inf
        if offers.removable[v]:
            offers.cost[v] = cheapest_collapse(mesh, trial, quadratic, v, most, floor)[0]


@inner_kernel
def next_collapse(mesh, trial, quadratic, offers, nodes, a, b, most, credit, floor):
    """Return a node to collapse at less than `most`, target, cost and unknowns.

    The cost per unknown is less than `most`. The collapse keeps edge ab at order 1, and costs less than `credit` at
    order 2. The node is -1 if there is none. Nodes that cannot collapse are marked in `offers.removable`.
    """
    for v in nodes:
        if not offers.cost[v] < most:
            break
        if not offers.removable[v]:
            continue
        _, w, cost, unknowns = cheapest_collapse(mesh, trial, quadratic, v, most, floor)
        if w < 0:
            offers.removable[v] = False
            continue
        if quadratic is None:
            fits = not holds_edge(mesh, prepare_collapse(mesh, v, w, floor, UNLIMITED)[1], a, b)
        else:
            fits = cost < credit
        if fits:
            return v, w, cost, unknowns
    return NOWHERE, NOWHERE, 0.0, 0


@inner_kernel
def offer_is_left(offers, nodes, state, margin, gain):
    # Return True if a collapse costs less than the largest gain that is left, by the factor `margin`.
    while state[AT] < len(nodes) and not offers.removable[nodes[state[AT]]]:
        state[AT] += 1
    return state[AT] < len(nodes) and margin * offers.cost[nodes[state[AT]]] < gain


@inner_kernel
def merge(mesh, quadratic, queue, offers, v, w, floor):
    offers.removable[v] = False
    if quadratic is not None:
        count = gather_around(mesh, v, mesh.cavity.old)
        neighbours = list_neighbours(mesh, v, mesh.cavity.old, count)
        energy_merged_order2(mesh, quadratic, v, w, count, neighbours, FLAT)
        solve_unknowns(quadratic.block)
    _, old, new = prepare_collapse(mesh, v, w, floor, UNLIMITED)  # the same elements in the same order
    collapse(mesh, v, old, new)
    if quadratic is None:
        enter_made(mesh, queue, new)
    else:
        store_new(mesh, quadratic, new)


@inner_kernel
def insert(mesh, trial, quadratic, queue, offers, a, b, count, value, given):
    p = split(mesh, a, b, count)
    trial.value[p], trial.fixed[p] = value, given
    offers.is_new[p] = True
    for region in range(trial.source.shape[1] if trial.source.shape[0] > 0 else 0):
        trial.source[p, region] = source_along(trial, region, a, b)
    if quadratic is None:
        enter_made(mesh, queue, 2 * count)
        return
    solve_unknowns(quadratic.block)
    if not given:
        trial.value[p] += quadratic.block.correction[0]
    store_new(mesh, quadratic, 2 * count)


@kernel
def exchange(mesh, trial, quadratic, queue, offers, ends, gains, nodes, state, margin, floor):
    """Split edges and collapse nodes while `margin` times the cost is less.

    Edges `ends` (k, 2) are sorted by decreasing `gains`, `nodes` by increasing costs, of which `state` has the position
    reached. Rows of removed nodes are used again for new nodes, which are marked `is_new`. Values of new nodes are
    stored in the trial. Returned are the number of splits and the decrease of the functional. At order 1 every split
    follows a collapse, and new elements enter the queue.

    At order 2 gains and costs are per unknown. A split is followed by collapses until as many unknowns are removed.
    They cost less per unknown by the factor `margin`, and together less than the gain of the split, so the functional
    never rises.
    """
    splits, decrease = 0, 0.0
    for i in range(len(ends)):
        a, b = ends[i, 0], ends[i, 1]
        if mesh.pool.height[1] < MOST or not offer_is_left(offers, nodes, state, margin, gains[i]):
            break
        if quadratic is not None and mesh.pool.height[0] < SCRATCH_ROWS:
            break
        count = 0 if offers.is_new[a] or offers.is_new[b] else prepare_split(mesh, a, b, floor)
        if count == 0:
            continue
        p = mesh.pool.free_nodes[mesh.pool.height[0] - 1]
        credit, added, value, given = gain_at(mesh, trial, quadratic, mesh.cavity.old, count, a, b, p)
        most = credit / (margin * added)
        if not credit > SHRUNK * gains[i] * added:
            continue
        if quadratic is None:
            v, w, cost, _ = next_collapse(mesh, trial, None, offers, nodes[state[AT] :], a, b, most, np.inf, floor)
            if v < 0:
                continue
            merge(mesh, None, queue, offers, v, w, floor)
            count = prepare_split(mesh, a, b, floor)
            decrease = decrease - cost
            credit, _, value, _ = gain_at(mesh, trial, None, mesh.cavity.old, count, a, b, p)
        insert(mesh, trial, quadratic, queue, offers, a, b, count, value, given)
        splits, decrease = splits + 1, decrease + credit
        if quadratic is None:
            continue
        before = state[DRIFT]
        state[DRIFT] += added
        while state[DRIFT] > 0:
            rest = nodes[state[AT] :]
            v, w, cost, saved = next_collapse(mesh, trial, quadratic, offers, rest, a, b, most, credit, floor)
            if v < 0:
                break
            merge(mesh, quadratic, queue, offers, v, w, floor)
            decrease, credit = decrease - cost, credit - cost
            state[DRIFT] -= saved
        if state[DRIFT] > 0 and state[DRIFT] >= before:
            break
    return splits, decrease


@inner_kernel
def is_open(mesh, offers, count, a, b):
    for i in range(count):
        e = mesh.cavity.around_other[i]
        for k in range(4):
            p = mesh.elements.patch[e, k]
            if p >= 0 and not offers.open[p] and mesh.elements.node[e, k] not in (a, b):
                return False
    return True


@inner_kernel
def halves_allowed(mesh, count, a, b, floor):
    position, node = mesh.position, mesh.elements.node
    x = midpoint(mesh.position, a, b)
    before = after = 2.0
    for i in range(count):
        e = mesh.cavity.around_other[i]
        c, d = other_corners(node, e, corner_of(node, e, a), corner_of(node, e, b))
        before = min(before, cubed_quality(position, a, b, c, d))
        after = min(after, cubed_quality_at(position, x, b, c, d))
        after = min(after, cubed_quality_at(position, x, a, d, c))
    return allowed(after, before, floor)
