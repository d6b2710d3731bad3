"""Longest facets on arcs whose slivers hold less energy than one node saves."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import ROUND, SLIDING
from kohonen_adapt.mesh.polynomials import LINEAR_FUNCTIONS, gradients
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.polishing.energy_tables import constants_of
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_at, source_at

__all__ = ["longest_on_arcs"]

SHARE = 0.01  # energy in the slivers of all arcs, relative to the squared estimate (in the energy norm 0.1)


def longest_on_arcs(ritz: Ritz, movable: MovableMesh, estimate: float) -> Floats:
    """Return the longest facet allowed per node that slides on an arc, shape (n,).

    The area between an arc of radius r and its chord of length l is ``l^3 / (12 r)``, between the arc and a
    curved side (the parabola through the ends and the midpoint) ``l^5 / (960 r^3)``. Twice the change of the
    functional per facet is at most ``estimate^2 / n`` and ``SHARE estimate^2 / f``, for n nodes and f facets on
    arcs. All other nodes have 0.
    """
    triangulation, constraints = movable.triangulation, movable.constraints
    elements, chains = triangulation.elements, constraints.chains
    if not np.any(chains.shape == ROUND):
        return np.zeros(movable.nnodes)
    on_arc = np.append(chains.shape == ROUND, False)[elements.chain]
    e, k = np.nonzero(on_arc & (elements.neighbour < np.arange(len(elements.node))[:, None]))  # each edge once
    shift = shift_per_area(ritz, triangulation, e, k)
    allowed = 0.5 * estimate**2 / max(movable.nnodes, len(e) / SHARE)
    with np.errstate(divide="ignore"):  # no limit on arcs at which the functional does not change
        curvature = np.abs(chains.curvature[elements.chain[e, k]])
        length = np.cbrt(12.0 * allowed / (shift * curvature))
        if movable.curved:
            length = (960.0 * allowed / (shift * curvature**3)) ** 0.2
    longest = np.full(movable.nnodes, np.inf)
    for node in elements.ends(e, k):
        np.minimum.at(longest, node, length)
    slides = (constraints.kind == SLIDING) & (chains.shape == ROUND)[constraints.own_chain]
    return np.where(slides, longest, 0.0)


def shift_per_area(ritz: Ritz, triangulation: Triangulation, e: Ints, k: Ints) -> Floats:
    """Return the largest change of the functional per area lost by an edge, (f,).

    Edges are opposite to corners `k` of elements `e`. The change is the jump of ``W - q_n du/dn``, with the
    density W of the functional and its derivative q by grad u (J. D. Eshelby, Phil. Trans. R. Soc. A 244, 1951).
    The parts of the jump are added as magnitudes. The tangential derivative is continuous, and so is q_n of the
    exact solution. The estimate of q_n is the mean of both sides weighted by 1 / coefficient, because the side of
    the smaller coefficient is more accurate.
    """
    values, position, elements = np.asarray(ritz.values), triangulation.position, triangulation.elements
    a, b = elements.ends(e, k)
    across = elements.neighbour[e, k]
    sides = np.stack([e, np.where(across >= 0, across, e)])
    there = np.stack([np.ones(len(e)), across >= 0])  # 0 outside of the mesh
    along = (position[b] - position[a]).T
    length = np.hypot(*along)
    (tx, ty), slope = along / length, (values[b] - values[a]) / length
    coefficient, source, fx, fy, gx, gy = state_of(ritz, triangulation, sides)
    flux, flux_n, slope_n = fx * tx + fy * ty, fx * ty - fy * tx, gx * ty - gy * tx
    q = np.sum(there * (slope_n - flux_n / coefficient), axis=0) / np.sum(there / coefficient, axis=0)
    parts = (
        0.5 * coefficient * slope**2 - flux * slope,
        0.5 * (q + flux_n) ** 2 / coefficient,
        0.5 * source * (values[a] + values[b]),
    )
    return sum((np.abs(np.diff(there * part, axis=0)[0]) for part in parts), np.zeros(len(e)))


def state_of(ritz: Ritz, triangulation: Triangulation, sides: Ints) -> Floats:
    """Return coefficient, source, flux and gradient of elements (2, f), (6, 2, f).

    The coefficient of nonlinear material is H / b.
    """
    e = sides.ravel()
    node, number = triangulation.elements.node[e], np.zeros(e.size, dtype=np.int64)
    number = number if ritz.region is None else np.asarray(ritz.region)[e]
    corners = triangulation.position[node]
    gx, gy = gradients(corners, np.asarray(ritz.values)[node], LINEAR_FUNCTIONS)[1][
        :, 0
    ]  # at any order from nodal values
    coefficient, source, *flux = constants_of(ritz, number).T
    if callable(ritz.source):
        source = source_at(corners.mean(axis=1).T[:, None], number, ritz.source)[0]
    if callable(ritz.flux):
        flux = [*flux_at(corners.mean(axis=1).T[:, None], number, ritz.flux)[:, 0]]
    size = np.hypot(gx, gy)
    for place, law in enumerate(ritz.laws):
        nonlinear = (number == place) & (size > 0.0)
        if law is not None and nonlinear.any():
            coefficient[nonlinear] = law.field_strength(size[nonlinear]) / size[nonlinear]
    return np.stack([coefficient, source, *flux, gx, gy]).reshape(6, *sides.shape)
