"""Uniform refinement with new nodes on the chords or on the circles of arcs."""

from dataclasses import replace

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Ints
from kohonen_adapt.geometry.plane.facets import facet_of_edge
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.kernels.arrays import ROUND
from kohonen_adapt.mesh.curved import is_second_order
from kohonen_adapt.mesh.isoparametric import refined
from kohonen_adapt.mesh.measures import signed_area

__all__ = ["refined_on_arcs"]


def refined_on_arcs(mesh: MeshTri) -> tuple[MeshTri, MeshTri] | None:
    """Return two uniform refinements of a mesh, with arcs as chords and round.

    New nodes on recognised arcs between elements stay on the chords in the first mesh and lie on the circle in the
    second. Arcs of the outer boundary are round in both meshes, because boundary conditions may need a circle. Returns
    None if no interface is an arc, or if an element would be inverted.
    """
    movable = MovableMesh.of(mesh, Rules())
    elements, chains = movable.triangulation.elements, movable.constraints.chains
    e, k = np.nonzero(np.append(chains.shape == ROUND, False)[elements.chain])
    chain = np.full(mesh.facets.shape[1], -1)
    chain[facet_of_edge(mesh, elements.node)[e, k]] = elements.chain[e, k]
    finer = refined(mesh)
    middle, facet = halves_of_facets(mesh, finer) if is_second_order(mesh) else midpoints_of_facets(mesh)
    middle, facet = middle[chain[facet] >= 0], facet[chain[facet] >= 0]
    (tx, ty), curvature = chains.direction[chain[facet]].T, chains.curvature[chain[facet]]
    centre = chains.origin[chain[facet]].T + np.stack((-ty, tx)) / curvature
    radial = finer.doflocs[:, middle] - centre
    on_circle, inside = centre + radial / (np.abs(curvature) * np.hypot(*radial)), mesh.f2t[1, facet] >= 0
    chords, arcs = finer.doflocs.copy(), finer.doflocs.copy()
    chords[:, middle[~inside]], arcs[:, middle] = on_circle[:, ~inside], on_circle
    pair = replace(finer, doflocs=chords), replace(finer, doflocs=arcs)
    inverted = [np.any(signed_area(each) * signed_area(finer) <= 0.0) for each in pair]
    return pair if inside.any() and not any(inverted) else None


def midpoints_of_facets(mesh: MeshTri) -> tuple[Ints, Ints]:
    facet = np.arange(mesh.facets.shape[1])
    return mesh.nvertices + facet, facet  # scikit-fem numbers the new nodes of a refined mesh so


def halves_of_facets(mesh: MeshTri, finer: MeshTri) -> tuple[Ints, Ints]:
    half = np.flatnonzero(finer.facets[0] < mesh.nvertices)
    return finer.nvertices + half, finer.facets[1, half] - mesh.nvertices
