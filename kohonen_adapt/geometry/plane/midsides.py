"""Recognition of curves from midside nodes, and midside nodes on curves.

Sides follow the curve as far as the Jacobian determinant of every element stays well above zero.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.chains import parameters_of, points_on, signed_distances
from kohonen_adapt.geometry.plane.cutting import COLLINEAR, TURN, fitted_circle
from kohonen_adapt.geometry.plane.polylines import BY_MIDSIDES, Facets, Joints, without_noise
from kohonen_adapt.kernels.triangle.arrays import STRAIGHT, Constraints
from kohonen_adapt.kernels.triangle.polish.by_points import MIN_JACOBIAN
from kohonen_adapt.mesh.curved import jacobian_coefficients
from kohonen_adapt.mesh.host import facets_opposite
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["MIN_JACOBIAN", "Midsides", "joints_on_curves", "midsides_of", "offsets_on_curves"]

CIRCULAR = 1e-6  # maximum distance of corners and midside nodes from their circle, relative to the radius


class Midsides(NamedTuple):
    """Offsets of the midside nodes of constrained facets."""

    offset: Floats  # (f, 2) from the midpoints of the chords
    is_curved: Mask  # (f,)
    any_curved: bool  # True if a facet is curved: then all others are straight, and no chords of arcs

    def curve_index(self, curve: Ints) -> Ints:
        return np.where((curve == -1) & self.is_curved, BY_MIDSIDES, curve)


def midsides_of(facets: Facets, triangulation: Triangulation, offsets: Floats | None) -> Midsides:
    if offsets is None:
        return Midsides(np.zeros(facets.nodes.shape), np.zeros(len(facets.nodes), dtype=bool), any_curved=False)
    offset = offsets.T[facets_opposite(triangulation.mesh, triangulation.elements.node)[facets.element, facets.corner]]
    position = triangulation.position
    chord = position[facets.nodes[:, 1]] - position[facets.nodes[:, 0]]
    height = np.abs(chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0])
    is_curved = height > COLLINEAR * np.sum(chord**2, axis=1)
    return Midsides(np.where(is_curved[:, None], offset, 0.0), is_curved, any_curved=bool(is_curved.any()))


def joints_on_curves(
    joints: Joints, facets: Facets, position: Floats, midsides: Midsides, curve: Ints
) -> tuple[Joints, Floats]:
    """Return the joints inside one line, arc or spline, and the circles of facets.

    A circle is centre and radius, shape (f, 3), nan for facets on no circle. Joints between facets with a user-defined
    curve remain.
    """
    circle = np.full((len(facets.nodes), 3), np.nan)
    if not midsides.any_curved:
        return joints, circle
    curve_index, (one, other) = curve == BY_MIDSIDES, joints.facets.T
    on_circle = on_one_circle(facets, position, midsides, one, other) & on_one_circle(
        facets, position, midsides, other, one
    )
    group = groups_of(len(circle), joints.facets[joints.smooth & curve_index[one] & curve_index[other] & on_circle])
    for rows in members(group, curve_index):
        circle[rows] = circle_through(facets, position, midsides, rows)
    group[np.isnan(circle[:, 0])] = -1
    continues = (curve_index[one] == curve_index[other]) & (~curve_index[one] | (group[one] == group[other]))
    kinked = (curve[one] == -1) & (curve[other] == -1) & (joints.turn > TURN)
    return joints._replace(smooth=joints.smooth & continues & ~kinked), circle


def on_one_circle(facets: Facets, position: Floats, midsides: Midsides, one: Ints, other: Ints) -> Mask:
    (a, b), m = ends_and_midside(facets, position, midsides, one)
    u, w = b - a, m - a
    twice = 2.0 * (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])
    uu, ww = np.sum(u**2, axis=1), np.sum(w**2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (w[:, 1] * uu - u[:, 1] * ww) / twice, (u[:, 0] * ww - w[:, 0] * uu) / twice
        radius, found = np.hypot(x, y), np.ones(len(one), dtype=bool)
        (c, d), n = ends_and_midside(facets, position, midsides, other)
        for point in (c, d, n):
            offset = point - a
            found &= np.abs(np.hypot(offset[:, 0] - x, offset[:, 1] - y) - radius) <= CIRCULAR * radius
    return found


def ends_and_midside(
    facets: Facets, position: Floats, midsides: Midsides, rows: Ints
) -> tuple[tuple[Floats, Floats], Floats]:
    a, b = (position[facets.nodes[rows, side]] for side in (0, 1))
    return (a, b), 0.5 * (a + b) + midsides.offset[rows]


def groups_of(count: int, linked: Ints) -> Ints:
    graph = coo_array((np.ones(len(linked), dtype=np.int8), tuple(linked.T)), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def members(group: Ints, curve_index: Mask) -> Iterator[Ints]:
    order = np.argsort(group[curve_index], kind="stable")
    rows = np.flatnonzero(curve_index)[order]
    cuts = np.flatnonzero(np.diff(group[rows])) + 1
    yield from (part for part in np.split(rows, cuts) if len(part) > 1)


def circle_through(facets: Facets, position: Floats, midsides: Midsides, rows: Ints) -> Floats:
    (a, b), m = ends_and_midside(facets, position, midsides, rows)
    points = np.concatenate([a, b, m])
    found = without_noise(np.array([fitted_circle(points, np.arange(len(points)), 0, len(points) - 1)]))[0]
    offset = np.abs(np.hypot(*(points - found[:2]).T) - found[2])
    return found if np.max(offset) <= CIRCULAR * found[2] < np.inf else np.full(3, np.nan)


def offsets_on_curves(triangulation: Triangulation, constraints: Constraints) -> Floats:
    """Return the midside offsets of all element sides, shape (m, 3, 2).

    The midside node of a curved boundary or interface has the mean parameter of the two ends. If an element would
    keep less than `MIN_JACOBIAN` of its determinant somewhere, the offsets of its sides are reduced until the element
    keeps as much.
    """
    elements = triangulation.elements
    offsets = np.zeros((*elements.node.shape, 2))
    curved = np.append(constraints.chains.shape != STRAIGHT, False)[elements.chain]
    e, k = np.nonzero(curved & (elements.neighbour < np.arange(len(offsets))[:, None]))
    offsets[e, k] = offsets_from_chords(triangulation, constraints, e, k)
    there, side = across(triangulation, e, k)
    offsets[there, side] = offsets[e, k][elements.neighbour[e, k] >= 0]
    rows = np.flatnonzero(curved.any(axis=1))
    offsets[rows] *= limit_factors(triangulation, constraints, rows, offsets[rows])[:, :, None]
    return offsets


def across(triangulation: Triangulation, e: Ints, k: Ints) -> tuple[Ints, Ints]:
    neighbour = triangulation.elements.neighbour
    other = neighbour[e, k]
    there = other[other >= 0]
    return there, np.argmax(neighbour[there] == e[other >= 0][:, None], axis=1)


def offsets_from_chords(triangulation: Triangulation, constraints: Constraints, e: Ints, k: Ints) -> Floats:
    position = triangulation.position
    chains, chain, ends = constraints.chains, triangulation.elements.chain[e, k], triangulation.elements.ends(e, k)
    start, end = (parameters_of(position, constraints, chain, node) for node in ends)
    middle = start + 0.5 * signed_distances(chains, chain, start, end)
    length = chains.length[chain]
    round_ = np.where(chains.closed[chain], np.floor(middle / length), 0.0)
    return points_on(constraints, chain, middle - round_ * length) - 0.5 * (position[ends[0]] + position[ends[1]])


def limit_factors(triangulation: Triangulation, constraints: Constraints, rows: Ints, offsets: Floats) -> Floats:
    corners = triangulation.position[triangulation.elements.node[rows]]
    doubled = jacobian_coefficients(corners, np.zeros_like(offsets))[:, 0]
    if not np.any(jacobian_coefficients(corners, offsets).min(axis=1) < MIN_JACOBIAN * doubled):
        return np.ones(offsets.shape[:2])
    side = np.unique(side_indices(triangulation, constraints, rows), return_inverse=True)[1].reshape(-1, 3)
    factor, limited = np.ones(side.max(initial=0) + 1), np.zeros(len(rows), dtype=bool)
    enough = sufficient_factors(corners, offsets, doubled)
    while True:
        least = jacobian_coefficients(corners, factor[side][:, :, None] * offsets).min(axis=1)
        too_small = (least < MIN_JACOBIAN * doubled) & ~limited
        if not too_small.any():
            return factor[side]
        limited |= too_small
        np.minimum.at(factor, side[too_small], np.repeat(enough[too_small, None], 3, axis=1))


def sufficient_factors(corners: Floats, offsets: Floats, doubled: Floats) -> Floats:
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
    available = (1.0 - MIN_JACOBIAN) * doubled[:, None]
    with np.errstate(divide="ignore"):
        found = 2.0 * available / (-linear_sum + np.sqrt(linear_sum**2 - 4.0 * quadratic_sum * available))
    return np.minimum(1.0, found.min(axis=1))


def side_indices(triangulation: Triangulation, constraints: Constraints, rows: Ints) -> Ints:
    elements, periodic = triangulation.elements, constraints.periodic
    ends = np.stack(elements.ends(rows[:, None], np.arange(3)))
    images = periodic.partner[ends]
    paired = np.append(constraints.chains.paired, False)[elements.chain[rows]]
    ends, images = (np.sort(nodes, axis=0).astype(np.int64) for nodes in (ends, images))
    own, other = (nodes[0] * triangulation.nnodes + nodes[1] for nodes in (ends, images))
    return np.where(paired & (images[0] >= 0), np.minimum(own, other), own)
