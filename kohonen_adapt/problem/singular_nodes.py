"""Nodes at which the solution of a problem is singular.

Around a node the solution is a sum of functions ``r^l s(angle)``. In a sector of constant coefficient s is a
combination of cos(l angle) and sin(l angle); s and coefficient times s' are continuous between sectors. The exponents l
for which s exists decide: polynomials have whole numbers, and a gradient with l < 1 is infinite at the node.
"""

from typing import NamedTuple

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["exponents", "singular_nodes"]

STRAIGHT = np.deg2rad(10.0)  # turn of an interface or boundary up to which a node is smooth; chords of arcs turn less
SMOOTH = 1.95  # exponent from which no layers are made
WHOLE = 0.01  # largest distance of an exponent of a polynomial from 1
SAMPLES = np.linspace(0.05, SMOOTH, 381)  # tried exponents


class Lines(NamedTuple):
    """Facets between materials and on the boundary of the mesh."""

    facets: Ints  # (f,)
    prescribed: Mask  # (f,): True on a boundary with prescribed values
    kind: Ints  # (f,): equal for the same materials on both sides and the same condition


def singular_nodes(mesh: MeshTri, ritz: Ritz) -> Ints:
    """Return the corners where the solution is not smooth.

    A corner counts if it has an exponent below 2 other than 1, or a jump of the flux. Pairs of boundaries are treated
    as natural conditions, and materials with a law as with their coefficient.
    """
    shape = Blended(mesh)
    material = materials_of(mesh, ritz)
    lines = lines_of(shape, ritz, material)
    found = [int(node) for node in candidates(shape, lines) if is_singular(shape, ritz, material, lines, int(node))]
    return np.union1d(found, points_inside(shape, ritz)).astype(np.int64)


def materials_of(mesh: MeshTri, ritz: Ritz) -> Ints:
    # equal constants make one material
    count = mesh.t.shape[1]
    region = np.zeros(count, dtype=np.int64) if ritz.region is None else np.asarray(ritz.region, dtype=np.int64)
    regions = int(region.max()) + 1
    laws = {id(law): number for number, law in enumerate(ritz.laws)}
    columns = [np.broadcast_to(np.asarray(ritz.coefficient, dtype=float), regions)]
    columns.append(np.array([laws[id(law)] for law in ritz.laws] or [0] * regions, dtype=float))
    if callable(ritz.flux):
        columns.append(np.arange(regions, dtype=float))
    elif np.ndim(ritz.flux) == 2:
        columns += [*np.asarray(ritz.flux, dtype=float)]
    return np.unique(np.stack(columns), axis=1, return_inverse=True)[1].ravel()[region]


def lines_of(shape: Blended, ritz: Ritz, material: Ints) -> Lines:
    first, second = shape.corners.f2t
    left, right = material[first], np.where(second >= 0, material[np.maximum(second, 0)], -1)
    facets = np.flatnonzero(left != right)
    fixed, nodes = np.asarray(ritz.fixed), shape.p.shape[1]
    prescribed = fixed[shape.corners.facets].all(axis=0) & (second < 0)
    if ritz.order > 1:
        prescribed &= fixed[nodes : nodes + (ritz.order - 1) * second.size].reshape(second.size, -1).all(axis=1)
    sides = np.sort(np.stack([left, right]), axis=0)
    kind = np.unique(np.stack([*sides, prescribed])[:, facets], axis=1, return_inverse=True)[1].ravel()
    return Lines(facets, prescribed[facets], kind)


def candidates(shape: Blended, lines: Lines) -> Ints:
    """Return the nodes at which lines meet, end, turn or change their kind."""
    count = shape.p.shape[1]
    ends = shape.corners.facets[:, lines.facets]
    _, tangents = shape.facet_points(lines.facets, np.array([0.0, 1.0]))
    direction = np.concatenate([tangents[..., 0], -tangents[..., 1]], axis=1)
    direction /= np.hypot(*direction)
    node = ends.ravel()
    meeting = np.bincount(node, minlength=count)
    total = np.stack([np.bincount(node, part, count) for part in direction])
    low, high = np.full(count, lines.kind.max(initial=0) + 1), np.full(count, -1)
    kinds = np.tile(lines.kind, 2)
    np.minimum.at(low, node, kinds)
    np.maximum.at(high, node, kinds)
    turns = np.hypot(*total) > 2.0 * np.sin(0.5 * STRAIGHT)
    return np.flatnonzero((meeting > 0) & ((meeting != 2) | turns | (low != high)))


def is_singular(shape: Blended, ritz: Ritz, material: Ints, lines: Lines, node: int) -> bool:
    element, k = np.nonzero(np.equal(shape.t.T, node))
    start, end = (shape.p[:, shape.t.T[element, np.take(ways, k)]] - shape.p[:, [node]] for ways in (AFTER, BEFORE))
    clockwise = start[0] * end[1] - start[1] * end[0] < 0.0
    start, end = np.where(clockwise, end, start), np.where(clockwise, start, end)
    begin = np.arctan2(start[1], start[0])
    angle = np.mod(np.arctan2(end[1], end[0]) - begin, 2.0 * np.pi)
    own = np.any(shape.corners.facets[:, lines.facets] == node, axis=0) & (shape.corners.f2t[1, lines.facets] < 0)
    order = np.argsort(begin)
    if own.any():  # from the boundary on, counter-clockwise
        gap = np.mod(np.roll(begin[order], -1) - (begin + angle)[order], 2.0 * np.pi)
        order = np.roll(order, -1 - int(np.argmax(np.where(gap > 2.0 * np.pi - 1e-9, 0.0, gap))))
    sectors, coefficient = material[element[order]], coefficients_of(ritz, element[order])
    if np.ptp(sectors) > 0 and jumps(ritz, element):
        return True
    prescribed = None
    if own.any():
        prescribed = ends_prescribed(shape, lines, node, begin[order[0]], own)
    found = exponents(angle[order], coefficient, prescribed)
    return bool(np.any(np.abs(found - 1.0) > WHOLE))


def coefficients_of(ritz: Ritz, element: Ints) -> Floats:
    values = np.asarray(ritz.coefficient, dtype=float)
    if values.ndim == 0:
        return np.full(element.size, float(values))
    return values[np.asarray(ritz.region)[element]]


def jumps(ritz: Ritz, element: Ints) -> bool:
    if callable(ritz.flux):
        return True
    flux = np.asarray(ritz.flux, dtype=float)
    return flux.ndim == 2 and bool(np.ptp(flux[:, np.asarray(ritz.region)[element]], axis=1).any())


def ends_prescribed(shape: Blended, lines: Lines, node: int, begin: float, own: Mask) -> tuple[bool, bool]:
    ends = shape.corners.facets[:, lines.facets[own]]
    other = np.where(ends[0] == node, ends[1], ends[0])
    direction = shape.p[:, other] - shape.p[:, [node]]
    away = np.mod(np.arctan2(direction[1], direction[0]) - begin + 1e-6, 2.0 * np.pi)
    order = np.argsort(away)
    conditions = lines.prescribed[own][order]
    return bool(conditions[0]), bool(conditions[-1])


def exponents(angle: Floats, coefficient: Floats, prescribed: tuple[bool, bool] | None) -> Floats:
    """Return the exponents below `SMOOTH` of sectors around a node.

    Parameters
    ----------
    angle, coefficient : (n,)
        Angles and coefficients of the sectors in order.
    prescribed
        Whether values are prescribed on both ends of the sectors, None for a node inside.
    """
    # maps s and coefficient s' / l from the beginning to the end of the sectors
    total = np.tile(np.eye(2), (SAMPLES.size, 1, 1))
    for size, value in zip(angle, coefficient / coefficient.max(), strict=True):
        cosine, sine = np.cos(SAMPLES * size), np.sin(SAMPLES * size)
        step = np.array([[cosine, sine / value], [-value * sine, cosine]])
        total = np.moveaxis(step, 2, 0) @ total
    if prescribed is None:
        values = total[:, 0, 0] + total[:, 1, 1] - 2.0  # the solution closes: an eigenvalue is 1
    else:
        # prescribed: s = 0, natural: s' = 0
        row, column = (0 if prescribed[1] else 1), (1 if prescribed[0] else 0)
        values = total[:, row, column]
    change = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    part = values[change] / (values[change] - values[change + 1])
    return SAMPLES[change] + part * (SAMPLES[change + 1] - SAMPLES[change])


def points_inside(shape: Blended, ritz: Ritz) -> Ints:
    """Return single nodes inside the mesh with prescribed values."""
    inside = np.ones(shape.p.shape[1], dtype=np.bool_)
    inside[shape.corners.facets[:, shape.corners.f2t[1] < 0]] = False
    fixed = np.asarray(ritz.fixed)[: inside.size]
    return np.flatnonzero(fixed & inside) if np.any(fixed & ~inside) else np.zeros(0, dtype=np.int64)
