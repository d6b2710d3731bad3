"""List the two kinds of elements of meshes, with all in which they differ above the compiled loops; refuse others."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np
from skfem import Mesh
from skfem.mesh import MeshTet1, MeshTri1, MeshTri2

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["CELLS", "TETRAHEDRON", "TRIANGLE", "Cell", "cell_of", "check_kind", "normals"]

SOLID = ("Tet", "Hex", "Wedge")  # in the names of classes of three dimensions


@dataclass(frozen=True)
class Cell:
    """One kind of element: a simplex of `dim` dimensions with as many corners and one more.

    Attributes
    ----------
    name, facet, size
        What messages call it, its facets, and |K|, with an article.
    mesh
        The class of scikit-fem's plain meshes of it.
    edges
        Its corners in pairs.
    facets, opposite
        The corners of its facets in scikit-fem's order, and the corner opposite to each.
    outward
        The corners of the facet opposite to each corner, so that of a positive element they run about the normal that
        points outward: with it on the left in the plane, counter-clockwise seen from outside in space.
    regular
        ``regular |K|^(2 / dim) / (sum of squared edges)`` is the quality of an element: 1 if it is regular.
    share
        The part of |K| that belongs to a node of a lattice whose edges have the length one: as of equilateral triangles
        in the plane, of densely packed spheres in space.
    floor
        The least quality that moving nodes leaves an element by default.
    determinant
        ``dim! |K|`` with its sign, (m,), of corners (dim, dim + 1, m).
    hat_gradients
        Gradients of the barycentric coordinates, (dim, dim + 1, m), of the same corners.
    """

    name: str
    facet: str
    size: str
    mesh: type[Mesh]
    dim: int
    edges: tuple[tuple[int, int], ...]
    facets: tuple[tuple[int, ...], ...]
    opposite: tuple[int, ...]
    outward: tuple[tuple[int, ...], ...]
    regular: float
    share: float
    floor: float
    determinant: Callable[[Floats], Floats]
    hat_gradients: Callable[[Floats], Floats]


def doubled_area(corners: Floats) -> Floats:
    """Twice the area of triangles, positive where their corners run counter-clockwise."""
    x, y = corners
    return (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])


def sixfold_volume(corners: Floats) -> Floats:
    """Six times the volume of tetrahedra a, b, c, d, positive where b, c, d run clockwise seen from a."""
    u, v, w = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    return np.sum(u * crossed(v, w), axis=0)


def crossed(u: Floats, v: Floats) -> Floats:
    """Cross products of vectors (3, m)."""
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])


def hats_of_triangles(corners: Floats) -> Floats:
    """``grad phi_i = (y_j - y_k, x_k - x_j) / (2 |K|)`` with i, j, k in their order and the area signed."""
    x, y = corners
    along_x = x[[2, 0, 1]] - x[[1, 2, 0]]
    along_y = y[[1, 2, 0]] - y[[2, 0, 1]]
    twice_area = along_y[0] * along_x[1] - along_y[1] * along_x[0]
    return np.stack((along_y, along_x)) / twice_area


def hats_of_tetrahedra(corners: Floats) -> Floats:
    """``grad phi_1 = v x w / (6 |K|)`` with u, v, w from corner 0 to the others, and so on; their sum is zero."""
    u, v, w = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    others = np.stack([crossed(v, w), crossed(w, u), crossed(u, v)], axis=1) / sixfold_volume(corners)
    return np.concatenate([-others.sum(axis=1, keepdims=True), others], axis=1)


def normals(position: Floats, nodes: Ints) -> Floats:
    """Vectors (f, 3) across triangles of nodes (f, 3), twice as long as their areas, towards who sees them run left."""
    a, b, c = (position[nodes[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


TRIANGLE = Cell(
    name="triangle",
    facet="an edge",
    size="an area",
    mesh=MeshTri1,
    dim=2,
    edges=((0, 2), (1, 0), (2, 1)),
    facets=((0, 1), (1, 2), (0, 2)),
    opposite=(2, 0, 1),
    outward=((1, 2), (2, 0), (0, 1)),
    regular=4.0 * sqrt(3.0),
    share=sqrt(3.0) / 2.0,
    floor=0.3,
    determinant=doubled_area,
    hat_gradients=hats_of_triangles,
)
TETRAHEDRON = Cell(
    name="tetrahedron",
    facet="a face",
    size="a volume",
    mesh=MeshTet1,
    dim=3,
    edges=((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)),
    facets=((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)),
    opposite=(3, 2, 1, 0),
    outward=((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)),
    regular=12.0 * 3.0 ** (2.0 / 3.0),
    share=sqrt(0.5),
    floor=0.2,
    determinant=sixfold_volume,
    hat_gradients=hats_of_tetrahedra,
)
CELLS = {cell.dim: cell for cell in (TRIANGLE, TETRAHEDRON)}  # by dimension


def cell_of(mesh: Mesh) -> Cell:
    """The kind of the elements of a mesh that `check_kind` lets pass; bent sides make no other kind."""
    return TRIANGLE if type(mesh) is MeshTri2 else next(cell for cell in CELLS.values() if type(mesh) is cell.mesh)


def check_kind(mesh: object, bent: bool = False, space: bool = False) -> None:
    """Refuse what is not exactly a `skfem.MeshTri`, a `MeshTri2` if `bent`, or a `MeshTet` if in `space`.

    The message names the remedy.
    """
    if type(mesh) is TRIANGLE.mesh or (bent and type(mesh) is MeshTri2) or (space and type(mesh) is TETRAHEDRON.mesh):
        return
    kinds = ["skfem.MeshTri", *["MeshTri2"] * bent, *["MeshTet"] * space]
    wanted = " or ".join(filter(None, (", ".join(kinds[:-1]), kinds[-1])))
    raise ValueError(f"mesh must be a {wanted}; got {type(mesh).__name__}. {remedy_for(mesh, space)}")


def remedy_for(mesh: object, space: bool) -> str:
    """What to do with a mesh of another class, where tetrahedra will do in `space`."""
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
