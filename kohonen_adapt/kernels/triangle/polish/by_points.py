"""Functionals of elements with curved sides, or around an axis, by quadrature.

The formulas are those of `descend_higher`, except that the columns of the Jacobian of the quadratic map replace
the edge vectors a - x_v and b - x_v at every point. The columns depend on x_v in the same way as the edge vectors,
because the midside offsets of curved sides stay constant.

Around the axis x = 0 the coefficient is divided by x, and a law depends on |grad u| / x. The energy therefore has
x D in place of the doubled area D, while the source and the flux keep D. The radius x of a point depends linearly
on x_v, so x D also has second derivatives.
"""

from kohonen_adapt.kernels.arrays import (
    COARSE_BLOCK,
    HALF_COEFFICIENT,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    NEAR_AXIS,
    SIXTH_SOURCE,
    VALUE,
)
from kohonen_adapt.kernels.nonlinear import stored
from kohonen_adapt.kernels.numba.compilation import inner_kernel

# Minimum Bernstein coefficient of the Jacobian determinant of a curved element, as a fraction of the determinant with
# straight sides, for accurate quadrature and well-conditioned quadratic elements. On facets of 15 degrees every element
# of quality 0.3, the default floor, satisfies the bound, on facets of 30 degrees every element of quality 0.6.
LEAST = 0.25
SURELY = 1.0 + 1e-9  # safety factor of `LEAST` for rounding, so that an accepted element passes a later check


@inner_kernel
def kind_of(x, ax, bx):
    near = NEAR_AXIS * max(x, x + ax, x + bx)
    first, second, third = x <= near, x + ax <= near, x + bx <= near
    count = (1 if first else 0) + (1 if second else 0) + (1 if third else 0)
    if count == 0:
        return 0
    if count == 1:
        return 1 if first else 2 if second else 3
    return 4 if not first else 5 if not second else 6


@inner_kernel
def gather_bends(shapes, e, k, bend):
    for i in range(3):
        bend[i, 0], bend[i, 1] = shapes.bend[e, (k + i) % 3, 0], shapes.bend[e, (k + i) % 3, 1]


@inner_kernel
def put_bends(shapes, e, k, bend):
    for i in range(3):
        shapes.bend[e, (k + i) % 3, 0], shapes.bend[e, (k + i) % 3, 1] = bend[i, 0], bend[i, 1]
    shapes.special[e] = shapes.around or is_curved(bend)


@inner_kernel
def is_curved(bend):
    for i in range(3):
        if bend[i, 0] != 0.0 or bend[i, 1] != 0.0:
            return True
    return False


@inner_kernel
def is_valid(bend, ax, ay, bx, by):
    """Return True if the Jacobian determinant of an element is surely positive.

    The columns of the Jacobian are affine, so the determinant is quadratic. Its six Bernstein coefficients must exceed
    `LEAST` times the determinant of the element with straight sides. Elements without curved sides are accepted.
    """
    if not is_curved(bend):
        return True
    least = SURELY * LEAST * (ax * by - ay * bx)
    for c in range(3):
        px, py, rx, ry = columns_at(bend, c, ax, ay, bx, by)
        if not px * ry - py * rx > least:
            return False
        ux, uy, wx, wy = columns_at(bend, (c + 1) % 3, ax, ay, bx, by)
        if not 0.5 * (px * wy - py * wx + ux * ry - uy * rx) > least:
            return False
    return True


@inner_kernel
def valid_at(position, bend, v, a, b):
    x, y = position[v, 0], position[v, 1]
    return is_valid(bend, position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y)


@inner_kernel
def columns_at(bend, c, ax, ay, bx, by):
    times = 4.0 if c == 0 else -4.0
    if c == 2:
        px, py = ax + 4.0 * (bend[0, 0] - bend[1, 0]), ay + 4.0 * (bend[0, 1] - bend[1, 1])
    else:
        px, py = ax + times * bend[2, 0], ay + times * bend[2, 1]
    if c == 1:
        rx, ry = bx + 4.0 * (bend[0, 0] - bend[2, 0]), by + 4.0 * (bend[0, 1] - bend[2, 1])
    else:
        rx, ry = bx + times * bend[1, 0], by + times * bend[1, 1]
    return px, py, rx, ry


@inner_kernel
def add_by_points(descent, e, j, local, bend, x, ax, ay, bx, by, wanted):
    trial, block, points, around = descent.trial, descent.block, descent.points, descent.shapes.around
    place, sign, across = block.place, block.sign, block.across
    size, total, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    kind, law, functions = kind_of(x, ax, bx) if around else 0, trial.laws.number[e], points.slope.shape[2]
    load, half = 3.0 * trial.data[e, SIXTH_SOURCE], trial.data[e, HALF_COEFFICIENT]
    flux_x, flux_y = trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y]
    few = law < 0 or wanted == COARSE_BLOCK
    for q in range(0 if few else points.plain, points.plain if few else points.weight.shape[1]):
        share, along, aside, level, radius, lead = points.weight[kind, q], 0.0, 0.0, 0.0, 1.0, 0.0
        px, py, rx, ry = ax, ay, bx, by
        for k in range(3):
            px += points.side[kind, q, k, 1] * bend[k, 0]
            py += points.side[kind, q, k, 1] * bend[k, 1]
            rx += points.side[kind, q, k, 2] * bend[k, 0]
            ry += points.side[kind, q, k, 2] * bend[k, 1]
        if around:
            lead, radius = points.share[kind, q, 0], x + points.share[kind, q, 1] * ax + points.share[kind, q, 2] * bx
            for k in range(3):
                radius += points.side[kind, q, k, 0] * bend[k, 0]
        for i in range(functions):
            along += local[i] * points.slope[kind, q, i, 0]
            aside += local[i] * points.slope[kind, q, i, 1]
            level += local[i] * points.value[kind, q, i]
        doubled, ex, ey, difference = px * ry - py * rx, rx - px, ry - py, along - aside
        inverse = 1.0 / (radius * doubled)
        fall_x, rise_y = radius * ey - lead * doubled, radius * ex  # derivatives of x D
        nx, ny = aside * px - along * rx, aside * py - along * ry
        qx, qy = inverse * nx, inverse * ny
        half_square = 0.5 * (qx * nx + qy * ny)
        weight, bent, rest = share * half * inverse, 0.0, 0.0
        energy = weight * half_square / inverse
        x_x, x_y = difference + qx * fall_x, qy * fall_x
        y_x, y_y = -qx * rise_y, difference - qy * rise_y
        if law >= 0:
            density, rate, hook = stored(trial.laws, law, qx * qx + qy * qy)
            weight, energy = share * rate * inverse, 0.5 * share * density / inverse
            bent = 2.0 * share * hook * inverse
            rest = 0.5 * share * (density - rate * (qx * qx + qy * qy))
        square_x, square_y = qx * x_x + qy * x_y, qx * y_x + qy * y_y
        push, pull, carried = share * (flux_y * nx - flux_x * ny), load * share * level, rest - weight * half_square
        size += energy + abs(push) + abs(pull * doubled)
        total += energy - push - pull * doubled
        by_x += weight * difference * nx - carried * fall_x - share * difference * flux_y + pull * ey
        by_y += weight * difference * ny + carried * rise_y + share * difference * flux_x - pull * ex
        xx += weight * (x_x * x_x + x_y * x_y) + bent * square_x * square_x - 2.0 * carried * lead * ey
        xy += weight * (x_x * y_x + x_y * y_y) + bent * square_x * square_y + carried * lead * ex
        yy += weight * (y_x * y_x + y_y * y_y) + bent * square_y * square_y
        for i in range(functions if wanted > VALUE else 0):
            row = place[j, i]
            if row < 0:
                continue
            g1, g2 = sign[j, i] * points.slope[kind, q, i, 0], sign[j, i] * points.slope[kind, q, i, 1]
            ix, iy, turn, pulled = (
                g2 * px - g1 * rx,
                g2 * py - g1 * ry,
                g1 - g2,
                load * share * points.value[kind, q, i],
            )
            pulled *= sign[j, i]
            across[i, 0], across[i, 1] = ix, iy
            square = qx * ix + qy * iy
            block.rest[row] += weight * (ix * nx + iy * ny) - share * (flux_y * ix - flux_x * iy) - pulled * doubled
            block.mixed[row, 0] += weight * (x_x * ix + x_y * iy + nx * turn) + bent * square_x * square
            block.mixed[row, 0] += pulled * ey - share * flux_y * turn
            block.mixed[row, 1] += weight * (y_x * ix + y_y * iy + ny * turn) + bent * square_y * square
            block.mixed[row, 1] += share * flux_x * turn - pulled * ex
            for other in range(i + 1):
                column = place[j, other]
                if column >= 0:
                    product = weight * (ix * across[other, 0] + iy * across[other, 1])
                    product += bent * square * (qx * across[other, 0] + qy * across[other, 1])
                    block.stiffness[max(row, column), min(row, column)] += product
    return size, total, by_x, by_y, xx, xy, yy
