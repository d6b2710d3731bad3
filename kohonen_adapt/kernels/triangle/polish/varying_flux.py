"""Mean fluxes over triangles from quadratic polynomials of the position.

The integral int g . grad u over a triangle depends on the mean of the flux g alone. With the centroid c and the
vectors r and s from one corner to the two others, the mean of a polynomial q of gradient d and Hessian H at a
point o is

    q(o) + d . (c - o) + (c - o) H (c - o) / 2 + (r H r + s H s - r H s) / 36.

The derivative of the mean by the position of the corner is a third of the gradient at the corner + (r + s) / 4.

The functional exceeds its minimum by terms of second order in the element size. Polynomials neglect terms of third
order. Constants per element would carry the flux along with the nodes, an error of first order, and all nodes
would move to the strongest flux.

Flips, splits and collapses evaluate the polynomial of the element whose row they use, before and after. The
columns of the data are defined in `kernels/triangle/arrays.py`. Without a varying flux the data have CONSTANTS columns.
"""

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import (
    CENTRE_X,
    CENTRE_Y,
    CONSTANTS,
    HALF_FLUX_X,
    HALF_FLUX_Y,
    RATES_X,
    RATES_Y,
)


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
