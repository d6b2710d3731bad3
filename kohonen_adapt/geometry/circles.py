"""Circles and spheres through points."""

import numpy as np

from kohonen_adapt.arrays import Floats

__all__ = ["fitted_sphere", "rounded", "sphere_through"]

BITS = 43  # bits kept of centres and radii that are recognised


def rounded(values: Floats | float, size: Floats | float) -> Floats:
    """Return values without noise, rounded to about 1e-13 of `size`."""
    step = np.ldexp(1.0, np.frexp(size)[1] - BITS)
    return np.round(np.asarray(values) / step) * step + 0.0  # no -0


def fitted_sphere(x: Floats) -> tuple[Floats, float]:
    """Return centre and radius of the least-squares sphere of points (Kasa, 1976).

    The sum of (|x - c|^2 - r^2)^2 over the points, shape (k, d), is least. In the plane the sphere is a circle. The
    radius is infinite if the points lie on a line, in space in a plane.
    """
    middle, size = x.mean(axis=0), np.ptp(x, axis=0).max()
    y = (x - middle) / size
    solution, _, rank, _ = np.linalg.lstsq(np.column_stack([2.0 * y, np.ones(len(y))]), np.sum(y**2, axis=1))
    if rank < len(solution):
        return middle, np.inf
    radius = size * np.sqrt(solution[-1] + np.sum(solution[:-1] ** 2))
    return rounded(middle + size * solution[:-1], radius), float(rounded(radius, radius))


def sphere_through(x: Floats, tolerance: float) -> tuple[Floats, float] | None:
    """Return the fitted sphere if points are within `tolerance` of its radius."""
    centre, radius = fitted_sphere(x)
    distance = np.abs(np.linalg.norm(x - centre, axis=1) - radius).max()
    return (centre, radius) if distance <= tolerance * radius < np.inf else None
