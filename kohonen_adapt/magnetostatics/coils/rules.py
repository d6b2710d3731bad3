"""Quadrature rules for the winding of a coil and for its bore."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.coils.winding import Arc, Bar, Winding

__all__ = ["Currents", "currents_of", "flux_rule"]

# Points along a piece, across the winding, in the bore and along the axis. They cluster at edges of the winding, where
# derivatives of H have logarithmic singularities. Error of an inductance: tests/magnetostatics/test_coil_quantities.py
ALONG, ACROSS, IN_BORE, IN_HEIGHT = 12, 10, 16, 12
SAME = 1e-9  # relative distance of equal ends


class Currents(NamedTuple):
    x: Floats  # (3, n) in m
    moment: Floats  # (3, n): current density times volume, per ampere-turn, in m


class _Line(NamedTuple):
    # the inner and the outer side of a piece, (n, 2) each, with derivatives by the parameter
    inner: Floats
    outer: Floats
    inner_slope: Floats
    outer_slope: Floats
    direction: Floats  # unit vectors along the current


def currents_of(winding: Winding) -> Currents:
    x, weight, _, direction = _winding_rule(winding)
    moment = weight / (winding.width * winding.height) * (winding.frame[:2].T @ direction)
    return Currents(x, moment)


def flux_rule(winding: Winding) -> tuple[Floats, Floats]:
    # Return points (3, n), and the weights of the flux along the axis.
    #
    # The flux through the turns, averaged over the section, is ``int A . J`` over the winding per ampere-turn. ``T =
    # fraction / height`` along the axis has the curl J, with the fraction of turns around a point, so that the integral
    # is ``int B . T`` over winding and bore for every B without divergence.
    x, weight, fraction, _ = _winding_rule(winding)
    bore, bore_weight = _bore_rule(winding)
    return np.concatenate((x, bore), axis=1), np.concatenate((weight * fraction, bore_weight)) / winding.height


def _winding_rule(winding: Winding) -> tuple[Floats, Floats, Floats, Floats]:
    # points, volumes, fraction of turns, direction of the current in the plane
    (t, along), (q, across) = _clustered(ALONG), _gauss(ACROSS)
    points, weights, fractions, directions = [], [], [], []
    for piece in (part for whole in winding.pieces for part in _divided(whole)):
        line = _line(piece, winding.width, t)
        for depth, weight in zip(q, across, strict=True):
            points.append((1.0 - depth) * line.inner + depth * line.outer)
            slope = (1.0 - depth) * line.inner_slope + depth * line.outer_slope
            weights.append(weight * along * np.abs(_cross(slope, line.outer - line.inner)))
            fractions.append(np.full(t.size, 1.0 - depth))
            directions.append(line.direction)
    x, volume = _extruded(winding, np.concatenate(points), np.concatenate(weights))
    repeat = (IN_HEIGHT, 1)
    return x, volume, np.tile(np.concatenate(fractions), IN_HEIGHT), np.tile(np.concatenate(directions), repeat).T


def _bore_rule(winding: Winding) -> tuple[Floats, Floats]:
    # Slabs between the ends of curves, each with one or more intervals across.
    curves = [curve for piece in winding.pieces for curve in _inner_curves(piece, winding.width)]
    ends = np.sort(np.array([end for curve in curves for end in curve[:2]]))
    ends = ends[np.diff(ends, prepend=-np.inf) > SAME * (ends[-1] - ends[0])] if ends.size else ends
    (u, along), (v, across) = _clustered(IN_BORE), _clustered(IN_BORE)
    points, weights = [np.zeros((0, 2))], [np.zeros(0)]
    for first, last in pairwise(ends):
        x, middle = first + (last - first) * u, 0.5 * (first + last)
        level = np.sort([curve.height(x) for curve in curves if curve.start < middle < curve.end], axis=0)
        for low, high in zip(level[::2], level[1::2], strict=True):
            y = low + np.outer(v, high - low)
            points.append(np.stack((np.broadcast_to(x, y.shape), y), axis=2).reshape(-1, 2))
            weights.append((np.outer(across, high - low) * along * (last - first)).ravel())
    return _extruded(winding, np.concatenate(points), np.concatenate(weights))


class _Curve(NamedTuple):
    # y as a function of x between two ends
    start: float
    end: float
    centre: Floats  # (2,) of an arc, or a point of a line
    radius: float
    slope: float  # of a line, or the side of the centre

    def height(self, x: Floats) -> Floats:
        across = x - self.centre[0]
        if self.radius == 0.0:
            return self.centre[1] + self.slope * across
        return self.centre[1] + self.slope * np.sqrt(np.maximum(self.radius**2 - across**2, 0.0))


def _inner_curves(piece: Bar | Arc, width: float) -> Iterator[_Curve]:
    if isinstance(piece, Bar):
        low, high = sorted(piece.corner[:2], key=lambda corner: float(corner[0]))
        if high[0] > low[0]:
            yield _Curve(low[0], high[0], low, 0.0, (high[1] - low[1]) / (high[0] - low[0]))
        return
    radius = piece.radius - 0.5 * piece.turn * width
    first, last = sorted((piece.start, piece.start + piece.extent))
    turns = np.arange(np.floor(first / np.pi) + 1.0, np.ceil(last / np.pi)) * np.pi
    for start, end in pairwise(np.r_[first, turns, last]):
        low, high = np.sort(piece.centre[0] + radius * np.cos([start, end]))
        if high > low:
            yield _Curve(low, high, piece.centre, radius, float(np.sign(np.sin(0.5 * (start + end)))))


def _divided(piece: Bar | Arc) -> list[Bar | Arc]:
    # into quarters of a circle
    if isinstance(piece, Bar):
        return [piece]
    count = max(1, round(np.ceil(abs(piece.extent) / (0.5 * np.pi) - SAME)))
    extent = piece.extent / count
    return [piece._replace(start=piece.start + k * extent, extent=extent) for k in range(count)]


def _line(piece: Bar | Arc, width: float, t: Floats) -> _Line:
    if isinstance(piece, Bar):
        starts, ends = piece.corner[[0, 3]], piece.corner[[1, 2]]
        (inner, outer), ones = starts[:, None] + t[:, None] * (ends - starts)[:, None], np.ones((t.size, 1))
        inner_slope, outer_slope = ones * (ends - starts)[:, None]
        return _Line(inner, outer, inner_slope, outer_slope, ones * piece.along)
    angle = piece.start + piece.extent * t
    outward = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    ahead = np.stack((-outward[:, 1], outward[:, 0]), axis=1)
    radii = [piece.radius - 0.5 * piece.turn * width, piece.radius + 0.5 * piece.turn * width]
    inner, outer = (piece.centre + radius * outward for radius in radii)
    inner_slope, outer_slope = (piece.extent * radius * ahead for radius in radii)
    return _Line(inner, outer, inner_slope, outer_slope, piece.turn * ahead)


def _extruded(winding: Winding, y: Floats, weight: Floats) -> tuple[Floats, Floats]:
    z, size = _clustered(IN_HEIGHT)
    levels = winding.height * (z - 0.5)
    x = np.concatenate([winding.in_space(y, level) for level in levels], axis=1)
    return x, np.outer(size * winding.height, weight).ravel()


def _gauss(count: int) -> tuple[Floats, Floats]:
    point, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (1.0 + point), 0.5 * weight


def _clustered(count: int) -> tuple[Floats, Floats]:
    # at both ends of [0, 1]
    u, weight = _gauss(count)
    return u**2 * (3.0 - 2.0 * u), weight * 6.0 * u * (1.0 - u)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
