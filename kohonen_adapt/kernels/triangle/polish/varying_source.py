"""Loads of a source that is a polynomial of the position in every element.

The variables of the polynomial are the affine coordinates X, Y in which the element was the reference triangle
when the source was last sampled. The load -int f u is integrated at the points of `Points`, which move with the
element. Derivatives by the position of a node therefore include those of f.

Flips, splits and collapses evaluate the polynomial of the element whose row they use, before and after. The
columns of the data are defined in `kernels/triangle/arrays.py`. Without a varying source the data have CONSTANTS
columns.
"""

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import (
    CENTRE_X,
    CENTRE_Y,
    SOURCE_TERMS,
    VALUE,
    X_BY_X,
    X_BY_Y,
    Y_BY_X,
    Y_BY_Y,
)
from kohonen_adapt.kernels.triangle.polish.by_points import axis_kind


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
