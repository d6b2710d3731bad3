"""Derivatives of a Ritz functional with respect to the coefficients of elements."""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.arrays import Points
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.near_axis import kinds_at_axis
from kohonen_adapt.mesh.polynomials import HAT_SLOPES, by_points, exact_reference, functions_at, law_reference
from kohonen_adapt.problem.functional_value import alike, flux_on, loads_in_space, source_on, source_points
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_table, looked_up, source_at

__all__ = ["Derivatives", "derivatives_in_space", "derivatives_on"]

ROWS = 20_000  # elements per block, to limit the memory
MARGIN = 3.0  # factor of the difference between the mean of a flux and its value at the centre


class Derivatives(NamedTuple):
    """Derivatives with respect to the coefficients of elements, shape (m, functions)."""

    total: Floats
    size: Floats  # sum of the magnitudes of the terms
    doubt: Floats  # uncertainty by the choice of quadrature rule if source or flux is a function


def derivatives_on(corners: Floats, coefficients: Floats, number: Ints, ritz: Ritz, bend: Floats) -> Derivatives:
    """Return the derivatives on triangles with corners and midside offsets (m, 3, 2)."""
    found = Derivatives(*np.zeros((3, *coefficients.shape)))
    kind = kinds_at_axis(corners[:, :, 0]) if ritz.axisymmetric else np.where(np.any(bend, axis=(1, 2)), 0, -1)
    for one, law, rows in alike(kind, number, ritz):
        for block in np.split(rows, range(ROWS, len(rows), ROWS)):
            part = _of_kind(corners[block], coefficients[block], number[block], ritz, bend[block], one, law)
            for array, values in zip(found, part, strict=True):
                array[block] = values
    return found


def _of_kind(
    corners: Floats, coefficients: Floats, number: Ints, ritz: Ritz, bend: Floats, kind: int, law: bool
) -> tuple[Floats, Floats, Floats]:
    """Return the derivatives on elements of one kind, -1 for straight triangles."""
    points, at = by_points(ritz.order, law), law_reference(ritz.order) if law else exact_reference(ritz.order)
    weight, slope = (at.weight, at.slope) if kind < 0 else (points.weight[kind], points.slope[kind])
    columns, x = np.einsum("id,mic->dcm", HAT_SLOPES, corners)[:, :, None], np.ones(())
    if kind >= 0:
        side = points.side[kind]
        columns = columns + np.einsum("qkd,mkc->dcqm", side[:, :, 1:], bend)
        if ritz.axisymmetric:
            x = points.share[kind] @ corners[:, :, 0].T + side[:, :, 0] @ bend[:, :, 0].T
    (ax, ay), (bx, by) = columns
    doubled = ax * by - ay * bx

    def tested(x: Floats, y: Floats) -> Floats:
        turned = np.stack([by * x - bx * y, ax * y - ay * x])
        return 0.5 * np.einsum("q,dqm,qid->mi", weight, np.sign(doubled) * turned, slope)

    along, aside = np.einsum("qid,mi->dqm", slope, coefficients)
    gradient = np.stack([by * along - ay * aside, ax * aside - bx * along]) / doubled
    stored = tested(*(secants(gradient, x, number, ritz) * gradient))
    ones = np.ones_like(along)
    pushed, doubt = tested(*(flux_on(corners, number, ritz).reshape(2, 1, -1) * ones)), np.zeros_like(stored)
    if callable(ritz.flux):
        middle = np.broadcast_to(corners.mean(axis=1, keepdims=True), corners.shape)
        doubt = MARGIN * np.abs(pushed - tested(*(flux_on(middle, number, ritz).reshape(2, 1, -1) * ones)))
    if kind < 0:
        mean = np.abs(doubled[0])[:, None] * at.mean
    else:
        mean = 0.5 * (weight[:, None] * np.abs(doubled)).T @ points.value[kind]
    if callable(ritz.source):
        pulled = loads(corners, bend, number, ritz, kind, points, doubled)
        middle = source_at(corners.mean(axis=1).T[:, None], number, ritz.source)[0]
        doubt = doubt + np.abs(pulled - middle[:, None] * mean)
    else:
        pulled = np.reshape(looked_up(np.asarray(ritz.source), number), (-1, 1)) * mean
    return stored - pushed - pulled, np.abs(stored) + np.abs(pushed) + np.abs(pulled), doubt


def loads(
    corners: Floats, bend: Floats, number: Ints, ritz: Ritz, kind: int, points: Points, doubled: Floats
) -> Floats:
    """Return the integrals of source times functions of elements, (m, functions)."""
    if kind < 0 and callable(ritz.source):
        share, weight = source_points(ritz.order)
        source = source_at(np.einsum("qk,mkd->dqm", share, corners), number, ritz.source)
        value = functions_at(share, ritz.order)
    else:
        source, weight, value = (
            source_on(points, kind, corners, bend, number, ritz),
            points.weight[kind],
            points.value[kind],
        )
    return 0.5 * (weight[:, None] * np.abs(doubled) * source).T @ value


def secants(gradient: Floats, x: Floats, number: Ints, ritz: Ritz) -> Floats:
    """Return the secant coefficients H(b) / b for gradients (d, points, m).

    Around an axis `x` contains the distances of the points from the axis.
    """
    secant = np.broadcast_to(looked_up(np.asarray(ritz.coefficient), number) / x, gradient.shape[1:]).copy()
    far = np.broadcast_to(x, secant.shape)
    for place, law in enumerate(ritz.laws):
        if law is not None:
            own = number == place
            size = np.maximum(np.linalg.norm(gradient[:, :, own], axis=0), np.finfo(float).tiny)
            secant[:, own] = law.field_strength(size / far[:, own]) / size
    return secant


def derivatives_in_space(corners: Floats, values: Floats, number: Ints, ritz: Ritz) -> Derivatives:
    """Return the derivatives on tetrahedra with corners (3, 4, m) and values (4, m)."""
    hats, volume = TETRAHEDRON.hat_gradients(corners), np.abs(TETRAHEDRON.determinant(corners)) / 6.0
    gradient = np.einsum("dkm,km->dm", hats, values)
    field = secants(gradient[:, None], np.ones(()), number, ritz)[0] * gradient
    flux = np.stack([looked_up(part, number) * np.ones_like(volume) for part in flux_table(np.asarray(ritz.flux), 3)])
    stored, pushed = (volume * np.einsum("dkm,dm->km", hats, part) for part in (field, flux))
    doubt = np.zeros_like(stored)
    if callable(ritz.source):
        pulled = loads_in_space(corners, number, ritz.source)
        doubt = np.abs(pulled - source_at(corners.mean(axis=1)[:, None], number, ritz.source)[0] * volume / 4.0)
    else:
        pulled = np.broadcast_to(looked_up(np.asarray(ritz.source), number) * volume / 4.0, stored.shape)
    size = np.abs(stored) + np.abs(pushed) + np.abs(pulled)
    return Derivatives((stored - pushed - pulled).T, size.T, doubt.T)
