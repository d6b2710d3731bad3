"""Equilibrated fluxes from local problems on vertex patches.

Braess and Schoeberl, "Equilibrated residual error estimator for edge elements", Math. Comp. 77 (2008); Ern and
Vohralik, "Polynomial-degree-robust a posteriori estimates in a unified setting", SIAM J. Numer. Anal. 53 (2015).

The elements of a patch are in counter-clockwise order. The patch is closed, or its first and last edge lie on the
boundary. Through edge s the normal flux times the length of the edge is -J/2 + x out of an element and J/2 + x
into the next element at the vertex, and y at the other end of the edge, where J is the jump of the discrete flux.
Equilibrium of the elements determines the means m = (x + y) / 2 up to a constant, the circulation. The tilts
d = (x - y) / 2 are free. Tilts and circulation minimise the energy.
"""

from typing import NamedTuple

from kohonen_adapt.kernels.functionals import eliminate, substitute
from kohonen_adapt.kernels.numba.array_types import B1, I1, I2, R1, R2
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel, record, zeros
from kohonen_adapt.kernels.triangle.geometry import corner_of, twice_area
from kohonen_adapt.kernels.vectors import cross, dot, from_to, xy

NATURAL, GIVEN = -1, -2  # in place of a neighbour at a boundary: zero flux, or Dirichlet values


@record
class FluxData(NamedTuple):
    """Discrete fluxes on t triangles.

    Nodes are counter-clockwise, and a side has the index of the opposite node.
    """

    point: R2  # (n, 2)
    node: I2  # (t, 3)
    neighbour: I2  # (t, 3): element across each side, NATURAL or GIVEN
    outflow: R2  # (t, 3): discrete flux through each side
    source: R1  # (t,)
    reluctivity: R1  # (t,)


@record
class Patch(NamedTuple):
    element: I1  # (w,)
    corner: I1  # (w,): local index of the vertex
    jump: R1  # (w + 2,) J, zero on the boundary
    mean: R1  # (w + 2,) m
    tilt: R1  # (w + 2,) d
    held: B1  # (w + 2,): fixed unknowns, the tilts of all edges followed by the circulation
    matrix: R2  # (w + 2, w + 2)
    load: R1  # (w + 2,)
    gram: R2  # (4, 4): energy products of the four boundary values of an element
    slope: R1  # (4,): energy products with the field of the source
    values: R1  # (4,): outward fluxes at the vertex and the other end, of the right and of the left edge


def patch_scratch(width: int) -> Patch:
    rows = width + 2
    return zeros(Patch, width, width, rows, rows, rows, rows, (rows, rows), rows, (4, 4), 4, 4)


@kernel
def equilibrate(data, patch, seen, correction, imbalance):
    """Add the P1 corrections of all patches to `correction`, shape (t, 3, 2).

    The residual of the equilibrium at every node is stored in `imbalance`, shape (n,). `seen`, shape (t, 3), is
    scratch and False at entry.
    """
    count = data.node.shape[0]
    for closed in (False, True):
        for e in range(count):
            for k in range(3):
                if not seen[e, k] and (closed or data.neighbour[e, (k + 2) % 3] < 0):
                    size = gather_patch(data, e, k, patch, seen)
                    v = data.node[e, k]
                    residual = balance(data, patch, size, closed)
                    imbalance[v] = max(imbalance[v], abs(residual))
                    minimise(data, patch, size, closed)
                    add(data, patch, size, closed, correction)


@inner_kernel
def gather_patch(data, e, k, patch, seen):
    size = 0
    while e >= 0 and not seen[e, k]:
        seen[e, k] = True
        patch.element[size], patch.corner[size] = e, k
        size += 1
        v = data.node[e, k]
        side = (k + 1) % 3
        e, outflow = data.neighbour[e, side], data.outflow[e, side]
        if e >= 0:
            k = corner_of(data.node, e, v)
            patch.jump[size] = outflow + data.outflow[e, (k + 2) % 3]
    if e < 0:
        patch.jump[size] = 0.0
    patch.jump[0] = patch.jump[size]
    return size


@inner_kernel
def balance(data, patch, size, closed):
    for s in range(size + 1):
        patch.tilt[s], patch.held[s] = 0.0, False
    patch.held[size + 1], patch.mean[0] = False, 0.0
    set_means(data, patch, size)
    if closed:
        return patch.mean[size]
    first = patch.element[0]
    right = (patch.corner[0] + 2) % 3
    last = patch.element[size - 1]
    left = (patch.corner[size - 1] + 1) % 3
    natural_start = data.neighbour[first, right] == NATURAL
    natural_end = data.neighbour[last, left] == NATURAL
    begin, finish = 0.5 * data.outflow[first, right], -0.5 * data.outflow[last, left]
    residual = finish - patch.mean[size] - begin if natural_start and natural_end else 0.0
    patch.held[size + 1] = natural_start or natural_end
    if natural_start:
        patch.tilt[0], patch.held[0] = begin, True
        add_to_all(patch.mean, size + 1, begin)
    elif natural_end:
        add_to_all(patch.mean, size + 1, finish - patch.mean[size])
    if natural_end:
        patch.tilt[size], patch.held[size] = finish, True
    return residual


@inner_kernel
def add_to_all(values, count, amount):
    for i in range(count):
        values[i] += amount


@inner_kernel
def set_means(data, patch, size):
    for s in range(size):
        e = patch.element[s]
        a, b, c = data.node[e, 0], data.node[e, 1], data.node[e, 2]
        element_source = data.source[e] * twice_area(data.point, a, b, c) / 6.0
        patch.mean[s + 1] = patch.mean[s] + 0.25 * (patch.jump[s] + patch.jump[s + 1]) - element_source


@inner_kernel
def minimise(data, patch, size, closed):
    edges = size if closed else size + 1
    if closed:
        patch.held[size] = False
    unknowns = edges + 1
    for i in range(unknowns):
        patch.load[i] = 0.0
        for j in range(unknowns):
            patch.matrix[i, j] = 0.0
    for s in range(size):
        left = s + 1 if s + 1 < edges else 0
        set_energy_matrix(data, patch, s)
        set_values(patch, s, left)
        assemble(patch, s, left, edges)
    for i in range(unknowns):
        if patch.held[i]:
            for j in range(unknowns):
                patch.matrix[i, j] = patch.matrix[j, i] = 0.0
            patch.matrix[i, i], patch.load[i] = 1.0, 0.0
    eliminate(patch.matrix, patch.load, patch.matrix, 0, 0, unknowns)
    substitute(patch.matrix, patch.load, 0, unknowns)
    for s in range(edges):
        patch.tilt[s] += patch.load[s]
    add_to_all(patch.mean, size + 1, patch.load[edges])


@inner_kernel
def set_energy_matrix(data, patch, s):
    """Set the matrix and the load of the energy of an element.

    With normal fluxes P at the vertex and Q at the other ends, outward through the right edge r and the left edge l,
    the field at the three nodes is -(P_r c + P_l b) / 2|K|, -Q_r (c - b) / 2|K| and Q_l (c - b) / 2|K|. The vectors b
    and c are the right and the left edge.
    """
    e, k = patch.element[s], patch.corner[s]
    v, u, w = data.node[e, k], data.node[e, (k + 1) % 3], data.node[e, (k + 2) % 3]
    x = xy(data.point, v)
    b, c = from_to(x, data.point, u), from_to(x, data.point, w)
    bb, bc, cc = dot(b, b), dot(b, c), dot(c, c)
    b_rim, c_rim, rim = bc - bb, cc - bc, bb - 2.0 * bc + cc
    gram = patch.gram
    gram[0, 0], gram[1, 1], gram[2, 2], gram[3, 3] = 2.0 * cc, 2.0 * rim, 2.0 * bb, 2.0 * rim
    gram[0, 1] = c_rim
    gram[0, 2] = 2.0 * bc
    gram[0, 3] = -c_rim
    gram[1, 2] = b_rim
    gram[1, 3], gram[2, 3] = -rim, -b_rim
    scale = 1.0 / (24.0 * data.reluctivity[e] * cross(b, c))
    for i in range(4):
        for j in range(i, 4):
            gram[i, j] *= scale
            gram[j, i] = gram[i, j]
    push = data.source[e] / (360.0 * data.reluctivity[e])
    patch.slope[0], patch.slope[2] = 2.0 * push * (bc + cc), 2.0 * push * (bb + bc)
    patch.slope[1], patch.slope[3] = push * (2.0 * b_rim + c_rim), -push * (b_rim + 2.0 * c_rim)


@inner_kernel
def set_values(patch, right, left):
    patch.values[0] = -0.5 * patch.jump[right] - patch.mean[right] - patch.tilt[right]
    patch.values[1] = patch.tilt[right] - patch.mean[right]
    patch.values[2] = -0.5 * patch.jump[left] + patch.mean[left] + patch.tilt[left]
    patch.values[3] = patch.mean[left] - patch.tilt[left]


@inner_kernel
def assemble(patch, right, left, circulation):
    directions = ((-1.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, -1.0), (-1.0, -1.0, 1.0, 1.0))
    unknowns = (right, left, circulation)
    for i in range(3):
        for k in range(4):
            if directions[i][k] == 0.0:
                continue
            total = patch.slope[k]
            for j in range(4):
                total += patch.gram[k, j] * patch.values[j]
            patch.load[unknowns[i]] -= directions[i][k] * total
            for n in range(3):
                for j in range(4):
                    patch.matrix[unknowns[i], unknowns[n]] += directions[i][k] * patch.gram[k, j] * directions[n][j]


@inner_kernel
def add(data, patch, size, closed, correction):
    point = data.point
    for s in range(size):
        e, k = patch.element[s], patch.corner[s]
        k1, k2 = (k + 1) % 3, (k + 2) % 3
        v, u, w = data.node[e, k], data.node[e, k1], data.node[e, k2]
        set_values(patch, s, 0 if closed and s + 1 == size else s + 1)
        scale = -1.0 / twice_area(point, v, u, w)
        for i in range(2):
            b, c = point[u, i] - point[v, i], point[w, i] - point[v, i]
            correction[e, k, i] += scale * (patch.values[0] * c + patch.values[2] * b)
            correction[e, k1, i] += scale * patch.values[1] * (c - b)
            correction[e, k2, i] -= scale * patch.values[3] * (c - b)
