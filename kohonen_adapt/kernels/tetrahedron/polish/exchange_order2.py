"""Exchange of nodes at order 2, ranked by the functional per unknown.

A node in the middle of edge ab has the value (u_a + u_b) / 2 + m_ab, the halves have the coefficient m_ab / 4, and the
edge to c has (m_ac + m_bc) / 2 - m_ab / 4. The function does not change, so the gain of a split is that of the
elimination of the new unknowns. A collapse eliminates the coefficients of new edges. A split adds as many unknowns as
the node has edges, a collapse saves 1 + the edges of the node - the new edges.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, MOST, UNKNOWNS
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES, FLAT, corner_of, element_quality, gather_around
from kohonen_adapt.kernels.tetrahedron.polish.cavity_order2 import (
    energy_of_old,
    least_energy,
    solve_unknowns,
    store_new,
)
from kohonen_adapt.kernels.tetrahedron.polish.descend_order2 import EDGE_OF
from kohonen_adapt.kernels.tetrahedron.polish.energy import value_at
from kohonen_adapt.kernels.tetrahedron.polish.energy_recycle import (
    AT,
    DRIFT,
    SHRUNK,
    edge_between,
    halves_allowed,
    is_open,
    list_neighbours,
    list_shell,
    offer_is_left,
    set_new,
)
from kohonen_adapt.kernels.tetrahedron.surgery import (
    NOWHERE,
    UNLIMITED,
    collapse,
    prepare_collapse,
    prepare_split,
    split,
)

SCRATCH_ROWS = 64  # free rows of nodes that remain for `weigh_splits_order2`


@inner_kernel
def row_of(block, rows, node):
    row = 0
    while row < rows and block.end[row, 0] != node:
        row += 1
    return row


@inner_kernel
def write_element(mesh, quadratic, i, e, end, p, own, rows):
    block, modes, node = quadratic.block, quadratic.modes, mesh.elements.node
    mesh.cavity.region[i] = mesh.elements.region[e]
    for k in range(4):
        v = p if node[e, k] == end else np.int64(node[e, k])
        mesh.cavity.new[i, k], block.dof[i, k] = v, -1
        block.local[i, k] = value_at(quadratic.trial, mesh.cavity.region[i], v) - own
    for k in range(6):
        first, second = node[e, EDGES[k, 0]], node[e, EDGES[k, 1]]
        if first != end and second != end:
            block.local[i, 4 + k], block.dof[i, 4 + k] = modes.side[e, k, 0], -1
            block.given[i, k] = modes.dirichlet[e, k]
            continue
        row = row_of(block, rows, second if first == end else first)
        block.local[i, 4 + k], block.dof[i, 4 + k] = block.mode[row], block.edge_dof[row]
        block.given[i, k] = block.edge_given[row]


@inner_kernel
def gain_of_split(mesh, quadratic, shell, count, a, b, p):
    # Return the gain of node p in the middle of edge ab, the number of its edges, and True if its value is given.
    # The position of p must be set. The elements are written to `cavity.new`, as by `prepare_split`.
    block, modes, trial, node = quadratic.block, quadratic.modes, quadratic.trial, mesh.elements.node
    # the halves of curved elements do not contain the function
    now = energy_of_old(mesh, quadratic, shell, count, a, b)[1] if block.curve_end.shape[0] > 0 else 0.0
    e = np.int64(shell[0])
    ab = EDGE_OF[corner_of(node, e, a), corner_of(node, e, b)]
    middle, given = modes.side[e, ab, 0], modes.dirichlet[e, ab]
    rows = 2
    block.end[0, 0], block.end[1, 0] = a, b
    for row in range(2):
        block.mode[row], block.edge_given[row] = 0.25 * middle, given
    for i in range(count):
        e = np.int64(shell[i])
        ka, kb = corner_of(node, e, a), corner_of(node, e, b)
        for k in range(4):
            if k in (ka, kb):
                continue
            row = row_of(block, rows, node[e, k])
            if row == rows:
                if rows == UNKNOWNS - 1:
                    return 0.0, 1, False
                rows += 1
                block.end[row, 0], block.edge_given[row] = node[e, k], False
                modes_to = modes.side[e, EDGE_OF[ka, k], 0] + modes.side[e, EDGE_OF[kb, k], 0]
                block.mode[row] = 0.5 * modes_to - 0.25 * middle
            patch = mesh.elements.patch[e, 6 - ka - kb - k]
            block.edge_given[row] = block.edge_given[row] or (patch >= 0 and quadratic.dirichlet[patch])
    unknowns = 0 if given else 1
    for row in range(rows):
        block.edge_dof[row] = -1 if block.edge_given[row] else unknowns
        unknowns += 0 if block.edge_given[row] else 1
    region = mesh.elements.region[e]  # edges between regions with different offsets are not split
    trial.value[p] = 0.5 * (value_at(trial, region, a) + value_at(trial, region, b)) + middle
    for i in range(count):
        for j in range(2):
            end = a if j == 0 else b
            write_element(mesh, quadratic, 2 * i + j, np.int64(shell[i]), end, p, trial.value[a], rows)
            if not given:
                block.dof[2 * i + j, corner_of(mesh.cavity.new, 2 * i + j, p)] = 0
    before, least = least_energy(mesh, quadratic, 2 * count, unknowns, a, b)
    return (now if block.curve_end.shape[0] > 0 else before) - least, rows, given


@kernel
def weigh_splits_order2(mesh, quadratic, offers, p, floor, nodes):
    """Compute the gains per unknown of splits of edges at `nodes`.

    Row p of the positions is scratch.
    """
    cavity, position = mesh.cavity, mesh.position
    for i in range(len(nodes)):
        v = np.int64(nodes[i])
        count = gather_around(mesh, v, cavity.old)
        for j in range(list_neighbours(mesh, v, count)):
            w = np.int64(cavity.made[j])
            if w < v:
                continue
            shell = list_shell(mesh, count, w)
            if not is_open(mesh, offers, shell, v, w) or not halves_allowed(mesh, shell, v, w, floor):
                continue
            for d in range(3):
                position[p, d] = 0.5 * (position[v, d] + position[w, d])
            gain, rows, _ = gain_of_split(mesh, quadratic, cavity.around_other, shell, v, w, p)
            e = np.int64(cavity.around_other[0])
            offers.gain[e, edge_between(mesh.elements.node, e, v, w)] = max(0.0, gain / rows)


@inner_kernel
def cost_of_collapse(mesh, quadratic, v, w, count, neighbours, least):
    # Return the functional after merging v into w, and the number of unknowns saved.
    # The elements around v must be in `cavity.old`, the neighbours in `cavity.made`. The functional is inf if an
    # element would be worse than `least`.
    block, modes, node = quadratic.block, quadratic.modes, mesh.elements.node
    for row in range(neighbours):
        block.end[row, 0], block.edge_dof[row], block.mode[row] = mesh.cavity.made[row], 0, 0.0
        block.edge_given[row] = False
    new = edges = unknowns = 0
    for i in range(count):
        e = np.int64(mesh.cavity.old[i])
        kv, kw = corner_of(node, e, v), corner_of(node, e, w)
        if kw >= 0:
            for k in range(4):
                if k not in (kv, kw):
                    row = row_of(block, neighbours, node[e, k])
                    block.mode[row], block.edge_dof[row] = modes.side[e, EDGE_OF[kw, k], 0], NOWHERE
                    block.edge_given[row] = modes.dirichlet[e, EDGE_OF[kw, k]]
            continue
        for k in range(4):
            if k != kv and modes.dirichlet[e, EDGE_OF[kv, k]]:
                row = row_of(block, neighbours, node[e, k])
                if block.edge_dof[row] != NOWHERE:
                    block.edge_given[row] = True
        for k in range(4):
            mesh.cavity.new[new, k] = w if k == kv else node[e, k]
        if not element_quality(mesh.position, mesh.cavity.new, new) >= least:
            return np.inf, 1
        new += 1
    for row in range(neighbours):
        if block.end[row, 0] == w or block.edge_dof[row] == NOWHERE:
            continue
        edges += 1
        block.edge_dof[row] = NOWHERE if block.edge_given[row] else unknowns
        unknowns += 0 if block.edge_given[row] else 1
    new = 0
    for i in range(count):
        e = np.int64(mesh.cavity.old[i])
        if corner_of(node, e, w) < 0:
            write_element(mesh, quadratic, new, e, v, w, quadratic.trial.value[v], neighbours)
            new += 1
    return least_energy(mesh, quadratic, new, unknowns, v, v)[1], 1 + neighbours - edges


@inner_kernel
def cheapest_collapse(mesh, quadratic, v, most, floor):
    # Return the least cost per unknown below `most` of a collapse of v, its target, its cost and unknowns.
    # Returned are inf and -1 if no collapse is allowed.
    freedom, cheapest = mesh.freedom, most
    into = np.int64(NOWHERE)
    least_cost, saved = 0.0, 0
    count, worst = gather_around(mesh, v, mesh.cavity.old), 2.0
    _, before, _ = energy_of_old(mesh, quadratic, mesh.cavity.old, count, v, v)
    for i in range(count):
        worst = min(worst, element_quality(mesh.position, mesh.elements.node, np.int64(mesh.cavity.old[i])))
    neighbours = list_neighbours(mesh, v, count)
    for i in range(neighbours if neighbours < UNKNOWNS else 0):
        w = np.int64(mesh.cavity.made[i])
        if freedom.number[w] == INSIDE and freedom.number[v] != INSIDE:
            continue
        least = max(FLAT, min(floor, worst))
        after, unknowns = cost_of_collapse(mesh, quadratic, v, w, count, neighbours, least)
        if unknowns < 1 or not after - before < cheapest * unknowns:
            continue
        if prepare_collapse(mesh, v, w, floor, UNLIMITED)[0] > 0.0:
            cheapest, into = (after - before) / unknowns, w
            least_cost, saved = after - before, unknowns
    return (cheapest if into >= 0 else np.inf), into, least_cost, saved


@kernel
def weigh_collapses_order2(mesh, quadratic, offers, most, floor, nodes):
    for i in range(len(nodes)):
        v = np.int64(nodes[i])
        offers.cost[v] = np.inf
        if offers.removable[v]:
            offers.cost[v] = cheapest_collapse(mesh, quadratic, v, most, floor)[0]


@inner_kernel
def next_collapse(mesh, quadratic, offers, nodes, most, credit, floor):
    # Return a node whose collapse costs less than `most` per unknown and `credit` in all, -1 if none.
    # Returned are the node, its target, cost and unknowns.
    for i in range(len(nodes)):
        v = np.int64(nodes[i])
        if not offers.cost[v] < most:
            break
        if not offers.removable[v]:
            continue
        _, w, cost, unknowns = cheapest_collapse(mesh, quadratic, v, most, floor)
        if w < 0:
            offers.removable[v] = False
        elif cost < credit:
            return v, w, cost, unknowns
    return NOWHERE, NOWHERE, 0.0, 0


@inner_kernel
def merge(mesh, quadratic, v, w, floor):
    count = gather_around(mesh, v, mesh.cavity.old)
    neighbours = list_neighbours(mesh, v, count)
    cost_of_collapse(mesh, quadratic, v, w, count, neighbours, FLAT)
    solve_unknowns(quadratic.block)
    _, old, new = prepare_collapse(mesh, v, w, floor, UNLIMITED)  # the same elements in the same order
    collapse(mesh, v, old, new)
    store_new(mesh, quadratic, new)


@inner_kernel
def insert(mesh, quadratic, offers, a, b, count, given):
    solve_unknowns(quadratic.block)
    trial, p = quadratic.trial, split(mesh, a, b, count)
    value = trial.value[p] if given else trial.value[p] + quadratic.block.correction[0]
    set_new(trial, offers, p, a, b, value, given)
    store_new(mesh, quadratic, 2 * count)


@kernel
def exchange_order2(mesh, quadratic, queue, offers, ends, gains, nodes, state, margin, floor):
    """Split edges, and collapse nodes until as many unknowns are removed.

    `ends` (k, 2), `gains` and `nodes` are sorted as in `exchange`, by gains and costs per unknown. A split is followed
    by collapses that cost less per unknown by the factor `margin`, and together less than the gain of the split, so the
    functional never rises. Returned are the number of splits and the decrease.
    """
    splits, decrease = 0, 0.0
    for i in range(len(ends)):
        a, b = np.int64(ends[i, 0]), np.int64(ends[i, 1])
        if mesh.pool.height[1] < MOST or mesh.pool.height[0] < SCRATCH_ROWS:
            break
        if offers.is_new[a] or offers.is_new[b]:
            continue
        if not offer_is_left(offers, nodes, state, margin, gains[i]):
            break
        count = prepare_split(mesh, a, b, floor)
        if count == 0:
            continue
        p = np.int64(mesh.pool.free_nodes[mesh.pool.height[0] - 1])
        credit, unknowns, given = gain_of_split(mesh, quadratic, mesh.cavity.old, count, a, b, p)
        most = credit / (margin * unknowns)
        if not credit > SHRUNK * gains[i] * unknowns:
            continue
        insert(mesh, quadratic, offers, a, b, count, given)
        splits, decrease = splits + 1, decrease + credit
        before = state[DRIFT]
        state[DRIFT] += unknowns
        while state[DRIFT] > 0:
            v, w, cost, unknowns = next_collapse(mesh, quadratic, offers, nodes[state[AT] :], most, credit, floor)
            if v < 0:
                break
            offers.removable[v] = False
            merge(mesh, quadratic, v, w, floor)
            decrease, credit = decrease - cost, credit - cost
            state[DRIFT] -= unknowns
        if state[DRIFT] > 0 and state[DRIFT] >= before:
            break
    return splits, decrease
