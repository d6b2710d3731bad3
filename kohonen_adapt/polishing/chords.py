"""Energy of the slivers between chords and curves, at order 1."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.geometry.plane.midsides import offsets_from_chords
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.outline import Outline
from kohonen_adapt.kernels.triangle.arrays import ROUND, SLIDING
from kohonen_adapt.mesh.cells import determinants
from kohonen_adapt.mesh.elements.polynomials import gradients
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.polishing.energy_tables import constants_of
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_at, source_at

__all__ = ["CENTROID", "Chords", "Slivers", "longest_on_arcs", "segment_areas"]

CENTROID = 0.4  # distance of the centroid of a sliver from its chord, relative to its height
FLAT = 1e-9  # sagitta of a straight facet, relative to its length

SHARE = 0.01  # energy in the slivers of all arcs, relative to the squared estimate (in the energy norm 0.1)


class Slivers(NamedTuple):
    element: Ints  # (s,)
    corner: Ints  # (s,): corner opposite to the chord
    change: Floats  # (s, 4): coefficient, source and flux of the sliver minus the values counted in the elements
    offset: Floats  # (s, 2): from the midpoint of the chord to the curve


@dataclass(frozen=True)
class Chords:
    """Curves whose slivers contribute to the functional, on a moving triangulation.

    Attributes
    ----------
    outline
        Boundaries and interfaces, which define the curves.
    constants
        Coefficient, source and flux of every region of the triangulation, (nregions, 4).
    counted
        Curve segments whose slivers can be counted, (c,) bool.
    dirichlet
        Curve segments with Dirichlet values, (c,) bool. On `counted` segments these are constant, and slivers have
        the same values.
    cut
        `counted` curve segments at which a source ends, (c,) bool. The polygon changes the area of the source
        there.
    """

    outline: Outline
    constants: Floats
    counted: Mask
    dirichlet: Mask
    cut: Mask

    @classmethod
    def of(
        cls,
        triangulation: Triangulation,
        outline: Outline,
        constants: Floats,
        curves: Mask,
        dirichlet: Mask,
        level: Floats,
    ) -> "Chords":
        """Select the curve segments whose slivers can be counted.

        `level` (c,) is the constant Dirichlet value of a segment, nan if there is no constant. Slivers at Dirichlet
        values are counted only on the convex outer boundary, and only if the source times `level` is 0.
        """
        if not curves.any():
            return cls(outline, constants, curves, dirichlet, curves)
        elements = triangulation.elements
        e, k = np.nonzero(on_chains(elements.chain, curves & dirichlet))
        inwards = bends_inwards(triangulation, outline, e, k)
        loaded = constants[elements.region[e], 1] * level[elements.chain[e, k]] != 0.0
        unknown = dirichlet & np.isnan(level)
        unknown[elements.chain[e, k][(elements.neighbour[e, k] >= 0) | inwards | loaded]] = True
        counted = curves & ~unknown
        return cls(outline, constants, counted, dirichlet, cut_sources(triangulation, outline, constants, counted))

    def moving(self, triangulation: Triangulation) -> Mask:
        constraints = self.outline.constraints
        found = np.zeros(triangulation.nnodes, bool)
        slides = constraints.kind == SLIDING
        found[slides] = (self.counted & ~self.cut)[constraints.own_chain[slides]]
        return found

    def slivers(self, triangulation: Triangulation) -> Slivers:
        elements = triangulation.elements
        e, k = np.nonzero(on_chains(elements.chain, self.counted & ~self.dirichlet))
        across = elements.neighbour[e, k]
        inwards = bends_inwards(triangulation, self.outline, e, k)
        own = self.constants[elements.region[e]]
        there = np.where((across >= 0)[:, None], self.constants[elements.region[across]], 0.0)
        change = np.where(inwards[:, None], there - own, own)
        rows = inwards | (across < 0)
        e, k = e[rows], k[rows]
        return Slivers(e, k, change[rows], offsets_from_chords(triangulation, self.outline.constraints, e, k))

    def value(self, triangulation: Triangulation, values: Floats) -> float:
        if not self.counted.any():
            return 0.0
        e, k, change, offset = self.slivers(triangulation)
        node, (a, b) = triangulation.elements.node[e], triangulation.elements.ends(e, k)
        slope = gradients(triangulation.position[node], values[node]).T
        mean = 0.5 * (values[a] + values[b]) + CENTROID * np.sum(slope * offset, axis=1)
        density = 0.5 * change[:, 0] * np.sum(slope**2, axis=1) - change[:, 1] * mean
        density -= np.sum(change[:, 2:] * slope, axis=1)
        return float(np.sum(segment_areas(triangulation.position[b] - triangulation.position[a], offset) * density))


def cut_sources(triangulation: Triangulation, outline: Outline, constants: Floats, counted: Mask) -> Mask:
    elements = triangulation.elements
    found = np.zeros(len(counted), bool)
    e, k = np.nonzero(on_chains(elements.chain, counted))
    across, source = elements.neighbour[e, k], constants[elements.region, 1]
    ends = source[e] != np.where(across >= 0, source[across], 0.0)
    offset = offsets_from_chords(triangulation, outline.constraints, e, k)
    start, end = (triangulation.position[node] for node in elements.ends(e, k))
    ends &= np.sum(offset**2, axis=1) > FLAT**2 * np.sum((end - start) ** 2, axis=1)
    found[elements.chain[e, k][ends]] = True
    return found


def bends_inwards(triangulation: Triangulation, outline: Outline, e: Ints, k: Ints) -> Mask:
    (a, b), offset = triangulation.elements.ends(e, k), offsets_from_chords(triangulation, outline.constraints, e, k)
    chord = triangulation.position[b] - triangulation.position[a]
    return determinants((chord.T, offset.T)) > 0.0


def segment_areas(chord: Floats, offset: Floats) -> Floats:
    """Return the areas between chords and curves, for vectors of shape (s, 2).

    `chord` is the vector along the chord, `offset` the vector from its midpoint to the curve. The relative error for
    arcs up to 30 degrees is below 2e-4.
    """
    length, height = np.hypot(*chord.T), np.hypot(*offset.T)
    return height * (2.0 / 3.0 * length + height**2 / (2.0 * length))


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
    values = np.asarray(ritz.values)
    position, elements = triangulation.position, triangulation.elements
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
    node = triangulation.elements.node[e]
    number = np.zeros(e.size, np.int64)
    number = number if ritz.region is None else np.asarray(ritz.region)[e]
    corners = triangulation.position[node]
    gx, gy = gradients(corners, np.asarray(ritz.values)[node])  # at any order from nodal values
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
