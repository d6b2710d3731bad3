"""Remesh triangles or tetrahedra by Mmg, with sizes or a metric tensor at nodes; interfaces and names stay."""

import numpy as np
from skfem import Mesh

from benchmarks.peers.edges import find_edges

GRADATION = 2.0  # of the sizes of neighbours; with Mmg's own 1.3 its errors on M and C are larger
SIMPLICES = {2: ("triangles", "edges"), 3: ("tetrahedra", "triangles")}  # elements and facets
PLANES = 4.0  # planes of the problems in space are at multiples of its inverse
ON = 1e-9
FACETS = 1000  # added to the references of named facets: Mmg gives those that it finds itself the numbers of regions


def mmg_remesh(mesh: Mesh, metric: np.ndarray) -> Mesh:
    """A new mesh of the same regions and named boundaries, by a metric as in `remeshing`.

    Names become reference numbers, one for every combination of names that occurs, and names again.
    """
    import mmgpy

    dim = mesh.dim()
    elements, facets = SIMPLICES[dim]
    element_numbers, element_names = numbered(mesh.subdomains, mesh.nelements)
    facet_numbers, facet_names = numbered(mesh.boundaries, mesh.facets.shape[1])
    named = np.flatnonzero(facet_numbers)
    mmg = getattr(mmgpy, f"MmgMesh{dim}D")()
    mmg.set_mesh_size(vertices=mesh.nvertices, **{elements: mesh.nelements, facets: named.size})
    mmg.set_vertices(np.ascontiguousarray(mesh.p.T))
    getattr(mmg, f"set_{elements}")(oriented(mesh), element_numbers)
    if named.size:
        ends = np.ascontiguousarray(mesh.facets[:, named].T, dtype=np.int32)
        getattr(mmg, f"set_{facets}")(ends, facet_numbers[named] + FACETS)
    if metric.ndim == 1:
        mmg.set_field("metric", metric[:, None] ** -0.5)
    else:
        mmg.set_field("tensor", np.ascontiguousarray(metric.T))
    mmg.remesh(hgrad=GRADATION, verbose=-1)
    p = np.array(mmg.get_vertices())
    if dim == 3:
        planes = np.round(PLANES * p) / PLANES  # which Mmg keeps up to rounding
        p = np.where(np.abs(p - planes) < ON, planes, p)
    t, numbers = getattr(mmg, f"get_{elements}_with_refs")()
    found = type(mesh)(np.ascontiguousarray(p.T), np.ascontiguousarray(np.asarray(t, dtype=np.int64).T))
    corners, numbers_of_facets = getattr(mmg, f"get_{facets}_with_refs")()
    subdomains = {name: np.flatnonzero(np.isin(numbers, known)) for name, known in element_names.items()}
    boundaries = {
        name: find_edges(found.facets, corners[np.isin(numbers_of_facets, known + FACETS)].T)
        for name, known in facet_names.items()
    }
    return found.with_subdomains(subdomains).with_boundaries(boundaries)


def numbered(sets: dict[str, np.ndarray] | None, count: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A number per element or facet, 0 where no name is, and the numbers that each name has."""
    member = np.zeros((len(sets or {}) + 1, count), dtype=bool)
    for row, chosen in enumerate((sets or {}).values()):
        member[row, chosen] = True
    combinations, numbers = np.unique(member, axis=1, return_inverse=True)  # in order: without any name comes first
    first = 0 if not combinations[:, 0].any() else 1
    return numbers + first, {name: first + np.flatnonzero(combinations[row]) for row, name in enumerate(sets or {})}


def oriented(mesh: Mesh) -> np.ndarray:
    """Elements of positive measure, (nelements, corners)."""
    corners = mesh.p[:, mesh.t]
    t = np.ascontiguousarray(mesh.t.T, dtype=np.int32)
    turned = np.linalg.det((corners[:, 1:] - corners[:, :1]).transpose(2, 1, 0)) < 0
    t[turned, -2:] = t[turned, :-3:-1]
    return t
