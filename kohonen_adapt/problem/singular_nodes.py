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
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["Materials", "exponents", "fixed_parts", "meetings", "singular_nodes"]

STRAIGHT = np.deg2rad(10.0)  # turn of an interface or boundary up to which a node is smooth; chords of arcs turn less
SMOOTH = 1.95  # exponent from which no layers are made
WHOLE = 0.01  # largest distance of an exponent of a polynomial from 1
SAMPLES = np.linspace(0.05, SMOOTH, 381)  # tried exponents


class Materials(NamedTuple):
    coefficient: Floats  # (m,); with a law its value at zero
    kind: Ints  # (m,): number of the material, equal for equal constants
    flux: Floats | None  # (2, m); None if the flux varies within materials
    fixed: Mask  # (nnodes,): nodes with prescribed values
    prescribed: Mask  # (nfacets,): facets with prescribed values

    @classmethod
    def of(cls, mesh: MeshTri, ritz: Ritz) -> "Materials":
        region = np.zeros(mesh.t.shape[1], dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
        regions = int(region.max()) + 1
        numbers = {id(law): number for number, law in enumerate(ritz.laws)}
        law = np.array([numbers[id(law)] for law in ritz.laws] or [0] * regions)
        flux = None if callable(ritz.flux) else np.asarray(ritz.flux, dtype=float)
        if flux is not None:
            flux = np.broadcast_to(flux if flux.ndim == 2 else np.reshape(flux, (-1, 1)), (2, regions))
        coefficient = np.broadcast_to(np.asarray(ritz.coefficient, dtype=float), regions)
        values = np.arange(regions)[None] if flux is None else flux
        kind = np.unique(np.stack([coefficient, law, *values]), axis=1, return_inverse=True)[1].ravel()
        fixed = fixed_parts(mesh, np.asarray(ritz.fixed), ritz.order)
        return cls(coefficient[region], kind[region], None if flux is None else flux[:, region], *fixed)


def fixed_parts(mesh: MeshTri, fixed: Mask, order: int) -> tuple[Mask, Mask]:
    number_facets(mesh)
    nodes, facets = mesh.nvertices, mesh.facets.shape[1]
    prescribed = fixed[mesh.facets].all(axis=0) & (mesh.f2t[1] < 0)
    own = fixed[nodes : nodes + (order - 1) * facets].reshape(facets, order - 1)
    return fixed[:nodes], prescribed & own.all(axis=1)


class Lines(NamedTuple):
    facets: Ints  # (f,)
    prescribed: Mask  # (f,): True on a boundary with prescribed values
    kind: Ints  # (f,): equal for the same materials on both sides and the same condition


def singular_nodes(mesh: MeshTri, materials: Materials) -> Ints:
    """Return the corners where the solution is not smooth.

    A corner counts if it has an exponent below 2 other than 1, or a jump of the flux. Pairs of boundaries are treated
    as natural conditions.
    """
    shape = Blended(mesh)
    lines = lines_of(shape, materials)
    found = [int(node) for node in candidates(shape, lines) if is_singular(shape, materials, lines, int(node))]
    return np.union1d(found, points_inside(shape, materials)).astype(np.int64)


def lines_of(shape: Blended, materials: Materials) -> Lines:
    first, second = shape.corners.f2t
    left, right = materials.kind[first], np.where(second >= 0, materials.kind[np.maximum(second, 0)], -1)
    facets = np.flatnonzero(left != right)
    sides, prescribed = np.sort(np.stack([left, right]), axis=0)[:, facets], materials.prescribed[facets]
    kind = np.unique(np.stack([*sides, prescribed]), axis=1, return_inverse=True)[1].ravel()
    return Lines(facets, prescribed, kind)


def candidates(shape: Blended, lines: Lines) -> Ints:
    """Return the nodes at which lines meet, end, turn or change their kind."""
    count = shape.p.shape[1]
    ends = shape.corners.facets[:, lines.facets]
    _, tangents = shape.facet_points(lines.facets, np.array([0.0, 1.0]))
    direction = np.concatenate([tangents[..., 0], -tangents[..., 1]], axis=1)
    direction /= np.hypot(*direction)
    node = ends.ravel()
    meeting, total = meetings(node, direction, count)
    low, high = np.full(count, lines.kind.max(initial=0) + 1), np.full(count, -1)
    kinds = np.tile(lines.kind, 2)
    np.minimum.at(low, node, kinds)
    np.maximum.at(high, node, kinds)
    turns = total > 2.0 * np.sin(0.5 * STRAIGHT)
    return np.flatnonzero((meeting > 0) & ((meeting != 2) | turns | (low != high)))


def meetings(node: Ints, direction: Floats, count: int) -> tuple[Ints, Floats]:
    # Number of facets at every node, and length of the sum of their directions, 2 sin(turn / 2) for two facets. `node`
    # (n,) and `direction` (2, n) are nodes and unit vectors into the facets at the ends of all facets.
    total = np.hypot(*(np.bincount(node, part, count) for part in direction))
    return np.bincount(node, minlength=count), total


def is_singular(shape: Blended, materials: Materials, lines: Lines, node: int) -> bool:
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
    if np.ptp(materials.kind[element]) > 0 and jumps(materials, element):
        return True
    prescribed = None
    if own.any():
        prescribed = ends_prescribed(shape, lines, node, begin[order[0]], own)
    found = exponents(angle[order], materials.coefficient[element[order]], prescribed)
    return bool(np.any(np.abs(found - 1.0) > WHOLE))


def jumps(materials: Materials, element: Ints) -> bool:
    return materials.flux is None or bool(np.ptp(materials.flux[:, element], axis=1).any())


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
    first = np.flatnonzero(np.append(True, coefficient[1:] != coefficient[:-1]))
    size, value = np.add.reduceat(angle, first), coefficient[first] / coefficient.max()
    # maps s and coefficient s' / l from the beginning to the end of the sectors
    cosine, sine = np.cos(np.outer(size, SAMPLES)), np.sin(np.outer(size, SAMPLES))
    total = np.eye(2)[:, :, None]
    for c, s, nu in zip(cosine, sine, value, strict=True):
        total = np.stack([c * total[0] + s / nu * total[1], c * total[1] - nu * s * total[0]])
    if prescribed is None:
        values = total[0, 0] + total[1, 1] - 2.0  # the solution closes: an eigenvalue is 1
    else:
        # prescribed: s = 0, natural: s' = 0
        row, column = (0 if prescribed[1] else 1), (1 if prescribed[0] else 0)
        values = total[row, column]
    change = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    part = values[change] / (values[change] - values[change + 1])
    return SAMPLES[change] + part * (SAMPLES[change + 1] - SAMPLES[change])


def points_inside(shape: Blended, materials: Materials) -> Ints:
    inside, fixed = np.ones(shape.p.shape[1], dtype=np.bool_), materials.fixed
    inside[shape.corners.facets[:, shape.corners.f2t[1] < 0]] = False
    return np.flatnonzero(fixed & inside) if np.any(fixed & ~inside) else np.zeros(0, dtype=np.int64)
