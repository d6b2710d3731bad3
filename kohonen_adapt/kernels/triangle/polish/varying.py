"""Mean fluxes and loads of polynomial data in triangles."""

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import (
    CENTRE_X,
    CENTRE_Y,
    CONSTANTS,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    RATES_X,
    RATES_Y,
    SOURCE_TERMS,
    VALUE,
    X_BY_X,
    X_BY_Y,
    Y_BY_X,
    Y_BY_Y,
)
from kohonen_adapt.kernels.triangle.polish.by_points import axis_kind


@inner_kernel
def half_flux(data, e, x, y, ax, ay, bx, by):
    """Return half the mean flux over the triangle of (x, y) and (x, y) + a, b."""
    flux_x, flux_y = data[e, HALF_FLUX_X], data[e, HALF_FLUX_Y]
    if data.shape[1] > CONSTANTS:
        cx, cy = x + (ax + bx) / 3.0 - data[e, CENTRE_X], y + (ay + by) / 3.0 - data[e, CENTRE_Y]
        xx = 0.5 * cx * cx + (ax * ax + bx * bx - ax * bx) / 36.0
        xy = cx * cy + (2.0 * (ax * ay + bx * by) - ax * by - ay * bx) / 36.0
        yy = 0.5 * cy * cy + (ay * ay + by * by - ay * by) / 36.0
        flux_x += increase(data, e, RATES_X, cx, cy, xx, xy, yy)
        flux_y += increase(data, e, RATES_Y, cx, cy, xx, xy, yy)
    return flux_x, flux_y


@inner_kernel
def half_flux_rates(data, e, x, y, ax, ay, bx, by):
    px = x + 0.25 * (ax + bx) - data[e, CENTRE_X]
    py = y + 0.25 * (ay + by) - data[e, CENTRE_Y]
    x_by_x = increase(data, e, RATES_X, 1.0, 0.0, px, py, 0.0) / 3.0
    x_by_y = increase(data, e, RATES_X, 0.0, 1.0, 0.0, px, py) / 3.0
    y_by_x = increase(data, e, RATES_Y, 1.0, 0.0, px, py, 0.0) / 3.0
    y_by_y = increase(data, e, RATES_Y, 0.0, 1.0, 0.0, px, py) / 3.0
    return x_by_x, x_by_y, y_by_x, y_by_y


@inner_kernel
def increase(data, e, first, x, y, xx, xy, yy):
    linear = data[e, first] * x + data[e, first + 1] * y
    return linear + data[e, first + 2] * xx + data[e, first + 3] * xy + data[e, first + 4] * yy


@inner_kernel
def flux_term(data, e, x, y, ax, ay, u, bx, by, v):
    flux_x, flux_y = half_flux(data, e, x, y, ax, ay, bx, by)
    return flux_y * (v * ax - u * bx) - flux_x * (v * ay - u * by)


@inner_kernel
def source_at(data, e, x, y):
    """Return the source at (x, y) and its derivatives by x, y, xx, xy and yy."""
    along, aside = x - data[e, CENTRE_X], y - data[e, CENTRE_Y]
    u = data[e, X_BY_X] * along + data[e, X_BY_Y] * aside
    v = data[e, Y_BY_X] * along + data[e, Y_BY_Y] * aside
    count, degree = data.shape[1] - SOURCE_TERMS, 0
    while (degree + 1) * (degree + 2) < 2 * count:
        degree += 1
    value, by_u, by_v, uu, uv, vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    column = data.shape[1] - 1
    for j in range(degree, -1, -1):  # Horner's method in v, with coefficients by Horner's method in u
        p, d, dd = 0.0, 0.0, 0.0
        for _ in range(degree - j + 1):
            dd = dd * u + 2.0 * d
            d = d * u + p
            p = p * u + data[e, column]
            column -= 1
        vv, uv, uu = vv * v + 2.0 * by_v, uv * v + by_u, uu * v + dd
        by_v, by_u = by_v * v + value, by_u * v + d
        value = value * v + p
    xu, yu, xv, yv = data[e, X_BY_X], data[e, X_BY_Y], data[e, Y_BY_X], data[e, Y_BY_Y]
    return (
        value,
        by_u * xu + by_v * xv,
        by_u * yu + by_v * yv,
        uu * xu * xu + 2.0 * uv * xu * xv + vv * xv * xv,
        uu * xu * yu + uv * (xu * yv + yu * xv) + vv * xv * yv,
        uu * yu * yu + 2.0 * uv * yu * yv + vv * yv * yv,
    )


@inner_kernel
def with_source(part, descent, e, j, local, special, offset, x, y, ax, ay, bx, by, wanted):
    magnitude, total, by_x, by_y, xx, xy, yy = part
    data, block, points = descent.trial.data, descent.block, descent.points
    kind = axis_kind(x, ax, bx) if descent.shapes.around else 0
    for q in range(points.plain):
        lead, second, third = points.share[kind, q, 0], points.share[kind, q, 1], points.share[kind, q, 2]
        at_x, at_y, level = x + second * ax + third * bx, y + second * ay + third * by, 0.0
        px, py, rx, ry = ax, ay, bx, by
        for k in range(3 if special else 0):
            at_x += points.side[kind, q, k, 0] * offset[k, 0]
            at_y += points.side[kind, q, k, 0] * offset[k, 1]
            px += points.side[kind, q, k, 1] * offset[k, 0]
            py += points.side[kind, q, k, 1] * offset[k, 1]
            rx += points.side[kind, q, k, 2] * offset[k, 0]
            ry += points.side[kind, q, k, 2] * offset[k, 1]
        f, f_x, f_y, f_xx, f_xy, f_yy = source_at(data, e, at_x, at_y)
        doubled, ex, ey, w = px * ry - py * rx, rx - px, ry - py, 0.5 * points.weight[kind, q]
        # derivatives of f D by the position of the first corner
        rate_x, rate_y = w * (doubled * lead * f_x - f * ey), w * (doubled * lead * f_y + f * ex)
        for i in range(points.value.shape[2]):
            value = points.value[kind, q, i]
            level += local[i] * value
            row = block.dof[j, i]
            if wanted > VALUE and row >= 0:
                value *= block.sign[j, i]
                block.rest[row] -= w * f * doubled * value
                block.mixed[row, 0] -= rate_x * value
                block.mixed[row, 1] -= rate_y * value
        pull = w * f * doubled * level
        magnitude += abs(pull)
        total -= pull
        by_x -= rate_x * level
        by_y -= rate_y * level
        xx -= w * level * lead * (doubled * lead * f_xx - 2.0 * ey * f_x)
        xy -= w * level * lead * (doubled * lead * f_xy - ey * f_y + ex * f_x)
        yy -= w * level * lead * (doubled * lead * f_yy + 2.0 * ex * f_y)
    return magnitude, total, by_x, by_y, xx, xy, yy
