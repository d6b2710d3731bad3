"""Descent of the Ritz functional of a P2 function by moves of nodes.

The unknowns that change with a node are its value and the coefficients of its edges. They are eliminated, so a node
moves to where the minimum over these unknowns is lower. With a law the minimum is that of one step of Newton's method,
by the functional itself.
"""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.functionals import eliminate, substitute
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import BLOCK, HELD, INSIDE, POSITION, UNKNOWNS, VALUE
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES, OPPOSITE, allowed, corner_of, star_quality
from kohonen_adapt.kernels.tetrahedron.polish.cavity_order2 import add_correction
from kohonen_adapt.kernels.tetrahedron.polish.curved_order2 import (
    SHORT,
    follow_surfaces,
    has_curves,
    slivers_at,
)
from kohonen_adapt.kernels.tetrahedron.polish.descend import newton_step, rates_row, tangential, turn_allowed
from kohonen_adapt.kernels.tetrahedron.polish.energy import ROUNDING, source_around, value_at
from kohonen_adapt.kernels.tetrahedron.polish.energy_order2 import add_element, clear
from kohonen_adapt.kernels.tetrahedron.surfaces import slid

EDGE_OF = np.full((4, 4), -1)  # edge between two corners
EDGE_OF[EDGES[:, 0], EDGES[:, 1]] = EDGE_OF[EDGES[:, 1], EDGES[:, 0]] = np.arange(6)
ORDERS = np.column_stack([np.arange(4), OPPOSITE])
EDGES_FROM = EDGE_OF[ORDERS[:, EDGES[:, 0]], ORDERS[:, EDGES[:, 1]]]  # edges between the corners (k, *OPPOSITE[k])


@kernel
def descend_nodes_order2(mesh, quadratic, order, floor):
    """Move nodes in order, and return the decrease of the functional.

    The unknowns that change with a node are eliminated. `floor` is the cube of a quality.
    """
    fall = 0.0
    for node in order:
        fall += move_node(mesh, quadratic, np.int64(node), floor)
    return fall


@inner_kernel
def number_star(mesh, quadratic, v):
    star, block, modes, trial = mesh.star, quadratic.block, quadratic.modes, quadratic.trial
    begin, own, count = star.start[v], trial.value[v], 1
    if star.start[v + 1] - begin > block.local.shape[0]:
        return False
    for row in range(begin, star.start[v + 1]):
        j, e = row - begin, np.int64(star.element[row])
        k, region = corner_of(mesh.elements.node, e, v), mesh.elements.region[e]
        for i in range(10):
            block.dof[j, i] = -1
        block.local[j, 0], block.dof[j, 0] = value_at(trial, region, v) - own, 0
        for i in range(6):
            block.local[j, 4 + i] = modes.side[e, EDGES_FROM[k, i], 0]
        for i in range(3):
            other = star.link[row, i]
            block.local[j, 1 + i] = value_at(trial, region, other) - own
            if modes.dirichlet[e, EDGES_FROM[k, i]]:
                continue
            s = 1
            while s < count and block.end[s, 0] != other:
                s += 1
            if s == count:
                if count == UNKNOWNS:
                    return False
                block.end[s, 0] = other
                count += 1
            block.dof[j, 4 + i] = s
    block.unknowns[0] = count
    return True


@inner_kernel
def derivatives(mesh, quadratic, v, wanted):
    star, trial, block = mesh.star, quadratic.trial, quadratic.block
    magnitude = total = by_x = by_y = by_z = xx = xy = xz = yy = yz = zz = 0.0
    if wanted > VALUE:
        clear(block, block.unknowns[0])
    begin = star.start[v]
    for row in range(begin, star.start[v + 1]):
        region = mesh.elements.region[star.element[row]]
        corners = v, np.int64(star.link[row, 0]), np.int64(star.link[row, 1]), np.int64(star.link[row, 2])
        load = source_around(trial, region, v)
        part = add_element(mesh.position, trial, block, row - begin, region, load, corners, wanted)
        magnitude, total, (x, y, z), h = magnitude + part[0], total + part[1], part[2], part[3]
        by_x, by_y, by_z = by_x + x, by_y + y, by_z + z
        xx, xy, xz, yy, yz, zz = xx + h[0], xy + h[1], xz + h[2], yy + h[3], yz + h[4], zz + h[5]
    return magnitude, total, (by_x, by_y, by_z), (xx, xy, xz, yy, yz, zz)


@inner_kernel
def follow_dirichlet(block, rate, gradient, hessian):
    (gx, gy, gz), (xx, xy, xz, yy, yz, zz), (x, y, z) = gradient, hessian, rate
    rest, mixed, ww = block.rest[0], block.mixed, block.stiffness[0, 0]
    px, py, pz = mixed[0, 0] + 0.5 * ww * x, mixed[0, 1] + 0.5 * ww * y, mixed[0, 2] + 0.5 * ww * z
    for i in range(1, block.unknowns[0]):
        for d in range(3):
            mixed[i, d] += block.stiffness[i, 0] * rate[d]
    return (gx + rest * x, gy + rest * y, gz + rest * z), (
        xx + 2.0 * px * x,
        xy + px * y + py * x,
        xz + px * z + pz * x,
        yy + 2.0 * py * y,
        yz + py * z + pz * y,
        zz + 2.0 * pz * z,
    )


@inner_kernel
def eliminated(block, first, gradient, hessian):
    count, rest, mixed = block.unknowns[0], block.rest, block.mixed
    solved, square = eliminate(block.stiffness, rest, mixed, 3, first, count)
    (gx, gy, gz), (xx, xy, xz, yy, yz, zz) = gradient, hessian
    for i in range(first, count):
        x, y, z = mixed[i, 0], mixed[i, 1], mixed[i, 2]
        gx, gy, gz = gx - x * rest[i], gy - y * rest[i], gz - z * rest[i]
        xx, xy, xz, yy, yz, zz = xx - x * x, xy - x * y, xz - x * z, yy - y * y, yz - y * z, zz - z * z
    return solved, 0.5 * square, (gx, gy, gz), (xx, xy, xz, yy, yz, zz)


@inner_kernel
def move_node(mesh, quadratic, v, floor):
    freedom, trial, block = mesh.constraints.freedom, quadratic.trial, quadratic.block
    given, held = trial.fixed[v], freedom.number[v] == HELD
    first = 1 if given else 0
    if not number_star(mesh, quadratic, v):
        return 0.0
    magnitude, total, gradient, hessian = derivatives(mesh, quadratic, v, BLOCK if held else POSITION)
    if not total < np.inf:  # of elements that fold
        return 0.0
    rate = 0.0, 0.0, 0.0
    if given and not held:
        row = rates_row(mesh.constraints, v)
        rate = trial.rate[row, 0], trial.rate[row, 1], trial.rate[row, 2]
        gradient, hessian = follow_dirichlet(block, rate, gradient, hessian)
    solved, gain, gradient, hessian = eliminated(block, first, gradient, hessian)
    if not solved:
        return 0.0
    take_correction(block, first)
    by_law, further, slivers = has_law(mesh, trial, v), 0.0, 0.0
    on_curve = not held and has_curves(block, v)
    if by_law or on_curve:
        gain = settle(mesh, quadratic, v, first, total)
    if not held:
        if freedom.number[v] != INSIDE:
            gradient, hessian = tangential(mesh, v, gradient, hessian)
        if on_curve:
            slivers, gradient = slivers_at(mesh, quadratic, v), gradient_on_curve(mesh, quadratic, v)
        step, now = newton_step(gradient, hessian), total - gain + slivers
        if -(step[0] * gradient[0] + step[1] * gradient[1] + step[2] * gradient[2]) > ROUNDING * magnitude:
            further = search(mesh, quadratic, v, step, rate, (now, ROUNDING * magnitude), floor, (by_law, on_curve))
    if further > 0.0 or not (by_law or on_curve):
        change_star(mesh, quadratic, v, first)
    return gain + further


@inner_kernel
def has_law(mesh, trial, v):
    for row in range(mesh.star.start[v], mesh.star.start[v + 1]):
        if trial.laws.number[mesh.elements.region[mesh.star.element[row]]] >= 0:
            return True
    return False


@inner_kernel
def settle(mesh, quadratic, v, first, total):
    # Apply the correction of the unknowns if the functional, `total` before, decreases, and return the decrease.
    # Values in the block remain relative to the former value of v, so that their source term is comparable.
    gain = total - corrected(mesh, quadratic, v, first)
    if not gain > 0.0:
        return 0.0
    add_correction(quadratic.block, mesh.star.start[v + 1] - mesh.star.start[v], first, 1.0)
    change_star(mesh, quadratic, v, first)
    return gain


@inner_kernel
def corrected(mesh, quadratic, v, first):
    # Return the functional of the star after the correction of the unknowns, which are not changed.
    block, count = quadratic.block, mesh.star.start[v + 1] - mesh.star.start[v]
    add_correction(block, count, first, 1.0)
    _, total, _, _ = derivatives(mesh, quadratic, v, VALUE)
    add_correction(block, count, first, -1.0)
    return total


@inner_kernel
def search(mesh, quadratic, v, step, rate, now, floor, kind):
    # `now` is the functional with eliminated unknowns, and its rounding error. The result is the decrease by a move,
    # 0 if v stays. After a move `correction` belongs to the new position, and a Dirichlet value has followed.
    position, star, trial, block = mesh.position, mesh.star, quadratic.trial, quadratic.block
    px, py, pz, own = position[v, 0], position[v, 1], position[v, 2], trial.value[v]
    first, relative, (dx, dy, dz) = 1 if trial.fixed[v] else 0, block.local[0, 0], step
    before, (by_law, on_curve) = star_quality(position, star, v, px, py, pz, -np.inf), kind
    for _ in range(HALVINGS + 1):
        x, y, z = slid(position, mesh.constraints, v, dx, dy, dz)
        worst = star_quality(position, star, v, x, y, z, min(floor, before))
        if allowed(worst, before, floor) and turn_allowed(mesh, v, on_curve, x, y, z):
            put(mesh, block, v, (x, y, z), on_curve)
            w = rate[0] * (x - px) + rate[1] * (y - py) + rate[2] * (z - pz)
            set_own(mesh, block, v, relative + w)
            _, total, _, _ = derivatives(mesh, quadratic, v, BLOCK)
            solved, square = eliminate(block.stiffness, block.rest, block.mixed, 0, first, block.unknowns[0])
            least = total - 0.5 * square
            if by_law:
                take_correction(block, first)
                least = corrected(mesh, quadratic, v, first)
            if on_curve:
                least += slivers_at(mesh, quadratic, v)
            gain = now[0] - least
            if solved and gain > now[1]:
                take_correction(block, first)
                trial.value[v] = own + w
                return gain
            put(mesh, block, v, (px, py, pz), on_curve)
            set_own(mesh, block, v, relative)
        dx, dy, dz = 0.5 * dx, 0.5 * dy, 0.5 * dz
    return 0.0


@inner_kernel
def put(mesh, block, v, at, on_curve):
    mesh.position[v, 0], mesh.position[v, 1], mesh.position[v, 2] = at
    if on_curve:
        follow_surfaces(mesh.position, mesh.constraints.surfaces, block, v)


@inner_kernel
def gradient_on_curve(mesh, quadratic, v):
    # by central differences along the surface, since edges follow
    position, other = mesh.position, mesh.star.link[mesh.star.start[v], 0]
    px, py, pz = position[v, 0], position[v, 1], position[v, 2]
    dx, dy, dz = position[other, 0] - px, position[other, 1] - py, position[other, 2] - pz
    h = SHORT * math.sqrt(dx * dx + dy * dy + dz * dz)
    gx = level_after(mesh, quadratic, v, (h, 0.0, 0.0)) - level_after(mesh, quadratic, v, (-h, 0.0, 0.0))
    gy = level_after(mesh, quadratic, v, (0.0, h, 0.0)) - level_after(mesh, quadratic, v, (0.0, -h, 0.0))
    gz = level_after(mesh, quadratic, v, (0.0, 0.0, h)) - level_after(mesh, quadratic, v, (0.0, 0.0, -h))
    return 0.5 * gx / h, 0.5 * gy / h, 0.5 * gz / h


@inner_kernel
def level_after(mesh, quadratic, v, step):
    # functional of the star and its slivers after a step along the surface, which is undone
    position, block = mesh.position, quadratic.block
    before = position[v, 0], position[v, 1], position[v, 2]
    put(mesh, block, v, slid(position, mesh.constraints, v, step[0], step[1], step[2]), True)
    level = derivatives(mesh, quadratic, v, VALUE)[1] + slivers_at(mesh, quadratic, v)
    put(mesh, block, v, before, True)
    return level


@inner_kernel
def set_own(mesh, block, v, w):
    for row in range(mesh.star.start[v + 1] - mesh.star.start[v]):
        block.local[row, 0] = w


@inner_kernel
def take_correction(block, first):
    count = block.unknowns[0]
    for i in range(first, count):
        block.correction[i] = -block.rest[i]
    substitute(block.stiffness, block.correction, first, count)


@inner_kernel
def change_star(mesh, quadratic, v, first):
    star, block, modes = mesh.star, quadratic.block, quadratic.modes
    begin = star.start[v]
    if first == 0:
        quadratic.trial.value[v] += block.correction[0]
    for row in range(begin, star.start[v + 1]):
        e = np.int64(star.element[row])
        k = corner_of(mesh.elements.node, e, v)
        for i in range(3):
            if block.dof[row - begin, 4 + i] >= 0:
                modes.side[e, EDGES_FROM[k, i], 0] += block.correction[block.dof[row - begin, 4 + i]]
