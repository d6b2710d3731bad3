"""Descent of the Ritz functional of a P2 function by moves of nodes.

The unknowns that change with a node are its value and the coefficients of its edges. They are eliminated, so a node
moves to where the minimum over these unknowns is lower. With a law the minimum is that of one step of Newton's method,
by the functional itself.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.functionals import eliminate, substitute
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import BLOCK, HELD, INSIDE, POSITION, UNKNOWNS, VALUE
from kohonen_adapt.kernels.tetrahedron.geometry import (
    EDGES,
    OPPOSITE,
    allowed,
    corner_of,
    corners_around,
    star_quality,
)
from kohonen_adapt.kernels.tetrahedron.polish.cavity_order2 import add_correction
from kohonen_adapt.kernels.tetrahedron.polish.curved_order2 import (
    SHORT,
    follow_surfaces,
    has_curves,
    slivers_at,
)
from kohonen_adapt.kernels.tetrahedron.polish.descend import (
    follow_value,
    newton_step,
    rates_row,
    tangential,
    turn_allowed,
)
from kohonen_adapt.kernels.tetrahedron.polish.energy import ROUNDING, source_around, value_at
from kohonen_adapt.kernels.tetrahedron.polish.energy_order2 import add_element, clear
from kohonen_adapt.kernels.tetrahedron.surfaces import slid
from kohonen_adapt.kernels.vectors import (
    ZERO,
    ZEROS,
    add_to,
    between,
    dot,
    minus,
    norm,
    plus,
    plus_square,
    plus_times,
    point,
    put,
    times,
)

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
    begin, own = star.start[v], trial.value[v]
    count = 1
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
    magnitude = total = 0.0
    gradient, hessian = ZERO, ZEROS
    if wanted > VALUE:
        clear(block, block.unknowns[0])
    begin = star.start[v]
    for row in range(begin, star.start[v + 1]):
        region, corners = mesh.elements.region[star.element[row]], corners_around(star, row, v)
        load = source_around(trial, region, v)
        part = add_element(mesh.position, trial, block, row - begin, region, load, corners, wanted)
        magnitude, total = magnitude + part[0], total + part[1]
        gradient, hessian = plus(gradient, part[2]), plus(hessian, part[3])
    return magnitude, total, gradient, hessian


@inner_kernel
def follow_dirichlet(block, rate, gradient, hessian):
    for i in range(1, block.unknowns[0]):
        add_to(block.mixed, i, times(block.stiffness[i, 0], rate))
    return follow_value(gradient, block.rest[0], hessian, point(block.mixed, 0), block.stiffness[0, 0], rate)


@inner_kernel
def eliminated(block, first, gradient, hessian):
    count, rest = block.unknowns[0], block.rest
    solved, square = eliminate(block.stiffness, rest, block.mixed, 3, first, count)
    for i in range(first, count):
        mixed = point(block.mixed, i)
        gradient, hessian = plus_times(gradient, -rest[i], mixed), plus_square(hessian, -1.0, mixed)
    return solved, 0.5 * square, gradient, hessian


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
    rate = ZERO
    if given and not held:
        rate = point(trial.rate, rates_row(mesh.constraints, v))
        gradient, hessian = follow_dirichlet(block, rate, gradient, hessian)
    solved, gain, gradient, hessian = eliminated(block, first, gradient, hessian)
    if not solved:
        return 0.0
    take_correction(block, first)
    by_law, on_curve = has_law(mesh, trial, v), not held and has_curves(block, v)
    further = slivers = 0.0
    if by_law or on_curve:
        gain = settle(mesh, quadratic, v, first, total)
    if not held:
        if freedom.number[v] != INSIDE:
            gradient, hessian = tangential(mesh, v, gradient, hessian)
        if on_curve:
            slivers, gradient = slivers_at(mesh, quadratic, v), gradient_on_curve(mesh, quadratic, v)
        step, now = newton_step(gradient, hessian), total - gain + slivers
        if -dot(step, gradient) > ROUNDING * magnitude:
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
    x = point(position, v)
    own, relative = trial.value[v], block.local[0, 0]
    first, (by_law, on_curve) = 1 if trial.fixed[v] else 0, kind
    before = star_quality(position, star, v, x, -np.inf)
    for _ in range(HALVINGS + 1):
        y = slid(position, mesh.constraints, v, step)
        worst = star_quality(position, star, v, y, min(floor, before))
        if allowed(worst, before, floor) and turn_allowed(mesh, v, on_curve, y):
            put_node(mesh, block, v, y, on_curve)
            w = dot(rate, minus(y, x))
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
            put_node(mesh, block, v, x, on_curve)
            set_own(mesh, block, v, relative)
        step = times(0.5, step)
    return 0.0


@inner_kernel
def put_node(mesh, block, v, x, on_curve):
    put(mesh.position, v, x)
    if on_curve:
        follow_surfaces(mesh.position, mesh.constraints.surfaces, block, v)


@inner_kernel
def gradient_on_curve(mesh, quadratic, v):
    # by central differences along the surface, since edges follow
    h = SHORT * norm(between(mesh.position, v, mesh.star.link[mesh.star.start[v], 0]))
    return (
        slope_on_curve(mesh, quadratic, v, (h, 0.0, 0.0), h),
        slope_on_curve(mesh, quadratic, v, (0.0, h, 0.0), h),
        slope_on_curve(mesh, quadratic, v, (0.0, 0.0, h), h),
    )


@inner_kernel
def slope_on_curve(mesh, quadratic, v, step, h):
    change = level_after(mesh, quadratic, v, step) - level_after(mesh, quadratic, v, times(-1.0, step))
    return 0.5 * change / h


@inner_kernel
def level_after(mesh, quadratic, v, step):
    # functional of the star and its slivers after a step along the surface, which is undone
    position, block = mesh.position, quadratic.block
    before = point(position, v)
    put_node(mesh, block, v, slid(position, mesh.constraints, v, step), True)
    level = derivatives(mesh, quadratic, v, VALUE)[1] + slivers_at(mesh, quadratic, v)
    put_node(mesh, block, v, before, True)
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
