"""Cuts of tetrahedral meshes by a plane, with the values on the cut."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Array, Floats, Ints, Mask
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of, width_of
from kohonen_adapt.mesh.host import keys_of, number_facets
from kohonen_adapt.mesh.measures import unit_vectors
from kohonen_adapt.mesh.names import named_sets

__all__ = ["CutBy", "Flat", "cut_triangles", "flat"]

SNAP = 1e-12  # distance below which a node is on the plane, relative to the size of the mesh
ALONG = 1e-12  # size of the other components below which a unit vector is along an axis

# Parts of a cut through an element, by the number of all corners and of the corners below the plane. Each node lies on
# an edge between two corners, numbered with the corners below first.
PIECES: dict[int, dict[int, tuple[tuple[tuple[int, int], ...], ...]]] = {
    3: {1: (((0, 1), (0, 2)),), 2: (((0, 2), (1, 2)),)},
    4: {
        1: (((0, 1), (0, 2), (0, 3)),),
        2: (((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))),
        3: (((0, 3), (1, 3), (2, 3)),),
    },
}


@runtime_checkable
class CutBy(Protocol):
    @property
    def point(self) -> tuple[float, float, float]: ...

    @property
    def normal(self) -> tuple[float, float, float]: ...


@dataclass(frozen=True)
class Flat:
    """Mesh of triangles to draw, a cut through tetrahedra or a plane mesh itself.

    Attributes
    ----------
    mesh
        The triangles. A cut has coordinates in its plane, and the subdomains of the tetrahedra.
    axes
        Names of the coordinates.
    element
        For a cut, the element that each triangle is a part of, (ntriangles,).
    ends, share
        For a cut, the ends of the edge that contains each node, (2, nnodes), and the position on this edge from 0 to 1,
        (nnodes,).
    """

    mesh: MeshTri
    axes: tuple[str, str] = ("x", "y")
    element: Ints | None = None
    ends: Ints | None = None
    share: Floats | None = None

    def of_elements(self, values: Array) -> Array:
        return values if self.element is None else values[..., self.element]

    def of_nodes(self, values: Array) -> Array:
        if self.ends is None or self.share is None:
            return values
        one, other = values[self.ends]
        return np.where(self.share == 1.0, other, one + self.share * (other - one))

    @property
    def sides(self) -> Ints:
        if self.element is None:
            return np.arange(self.mesh.nfacets)
        number_facets(self.mesh)
        one, other = self.mesh.f2t
        return np.flatnonzero((other < 0) | (self.element[one] != self.element[other]))


def flat(mesh: Mesh, plane: CutBy | None, axisymmetric: bool = False) -> Flat:
    if cell_of(mesh) is not TETRAHEDRON:
        if plane is not None:
            raise ValueError("plane cuts tetrahedra only; got a plane mesh.")
        return Flat(mesh, ("r", "z")) if axisymmetric else Flat(mesh)
    if plane is None:
        raise ValueError("a mesh of tetrahedra is shown in a cut: plane=ka.Plane(point, normal). Or plot_surface.")
    if not isinstance(plane, CutBy):
        raise ValueError(f"plane must be a Plane, for instance ka.Plane(point, normal); got {plane!r}.")
    normal = unit_vectors(np.array(plane.normal, float))
    below, above, element, height = _cut(mesh, np.asarray(plane.point, float), normal)
    on, under = height[above] == 0.0, height[below] == 0.0
    below, above = np.where(on, above, below), np.where(under, below, above)
    key = keys_of(np.sort(np.stack([below.ravel(), above.ravel()]), axis=0), mesh.nvertices).reshape(below.shape)
    whole = (key[0] != key[1]) & (key[1] != key[2]) & (key[2] != key[0])
    _, first, node = np.unique(key[:, whole], return_index=True, return_inverse=True)
    ends = np.stack([below[:, whole].ravel()[first], above[:, whole].ravel()[first]])
    low, high = height[ends]
    share = np.divide(low, low - high, out=np.zeros(len(low)), where=low != high)
    axes, names = _frame(normal)
    one, other = mesh.p[:, ends].swapaxes(0, 1)
    p = np.ascontiguousarray(axes @ (one + share * (other - one)))
    element = element[whole]
    pieces = {name: np.flatnonzero(np.isin(element, rows)) for name, rows in named_sets(mesh.subdomains).items()}
    return Flat(MeshTri(p, node.reshape(3, -1), None, pieces), names, element, ends, share)


def _cut(mesh: Mesh, point: Floats, normal: Floats) -> tuple[Ints, Ints, Ints, Floats]:
    # The corners of triangle i lie on the edges between the nodes ``below[:, i]`` and ``above[:, i]``, both of shape
    # (3, k). Heights are distances from the plane along the normal.
    height = normal @ (mesh.p - point[:, None])
    height[np.abs(height) < SNAP * width_of(mesh)] = 0.0
    for is_above in (height >= 0.0, height > 0.0):  # the second for a plane along the boundary
        below, above, element = _pieces(is_above[mesh.t])
        if element.size:
            return mesh.t[below, element], mesh.t[above, element], element, height
    raise ValueError(
        f"plane must meet the mesh, which is from {height.min():.4g} to {height.max():.4g} along its normal from "
        f"its point {tuple(point.tolist())}."
    )


def _pieces(above: Mask) -> tuple[Ints, Ints, Ints]:
    # Corners below and above at the ends of the edges that are cut, (nodes, k), and the element of each part of the
    # cut, from a mask of corners above, (corners, m).
    count, order, found = np.sum(~above, axis=0), np.argsort(above, axis=0, kind="stable"), []
    for number, pieces in PIECES[len(above)].items():
        element = np.flatnonzero(count == number)
        for edges in pieces:
            first, second = np.transpose(edges)
            found.append((order[first[:, None], element], order[second[:, None], element], element))
    below, over, element = (np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True))
    rows = np.argsort(element, kind="stable")
    return below[:, rows], over[:, rows], element[rows]


def cut_triangles(corners: Floats, plane: CutBy) -> Floats:
    """Return the segments in which a plane cuts triangles.

    Parameters
    ----------
    corners : (3, 3, n)
        Coordinates of the three corners of every triangle.
    plane
        The plane.

    Returns
    -------
    ndarray (2, 2, k)
        Coordinates in the plane, as those of `flat`, of both ends of the segments.
    """
    normal = unit_vectors(np.array(plane.normal, float))
    height = np.einsum("c,cin->in", normal, corners - np.reshape(plane.point, (3, 1, 1)))
    below, above, row = _pieces(height >= 0.0)
    low, high = height[below, row], height[above, row]
    start, end = corners[:, below, row], corners[:, above, row]
    return np.einsum("ac,cek->aek", _frame(normal)[0], start + low / (low - high) * (end - start))


def _frame(normal: Floats) -> tuple[Floats, tuple[str, str]]:
    across = int(np.argmax(np.abs(normal)))
    if np.linalg.norm(np.delete(normal, across)) < ALONG:
        axes = np.delete(np.eye(3), across, axis=0)
    else:
        right = np.array([-normal[1], normal[0], 0.0]) / np.hypot(*normal[:2])
        axes = np.stack([right, np.cross(normal, right)])
        axes *= np.sign(axes[[0, 1], np.argmax(np.abs(axes), axis=1)])[:, None]
    one, other = map(_called, axes + 0.0)  # without minus zeros
    return axes, (one, other)


def _called(axis: Floats) -> str:
    along = int(np.argmax(axis))
    return "xyz"[along] if axis[along] > 1.0 - ALONG else f"along ({', '.join(f'{part:.3g}' for part in axis)})"
