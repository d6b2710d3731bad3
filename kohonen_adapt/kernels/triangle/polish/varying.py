"""Mean fluxes and loads of polynomial data in triangles."""

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import (
    CENTRE_X,
    CENTRE_Y,
    CONSTANTS,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    POSITION,
    RATES_X,
    RATES_Y,
    SOURCE_TERMS,
    STRAIGHT_WITH_SOURCE,
    VALUE,
    X_BY_X,
    X_BY_Y,
    Y_BY_X,
    Y_BY_Y,
)
from kohonen_adapt.kernels.triangle.polish.by_points import axis_kind
from kohonen_adapt.kernels.vectors import (
    add_to,
    cross,
    divided,
    minus,
    plus,
    plus_times,
    times,
    weighted,
    xy,
)


@inner_kernel
def half_flux(data, e, x, a, b):
    """Return half the mean flux over the triangle of x, x + a and x + b."""
    flux = data[e, HALF_FLUX_X], data[e, HALF_FLUX_Y]
    if data.shape[1] > CONSTANTS:
        c = minus(plus(x, divided(plus(a, b), 3.0)), centre_of(data, e))
        (ax, ay), (bx, by), (cx, cy) = a, b, c
        xx = 0.5 * cx * cx + (ax * ax + bx * bx - ax * bx) / 36.0
        mixed = cx * cy + (2.0 * (ax * ay + bx * by) - ax * by - ay * bx) / 36.0
        yy = 0.5 * cy * cy + (ay * ay + by * by - ay * by) / 36.0
        flux = plus(flux, increase(data, e, c, (xx, mixed, yy)))
    return flux


@inner_kernel
def half_flux_rates(data, e, x, a, b):
    """Return the derivatives of `half_flux` by x and by y."""
    px, py = minus(plus(x, times(0.25, plus(a, b))), centre_of(data, e))
    by_x, by_y = increase(data, e, (1.0, 0.0), (px, py, 0.0)), increase(data, e, (0.0, 1.0), (0.0, px, py))
    return divided(by_x, 3.0), divided(by_y, 3.0)


@inner_kernel
def centre_of(data, e):
    return data[e, CENTRE_X], data[e, CENTRE_Y]


@inner_kernel
def increase(data, e, x, squares):
    return increase_of(data, e, RATES_X, x, squares), increase_of(data, e, RATES_Y, x, squares)


@inner_kernel
def increase_of(data, e, first, x, squares):
    linear = data[e, first] * x[0] + data[e, first + 1] * x[1]
    return linear + data[e, first + 2] * squares[0] + data[e, first + 3] * squares[1] + data[e, first + 4] * squares[2]


@inner_kernel
def flux_term(data, e, x, a, u, b, v):
    return cross(weighted(v, a, -u, b), half_flux(data, e, x, a, b))


@inner_kernel
def source_at(data, e, x, wanted):
    """Return the source at x, its gradient, and its second derivatives.

    The derivatives are zero unless `wanted` is POSITION.
    """
    along, aside = minus(x, centre_of(data, e))
    u = data[e, X_BY_X] * along + data[e, X_BY_Y] * aside
    v = data[e, Y_BY_X] * along + data[e, Y_BY_Y] * aside
    count = data.shape[1] - SOURCE_TERMS
    degree = 0
    while (degree + 1) * (degree + 2) < 2 * count:
        degree += 1
    value = by_u = by_v = uu = uv = vv = 0.0
    column = data.shape[1] - 1
    for j in range(degree, -1, -1):  # Horner's method in v, with coefficients by Horner's method in u
        p = d = dd = 0.0
        for _ in range(degree - j + 1):
            if wanted == POSITION:
                dd = dd * u + 2.0 * d
                d = d * u + p
            p = p * u + data[e, column]
            column -= 1
        if wanted == POSITION:
            vv, uv, uu = vv * v + 2.0 * by_v, uv * v + by_u, uu * v + dd
            by_v, by_u = by_v * v + value, by_u * v + d
        value = value * v + p
    xu, yu, xv, yv = data[e, X_BY_X], data[e, X_BY_Y], data[e, Y_BY_X], data[e, Y_BY_Y]
    return (
        value,
        (by_u * xu + by_v * xv, by_u * yu + by_v * yv),
        (
            uu * xu * xu + 2.0 * uv * xu * xv + vv * xv * xv,
            uu * xu * yu + uv * (xu * yv + yu * xv) + vv * xv * yv,
            uu * yu * yu + 2.0 * uv * yu * yv + vv * yv * yv,
        ),
    )


@inner_kernel
def with_source(part, descent, j, x, a, b, wanted):
    magnitude, total, gradient, hessian = part
    data, block, points = descent.trial.data, descent.block, descent.points
    e, special = block.element[j], block.special[j]
    kind = STRAIGHT_WITH_SOURCE
    if special:
        kind = axis_kind(x[0], a[0], b[0]) if descent.shapes.around else 0
    for q in range(points.last[kind, 0]):
        lead, second, third = points.share[kind, q, 0], points.share[kind, q, 1], points.share[kind, q, 2]
        there = plus_times(plus_times(x, second, a), third, b)
        level = 0.0
        p, r = a, b
        for k in range(3 if special else 0):
            side = points.side[kind, q, k]
            midside = xy(block.offset[j], k)
            there = plus_times(there, side[0], midside)
            p, r = plus_times(p, side[1], midside), plus_times(r, side[2], midside)
        f, (f_x, f_y), (f_xx, f_xy, f_yy) = source_at(data, e, there, wanted)
        doubled = cross(p, r)
        w = 0.5 * points.weight[kind, q]
        (ex, ey) = minus(r, p)
        # derivatives of f D by the position of the first corner
        rate = w * (doubled * lead * f_x - f * ey), w * (doubled * lead * f_y + f * ex)
        for i in range(points.value.shape[2]):
            value = points.value[kind, q, i]
            level += block.local[j, i] * value
            row = block.dof[j, i]
            if wanted > VALUE and row >= 0:
                value *= block.sign[j, i]
                block.rest[row] -= w * f * doubled * value
                add_to(block.mixed, row, times(-value, rate))
        pull = w * f * doubled * level
        magnitude += abs(pull)
        total -= pull
        gradient = plus_times(gradient, -level, rate)
        xx, mixed = doubled * lead * f_xx - 2.0 * ey * f_x, doubled * lead * f_xy - ey * f_y + ex * f_x
        yy = doubled * lead * f_yy + 2.0 * ex * f_y
        hessian = plus_times(hessian, -w * level * lead, (xx, mixed, yy))
    return magnitude, total, gradient, hessian
