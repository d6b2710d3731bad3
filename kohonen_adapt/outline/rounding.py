"""Cut every element of a mesh in four, once with the new nodes of arcs on the chords and once on the arcs."""

from dataclasses import replace

import numpy as np
from skfem import MeshTri

from kohonen_adapt.kernels.arrays import ROUND
from kohonen_adapt.mesh.measures import signed_area
from kohonen_adapt.outline.facets import facet_of_edge
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.rules import Rules

__all__ = ["refined_on_arcs"]


def refined_on_arcs(mesh: MeshTri) -> tuple[MeshTri, MeshTri] | None:
    """The mesh with every element cut in four, as it is, and with its arcs between elements made rounder.

    None where there are no such arcs, or an element would be overturned. Arcs of the outer boundary are rounder in
    both, for conditions there may need a circle. Arcs are those that adapting recognises without being told.
    """
    movable = MovableMesh.of(mesh, Rules())
    elements, chains = movable.triangulation.elements, movable.constraints.chains
    e, k = np.nonzero(np.append(chains.shape == ROUND, False)[elements.chain])
    facet, on = facet_of_edge(mesh, elements.node)[e, k], elements.chain[e, k]
    (tx, ty), curvature = chains.direction[on].T, chains.curvature[on]
    centre = chains.origin[on].T + np.stack((-ty, tx)) / curvature
    refined, middle = mesh.refined(), mesh.p.shape[1] + facet  # scikit-fem numbers the middles of facets like these
    radial = refined.p[:, middle] - centre
    place, inside = centre + radial / (np.abs(curvature) * np.hypot(*radial)), mesh.f2t[1, facet] >= 0
    chords, arcs = refined.p.copy(), refined.p.copy()
    chords[:, middle[~inside]], arcs[:, middle] = place[:, ~inside], place
    pair = replace(refined, doflocs=chords), replace(refined, doflocs=arcs)
    overturned = [np.any(signed_area(each) * signed_area(refined) <= 0.0) for each in pair]
    return pair if inside.any() and not any(overturned) else None
