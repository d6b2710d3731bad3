"""Triangles with sides on arcs and other curves, by transfinite blending.

A side from corner a to corner b has the position ``chord(t) + (1 - t^2) e(t)`` for t from -1 to 1, with a polynomial e
(its first coefficient is the midside offset, and a parabola has no other). The element is the image of ``x = sum_i
lambda_i x_i + 4 sum_k lambda_a lambda_b e_k(lambda_b - lambda_a)`` (B. Szabo and I. Babuska, Finite Element Analysis,
1991, section 6.2), which for parabolas is the isoparametric map of order 2.
"""

from collections.abc import Mapping
from functools import cached_property
from math import factorial

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, FloatsPair, Function, Ints
from kohonen_adapt.mesh.curved import AFTER, Isoparametric
from kohonen_adapt.mesh.elements.rules import triangle_rule
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.names import named

__all__ = ["Blended", "Projections", "exact_area", "is_folded"]

Projections = Mapping[str, Function]  # boundary name to the projection onto its curve

ROUND = 1e-6  # shift of a midside node along the chord, relative to its offset, up to which the side is an arc
DEGREE = 26  # of the quadrature of areas
FITTED = 16  # coefficients of a side on a curve that is no arc
TERMS = 12  # terms of the series of sine and cosine, exact to rounding up to half a circle


class Blended(Isoparametric):
    """Triangles with an arc through the three nodes of a curved side.

    A side whose midside node is not on the perpendicular bisector of the chord is a parabola. Curved sides on a
    boundary in `sides` follow the curve of its projection.
    """

    def __init__(self, mesh: MeshTri, sides: Projections | None = None) -> None:
        super().__init__(mesh)
        size = np.hypot(*self.side_offset)
        curved = np.flatnonzero(size > 0.0)
        self.number = np.full(size.size, -1)  # of a side among the curved ones, the last for the rest
        self.number[curved] = np.arange(curved.size)
        self.facet_series = np.zeros((2 * TERMS, 2, curved.size + 1))  # (powers, 2, ncurved + 1): e by powers of t
        start, end = self.corners.p[:, self.corners.facets[:, curved]].swapaxes(0, 1)
        half, offset = 0.5 * (end - start), self.side_offset[:, curved]
        self.facet_series[0, :, :-1] = offset
        rounded = np.flatnonzero(np.abs(np.sum(half * offset, axis=0)) <= ROUND * size[curved] * np.hypot(*half))
        self.facet_series[:, :, rounded] = series_of_arcs(half[:, rounded], offset[:, rounded])
        for name, project in (sides or {}).items():
            on = np.asarray(named(self.corners.boundaries, name, "boundary"))
            rows = self.number[on[size[on] > 0.0]]
            self.facet_series[:, :, rows] = 0.0
            self.facet_series[:FITTED, :, rows] = fitted_series(start[:, rows], end[:, rows], offset[:, rows], project)

    @cached_property
    def series(self) -> Floats:
        """Coefficients e of the sides opposite to the corners, (powers, 2, 3, nelements)."""
        facet = self.corners.t2f[AFTER]
        sign = np.where(self.corners.facets[0, facet] == self.t[AFTER], 1.0, -1.0)
        powers = np.arange(len(self.facet_series))[:, None, None]
        return self.facet_series[:, :, self.number[facet]] * (sign**powers)[:, None]

    def bows(self, element: Ints, barycentric: Floats) -> FloatsPair:
        start, end = barycentric[self.ends]
        return _polynomial(self.series[..., element], end - start)


def fitted_series(start: Floats, end: Floats, offset: Floats, project: Function) -> Floats:
    """Return e of sides on a curve, through Chebyshev points, (FITTED, 2, n)."""
    if not start.size:
        return np.zeros((FITTED, *start.shape))
    t = np.cos((2.0 * np.arange(FITTED) + 1.0) * np.pi / (2.0 * FITTED))[:, None, None]
    chord = 0.5 * ((1.0 - t) * start + (1.0 + t) * end)  # (FITTED, 2, n)
    guess = chord + (1.0 - t**2) * offset
    found = project(np.moveaxis(guess, 1, 0).reshape(2, -1)).reshape(2, FITTED, -1)
    missed = [project(ends) - ends for ends in (start, end)]  # rounding, so that sides end exactly at their nodes
    on_curve = np.moveaxis(found, 1, 0) - 0.5 * ((1.0 - t) * missed[0] + (1.0 + t) * missed[1])
    powers = np.linalg.inv(np.vander(t.ravel(), increasing=True))
    return np.einsum("pq,qcn->pcn", powers, (on_curve - chord) / (1.0 - t**2))


def exact_area(mesh: MeshTri, sides: Projections | None = None) -> Floats:
    size, shape = area(mesh), Blended(mesh, sides)
    size[shape.curved] = 0.5 * np.abs(determinants(shape)) @ triangle_rule(DEGREE)[1]
    return size


def determinants(shape: Blended) -> Floats:
    rows, (barycentric, weight) = np.flatnonzero(shape.curved), triangle_rule(DEGREE)
    element, at = np.repeat(rows, weight.size), np.tile(barycentric.T, rows.size)
    return shape.determinants(element, at).reshape(-1, weight.size)


def is_folded(mesh: MeshTri) -> bool:
    found = np.sign(determinants(Blended(mesh)))
    return bool(np.any(found != found[:, :1]))


def _polynomial(series: Floats, t: Floats) -> FloatsPair:
    value, slope = (np.asarray(polyval(t, each, tensor=False), np.float64) for each in (series, polyder(series)))
    return value, slope


def series_of_arcs(half: Floats, offset: Floats) -> Floats:
    """Return e of arcs, (powers, 2, n), from half chords and midside offsets, (2, n).

    With the half angle w and the radius r the arc is ``r sin(w t)`` along and ``r (cos(w t) - cos w)`` across the
    chord. e is its difference to the chord divided by ``1 - t^2``, term by term of the series of both functions.
    """
    length, rise = np.hypot(*half), np.hypot(*offset)
    angle = 2.0 * np.arctan2(rise, length)
    radius = length / np.sin(angle)
    series = np.zeros((2 * TERMS, *half.shape))
    for k in range(1, TERMS):
        even, odd = ((-1.0) ** k * radius * angle**power / factorial(power) for power in (2 * k, 2 * k + 1))
        for power in range(0, 2 * k, 2):  # (t^2k - 1) / (1 - t^2) = -(1 + t^2 + ... + t^(2k - 2))
            series[power] -= even * offset / rise
            series[power + 1] -= odd * half / length
    return series
