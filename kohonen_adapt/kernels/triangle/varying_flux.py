"""Evaluate fluxes that vary inside regions: in every element a quadratic polynomial of the place.

Of a flux g that varies, int g . grad u over a triangle needs the mean alone. With c the centroid, r and s the ways from
one corner to the others, that of a polynomial q of gradient d and Hessian H at a point o is

    q(o) + d . (c - o) + (c - o) H (c - o) / 2 + (r H r + s H s - r H s) / 36,

and with the corner's place it changes by a third of the gradient at the corner + (r + s) / 4. The functional lies above
its least value by terms of second order in the size of elements. Polynomials leave out what is of third order; frozen
constants would carry the flux along with the nodes, which is of first order, and send them all to where it is stronger.

Flips, splits and collapses take the polynomial of the element that is there for the triangle in its place, before and
after, so that they are judged by one flux. The columns of the data are those of `kernels/arrays.py`; where no flux
varies there are CONSTANTS of them, and nothing is added.
"""

from kohonen_adapt.kernels.arrays import CENTRE_X, CENTRE_Y, CONSTANTS, HALF_FLUX_X, HALF_FLUX_Y, RATES_X, RATES_Y
from kohonen_adapt.kernels.compilation import inner_kernel


@inner_kernel
def half_flux(data, e, x, y, ax, ay, bx, by):
    """Both parts of half the mean flux, by the polynomial of e, over the triangle of (x, y) and the corners a, b from
    there on; as it is where no flux varies.
    """
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
    """How half the mean flux of that triangle changes with (x, y): its first part by x and by y, then its second."""
    px = x + 0.25 * (ax + bx) - data[e, CENTRE_X]
    py = y + 0.25 * (ay + by) - data[e, CENTRE_Y]
    x_by_x = increase(data, e, RATES_X, 1.0, 0.0, px, py, 0.0) / 3.0
    x_by_y = increase(data, e, RATES_X, 0.0, 1.0, 0.0, px, py) / 3.0
    y_by_x = increase(data, e, RATES_Y, 1.0, 0.0, px, py, 0.0) / 3.0
    y_by_y = increase(data, e, RATES_Y, 0.0, 1.0, 0.0, px, py) / 3.0
    return x_by_x, x_by_y, y_by_x, y_by_y


@inner_kernel
def increase(data, e, first, x, y, xx, xy, yy):
    """What a polynomial adds to its value at the centre, for the mean of x, y, xx / 2, xy and yy / 2 from there."""
    linear = data[e, first] * x + data[e, first + 1] * y
    return linear + data[e, first + 2] * xx + data[e, first + 3] * xy + data[e, first + 4] * yy


@inner_kernel
def pushed(data, e, x, y, ax, ay, u, bx, by, v):
    """int g . grad of the function 0, u, v on the triangle of (x, y) and the corners a, b from there on."""
    flux_x, flux_y = half_flux(data, e, x, y, ax, ay, bx, by)
    return flux_y * (v * ax - u * bx) - flux_x * (v * ay - u * by)
