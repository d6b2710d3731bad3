"""Cut every element of a mesh in four, once with the new nodes of arcs on the chords and once on the arcs."""

from dataclasses import replace

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Ints
from kohonen_adapt.kernels.arrays import ROUND
from kohonen_adapt.mesh.curved import is_second_order
from kohonen_adapt.mesh.isoparametric import refined
from kohonen_adapt.mesh.measures import signed_area
from kohonen_adapt.outline.facets import facet_of_edge
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.rules import Rules

__all__ = ["refined_on_arcs"]


def refined_on_arcs(mesh: MeshTri) -> tuple[MeshTri, MeshTri] | None:
    """The mesh with every element cut in four, as it is, and with its arcs between elements made rounder.

    So they are by new nodes on the arcs, of a `MeshTri2` by those in the middle of new sides. None where there are no
    such arcs, or an element would be overturned. Arcs of the outer boundary are rounder in both, for conditions there
    may need a circle. Arcs are those that adapting recognises without being told.
    """
    movable = MovableMesh.of(mesh, Rules())
    elements, chains = movable.triangulation.elements, movable.constraints.chains
    e, k = np.nonzero(np.append(chains.shape == ROUND, False)[elements.chain])
    chain = np.full(mesh.facets.shape[1], -1)
    chain[facet_of_edge(mesh, elements.node)[e, k]] = elements.chain[e, k]
    finer = refined(mesh)
    middle, facet = halves_of_facets(mesh, finer) if is_second_order(mesh) else middles_of_facets(mesh)
    middle, facet = middle[chain[facet] >= 0], facet[chain[facet] >= 0]
    (tx, ty), curvature = chains.direction[chain[facet]].T, chains.curvature[chain[facet]]
    centre = chains.origin[chain[facet]].T + np.stack((-ty, tx)) / curvature
    radial = finer.doflocs[:, middle] - centre
    place, inside = centre + radial / (np.abs(curvature) * np.hypot(*radial)), mesh.f2t[1, facet] >= 0
    chords, arcs = finer.doflocs.copy(), finer.doflocs.copy()
    chords[:, middle[~inside]], arcs[:, middle] = place[:, ~inside], place
    pair = replace(finer, doflocs=chords), replace(finer, doflocs=arcs)
    overturned = [np.any(signed_area(each) * signed_area(finer) <= 0.0) for each in pair]
    return pair if inside.any() and not any(overturned) else None


def middles_of_facets(mesh: MeshTri) -> tuple[Ints, Ints]:
    """The nodes that a mesh has in the middles of its facets where it is refined, and these facets."""
    facet = np.arange(mesh.facets.shape[1])
    return mesh.nvertices + facet, facet  # as scikit-fem numbers them


def halves_of_facets(mesh: MeshTri, finer: MeshTri) -> tuple[Ints, Ints]:
    """The nodes in the middles of the halves of facets, of the refined mesh, and these facets."""
    half = np.flatnonzero(finer.facets[0] < mesh.nvertices)
    return finer.nvertices + half, finer.facets[1, half] - mesh.nvertices
