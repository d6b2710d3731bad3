"""Exchange of nodes at order 2, ranked by the functional per unknown.

A node in the middle of edge ab has the value (u_a + u_b) / 2 + m_ab, the halves have the coefficient m_ab / 4, and the
edge to c has (m_ac + m_bc) / 2 - m_ab / 4. The function does not change, so the gain of a split is that of the
elimination of the new unknowns. A collapse eliminates the coefficients of new edges. A split adds as many unknowns as
the node has edges, a collapse saves 1 + the edges of the node - the new edges.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import UNKNOWNS
from kohonen_adapt.kernels.tetrahedron.geometry import corner_of, edge_of, element_quality
from kohonen_adapt.kernels.tetrahedron.polish.cavity_order2 import energy_of_old, least_energy
from kohonen_adapt.kernels.tetrahedron.polish.energy import value_at
from kohonen_adapt.kernels.tetrahedron.polish.star import EDGE_OF
from kohonen_adapt.kernels.tetrahedron.surgery import NOWHERE


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
        v = p if node[e, k] == end else node[e, k]
        mesh.cavity.new[i, k], block.dof[i, k] = v, -1
        block.local[i, k] = value_at(quadratic.trial, mesh.cavity.region[i], v) - own
    for k in range(6):
        first, second = edge_of(node, e, k)
        if first != end and second != end:
            block.local[i, 4 + k] = modes.side[e, k, 0]
            block.dof[i, 4 + k] = -1
            block.given[i, k] = modes.dirichlet[e, k]
            continue
        row = row_of(block, rows, second if first == end else first)
        block.local[i, 4 + k], block.dof[i, 4 + k] = block.mode[row], block.edge_dof[row]
        block.given[i, k] = block.edge_given[row]


@inner_kernel
def gain_of_split_order2(mesh, quadratic, shell, count, a, b, p):
    # Return the gain of node p in the middle of edge ab, the number of its edges, and True if its value is given.
    # The position of p must be set. The elements are written to `cavity.new`, as by `prepare_split`.
    block, modes, trial, node = quadratic.block, quadratic.modes, quadratic.trial, mesh.elements.node
    # the halves of curved elements do not contain the function
    now = energy_of_old(mesh, quadratic, shell, count, a, b)[1] if block.curve_end.shape[0] > 0 else 0.0
    e = shell[0]
    ab = EDGE_OF[corner_of(node, e, a), corner_of(node, e, b)]
    middle, given = modes.side[e, ab, 0], modes.dirichlet[e, ab]
    rows = 2
    block.end[0, 0], block.end[1, 0] = a, b
    for row in range(2):
        block.mode[row] = 0.25 * middle
        block.edge_given[row] = given
    for i in range(count):
        e = shell[i]
        ka, kb = corner_of(node, e, a), corner_of(node, e, b)
        for k in range(4):
            if k in (ka, kb):
                continue
            row = row_of(block, rows, node[e, k])
            if row == rows:
                if rows == UNKNOWNS - 1:
                    return 0.0, 1, False
                rows += 1
                block.end[row, 0] = node[e, k]
                block.edge_given[row] = False
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
            write_element(mesh, quadratic, 2 * i + j, shell[i], end, p, trial.value[a], rows)
            if not given:
                block.dof[2 * i + j, corner_of(mesh.cavity.new, 2 * i + j, p)] = 0
    before, least = least_energy(mesh, quadratic, 2 * count, unknowns, a, b)
    return (now if block.curve_end.shape[0] > 0 else before) - least, rows, given


@inner_kernel
def energy_merged_order2(mesh, quadratic, v, w, count, neighbours, least):
    # Return the functional after merging v into w, and the number of unknowns saved.
    # The elements around v must be in `cavity.old`, the neighbours in `cavity.made`. The functional is inf if an
    # element would be worse than `least`.
    block, modes, node = quadratic.block, quadratic.modes, mesh.elements.node
    for row in range(neighbours):
        block.end[row, 0] = mesh.cavity.made[row]
        block.edge_dof[row] = 0
        block.mode[row] = 0.0
        block.edge_given[row] = False
    new = edges = unknowns = 0
    for i in range(count):
        e = mesh.cavity.old[i]
        kv, kw = corner_of(node, e, v), corner_of(node, e, w)
        if kw >= 0:
            for k in range(4):
                if k not in (kv, kw):
                    row = row_of(block, neighbours, node[e, k])
                    block.mode[row] = modes.side[e, EDGE_OF[kw, k], 0]
                    block.edge_dof[row] = NOWHERE
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
        e = mesh.cavity.old[i]
        if corner_of(node, e, w) < 0:
            write_element(mesh, quadratic, new, e, v, w, quadratic.trial.value[v], neighbours)
            new += 1
    return least_energy(mesh, quadratic, new, unknowns, v, v)[1], 1 + neighbours - edges
