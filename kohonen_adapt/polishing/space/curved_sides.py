"""Curved edges of order 2, and energy of slivers at curved surfaces.

A P1 function on a mesh whose faces are inscribed in a sphere, cylinder or cone extends to the true domain.
The functional of the true domain is that of the mesh plus, for every sliver, ``S = volume (psi_true -
psi_face)(grad u)``, with the gradient of the element that covers the sliver or is extended into the sliver. A
linear Dirichlet function on an outer surface is extended as given. The polish adds ``S + |S|``, as
`kernels/tetrahedron/polish/slivers.py` explains. At order 2 nodes on curved surfaces stay.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Int32s, Ints, Mask
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.patches import Patches
from kohonen_adapt.geometry.space.projection import midpoints_of_edges
from kohonen_adapt.kernels.tetrahedron.arrays import (
    CONE,
    CYLINDER,
    NO_SURFACE,
    SPHERE,
    SolidBlock,
    Tetrahedra,
)
from kohonen_adapt.mesh.cells import TETRAHEDRON, normals
from kohonen_adapt.mesh.curved import offsets_of_sides
from kohonen_adapt.mesh.elements.rules import CURVED_RULE_IN_SPACE, LAW_RULE_IN_SPACE
from kohonen_adapt.mesh.host import keys_of
from kohonen_adapt.mesh.measures import EDGES
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization, faces_of, faces_on
from kohonen_adapt.problem.boundary_terms import corner_values, reduced_regions
from kohonen_adapt.problem.functional_value import integrand
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import constants_at

__all__ = ["CurvedEdges", "CurvedFaces"]


ROUND = SPHERE, CYLINDER, CONE


@dataclass(frozen=True)
class CurvedFaces:
    """Curved surfaces whose slivers contribute to the functional.

    Attributes
    ----------
    patches
        Geometry of all faces of the body (patches).
    ritz, number
        The functional, and the index of every region in its tables, (nregions,).
    counted
        Patches whose slivers are counted, (p,) bool.
    follows
        `counted` patches with Dirichlet values, which slivers continue linearly, (p,) bool.
    rate
        Gradient of the Dirichlet values, (p, 3).
    """

    patches: Patches
    ritz: Ritz
    number: Ints
    counted: Mask
    follows: Mask
    rate: Floats

    @classmethod
    def of(
        cls,
        tet: Tetrahedralization,
        patches: Patches,
        ritz: Ritz,
        number: Ints,
        linear: Mask,
        dirichlet: Mask,
        rate: Floats,
    ) -> "CurvedFaces":
        """Select the patches whose slivers are counted.

        Slivers are counted on spheres, cylinders and cones without Dirichlet values if no source ends there, because
        the faces change the volume of the source. With Dirichlet values they are counted on the convex outer boundary
        only, and beside a source only if all values are 0. `linear` selects patches without Dirichlet values, or with
        linear Dirichlet values.
        """
        elements = tet.elements
        values = np.asarray(ritz.values)
        counted = linear & np.isin(patches.shape, ROUND)
        e, k = faces_on(elements, counted)
        patch, across = elements.patch[e, k], elements.neighbour[e, k]
        outer = is_outside(tet.position, elements, patches, e, k)
        sources = (
            np.nan if callable(ritz.source) else np.asarray(ritz.source)
        )  # a function may jump anywhere, and nan != nan
        source = constants_at(sources, number)[elements.region]
        source_across = np.where(across >= 0, source[across], 0.0)
        ends = np.where(outer | (across >= 0), source[e] != source_across, source[e] != 0.0)
        level = np.abs(values[faces_of(elements, e, k)]).max(axis=1, initial=0.0)
        cannot_count = (across >= 0) | outer | ((source[e] != 0.0) & (level > 0.0))
        counted[patch[np.where(dirichlet[patch], cannot_count, ends)]] = False
        return cls(patches, ritz, number, counted, counted & dirichlet, rate)

    def value(self, position: Floats, elements: Tetrahedra, values: Floats, surface: Floats = NO_SURFACE) -> float:
        """Return the sum of S + abs(S) over all slivers for nodal values of shape (n,).

        `surface` has the offsets of `Trial.surface`.
        """
        e, k = faces_on(elements, self.counted)
        outer = is_outside(position, elements, self.patches, e, k)
        across = elements.neighbour[e, k]
        has = outer | (across < 0)
        e, k, outer, across = e[has], k[has], outer[has], across[has]
        if not len(e):
            return 0.0
        corners, patch = position.T[:, elements.node[e].T], elements.patch[e, k]
        reduced = reduced_regions(self.ritz.surface, self.number[elements.region[e]])
        on_corners = corner_values(values, surface, elements.node[e].T, reduced)
        slope = np.einsum("dkm,km->dm", TETRAHEDRON.hat_gradients(corners), on_corners)
        slope = np.where(~outer & self.follows[patch], self.rate[patch].T, slope)
        volume = volumes(position, elements, self.patches, e, k)
        volume = np.where(outer, np.minimum(volume, TETRAHEDRON.determinant(corners) / 6.0), volume)
        own, outer_number = (self.number[elements.region[rows]] for rows in (e, across))
        change = np.where(across >= 0, integrand(slope, outer_number, self.ritz)[0], 0.0)
        own_density, _ = integrand(slope, own, self.ritz)
        return float(2.0 * volume @ np.maximum(np.where(outer, change - own_density, own_density), 0.0))


def is_outside(position: Floats, elements: Tetrahedra, patches: Patches, e: Ints, k: Ints) -> Mask:
    nodes = faces_of(elements, e, k)
    middle = position[nodes].mean(axis=1)
    away = patches.project(elements.patch[e, k], middle) - middle
    return np.einsum("ij,ij->i", normals(position, nodes), away) < 0.0


def volumes(position: Floats, elements: Tetrahedra, patches: Patches, e: Ints, k: Ints) -> Floats:
    # between faces and surfaces, (f,), for a parabolic height
    nodes, height = faces_of(elements, e, k), np.zeros(len(e))
    for x in midpoints_of_edges(position[nodes]):
        height += np.linalg.norm(patches.project(elements.patch[e, k], x) - x, axis=1)
    return np.linalg.norm(normals(position, nodes), axis=1) * height / 6.0


class CurvedEdges(NamedTuple):
    # as in `SolidBlock`
    start: Int32s  # (n + 1,)
    end: Int32s  # (k,)
    offset: Floats  # (k, 3)

    @classmethod
    def of(cls, movable: MovableSolid, nodes: int) -> "CurvedEdges":
        # for up to `nodes` nodes
        if not movable.curved:
            none = np.zeros(0, np.int32)
            return cls(np.zeros(1, np.int32), none, np.zeros((0, 3)))
        mesh, _, _ = movable.curved_mesh()
        offset = offsets_of_sides(mesh)
        rows = np.flatnonzero(offset.any(axis=0))
        one, other = mesh.edges[:, np.append(rows, rows)]
        one[rows.size :], other[rows.size :] = mesh.edges[::-1, rows]
        order = np.lexsort((other, one))
        start = np.searchsorted(one[order], np.arange(nodes + 1)).astype(np.int32)
        edge = np.append(rows, rows)[order]
        return cls(start, other[order].astype(np.int32), np.ascontiguousarray(offset[:, edge].T))

    def on(self, node: Ints) -> Floats:
        # of elements with nodes (4, m), (3, 6, m)
        if not self.end.size:
            return np.zeros((3, len(EDGES[0]), node.shape[1]))
        count = len(self.start) - 1
        known = keys_of(np.stack([np.repeat(np.arange(count), np.diff(self.start)), self.end]), count)
        key = keys_of(node[EDGES], count)
        row = np.searchsorted(known, key).clip(max=known.size - 1)
        return np.where(known[row] == key, self.offset.T[:, row], 0.0)

    def block(self) -> SolidBlock:
        return SolidBlock.of(*LAW_RULE_IN_SPACE, self, CURVED_RULE_IN_SPACE)
