"""Remesh by Mmg 2D from a mesh, with sizes or a metric tensor at its nodes; interfaces and names are handed over."""

from typing import Any

import numpy as np
from skfem import MeshTri

from benchmarks.peers.edges import find_edges

GRADATION = 2.0  # of the sizes of neighbours; with Mmg's own 1.3 its errors on M and C are larger


def mmg_remesh(mesh: MeshTri, metric: np.ndarray) -> MeshTri:
    """A new mesh of the same regions and named boundaries.

    `metric`: 1 / h^2 (nnodes,) of the wanted edge lengths at its nodes, or tensors' entries xx, xy, yy (3, nnodes).
    Names become reference numbers, one for every combination of names that occurs, and names again.
    """
    from mmgpy import MmgMesh2D

    elements, element_names = numbered(mesh.subdomains, mesh.t.shape[1])
    facets, facet_names = numbered(mesh.boundaries, mesh.facets.shape[1])
    named = np.flatnonzero(facets)
    mmg = MmgMesh2D()
    mmg.set_mesh_size(vertices=mesh.p.shape[1], triangles=mesh.t.shape[1], edges=named.size)
    mmg.set_vertices(np.ascontiguousarray(mesh.p.T))
    mmg.set_triangles(np.ascontiguousarray(mesh.t.T, dtype=np.int32), elements)
    if named.size:
        mmg.set_edges(np.ascontiguousarray(mesh.facets[:, named].T, dtype=np.int32), facets[named])
    _set_metric(mmg, metric)
    mmg.remesh(hgrad=GRADATION, verbose=-1)
    return _named_mesh(mmg, element_names, facet_names)


def _set_metric(mmg: Any, metric: np.ndarray) -> None:
    if metric.ndim == 1:
        mmg.set_field("metric", metric[:, None] ** -0.5)
    else:
        mmg.set_field("tensor", np.ascontiguousarray(metric.T))


def numbered(sets: dict[str, np.ndarray] | None, count: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A number per element or facet, 0 where no name is, and the numbers that each name has."""
    member = np.zeros((len(sets or {}) + 1, count), dtype=bool)
    for row, chosen in enumerate((sets or {}).values()):
        member[row, chosen] = True
    combinations, numbers = np.unique(member, axis=1, return_inverse=True)  # in order: without any name comes first
    first = 0 if not combinations[:, 0].any() else 1
    return numbers + first, {name: first + np.flatnonzero(combinations[row]) for row, name in enumerate(sets or {})}


def _named_mesh(mmg: Any, element_names: dict[str, np.ndarray], facet_names: dict[str, np.ndarray]) -> MeshTri:
    triangles, numbers = mmg.get_triangles_with_refs()
    mesh = MeshTri(np.ascontiguousarray(mmg.get_vertices().T), np.ascontiguousarray(triangles.T, dtype=np.int64))
    edges, edge_numbers = mmg.get_edges_with_refs()
    subdomains = {name: np.flatnonzero(np.isin(numbers, known)) for name, known in element_names.items()}
    boundaries = {
        name: find_edges(mesh.facets, edges[np.isin(edge_numbers, known)].T) for name, known in facet_names.items()
    }
    return mesh.with_subdomains(subdomains).with_boundaries(boundaries)
