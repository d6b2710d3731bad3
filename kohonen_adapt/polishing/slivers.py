"""Say how long facets on arcs may become until what they cut off would hold more energy than a node is worth."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.arrays import ROUND, SLIDING
from kohonen_adapt.mesh.polynomials import LINEAR_FUNCTIONS, gradients
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.polishing.regions import constants_of
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_at, source_at

__all__ = ["longest_on_arcs"]

SHARE = 0.01  # of the squared estimate, a tenth of it in the energy norm: what all arcs together may cut off


def longest_on_arcs(ritz: Ritz, movable: MovableMesh, estimate: float) -> Floats:
    """The longest facets that may be made at the nodes that slide on arcs, (n,); 0 at all others.

    Between an arc of radius r and its chord of length l there is ``l^3 / (12 r)`` of the wrong material, between it and
    a curved side, the parabola through its ends and its middle, ``l^5 / (960 r^3)``. Twice what that does to the
    functional is to be no more than an equal share of a hundredth of the squared estimate, nor than one node's share in
    all of that: what fewer facets save would be lost again elsewhere.
    """
    triangulation, constraints = movable.triangulation, movable.constraints
    elements, chains = triangulation.elements, constraints.chains
    if not np.any(chains.shape == ROUND):
        return np.zeros(movable.nnodes)
    on_arc = np.append(chains.shape == ROUND, False)[elements.chain]
    e, k = np.nonzero(on_arc & (elements.neighbour < np.arange(len(elements.node))[:, None]))  # -1 beyond the boundary
    shift = shift_per_area(ritz, triangulation, e, k)
    allowed = 0.5 * estimate**2 / max(movable.nnodes, len(e) / SHARE)
    with np.errstate(divide="ignore"):  # where nothing changes at an arc it may be cut off
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
    """By how much the functional changes at most per area that an edge leaves to its other side, (f,).

    The edges are those opposite to corners k of elements e. It is the jump of ``W - q_n du/dn`` with W all that is
    integrated and q its derivative by grad u (J. D. Eshelby, Phil. Trans. R. Soc. A 244, 1951), the parts of it taken
    as if they added up. The slope along the edge is the same on both sides, and so is q_n of the exact solution: here
    the mean of both by 1 / coefficient, for the side of the smaller one tells it better.
    """
    values, position, elements = np.asarray(ritz.values), triangulation.position, triangulation.elements
    a, b = elements.ends(e, k)
    across = elements.neighbour[e, k]
    sides = np.stack([e, np.where(across >= 0, across, e)])
    there = np.stack([np.ones(len(e)), across >= 0])  # beyond the outer boundary is nothing
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
    """Coefficient, source, flux and gradient of elements (2, f), as (6, 2, f); in nonlinear material it is H / b."""
    e = sides.ravel()
    node, number = triangulation.elements.node[e], np.zeros(e.size, dtype=np.int64)
    number = number if ritz.region is None else np.asarray(ritz.region)[e]
    corners = triangulation.position[node]
    gx, gy = gradients(corners, np.asarray(ritz.values)[node], LINEAR_FUNCTIONS)[1][:, 0]  # at any order from the nodes
    coefficient, source, *flux = constants_of(ritz, number).T
    if callable(ritz.source):
        source = source_at(corners.mean(axis=1).T[:, None], number, ritz.source)[0]
    if callable(ritz.flux):
        flux = [*flux_at(corners.mean(axis=1).T[:, None], number, ritz.flux)[:, 0]]
    size = np.hypot(gx, gy)
    for place, law in enumerate(ritz.laws):
        bent = (number == place) & (size > 0.0)
        if law is not None and bent.any():
            coefficient[bent] = law.field_strength(size[bent]) / size[bent]
    return np.stack([coefficient, source, *flux, gx, gy]).reshape(6, *sides.shape)
