"""Energy of a nonlinear B-H law on elements with straight sides.

The formulas are those of `descend_higher`. First derivatives by the coefficients are linear in the gradients (g1,
g2) of the functions on the reference triangle, second derivatives are bilinear. Two or three numbers per
quadrature point therefore serve all functions, which keeps the many points of a law cheap.
"""

from kohonen_adapt.kernels.arrays import COARSE_BLOCK, HALF_FLUX_X, HALF_FLUX_Y, PLACE, VALUE
from kohonen_adapt.kernels.nonlinear import stored
from kohonen_adapt.kernels.numba.compilation import inner_kernel


@inner_kernel
def add_by_law(trial, reference, block, e, j, local, ax, ay, bx, by, wanted):
    slope, added, place, law = reference.slope, block.added, block.place, trial.laws.number[e]
    size, total, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    functions, ex, ey = slope.shape[1], bx - ax, by - ay
    doubled = ax * by - ay * bx
    inverse = 1.0 / doubled
    flux_x, flux_y = trial.data[e, HALF_FLUX_X], trial.data[e, HALF_FLUX_Y]
    for i in range(functions if wanted > VALUE else 0):
        for other in range(functions + 3):
            added[i, other] = 0.0
    coarse = wanted == COARSE_BLOCK
    for q in range(0 if coarse else reference.plain, reference.plain if coarse else slope.shape[0]):
        share, along, aside = reference.weight[q], 0.0, 0.0
        for i in range(functions):
            along += local[i] * slope[q, i, 0]
            aside += local[i] * slope[q, i, 1]
        nx, ny = aside * ax - along * bx, aside * ay - along * by
        qx, qy = inverse * nx, inverse * ny
        density, rate, bend = stored(trial.laws, law, qx * qx + qy * qy)
        energy = 0.5 * share * doubled * density
        push = share * (flux_y * nx - flux_x * ny)
        size += energy + abs(push)
        total += energy - push
        if wanted == VALUE:
            continue
        weight, bent = share * rate * inverse, 2.0 * share * bend * inverse
        fx, fy = weight * nx - share * flux_y, weight * ny + share * flux_x
        qa, qb = qx * ax + qy * ay, qx * bx + qy * by
        t11 = weight * (bx * bx + by * by) + bent * qb * qb
        t12 = -weight * (ax * bx + ay * by) - bent * qa * qb
        t22 = weight * (ax * ax + ay * ay) + bent * qa * qa
        rest_1, rest_2 = -fx * bx - fy * by, fx * ax + fy * ay
        for i in range(functions):
            if place[j, i] < 0:
                continue
            g1, g2 = slope[q, i, 0], slope[q, i, 1]
            added[i, functions] += g1 * rest_1 + g2 * rest_2
            h1, h2 = t11 * g1 + t12 * g2, t12 * g1 + t22 * g2
            for other in range(i + 1):
                added[i, other] += h1 * slope[q, other, 0] + h2 * slope[q, other, 1]
        if wanted < PLACE:
            continue
        difference = along - aside
        # dn/dx - q dD/dx and dn/dy - q dD/dy with the doubled area D
        x_x, x_y = difference + qx * ey, qy * ey
        y_x, y_y = -qx * ex, difference - qy * ex
        square_x, square_y = qx * x_x + qy * x_y, qx * y_x + qy * y_y
        carried = share * (rate * (qx * qx + qy * qy) - 0.5 * density)  # factor of the derivatives of the area
        by_x += weight * difference * nx + carried * ey - share * difference * flux_y
        by_y += weight * difference * ny - carried * ex + share * difference * flux_x
        xx += weight * (x_x * x_x + x_y * x_y) + bent * square_x * square_x
        xy += weight * (x_x * y_x + x_y * y_y) + bent * square_x * square_y
        yy += weight * (y_x * y_x + y_y * y_y) + bent * square_y * square_y
        x_1, x_2 = weight * x_x + bent * square_x * qx, weight * x_y + bent * square_x * qy
        y_1, y_2 = weight * y_x + bent * square_y * qx, weight * y_y + bent * square_y * qy
        mixed_x_1, mixed_x_2 = fx - x_1 * bx - x_2 * by, x_1 * ax + x_2 * ay - fx
        mixed_y_1, mixed_y_2 = fy - y_1 * bx - y_2 * by, y_1 * ax + y_2 * ay - fy
        for i in range(functions):
            added[i, functions + 1] += slope[q, i, 0] * mixed_x_1 + slope[q, i, 1] * mixed_x_2
            added[i, functions + 2] += slope[q, i, 0] * mixed_y_1 + slope[q, i, 1] * mixed_y_2
    if wanted > VALUE:
        put_added(block, j, functions)
    return size, total, by_x, by_y, xx, xy, yy


@inner_kernel
def put_added(block, j, functions):
    place, sign, added = block.place, block.sign, block.added
    for i in range(functions):
        row = place[j, i]
        if row < 0:
            continue
        block.rest[row] += sign[j, i] * added[i, functions]
        block.mixed[row, 0] += sign[j, i] * added[i, functions + 1]
        block.mixed[row, 1] += sign[j, i] * added[i, functions + 2]
        for other in range(i + 1):
            column = place[j, other]
            if column >= 0:
                block.stiffness[max(row, column), min(row, column)] += sign[j, i] * sign[j, other] * added[i, other]
