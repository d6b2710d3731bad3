"""Quadrature rules for the winding of a coil and for its bore."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair, Function
from kohonen_adapt.magnetostatics.coils.winding import Arc, Bar, Plane, Winding, cross
from kohonen_adapt.mesh.elements.rules import product_rule

__all__ = ["Currents", "currents_of", "flux_rule", "gauss"]

# Points along a piece, across the winding, in the bore and along the axis. They cluster at edges of the winding, where
# derivatives of H have logarithmic singularities. Error of an inductance: tests/magnetostatics/test_coil_quantities.py
ALONG, ACROSS, IN_BORE, IN_HEIGHT = 12, 10, 16, 12
SAME = 1e-9  # relative distance of equal ends


Curve = tuple[float, float, Function]  # y as a function of x between two ends


class Currents(NamedTuple):
    x: Floats  # (3, n) in m
    moment: Floats  # (3, n): current density times volume, per ampere-turn, in m


def currents_of(winding: Winding) -> Currents:
    x, weight, _, direction = _winding_rule(winding)
    return Currents(x, weight / (winding.width * winding.height) * winding.vectors(direction))


def flux_rule(winding: Winding) -> FloatsPair:
    # Return points (3, n), and the weights of the flux along the axis.
    #
    # The flux through the turns, averaged over the section, is ``int A . J`` over the winding per ampere-turn. ``T =
    # fraction / height`` along the axis has the curl J, with the fraction of turns around a point, so that the integral
    # is ``int B . T`` over winding and bore for every B without divergence.
    x, weight, fraction, _ = _winding_rule(winding)
    bore, bore_weight = _bore_rule(winding)
    return np.concatenate((x, bore), axis=1), np.concatenate((weight * fraction, bore_weight)) / winding.height


def _winding_rule(winding: Winding) -> tuple[Floats, Floats, Floats, Plane]:
    # points, volumes, fraction of turns, direction of the current in the plane
    (t, along), (q, across) = _clustered(ALONG), gauss(ACROSS)
    mix, points, weights, directions = np.stack((1.0 - q, q), axis=1), [], [], []
    for piece in (part for whole in winding.pieces for part in _divided(whole)):
        sides, rates = piece.sides(t)
        points.append(mix @ sides)
        weights.append(across[:, None] * along * np.abs(cross(mix @ rates, sides[1] - sides[0])))
        directions.append(np.tile(rates.sum(axis=0) / np.abs(rates.sum(axis=0)), (q.size, 1)))
    y, weight, direction = (np.ravel(part) for part in (points, weights, directions))
    x, volume = _extruded(winding, y, weight)
    fraction = np.broadcast_to(1.0 - q[:, None], np.shape(weights)).ravel()
    return x, volume, np.tile(fraction, IN_HEIGHT), np.tile(direction, IN_HEIGHT)


def _bore_rule(winding: Winding) -> FloatsPair:
    # Slabs between the ends of curves, each with one or more intervals across.
    curves = [curve for piece in winding.pieces for curve in _inner_curves(piece)]
    ends = np.sort([end for *both, _ in curves for end in both])
    ends = ends[np.diff(ends, prepend=-np.inf) > SAME * np.ptp(ends)] if ends.size else ends
    (u, along), (v, across) = _clustered(IN_BORE), _clustered(IN_BORE)
    points, weights = [np.zeros(0)], [np.zeros(0)]
    for first, last in pairwise(ends):
        x, middle = first + (last - first) * u, 0.5 * (first + last)
        level = np.sort([height(x) for start, end, height in curves if start < middle < end], axis=0)
        for low, high in zip(level[::2], level[1::2], strict=True):
            y = low + np.outer(v, high - low)
            points.append((x + 1j * y).ravel())
            weights.append((np.outer(across, high - low) * along * (last - first)).ravel())
    return _extruded(winding, np.concatenate(points), np.concatenate(weights))


def _inner_curves(piece: Bar | Arc) -> Iterator[Curve]:
    if isinstance(piece, Bar):
        low, high = np.sort(piece.core)
        if high.real > low.real:
            yield low.real, high.real, lambda x: low.imag + (high - low).imag / (high - low).real * (x - low.real)
        return
    centre, radius = piece.centre, piece.radius - 0.5 * piece.turn * piece.width
    first, last = sorted((piece.start, piece.start + piece.extent))
    turns = np.arange(np.floor(first / np.pi) + 1.0, np.ceil(last / np.pi)) * np.pi
    for start, end in pairwise(np.r_[first, turns, last]):
        low, high = np.sort(centre.real + radius * np.cos([start, end]))
        if high > low:
            yield low, high, partial(_on_circle, centre, radius, np.sign(np.sin(0.5 * (start + end))))


def _on_circle(centre: complex, radius: float, side: float, x: Floats) -> Floats:
    return centre.imag + side * np.sqrt(np.maximum(radius**2 - (x - centre.real) ** 2, 0.0))


def _divided(piece: Bar | Arc) -> list[Bar | Arc]:
    # into quarters of a circle
    if isinstance(piece, Bar):
        return [piece]
    count = max(1, round(np.ceil(abs(piece.extent) / (0.5 * np.pi) - SAME)))
    extent = piece.extent / count
    return [piece._replace(start=piece.start + k * extent, extent=extent) for k in range(count)]


def _extruded(winding: Winding, y: Plane, weight: Floats) -> FloatsPair:
    z, size = _clustered(IN_HEIGHT)
    x = np.concatenate([winding.in_space(y, level) for level in winding.height * (z - 0.5)], axis=1)
    return x, np.outer(size * winding.height, weight).ravel()


def gauss(count: int) -> FloatsPair:
    barycentric, weight = product_rule((count,))
    return barycentric[:, 1], weight


def _clustered(count: int) -> FloatsPair:
    # at both ends of [0, 1]
    u, weight = gauss(count)
    return u**2 * (3.0 - 2.0 * u), weight * 6.0 * u * (1.0 - u)
