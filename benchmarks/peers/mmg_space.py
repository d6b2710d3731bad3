"""Remesh tetrahedra by Mmg3d, with sizes or a metric tensor at their nodes; interfaces and names are handed over."""

import numpy as np
from skfem import MeshTet

from benchmarks.peers.edges import find_edges
from benchmarks.peers.mmg_remesh import GRADATION, numbered
from benchmarks.problems.quadratic_solids import Quadratic
from benchmarks.problems.solids import ON, Solid

LAST = 4.0  # planes of the problems are at multiples of its inverse
FACES = 1000  # added to the references of named faces: Mmg gives those that it finds itself the numbers of regions


def mmg_in_space(problem: Solid | Quadratic, mesh: MeshTet, metric: np.ndarray) -> MeshTet:
    """A new mesh of the same regions and named boundaries.

    `metric`: 1 / h^2 (nnodes,) of the wanted edge lengths at its nodes, or tensors' entries xx, xy, xz, yy, yz, zz
    (6, nnodes). Names become reference numbers, one for every combination of names that occurs, and names again.
    """
    from mmgpy import MmgMesh3D

    elements, element_names = numbered(mesh.subdomains, mesh.nelements)
    facets, facet_names = numbered(mesh.boundaries, mesh.facets.shape[1])
    named, facets = np.flatnonzero(facets), facets + FACES
    mmg = MmgMesh3D()
    mmg.set_mesh_size(vertices=mesh.nvertices, tetrahedra=mesh.nelements, triangles=named.size)
    mmg.set_vertices(np.ascontiguousarray(mesh.p.T))
    mmg.set_tetrahedra(oriented(mesh), elements)
    mmg.set_triangles(np.ascontiguousarray(mesh.facets[:, named].T, dtype=np.int32), facets[named])
    if metric.ndim == 1:
        mmg.set_field("metric", metric[:, None] ** -0.5)
    else:
        mmg.set_field("tensor", np.ascontiguousarray(metric.T))
    mmg.remesh(hgrad=GRADATION, verbose=-1)
    p = np.array(mmg.get_vertices())
    planes = np.round(LAST * p) / LAST  # which Mmg keeps up to rounding
    t, numbers = mmg.get_tetrahedra_with_refs()
    found = MeshTet(np.where(np.abs(p - planes) < ON, planes, p).T.copy(), np.asarray(t, dtype=np.int64).T.copy())
    corners, facet_numbers = mmg.get_triangles_with_refs()
    subdomains = {name: np.flatnonzero(np.isin(numbers, known)) for name, known in element_names.items()}
    boundaries = {
        name: find_edges(found.facets, corners[np.isin(facet_numbers, known + FACES)].T)
        for name, known in facet_names.items()
    }
    return found.with_subdomains(subdomains).with_boundaries(boundaries)


def oriented(mesh: MeshTet) -> np.ndarray:
    """Elements of positive volume, (nelements, 4)."""
    a, b, c, d = mesh.p[:, mesh.t].transpose(1, 0, 2)
    t = np.ascontiguousarray(mesh.t.T, dtype=np.int32)
    turned = np.einsum("ij,ij->j", b - a, np.cross(c - a, d - a, axis=0)) < 0
    t[turned, 2], t[turned, 3] = t[turned, 3], t[turned, 2].copy()
    return t
