"""Cut tetrahedra by a plane: a mesh of triangles, and what the values on nodes and elements are there."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of
from kohonen_adapt.mesh.host import keys_of, number_facets
from kohonen_adapt.mesh.names import named_sets

__all__ = ["CutBy", "Flat", "flat"]

SNAP = 1e-12  # of the size of the mesh: nodes nearer to the plane than that are on it
ALONG = 1e-12  # of a unit normal: with less in other directions it is along an axis

# Triangles of a cut by the number of corners below the plane: each node is on the edge from one below to one above,
# where corners are sorted by side.
PIECES = {
    1: (((0, 1), (0, 2), (0, 3)),),
    2: (((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))),
    3: (((0, 3), (1, 3), (2, 3)),),
}


class CutBy(Protocol):
    """What tells where to cut: `kohonen_adapt.Plane` does."""

    @property
    def point(self) -> tuple[float, float, float]:
        """Any point of the plane."""

    @property
    def normal(self) -> tuple[float, float, float]:
        """A vector across it."""


@dataclass(frozen=True)
class Flat:
    """A mesh of triangles that stands for a mesh in a view: a cut through tetrahedra, or a plane mesh itself.

    Attributes
    ----------
    mesh
        The triangles; of a cut in coordinates of the plane, with the subdomains of what is cut.
    axes
        What the coordinates are called.
    element
        (ntriangles,): of a cut, the element that each triangle is a piece of.
    ends, share
        (2, nnodes) and (nnodes,): of a cut, the nodes of the edge that a node is on, and how far from the first it is.
    """

    mesh: MeshTri
    axes: tuple[str, str] = ("x", "y")
    element: Ints | None = None
    ends: Ints | None = None
    share: Floats | None = None

    def of_elements(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values on the triangles, of values on the elements, (..., nelements)."""
        return values if self.element is None else values[..., self.element]

    def of_nodes(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values on the nodes, (nnodes,), of values on the nodes of what is shown, linear between them."""
        if self.ends is None or self.share is None:
            return values
        one, other = values[self.ends]
        return np.where(self.share == 1.0, other, one + self.share * (other - one))

    @property
    def sides(self) -> Ints:
        """Facets of the triangles that are sides of elements, and not between two pieces of one."""
        if self.element is None:
            return np.arange(self.mesh.facets.shape[1])
        number_facets(self.mesh)
        one, other = self.mesh.f2t
        return np.flatnonzero((other < 0) | (self.element[one] != self.element[other]))


def flat(mesh: Mesh, plane: CutBy | None) -> Flat:
    """What is shown of a mesh: of tetrahedra the cut by a plane, else the mesh itself.

    Raises
    ------
    ValueError
        If tetrahedra come without a plane or it does not meet them, or a plane mesh comes with one.
    """
    if cell_of(mesh) is not TETRAHEDRON:
        if plane is not None:
            raise ValueError("plane cuts tetrahedra only; got a plane mesh.")
        return Flat(mesh)
    if plane is None:
        raise ValueError("a mesh of tetrahedra is shown in a cut: plane=ka.Plane(point, normal). Or plot_surface.")
    normal = np.array(plane.normal, dtype=float) / np.linalg.norm(plane.normal)
    below, above, element, height = _cut(mesh, np.asarray(plane.point, dtype=float), normal)
    on, under = height[above] == 0.0, height[below] == 0.0
    below, above = np.where(on, above, below), np.where(under, below, above)  # nodes in the plane are their own
    key = keys_of(np.sort(np.stack([below.ravel(), above.ravel()]), axis=0), mesh.p.shape[1]).reshape(below.shape)
    whole = (key[0] != key[1]) & (key[1] != key[2]) & (key[2] != key[0])  # others are pieces without area
    _, first, node = np.unique(key[:, whole], return_index=True, return_inverse=True)
    ends = np.stack([below[:, whole].ravel()[first], above[:, whole].ravel()[first]])
    low, high = height[ends]
    share = np.divide(low, low - high, out=np.zeros(len(low)), where=low != high)
    axes, names = _frame(normal)
    one, other = mesh.p[:, ends[0]], mesh.p[:, ends[1]]
    p = np.ascontiguousarray(axes @ (one + share * (other - one)))
    element = element[whole]
    return Flat(MeshTri(p, node.reshape(3, -1), None, _pieces(mesh, element)), names, element, ends, share)


def _cut(mesh: Mesh, point: Floats, normal: Floats) -> tuple[Ints, Ints, Ints, Floats]:
    """The edges on which the corners of all pieces are, (3, k) from below and above, their elements, all heights."""
    height = normal @ (mesh.p - point[:, None])
    height[np.abs(height) < SNAP * np.ptp(mesh.p, axis=1).max()] = 0.0
    for is_above in (height >= 0.0, height > 0.0):  # a plane along the rim has the mesh on one of its sides
        count = np.sum(~is_above[mesh.t], axis=0)
        if np.any((count > 0) & (count < len(mesh.t))):
            break
    else:
        raise ValueError(
            f"plane must meet the mesh, which is from {height.min():.4g} to {height.max():.4g} along its normal from "
            f"its point {tuple(point.tolist())}."
        )
    found = []
    for number, triangles in PIECES.items():
        element = np.flatnonzero(count == number)
        corners = mesh.t[:, element]
        corners = np.take_along_axis(corners, np.argsort(is_above[corners], axis=0, kind="stable"), axis=0)
        for edges in triangles:
            below, above = np.transpose(edges)
            found.append((corners[below], corners[above], element))
    below, above, element = (np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True))
    order = np.argsort(element, kind="stable")
    return below[:, order], above[:, order], element[order], height


def _frame(normal: Floats) -> tuple[Floats, tuple[str, str]]:
    """Two unit vectors along a plane, (2, 3), and what the coordinates along them are called."""
    across = int(np.argmax(np.abs(normal)))
    if np.linalg.norm(np.delete(normal, across)) < ALONG:
        axes = np.delete(np.eye(3), across, axis=0)
    else:
        right = np.array([-normal[1], normal[0], 0.0]) / np.hypot(*normal[:2])  # horizontal
        axes = np.stack([right, np.cross(normal, right)])
        axes *= np.sign(axes[[0, 1], np.argmax(np.abs(axes), axis=1)])[:, None]
    one, other = map(_called, axes + 0.0)  # without minus zeros
    return axes, (one, other)


def _called(axis: Floats) -> str:
    along = int(np.argmax(axis))
    return "xyz"[along] if axis[along] > 1.0 - ALONG else f"along ({', '.join(f'{part:.3g}' for part in axis)})"


def _pieces(mesh: Mesh, element: Ints) -> dict[str, Ints]:
    """The triangles in every subdomain."""
    found: dict[str, Ints] = {}
    for name, rows in named_sets(mesh.subdomains).items():
        inside = np.zeros(mesh.t.shape[1], dtype=bool)
        inside[rows] = True
        found[name] = np.flatnonzero(inside[element])
    return found
