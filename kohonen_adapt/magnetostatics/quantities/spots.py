"""Quadrature on discs and balls, and their distance to jumps of B."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["AXIAL", "Spot", "distance_to_jumps", "is_harmonic", "spot_rule"]

AXIAL = 1  # component of vectors (r, z) along an axis
# Points along a radius, between the poles of a ball, and around. B jumps between elements within the spot, and a fifth
# of these points added more to the error than the elements did, if the elements were a tenth of the spot in size.
DISC, BALL, TURNED_BALL = (48, 192), (24, 16, 32), (32, 48, 24)


class Spot(NamedTuple):
    x: Floats  # (d, n) in m
    weight: Floats  # (d, n), vectors whose products with B add up to the mean


def spot_rule(x: Floats, direction: Floats, radius: float, exponent: int, around_axis: bool) -> Spot:
    # A mean with the weight ``(1 - s^2)^exponent`` at the distance s times the radius. Points of a ball around an axis
    # are turned into the half-plane, and radial components are multiplied by the cosine of the angle.
    if len(x) == 2 and not around_axis:
        points, weight = disc_rule(exponent)
        return Spot(x[:, None] + radius * points, direction[:, None] * weight)
    points, weight = ball_rule(exponent, *(TURNED_BALL if around_axis else BALL))
    if not around_axis:
        return Spot(x[:, None] + radius * points, direction[:, None] * weight)
    half = points[1] > 0.0  # the second half is turned to the same points
    along, aside, up = np.array([x[0], 0.0, x[1]])[:, None] + radius * points[:, half]
    r = np.hypot(along, aside)
    return Spot(np.stack([r, up]), 2.0 * direction[:, None] * weight[half] * np.stack([along / r, np.ones(r.size)]))


@cache
def disc_rule(exponent: int) -> tuple[Floats, Floats]:
    (squared, of_radius), angle = _gauss(DISC[0]), _angles(DISC[1])
    directions = np.stack([np.cos(angle), np.sin(angle)])
    return _product(np.sqrt(squared), of_radius * (1.0 - squared) ** exponent, directions, np.ones(angle.size))


@cache
def ball_rule(exponent: int, radii: int, latitudes: int, around: int) -> tuple[Floats, Floats]:
    (radius, of_radius), (height, of_height) = _gauss(radii), _gauss(latitudes)
    up, angle = np.repeat(2.0 * height - 1.0, around), np.tile(_angles(around), latitudes)
    directions = np.stack([np.sqrt(1.0 - up**2) * np.cos(angle), np.sqrt(1.0 - up**2) * np.sin(angle), up])
    of_shell = of_radius * radius**2 * (1.0 - radius**2) ** exponent
    return _product(radius, of_shell, directions, np.repeat(of_height, around))


def _product(radius: Floats, of_radius: Floats, directions: Floats, of_direction: Floats) -> tuple[Floats, Floats]:
    points = (radius[:, None] * directions[:, None]).reshape(len(directions), -1)
    weight = np.outer(of_radius, of_direction).ravel()
    return points, weight / weight.sum()


def _gauss(count: int) -> tuple[Floats, Floats]:
    at, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 + 0.5 * at, 0.5 * weight


def _angles(count: int) -> Floats:
    return 2.0 * np.pi * (np.arange(count) + 0.5) / count


def is_harmonic(field: Any, element: int) -> bool:
    coefficients, own = field.coefficients, np.array([element])
    varies = any(np.isin(own, magnet.elements).item() for magnet in coefficients.varying_magnets)
    turns = getattr(field, "axisymmetric", False) and coefficients.current_density[element] != 0.0
    return not (coefficients.nonlinear[element] or varies or turns)


def distance_to_jumps(field: Any, x: Floats, include_current: bool) -> float:
    # The axis of an axisymmetric field is no boundary, and B has a kink where the current density jumps.
    mesh = field.elements.corners
    one, other = mesh.f2t
    kind = _kinds(field, include_current)
    facets = mesh.facets[:, (other < 0) | (kind[one] != kind[other])]
    if getattr(field, "axisymmetric", False):
        facets = facets[:, ~field.symmetry.on_axis(mesh.p)[facets].all(axis=0)]
    return float(distances(x, mesh.p[:, facets]).min(initial=np.inf))


def _kinds(field: Any, include_current: bool) -> Ints:
    coefficients = field.coefficients
    _, first, index = np.unique(coefficients.material_index, return_index=True, return_inverse=True)
    of_its_own = coefficients.nonlinear.copy()
    for magnet in coefficients.varying_magnets:
        of_its_own[magnet.elements] = True
    rows = [
        coefficients.reluctivity[first],
        np.where(of_its_own[first], first, -1),
        *np.where(of_its_own[first], 0.0, coefficients.coercivity[:, first]),
        *([coefficients.current_density[first]] if include_current else []),
    ]
    return np.unique(np.vstack(rows), axis=1, return_inverse=True)[1].ravel()[index]


def distances(x: Floats, corners: Floats) -> Floats:
    # from points (d, 1, n), segments (d, 2, n) or triangles (d, 3, n)
    away = x[:, None] - corners[:, 0]
    if corners.shape[1] == 1:
        return np.asarray(np.linalg.norm(away, axis=0))
    sides = [distances(x, np.delete(corners, k, axis=1)) for k in range(corners.shape[1])]
    edges = np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0)
    share = np.linalg.pinv(edges) @ away.T[:, :, None]
    off_plane = np.linalg.norm(away.T - (edges @ share)[:, :, 0], axis=1)
    above = np.all(share >= 0.0, axis=(1, 2)) & (share.sum(axis=(1, 2)) <= 1.0)
    return np.where(above, off_plane, np.min(sides, axis=0))
