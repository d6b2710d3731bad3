"""Energy of a nonlinear B-H law on elements with straight sides.

The formulas are those of `descend_higher`. First derivatives by the coefficients are linear in the gradients (g1,
g2) of the functions on the reference triangle, second derivatives are bilinear. Two or three numbers per
quadrature point therefore serve all functions, which keeps the many points of a law cheap.
"""

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import COARSE_BLOCK, HALF_FLUX_X, HALF_FLUX_Y, POSITION, VALUE


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
