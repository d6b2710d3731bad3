"""Windings as arrays of the kernels that sum their fields."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.coils import Arcs, Bars, add_arcs, add_bars
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.magnetostatics.coils.rules import gauss
from kohonen_adapt.magnetostatics.coils.winding import Winding

__all__ = ["Source", "field_of", "source_of"]

# Points t^POWER of a Gauss rule in t, more for windings thinner than SLENDER of their radius, in which x may be nearer
# to a surface. The error of H is below 1e-5 of the largest, also on surfaces (test_coils_in_space.py).
POINTS, MORE_POINTS, MOST_POINTS, POWER, SLENDER = 22, 4, 48, 5, 0.25
# Gauss rules for points away from an arc, and the error rho^-2n of n points if the integrand is analytic in an ellipse
# around the interval whose half-axes have the sum rho.
GAUSS_RULES, GAUSS_ERROR = (3, 4, 5, 6, 8, 10, 14), 1e-6
FEW = 1_000  # points per thread, at least
CHUNK = 20_000  # points per compiled call, so that Ctrl-C takes effect

Source = tuple[Bars, Arcs]
# Corners of a cut across a bar: inner low, outer low, outer high, inner high. Faces between the cuts at both ends of a
# bar: outer, inner, high and low, with corners 4 to 7 at the second cut; then the second cut itself.
SIDES = np.array([[1, 5, 6, 2], [4, 0, 3, 7], [2, 6, 7, 3], [0, 4, 5, 1]])
CUT = np.array([1, 0, 3, 2])


def source_of(winding: Winding, current_density: float) -> Source:
    return _bars_of(winding, current_density), _arcs_of(winding, current_density)


def field_of(source: Source, x: Floats) -> Floats:
    bars, arcs = source
    points, field = np.ascontiguousarray(x.T), np.zeros(x.shape[::-1])

    def add(_: int, first: int, last: int) -> None:
        scratch = np.empty((len(bars.corner), 4))
        for start in range(first, last, CHUNK):
            end = min(start + CHUNK, last)
            if len(bars.end):
                add_bars(bars, points, start, end, scratch, field)
            if len(arcs.centre):
                add_arcs(arcs, points, start, end, field)

    expect("space coils")
    shared(add, even_cuts(len(points), FEW))
    return np.ascontiguousarray(field.T)


def _bars_of(winding: Winding, current_density: float) -> Bars:
    bars, mitred = winding.bars, not winding.arcs
    cut = np.arange(len(bars)) if mitred else np.arange(0, 2 * len(bars), 2)
    next_cut = np.roll(cut, -1) if mitred else cut + 1
    ends = np.array([bar.corner for bar in bars]).reshape(-1, 4)[:, [0, 3, 1, 2]]
    cuts = ends[:, :2] if mitred else ends.reshape(-1, 2)
    corner = winding.in_space(cuts[:, [0, 1, 1, 0]], 0.5 * winding.height * np.array([-1.0, -1.0, 1.0, 1.0]))
    density = current_density / (4.0 * np.pi) * winding.vectors(np.array([bar.along for bar in bars], complex)).T
    local = np.concatenate((4 * cut[:, None] + np.arange(4), 4 * next_cut[:, None] + np.arange(4)), axis=1)
    face = np.concatenate((local[:, SIDES].reshape(-1, 4), local[:, 4 + CUT]))
    jump = density - np.roll(density, -1, axis=0) if mitred else np.zeros_like(density)
    source = np.concatenate((np.repeat(density, 4, axis=0), jump))
    return _polyhedra(corner.reshape(3, -1).T, face, source)


def _polyhedra(corner: Floats, face: Ints, source: Floats) -> Bars:
    # `source` is the jump of the current density over each face, divided by 4 pi.
    rows = np.flatnonzero(source.any(axis=1))
    face, source = face[rows], source[rows]
    a, b, c, d = corner[face].swapaxes(0, 1)
    doubled = np.stack((np.cross(b - a, c - a), np.cross(c - a, d - a)), axis=1)
    normal = _unit(doubled.sum(axis=1))
    weight = np.cross(source, normal)
    start, end = face, np.roll(face, -1, axis=1)
    key, inverse = np.unique(np.minimum(start, end) * len(corner) + np.maximum(start, end), return_inverse=True)
    across = np.cross(_unit(corner[end] - corner[start]), normal[:, None])
    matrix = np.zeros((len(key), 3, 3))
    np.add.at(matrix, inverse.reshape(start.shape), weight[:, None, :, None] * across[:, :, None, :])
    ends = np.stack(np.divmod(key, max(len(corner), 1)), axis=1).astype(np.int32)
    length = np.linalg.norm(corner[ends[:, 1]] - corner[ends[:, 0]], axis=1)
    area = np.linalg.norm(doubled, axis=2)
    return Bars(np.ascontiguousarray(corner), ends, length, matrix, face.astype(np.int32), normal, weight, area)


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _arcs_of(winding: Winding, current_density: float) -> Arcs:
    arcs, height = winding.arcs, winding.height
    start, extent, radius, turn = (
        np.array([(arc.start, arc.extent, arc.radius, arc.turn) for arc in arcs]).reshape(-1, 4).T
    )
    centre = winding.in_space(np.array([arc.centre for arc in arcs], complex), 0.0).T
    first = winding.vectors(np.exp(1j * (start + 0.5 * extent))).T
    axis = np.tile(winding.frame[2], (len(arcs), 1))
    frame = np.stack((first, np.cross(axis, first), axis), axis=1)
    bounds = np.array([-winding.width, winding.width, -height, height]) / 2.0 + np.outer(radius, [1.0, 1.0, 0.0, 0.0])
    bounds[:, 0] = np.maximum(bounds[:, 0], 0.0)
    slender = radius.max(initial=0.0) * SLENDER / min(winding.width, height)
    count = POINTS + MORE_POINTS * np.log2(max(slender, 1.0))
    rules = _rules(min(round(count), MOST_POINTS))
    return Arcs(centre, frame, 0.5 * abs(extent) + 1e-12, bounds, turn * current_density / (4.0 * np.pi), *rules)


def _rules(clustered: int) -> tuple[Ints, Floats, Floats, Floats]:
    counts = np.array([*(count for count in GAUSS_RULES if count < clustered), clustered], np.int32)
    fraction, weight = np.zeros((2, len(counts), clustered))
    for rule, count in enumerate(counts):
        fraction[rule, :count], weight[rule, :count] = gauss(int(count))
    weight[-1] *= POWER * fraction[-1] ** (POWER - 1)
    fraction[-1] **= POWER
    rho = GAUSS_ERROR ** (-0.5 / counts)
    reach = 0.5 * (rho + 1.0 / rho)
    reach[-1] = 0.0
    return counts, reach, fraction, weight
