"""Midside nodes on curves.

Sides follow the curve as far as the Jacobian determinant of every element stays well above zero.
"""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.chains import on_chains, points_on, spans_of
from kohonen_adapt.kernels.triangle.arrays import STRAIGHT, Constraints
from kohonen_adapt.kernels.triangle.polish.by_points import MIN_JACOBIAN
from kohonen_adapt.mesh.adjacency import across, write_on_both_sides
from kohonen_adapt.mesh.cells import determinants
from kohonen_adapt.mesh.curved import AFTER, BEFORE, determinant_coefficients
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["MIN_JACOBIAN", "area_cut_off", "offsets_on_curves", "offsets_with_free_sides"]

CROWDED = 0.1  # relative determinant of an element whose free sides make way for its curved sides
RISES = np.arange(16) / 50  # midside offsets added to free sides, relative to their lengths


def offsets_on_curves(triangulation: Triangulation, constraints: Constraints, least: float = MIN_JACOBIAN) -> Floats:
    """Return the midside offsets of all element sides, shape (m, 3, 2).

    The midside node of a curved boundary or interface has the mean parameter of the two ends. If an element would
    keep less than the fraction `least` of its determinant somewhere, the offsets of its sides are reduced until the
    element keeps as much.
    """
    elements = triangulation.elements
    offsets, curved = (
        np.zeros((*elements.node.shape, 2)),
        on_chains(elements.chain, constraints.chains.shape != STRAIGHT),
    )
    e, k = np.nonzero(curved & (elements.neighbour < np.arange(len(offsets))[:, None]))
    offset = offsets_from_chords(triangulation, constraints, e, k)
    write_on_both_sides(offsets, elements.neighbour, e, k, offset)
    rows = np.flatnonzero(curved.any(axis=1))
    offsets[rows] *= limit_factors(triangulation, constraints, rows, offsets[rows], least)[:, :, None]
    return offsets


def offsets_with_free_sides(triangulation: Triangulation, constraints: Constraints) -> Floats:
    """Return the midside offsets of all sides, exact on curves, (m, 3, 2)."""
    # Sides inside regions are curved where an element would be folded.
    elements = triangulation.elements
    offsets = offsets_on_curves(triangulation, constraints, -np.inf)
    corners = triangulation.position[elements.node]
    for e in np.flatnonzero(relative_determinants(corners, offsets) < CROWDED):
        free = np.flatnonzero((elements.chain[e] < 0) & (elements.neighbour[e] >= 0))
        there, side = across(elements.neighbour, np.full(free.size, e), free)
        rows, others = np.append(e, there), np.arange(1, 1 + free.size)
        rises = np.stack(np.meshgrid(*[RISES] * free.size), axis=-1).reshape(-1, free.size, 1)
        outward = rises * (corners[e, np.take(AFTER, free)] - corners[e, np.take(BEFORE, free)])[:, ::-1] * [-1.0, 1.0]
        trials = np.repeat(offsets[rows][None], len(rises), axis=0)  # (trials, rows, 3, 2)
        trials[:, 0, free] += outward
        trials[:, others, side] += outward
        least = relative_determinants(np.tile(corners[rows], (len(rises), 1, 1)), trials.reshape(-1, 3, 2))
        offsets[rows] = trials[np.argmax(least.reshape(len(rises), -1).min(axis=1))]
    return offsets


def jacobian_coefficients(corners: Floats, offsets: Floats) -> Floats:
    # (m, 6), of corners and midside offsets (m, 3, 2)
    return determinant_coefficients(corners.T, offsets.T).T


def relative_determinants(corners: Floats, offsets: Floats) -> Floats:
    straight = jacobian_coefficients(corners, np.zeros_like(offsets))[:, 0]
    return jacobian_coefficients(corners, offsets).min(axis=1) / straight


def offsets_from_chords(triangulation: Triangulation, constraints: Constraints, e: Ints, k: Ints) -> Floats:
    position = triangulation.position
    chain = triangulation.elements.chain[e, k]
    ends = triangulation.elements.ends(e, k)
    start, distance = spans_of(position, constraints, chain, ends)
    middle = points_on(constraints, chain, start + 0.5 * distance)
    return middle - 0.5 * (position[ends[0]] + position[ends[1]])


def area_cut_off(triangulation: Triangulation, constraints: Constraints) -> float:
    # between the straight sides of elements and their curves, without sign
    elements, position = triangulation.elements, triangulation.position
    e, k = np.nonzero(on_chains(elements.chain, constraints.chains.shape != STRAIGHT))
    offset, (a, b) = offsets_from_chords(triangulation, constraints, e, k), elements.ends(e, k)
    return float(np.sum(np.abs(determinants(((position[b] - position[a]).T, offset.T)))) * 2.0 / 3.0)


def limit_factors(
    triangulation: Triangulation, constraints: Constraints, rows: Ints, offsets: Floats, fraction: float
) -> Floats:
    corners = triangulation.position[triangulation.elements.node[rows]]
    doubled = jacobian_coefficients(corners, np.zeros_like(offsets))[:, 0]
    if not np.any(jacobian_coefficients(corners, offsets).min(axis=1) < fraction * doubled):
        return np.ones(offsets.shape[:2])
    side = np.unique(side_indices(triangulation, constraints, rows), return_inverse=True)[1].reshape(-1, 3)
    factor, limited = np.ones(side.max(initial=0) + 1), np.zeros(len(rows), bool)
    enough = sufficient_factors(corners, offsets, doubled, fraction)
    while True:
        least = jacobian_coefficients(corners, factor[side][:, :, None] * offsets).min(axis=1)
        too_small = (least < fraction * doubled) & ~limited
        if not too_small.any():
            return factor[side]
        limited |= too_small
        np.minimum.at(factor, side[too_small], enough[too_small, None])


def sufficient_factors(corners: Floats, offsets: Floats, doubled: Floats, fraction: float) -> Floats:
    """Return factors (q,) of the offsets that keep the determinant large enough.

    With factors t of the sides, the Bernstein coefficients of the determinant are
    ``D + sum_k t_k L_k + sum_jk t_j t_k Q_jk``. Only the negative parts of L and Q are counted: then the coefficients
    decrease with every t, and smaller factors are sufficient, too. For one curved side Q is 0, and nothing is lost.
    """
    sides = np.eye(3)[:, None, :, None]
    linear = [jacobian_coefficients(corners, offsets * side) - doubled[:, None] for side in sides]
    linear_sum = sum(np.minimum(part, 0.0) for part in linear)
    quadratic_sum = np.zeros_like(linear_sum)
    for j, k in ((0, 1), (1, 2), (2, 0)):
        both = jacobian_coefficients(corners, offsets * (sides[j] + sides[k])) - doubled[:, None]
        quadratic_sum += np.minimum(both - linear[j] - linear[k], 0.0)
    available = (1.0 - fraction) * doubled[:, None]
    with np.errstate(divide="ignore"):
        found = 2.0 * available / (-linear_sum + np.sqrt(linear_sum**2 - 4.0 * quadratic_sum * available))
    return np.minimum(1.0, found.min(axis=1))


def side_indices(triangulation: Triangulation, constraints: Constraints, rows: Ints) -> Ints:
    elements, periodic = triangulation.elements, constraints.periodic
    ends = np.stack(elements.ends(rows[:, None], np.arange(3)))
    images = periodic.partner[ends]
    paired = on_chains(elements.chain[rows], constraints.chains.paired) & np.all(images >= 0, axis=0)
    own, other = (keys_of(ascending(*nodes), triangulation.nnodes) for nodes in (ends, np.maximum(images, 0)))
    return np.where(paired, np.minimum(own, other), own)
