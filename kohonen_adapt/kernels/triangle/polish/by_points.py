"""Functionals of elements with curved sides, or around an axis, by quadrature.

The formulas are those of `descend_higher`, except that the columns of the Jacobian of the quadratic map replace
the edge vectors a - x_v and b - x_v at every point. The columns depend on x_v in the same way as the edge vectors,
because the midside offsets of curved sides stay constant.

Around the axis x = 0 the coefficient is divided by x, and a law depends on |grad u| / x. The energy therefore has
x D in place of the doubled area D, while the source and the flux keep D. The radius x of a point depends linearly
on x_v, so x D also has second derivatives.
"""

from kohonen_adapt.kernels.arrays import NEAR_AXIS
from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import (
    COARSE_BLOCK,
    HALF_COEFFICIENT,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    POSITION,
    SIXTH_SOURCE,
    VALUE,
)

# Minimum Bernstein coefficient of the Jacobian determinant of a curved element, as a fraction of the determinant with
# straight sides, for accurate quadrature and well-conditioned quadratic elements. On facets of 15 degrees every element
# of quality 0.3, the default floor, satisfies the bound, on facets of 30 degrees every element of quality 0.6.
MIN_JACOBIAN = 0.25
SAFETY = 1.0 + 1e-9  # safety factor of `MIN_JACOBIAN` for rounding, so that an accepted element passes a later check


@inner_kernel
def add_by_law(trial, reference, block, e, j, local, ax, ay, bx, by, wanted):
    slope, added, dof, law = reference.slope, block.added, block.dof, trial.laws.number[e]
    magnitude, total, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    functions, ex, ey = slope.shape[1], bx - ax, by - ay
    doubled = ax * by - ay * bx
    inverse = 1.0 / doubled
    flux_x, flux_y = trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y]
    for i in range(functions if wanted > VALUE else 0):
        for other in range(functions + 3):
            added[i, other] = 0.0
    coarse = wanted == COARSE_BLOCK
    for q in range(0 if coarse else reference.plain, reference.plain if coarse else slope.shape[0]):
        w, slope_1, slope_2 = reference.weight[q], 0.0, 0.0
        for i in range(functions):
            slope_1 += local[i] * slope[q, i, 0]
            slope_2 += local[i] * slope[q, i, 1]
        nx, ny = slope_2 * ax - slope_1 * bx, slope_2 * ay - slope_1 * by
        qx, qy = inverse * nx, inverse * ny
        density, rate, curve = energy_density(trial.laws, law, qx * qx + qy * qy)
        energy = 0.5 * w * doubled * density
        push = w * (flux_y * nx - flux_x * ny)
        magnitude += energy + abs(push)
        total += energy - push
        if wanted == VALUE:
            continue
        weight, curve_weight = w * rate * inverse, 2.0 * w * curve * inverse
        fx, fy = weight * nx - w * flux_y, weight * ny + w * flux_x
        qa, qb = qx * ax + qy * ay, qx * bx + qy * by
        t11 = weight * (bx * bx + by * by) + curve_weight * qb * qb
        t12 = -weight * (ax * bx + ay * by) - curve_weight * qa * qb
        t22 = weight * (ax * ax + ay * ay) + curve_weight * qa * qa
        rest_1, rest_2 = -fx * bx - fy * by, fx * ax + fy * ay
        for i in range(functions):
            if dof[j, i] < 0:
                continue
            g1, g2 = slope[q, i, 0], slope[q, i, 1]
            added[i, functions] += g1 * rest_1 + g2 * rest_2
            h1, h2 = t11 * g1 + t12 * g2, t12 * g1 + t22 * g2
            for other in range(i + 1):
                added[i, other] += h1 * slope[q, other, 0] + h2 * slope[q, other, 1]
        if wanted < POSITION:
            continue
        difference = slope_1 - slope_2
        # dn/dx - q dD/dx and dn/dy - q dD/dy with the doubled area D
        x_x, x_y = difference + qx * ey, qy * ey
        y_x, y_y = -qx * ex, difference - qy * ex
        square_x, square_y = qx * x_x + qy * x_y, qx * y_x + qy * y_y
        area_factor = w * (rate * (qx * qx + qy * qy) - 0.5 * density)
        by_x += weight * difference * nx + area_factor * ey - w * difference * flux_y
        by_y += weight * difference * ny - area_factor * ex + w * difference * flux_x
        xx += weight * (x_x * x_x + x_y * x_y) + curve_weight * square_x * square_x
        xy += weight * (x_x * y_x + x_y * y_y) + curve_weight * square_x * square_y
        yy += weight * (y_x * y_x + y_y * y_y) + curve_weight * square_y * square_y
        x_1, x_2 = weight * x_x + curve_weight * square_x * qx, weight * x_y + curve_weight * square_x * qy
        y_1, y_2 = weight * y_x + curve_weight * square_y * qx, weight * y_y + curve_weight * square_y * qy
        mixed_x_1, mixed_x_2 = fx - x_1 * bx - x_2 * by, x_1 * ax + x_2 * ay - fx
        mixed_y_1, mixed_y_2 = fy - y_1 * bx - y_2 * by, y_1 * ax + y_2 * ay - fy
        for i in range(functions):
            added[i, functions + 1] += slope[q, i, 0] * mixed_x_1 + slope[q, i, 1] * mixed_x_2
            added[i, functions + 2] += slope[q, i, 0] * mixed_y_1 + slope[q, i, 1] * mixed_y_2
    if wanted > VALUE:
        put_added(block, j, functions)
    return magnitude, total, by_x, by_y, xx, xy, yy


@inner_kernel
def put_added(block, j, functions):
    dof, sign, added = block.dof, block.sign, block.added
    for i in range(functions):
        row = dof[j, i]
        if row < 0:
            continue
        block.rest[row] += sign[j, i] * added[i, functions]
        block.mixed[row, 0] += sign[j, i] * added[i, functions + 1]
        block.mixed[row, 1] += sign[j, i] * added[i, functions + 2]
        for other in range(i + 1):
            column = dof[j, other]
            if column >= 0:
                block.stiffness[max(row, column), min(row, column)] += sign[j, i] * sign[j, other] * added[i, other]


@inner_kernel
def axis_kind(x, ax, bx):
    near = NEAR_AXIS * max(x, x + ax, x + bx)
    first, second, third = x <= near, x + ax <= near, x + bx <= near
    count = (1 if first else 0) + (1 if second else 0) + (1 if third else 0)
    if count == 0:
        return 0
    if count == 1:
        return 1 if first else 2 if second else 3
    return 4 if not first else 5 if not second else 6


@inner_kernel
def gather_offsets(shapes, e, k, offset):
    for i in range(3):
        offset[i, 0], offset[i, 1] = shapes.offset[e, (k + i) % 3, 0], shapes.offset[e, (k + i) % 3, 1]


@inner_kernel
def put_offsets(shapes, e, k, offset):
    for i in range(3):
        shapes.offset[e, (k + i) % 3, 0], shapes.offset[e, (k + i) % 3, 1] = offset[i, 0], offset[i, 1]
    shapes.special[e] = shapes.around or is_curved(offset)


@inner_kernel
def is_curved(offset):
    for i in range(3):
        if offset[i, 0] != 0.0 or offset[i, 1] != 0.0:
            return True
    return False


@inner_kernel
def is_valid(offset, ax, ay, bx, by):
    """Return True if the Jacobian determinant of an element is surely positive.

    The columns of the Jacobian are affine, so the determinant is quadratic. Its six Bernstein coefficients must exceed
    `MIN_JACOBIAN` times the determinant of the element with straight sides. Elements without curved sides are accepted.
    """
    if not is_curved(offset):
        return True
    least = SAFETY * MIN_JACOBIAN * (ax * by - ay * bx)
    for c in range(3):
        px, py, rx, ry = jacobian_at(offset, c, ax, ay, bx, by)
        if not px * ry - py * rx > least:
            return False
        ux, uy, wx, wy = jacobian_at(offset, (c + 1) % 3, ax, ay, bx, by)
        if not 0.5 * (px * wy - py * wx + ux * ry - uy * rx) > least:
            return False
    return True


@inner_kernel
def valid_at(position, offset, v, a, b):
    x, y = position[v, 0], position[v, 1]
    return is_valid(offset, position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y)


@inner_kernel
def jacobian_at(offset, c, ax, ay, bx, by):
    times = 4.0 if c == 0 else -4.0
    if c == 2:
        px, py = ax + 4.0 * (offset[0, 0] - offset[1, 0]), ay + 4.0 * (offset[0, 1] - offset[1, 1])
    else:
        px, py = ax + times * offset[2, 0], ay + times * offset[2, 1]
    if c == 1:
        rx, ry = bx + 4.0 * (offset[0, 0] - offset[2, 0]), by + 4.0 * (offset[0, 1] - offset[2, 1])
    else:
        rx, ry = bx + times * offset[1, 0], by + times * offset[1, 1]
    return px, py, rx, ry


@inner_kernel
def add_by_points(descent, e, j, local, offset, x, ax, ay, bx, by, wanted):
    trial, block, points, around = descent.trial, descent.block, descent.points, descent.shapes.around
    dof, sign, across = block.dof, block.sign, block.across
    magnitude, total, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    kind, law, functions = axis_kind(x, ax, bx) if around else 0, trial.laws.number[e], points.slope.shape[2]
    load, half = 3.0 * trial.data[e, SIXTH_SOURCE], trial.data[e, HALF_COEFFICIENT]
    flux_x, flux_y = trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y]
    few = law < 0 or wanted == COARSE_BLOCK
    for q in range(0 if few else points.plain, points.plain if few else points.weight.shape[1]):
        w, slope_1, slope_2, level, radius, lead = points.weight[kind, q], 0.0, 0.0, 0.0, 1.0, 0.0
        px, py, rx, ry = ax, ay, bx, by
        for k in range(3):
            px += points.side[kind, q, k, 1] * offset[k, 0]
            py += points.side[kind, q, k, 1] * offset[k, 1]
            rx += points.side[kind, q, k, 2] * offset[k, 0]
            ry += points.side[kind, q, k, 2] * offset[k, 1]
        if around:
            lead, radius = points.share[kind, q, 0], x + points.share[kind, q, 1] * ax + points.share[kind, q, 2] * bx
            for k in range(3):
                radius += points.side[kind, q, k, 0] * offset[k, 0]
        for i in range(functions):
            slope_1 += local[i] * points.slope[kind, q, i, 0]
            slope_2 += local[i] * points.slope[kind, q, i, 1]
            level += local[i] * points.value[kind, q, i]
        doubled, ex, ey, difference = px * ry - py * rx, rx - px, ry - py, slope_1 - slope_2
        inverse = 1.0 / (radius * doubled)
        fall_x, rise_y = radius * ey - lead * doubled, radius * ex  # derivatives of x D
        nx, ny = slope_2 * px - slope_1 * rx, slope_2 * py - slope_1 * ry
        qx, qy = inverse * nx, inverse * ny
        half_square = 0.5 * (qx * nx + qy * ny)
        weight, curve_weight, rest = w * half * inverse, 0.0, 0.0
        energy = weight * half_square / inverse
        x_x, x_y = difference + qx * fall_x, qy * fall_x
        y_x, y_y = -qx * rise_y, difference - qy * rise_y
        if law >= 0:
            density, rate, curve = energy_density(trial.laws, law, qx * qx + qy * qy)
            weight, energy = w * rate * inverse, 0.5 * w * density / inverse
            curve_weight = 2.0 * w * curve * inverse
            rest = 0.5 * w * (density - rate * (qx * qx + qy * qy))
        square_x, square_y = qx * x_x + qy * x_y, qx * y_x + qy * y_y
        push, pull, area_factor = w * (flux_y * nx - flux_x * ny), load * w * level, rest - weight * half_square
        magnitude += energy + abs(push) + abs(pull * doubled)
        total += energy - push - pull * doubled
        by_x += weight * difference * nx - area_factor * fall_x - w * difference * flux_y + pull * ey
        by_y += weight * difference * ny + area_factor * rise_y + w * difference * flux_x - pull * ex
        xx += weight * (x_x * x_x + x_y * x_y) + curve_weight * square_x * square_x - 2.0 * area_factor * lead * ey
        xy += weight * (x_x * y_x + x_y * y_y) + curve_weight * square_x * square_y + area_factor * lead * ex
        yy += weight * (y_x * y_x + y_y * y_y) + curve_weight * square_y * square_y
        for i in range(functions if wanted > VALUE else 0):
            row = dof[j, i]
            if row < 0:
                continue
            g1, g2 = sign[j, i] * points.slope[kind, q, i, 0], sign[j, i] * points.slope[kind, q, i, 1]
            ix, iy, turn, pulled = (
                g2 * px - g1 * rx,
                g2 * py - g1 * ry,
                g1 - g2,
                load * w * points.value[kind, q, i],
            )
            pulled *= sign[j, i]
            across[i, 0], across[i, 1] = ix, iy
            square = qx * ix + qy * iy
            block.rest[row] += weight * (ix * nx + iy * ny) - w * (flux_y * ix - flux_x * iy) - pulled * doubled
            block.mixed[row, 0] += weight * (x_x * ix + x_y * iy + nx * turn) + curve_weight * square_x * square
            block.mixed[row, 0] += pulled * ey - w * flux_y * turn
            block.mixed[row, 1] += weight * (y_x * ix + y_y * iy + ny * turn) + curve_weight * square_y * square
            block.mixed[row, 1] += w * flux_x * turn - pulled * ex
            for other in range(i + 1):
                column = dof[j, other]
                if column >= 0:
                    product = weight * (ix * across[other, 0] + iy * across[other, 1])
                    product += curve_weight * square * (qx * across[other, 0] + qy * across[other, 1])
                    block.stiffness[max(row, column), min(row, column)] += product
    return magnitude, total, by_x, by_y, xx, xy, yy
