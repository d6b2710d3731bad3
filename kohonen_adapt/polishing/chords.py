"""Energy of the slivers between chords and curves, at order 1.

A P1 function on a mesh whose facets are chords extends to the true domain, because elements are extended from
the chord to the curve. The functional of the true domain is that of the polygons plus, for every sliver,
``area (psi_true - psi_chord)(grad u)``, with the gradient of the element that covers the sliver or is
extended into the sliver.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.geometry.plane.midsides import offsets_from_chords
from kohonen_adapt.geometry.plane.outline import Outline
from kohonen_adapt.kernels.triangle.arrays import SLIDING
from kohonen_adapt.mesh.polynomials import LINEAR_FUNCTIONS, gradients
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["CENTROID", "Chords", "Slivers", "segment_areas"]

CENTROID = 0.4  # distance of the centroid of a sliver from its chord, relative to its height
FLAT = 1e-9  # sagitta of a straight facet, relative to its length


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
        constraints, found = self.outline.constraints, np.zeros(triangulation.nnodes, dtype=np.bool_)
        slides = constraints.kind == SLIDING
        found[slides] = (self.counted & ~self.cut)[constraints.own_chain[slides]]
        return found

    def slivers(self, triangulation: Triangulation) -> Slivers:
        elements = triangulation.elements
        e, k = np.nonzero(on_chains(elements.chain, self.counted & ~self.dirichlet))
        across, inwards = elements.neighbour[e, k], bends_inwards(triangulation, self.outline, e, k)
        own = self.constants[elements.region[e]]
        there = np.where((across >= 0)[:, None], self.constants[elements.region[across]], 0.0)
        change, rows = np.where(inwards[:, None], there - own, own), inwards | (across < 0)
        e, k = e[rows], k[rows]
        return Slivers(e, k, change[rows], offsets_from_chords(triangulation, self.outline.constraints, e, k))

    def value(self, triangulation: Triangulation, values: Floats) -> float:
        if not self.counted.any():
            return 0.0
        e, k, change, offset = self.slivers(triangulation)
        node, (a, b) = triangulation.elements.node[e], triangulation.elements.ends(e, k)
        slope = gradients(triangulation.position[node], values[node], LINEAR_FUNCTIONS)[1][:, 0].T
        mean = 0.5 * (values[a] + values[b]) + CENTROID * np.sum(slope * offset, axis=1)
        density = 0.5 * change[:, 0] * np.sum(slope**2, axis=1) - change[:, 1] * mean
        density -= np.sum(change[:, 2:] * slope, axis=1)
        return float(np.sum(segment_areas(triangulation.position[b] - triangulation.position[a], offset) * density))


def cut_sources(triangulation: Triangulation, outline: Outline, constants: Floats, counted: Mask) -> Mask:
    elements, found = triangulation.elements, np.zeros(len(counted), dtype=np.bool_)
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
    return chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0] > 0.0


def segment_areas(chord: Floats, offset: Floats) -> Floats:
    """Return the areas between chords and curves, for vectors of shape (s, 2).

    `chord` is the vector along the chord, `offset` the vector from its midpoint to the curve. The relative error for
    arcs up to 30 degrees is below 2e-4.
    """
    length, height = np.hypot(*chord.T), np.hypot(*offset.T)
    return height * (2.0 / 3.0 * length + height**2 / (2.0 * length))
