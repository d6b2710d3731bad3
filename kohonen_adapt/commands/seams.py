"""Nodes at which parts of a mesh do not join."""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.cells import TRIANGLE, cell_of
from kohonen_adapt.mesh.host import keys_of

__all__ = ["seams"]

SAME = 1e-9  # tolerance for equal positions, relative to the size of the mesh or a facet


def seams(mesh: Mesh) -> Iterator[tuple[Ints, str, str]]:
    """Yield the nodes, the name and the remedy of every kind of fault."""
    rim, cell = mesh.boundary_facets(), cell_of(mesh)
    yield (
        _coincident(mesh, rim),
        "coincident rim node",
        ": the parts on both sides are not connected there. Unless a slit is intended, merge them (Gmsh: Coherence, or "
        "BooleanFragments).",
    )
    yield (
        _hanging(mesh, rim),
        "hanging node",
        f", inside {cell.facet} of another {cell.name}, so the field has a gap there. Mesh both sides together.",
    )
    touch = "a point" if cell is TRIANGLE else "a point or an edge"
    yield (
        (_crossed if cell is TRIANGLE else _fanned)(mesh, rim),
        "non-manifold node",
        f": parts of the mesh touch only in {touch}; such a node does not move.",
    )


def _coincident(mesh: Mesh, rim: Ints) -> Ints:
    nodes = np.unique(mesh.facets[:, rim])
    found = cKDTree(mesh.p[:, nodes].T).query_pairs(SAME * np.ptp(mesh.p, axis=1).max(), output_type="ndarray")
    return nodes[np.unique(found)]


def _hanging(mesh: Mesh, rim: Ints) -> Ints:
    corners = mesh.p[:, mesh.facets[:, rim]]
    centre = corners.mean(axis=1)
    reach = np.sqrt(np.sum((corners - centre[:, None]) ** 2, axis=0).max(axis=0))
    nodes = np.unique(mesh.facets[:, rim])
    near = cKDTree(mesh.p[:, nodes].T).query_ball_point(centre.T, reach * (1.0 - SAME))
    facet = np.repeat(np.arange(len(rim)), [len(found) for found in near])
    node = nodes[np.concatenate([np.asarray(found, dtype=np.int64) for found in near])]
    share, distance = _shares(corners[:, :, facet], mesh.p[:, node])
    inside = (share.min(axis=0) > -SAME) & (share.max(axis=0) < 1.0 - SAME)
    return np.unique(node[inside & (distance < SAME * reach[facet])])


def _shares(corners: Floats, point: Floats) -> tuple[Floats, Floats]:
    """Return barycentric coordinates of the nearest points on facets, and distances."""
    edges, off = np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0), (point - corners[:, 0]).T
    turned = edges.swapaxes(1, 2)
    share = np.linalg.solve(turned @ edges, turned @ off[:, :, None])
    distance = np.linalg.norm(off - (edges @ share)[:, :, 0], axis=1)
    others = share[:, :, 0].T
    return np.vstack([1.0 - others.sum(axis=0), others]), distance


def _crossed(mesh: Mesh, rim: Ints) -> Ints:
    return np.flatnonzero(np.bincount(mesh.facets[:, rim].ravel()) > 2)


def _fanned(mesh: Mesh, rim: Ints) -> Ints:
    """Return rim nodes with several fans of rim faces, or on an edge of three faces."""
    faces = mesh.facets[:, rim]
    ends = np.concatenate(
        [faces[list(pair)] for pair in TRIANGLE.outward], axis=1
    )  # a face may have either orientation
    _, edge = np.unique(keys_of(np.sort(ends, axis=0), mesh.p.shape[1]), return_inverse=True)
    count, order = np.bincount(edge), np.argsort(edge, kind="stable")
    crowded = ends[:, count[edge] > 2]
    pair = order[count[edge[order]] == 2].reshape(-1, 2)
    # A fan is a connected set of corners (face, node); two faces with a common edge connect corners at both ends.
    corner = {end: _corners(faces, pair % len(rim), ends[end, pair[:, 0]]) for end in (0, 1)}
    one, other = np.concatenate([corner[0], corner[1]]).T
    graph = coo_array((np.ones(len(one), dtype=np.int8), (one, other)), shape=(faces.size, faces.size))
    fan = connected_components(graph, directed=False)[1]
    node = np.unique(np.stack([faces.ravel(), fan]), axis=1)[0]
    return np.union1d(np.flatnonzero(np.bincount(node) > 1), crowded)


def _corners(faces: Ints, face: Ints, node: Ints) -> Ints:
    """Return the flat index of the corner of each face (k, 2) at a node (k,)."""
    which = np.argmax(faces[:, face] == node[:, None], axis=0)
    return which * faces.shape[1] + face
