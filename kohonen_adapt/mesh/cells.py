"""Tables of the two kinds of elements, triangles and tetrahedra."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from skfem import Mesh
from skfem.mesh import MeshTet1, MeshTet2, MeshTri1, MeshTri2

from kohonen_adapt.arrays import Floats, Function, Ints

__all__ = [
    "CELLS",
    "FACES",
    "LARGEST_EXTENT",
    "LEAST_EXTENT",
    "TETRAHEDRON",
    "TRIANGLE",
    "Cell",
    "cell_of",
    "centroids_of",
    "check_kind",
    "corner_positions",
    "determinants",
    "facet_normals",
    "normals",
    "remedy_for",
    "width_of",
]

# The kernels take third powers of volumes. An element 1e8 times smaller than a mesh of this extent has one in range.
LEAST_EXTENT, LARGEST_EXTENT = 1e-20, 1e20
SOLID = ("Tet", "Hex", "Wedge")  # parts of the names of classes for three dimensions


@dataclass(frozen=True)
class Cell:
    """Kind of element, a simplex of `dim` dimensions with ``dim + 1`` corners.

    Attributes
    ----------
    name, facet, size
        Words for the element, its facets and ``|K|`` in messages, the latter two with an article.
    mesh, curved_mesh
        Classes of scikit-fem's meshes of straight and of curved elements of this kind.
    edges
        Pairs of corners, in the plane opposite to each corner, in space in the order of scikit-fem.
    facets, opposite
        Corners of the facets in the order of scikit-fem, and the corner opposite to each.
    outward
        Corners of the facet opposite to each corner. For a positive element they run counter-clockwise around the
        element in the plane, and counter-clockwise as seen from outside in space.
    regular
        Constant of the quality ``regular |K|^(2 / dim) / (sum of squared edges)``, which is 1 for a regular element.
    size_per_node
        Area or volume per node of a lattice with edges of length one, equilateral triangles in the plane and densely
        packed spheres in space.
    floor
        Default of `min_quality`, the quality that moves of nodes preserve.
    hat_gradients
        Function of corners (dim, dim + 1, m) that returns the gradients of the barycentric coordinates, (dim, dim + 1,
        m).
    """

    name: str
    facet: str
    size: str
    mesh: type[Mesh]
    curved_mesh: type[Mesh]
    dim: int
    edges: tuple[tuple[int, int], ...]
    facets: tuple[tuple[int, ...], ...]
    opposite: tuple[int, ...]
    outward: tuple[tuple[int, ...], ...]
    regular: float
    size_per_node: float
    floor: float
    hat_gradients: Function

    def determinant(self, corners: Floats) -> Floats:
        """Return the signed ``dim! |K|``, (m,), from corners (dim, dim + 1, m).

        In space it is positive if corners 1, 2, 3 run clockwise as seen from corner 0.
        """
        return determinants((corners[:, 1:] - corners[:, :1]).swapaxes(0, 1))


def determinants(columns: Iterable[Floats]) -> Floats:
    """Return the determinants of matrices with columns (d, ...)."""
    first, *others = columns
    if len(first) == 2:
        return first[0] * others[0][1] - others[0][0] * first[1]
    return np.sum(first * crossed(*others), axis=0)


def crossed(u: Floats, v: Floats) -> Floats:
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])


def hats_of_triangles(corners: Floats) -> Floats:
    """Return the gradients of barycentric coordinates, (2, 3, m).

    For i, j, k in cyclic order and the signed area, ``grad phi_i = (y_j - y_k, x_k - x_j) / (2 |K|)``.
    """
    x, y = corners
    along_x = x[[2, 0, 1]] - x[[1, 2, 0]]
    along_y = y[[1, 2, 0]] - y[[2, 0, 1]]
    twice_area = along_y[0] * along_x[1] - along_y[1] * along_x[0]
    return np.stack((along_y, along_x)) / twice_area


def hats_of_tetrahedra(corners: Floats) -> Floats:
    """Return the gradients of barycentric coordinates, (3, 4, m).

    With the edges u, v, w from corner 0, ``grad phi_1 = v x w / (6 |K|)`` and cyclically; the sum of all four is zero.
    """
    u, v, w = (corners[:, 1:] - corners[:, :1]).swapaxes(0, 1)
    others = np.stack([crossed(v, w), crossed(w, u), crossed(u, v)], axis=1) / determinants((u, v, w))
    return np.concatenate([-others.sum(axis=1, keepdims=True), others], axis=1)


def normals(position: Floats, nodes: Ints) -> Floats:
    """Return normals (f, 3) of triangles with nodes (f, 3).

    Their length is twice the area. Seen from the tip of the normal, the nodes run counter-clockwise.
    """
    a, b, c = (position[nodes[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def facet_normals(mesh: Mesh, facets: Ints | slice) -> Floats:  # (3, n), of twice the area
    return normals(mesh.p.T, mesh.facets[:, facets].T).T


def centroids_of(mesh: Mesh, elements: Any = slice(None)) -> Floats:
    return mesh.p[:, mesh.t[:, elements]].mean(axis=1)


def corner_positions(mesh: Mesh) -> Floats:  # (d, d + 1, nelements)
    return mesh.p[:, mesh.t]


def width_of(mesh: Mesh) -> float:  # largest extent along an axis
    return np.ptp(mesh.p, axis=1).max()


TRIANGLE = Cell(
    name="triangle",
    facet="an edge",
    size="an area",
    mesh=MeshTri1,
    curved_mesh=MeshTri2,
    dim=2,
    edges=((1, 2), (2, 0), (0, 1)),
    facets=((0, 1), (1, 2), (0, 2)),
    opposite=(2, 0, 1),
    outward=((1, 2), (2, 0), (0, 1)),
    regular=4.0 * sqrt(3.0),
    size_per_node=sqrt(3.0) / 2.0,
    floor=0.3,
    hat_gradients=hats_of_triangles,
)
TETRAHEDRON = Cell(
    name="tetrahedron",
    facet="a face",
    size="a volume",
    mesh=MeshTet1,
    curved_mesh=MeshTet2,
    dim=3,
    edges=((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)),
    facets=((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)),
    opposite=(3, 2, 1, 0),
    outward=((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)),
    regular=12.0 * 3.0 ** (2.0 / 3.0),
    size_per_node=sqrt(0.5),
    floor=0.2,
    hat_gradients=hats_of_tetrahedra,
)
CELLS = {cell.dim: cell for cell in (TRIANGLE, TETRAHEDRON)}  # by dimension
FACES = np.array(TETRAHEDRON.outward)  # corners of the face opposite to each corner, counter-clockwise from outside


def cell_of(mesh: Mesh) -> Cell:
    return next(cell for cell in CELLS.values() if type(mesh) in (cell.mesh, cell.curved_mesh))


def check_kind(mesh: object, curved: bool = True, space: bool = True) -> None:
    cells = (TRIANGLE, TETRAHEDRON)[: 1 + space]
    kinds = [kind for cell in cells for kind in (cell.mesh, cell.curved_mesh)[: 1 + curved]]
    if type(mesh) in kinds:
        return
    names = [kind.__name__.removesuffix("1") for kind in kinds]
    wanted = "skfem." + " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))
    raise ValueError(f"mesh must be a {wanted}; got {type(mesh).__name__}. {remedy_for(mesh, space)}")


def remedy_for(mesh: object, space: bool) -> str:
    name = type(mesh).__name__
    if "Quad" in name:
        return "Split the quadrilaterals: mesh.to_meshtri()."
    if "Line" in name or (not space and any(kind in name for kind in SOLID)):
        return f"This works in the plane{' and in space' if space else ''} only."
    if name == "MeshTet2":
        return "Keep its corners only: MeshTet(mesh.p[:, :mesh.nvertices], mesh.t)."
    if name.endswith("DG") and "Tri" in name:
        return "Connect its elements: MeshTri(mesh.p, mesh.dofs.element_dofs).remove_duplicate_nodes()."
    if name.startswith("MeshTri"):
        return "Keep its corners only: MeshTri(mesh.p[:, :mesh.nvertices], mesh.t)."
    if any(kind in name for kind in SOLID):
        return "Split its elements into tetrahedra: mesh.to_meshtet()."
    return f"Build one with skfem.MeshTri{' or MeshTet' if space else ''} or kohonen_adapt.read_mesh."
