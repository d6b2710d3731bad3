"""Expand a flux that varies inside elements as a quadratic polynomial in each."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.arrays import CENTRE_X, CONSTANTS, HALF_FLUX_X, RATES_X, RATES_Y, VARYING
from kohonen_adapt.mesh.measures import inner_points
from kohonen_adapt.mesh.polynomials import LINEAR_FUNCTIONS, gradients
from kohonen_adapt.problem.tables import flux_at

__all__ = ["expanded"]


def expanded(constants: Floats, corners: Floats, number: Ints, flux: Callable[[Floats, Ints], ArrayLike]) -> Floats:
    """What `Trial` calls its data, (m, VARYING), where a function gives the flux, of the constants (m, CONSTANTS).

    The polynomial has the values of the function at the points of `inner_points` and at the middles between them. Its
    mean over the element is that of the function over the three points, as in the functional itself. The function is
    asked inside of elements only: an element moves by less than its size until it is asked again.
    """
    points = inner_points(corners)
    sampled = flux_at(np.concatenate([points, 0.5 * (points + np.roll(points, -1, axis=1))], axis=1), number, flux)
    data = np.zeros((len(constants), VARYING))
    data[:, :CONSTANTS] = constants
    data[:, CENTRE_X : CENTRE_X + 2] = corners.mean(axis=1).T
    for part, rates in enumerate((RATES_X, RATES_Y)):
        value, increase = polynomial(points, 0.5 * sampled[part])
        data[:, HALF_FLUX_X + part] = value
        data[:, rates : rates + len(increase)] = increase.T
    return data


def polynomial(points: Floats, values: Floats) -> tuple[Floats, Floats]:
    """The quadratic polynomial of values (6, m) at corners (2, 3, m) and then at the middles after each.

    Returns its value at the centre (m,), and gradient and Hessian there, by x, y, xx, xy and yy, (5, m).
    """
    corner, middle = values[:3], values[3:]
    hat = np.stack(
        [gradients(points.T, np.tile(unit, (points.shape[2], 1)), LINEAR_FUNCTIONS)[1][:, 0] for unit in np.eye(3)]
    )
    after = np.roll(hat, -1, axis=0)
    slope = np.einsum("im,icm->cm", corner, hat) + 4.0 * np.einsum("im,icm->cm", middle, hat + after)
    bend = np.einsum("im,icm,idm->cdm", corner, hat, hat) + 2.0 * np.einsum("im,icm,idm->cdm", middle, hat, after)
    value = (4.0 * middle.sum(axis=0) - corner.sum(axis=0)) / 9.0
    return value, np.stack([*slope / 3.0, 4.0 * bend[0, 0], 2.0 * (bend[0, 1] + bend[1, 0]), 4.0 * bend[1, 1]])
