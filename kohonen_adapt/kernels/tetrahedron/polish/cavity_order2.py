"""P2 functions on the elements that surgery removes and inserts.

Every element has the coefficients of its own edges. Edges of new elements are those of removed elements, or new. The
coefficients of new edges are eliminated, with all other unknowns fixed, and stored when the elements are.
"""

import numpy as np

from kohonen_adapt.kernels.functionals import clear, eliminate, substitute
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import BLOCK, UNKNOWNS, VALUE
from kohonen_adapt.kernels.tetrahedron.geometry import corners_of, edge_of, gather_edge
from kohonen_adapt.kernels.tetrahedron.polish.energy import source_along, value_at
from kohonen_adapt.kernels.tetrahedron.polish.energy_order2 import add_element


@inner_kernel
def energy_of_old(mesh, quadratic, old, count, a, b):
    # Return magnitude and functional of the elements `old`, and its minimum by edge ab.
    # The source is that along the edge.
    trial, modes, block, node = quadratic.trial, quadratic.modes, quadratic.block, mesh.elements.node
    own = trial.value[a]
    magnitude = total = 0.0
    clear(block, 1)
    for i in range(count):
        e = old[i]
        region = mesh.elements.region[e]
        for k in range(4):
            block.local[i, k] = value_at(trial, region, node[e, k]) - own
            block.dof[i, k] = -1
        for k in range(6):
            p, q = edge_of(node, e, k)
            is_removed = ((p == a and q == b) or (p == b and q == a)) and not modes.dirichlet[e, k]
            block.local[i, 4 + k] = modes.side[e, k, 0]
            block.dof[i, 4 + k] = 0 if is_removed else -1
        load = source_along(trial, region, a, b)
        part = add_element(mesh.position, trial, block, i, region, load, corners_of(node, e), BLOCK)
        magnitude, total = magnitude + part[0], total + part[1]
    gain = 0.5 * block.rest[0] * block.rest[0] / block.stiffness[0, 0] if block.stiffness[0, 0] > 0.0 else 0.0
    return magnitude, total, total - gain


@inner_kernel
def least_energy(mesh, quadratic, count, unknowns, a, b):
    # Return the functional of the elements to insert, and its minimum over the unknowns, inf if this fails.
    # With a law this is the functional after one step of Newton's method.
    block = quadratic.block
    block.unknowns[0] = unknowns
    clear(block, unknowns)
    total = energy_of_new(mesh, quadratic, count, a, b, BLOCK if unknowns > 0 else VALUE)
    solved, square = eliminate(block.stiffness, block.rest, block.mixed, 0, 0, unknowns)
    if not solved:
        return total, np.inf
    if unknowns == 0 or not has_law(mesh, quadratic, count):
        return total, total - 0.5 * square
    solve_unknowns(block)
    add_correction(block, count, 1.0)
    after = energy_of_new(mesh, quadratic, count, a, b, VALUE)
    add_correction(block, count, -1.0)
    return total, (after if after <= total else np.inf)


@inner_kernel
def energy_of_new(mesh, quadratic, count, a, b, wanted):
    trial, total = quadratic.trial, 0.0
    for i in range(count):
        region = mesh.cavity.region[i]
        load, corners = source_along(trial, region, a, b), corners_of(mesh.cavity.new, i)
        total += add_element(mesh.position, trial, quadratic.block, i, region, load, corners, wanted)[1]
    return total


@inner_kernel
def has_law(mesh, quadratic, count):
    for i in range(count):
        if quadratic.trial.laws.number[mesh.cavity.region[i]] >= 0:
            return True
    return False


@inner_kernel
def add_correction(block, count, times):
    for i in range(count):
        for k in range(10):
            dof = block.dof[i, k]
            if dof >= 0:
                block.local[i, k] += times * block.correction[dof]


@inner_kernel
def find_edge(block, edges, p, q):
    low, high = min(p, q), max(p, q)
    row = 0
    while row < edges and not (block.end[row, 0] == low and block.end[row, 1] == high):
        row += 1
    return row


@inner_kernel
def list_edges(mesh, quadratic, count):
    # List the edges of the elements to remove, and return their number, -1 if too many.
    block, modes, node = quadratic.block, quadratic.modes, mesh.elements.node
    edges = 0
    for i in range(count):
        e = mesh.cavity.old[i]
        for k in range(6):
            p, q = edge_of(node, e, k)
            if find_edge(block, edges, p, q) < edges:
                continue
            if edges == UNKNOWNS // 2:
                return -1
            block.end[edges, 0], block.end[edges, 1] = min(p, q), max(p, q)
            block.mode[edges] = modes.side[e, k, 0]
            block.edge_dof[edges] = -1
            block.edge_given[edges] = modes.dirichlet[e, k]
            edges += 1
    return edges


@inner_kernel
def gather_new(mesh, quadratic, count, known, own, base):
    # Gather the elements to insert, and return the numbers of edges and of unknowns.
    # New edges follow the `known` edges, and have unknown coefficients. `base` is a new edge on a patch with linear
    # Dirichlet values, (-1, -1) for none.
    block, node = quadratic.block, mesh.cavity.new
    edges, unknowns = known, 0
    for i in range(count):
        region = mesh.cavity.region[i]
        for k in range(4):
            block.local[i, k] = value_at(quadratic.trial, region, node[i, k]) - own
            block.dof[i, k] = -1
        for k in range(6):
            p, q = edge_of(node, i, k)
            row = find_edge(block, edges, p, q)
            if row == edges:
                given = min(p, q) == min(base[0], base[1]) and max(p, q) == max(base[0], base[1])
                block.end[row, 0], block.end[row, 1] = min(p, q), max(p, q)
                block.mode[row] = 0.0
                block.edge_given[row] = given
                block.edge_dof[row] = -1 if given else unknowns
                edges, unknowns = edges + 1, unknowns + (0 if given else 1)
            block.local[i, 4 + k], block.dof[i, 4 + k] = block.mode[row], block.edge_dof[row]
            block.given[i, k] = block.edge_given[row]
    return edges, unknowns


@inner_kernel
def are_new(mesh, block, known, edges):
    for row in range(known, edges):
        if gather_edge(mesh, block.end[row, 0], block.end[row, 1], mesh.cavity.around_other) != 0:
            return False
    return True


@inner_kernel
def solve_unknowns(block):
    count = block.unknowns[0]
    for i in range(count):
        block.correction[i] = -block.rest[i]
    substitute(block.stiffness, block.correction, 0, count)


@inner_kernel
def store_new(mesh, quadratic, count):
    block, modes = quadratic.block, quadratic.modes
    for i in range(count):
        e = mesh.cavity.made[i]
        for k in range(6):
            mode, dof = block.local[i, 4 + k], block.dof[i, 4 + k]
            modes.side[e, k, 0] = mode + block.correction[dof] if dof >= 0 else mode
            modes.dirichlet[e, k] = block.given[i, k]
