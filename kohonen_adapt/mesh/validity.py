"""Refuse what is not a valid mesh of triangles, straight or with bent sides."""

import numpy as np
from skfem import MeshTri
from skfem.mesh import MeshTri1

from kohonen_adapt.mesh.curved import check_bent, check_middles, corners_of, is_second_order
from kohonen_adapt.mesh.host import is_own_name, number_facets

__all__ = ["check_mesh"]


def check_mesh(mesh: MeshTri, bent: bool = False, folded: bool = False) -> None:
    """Refuse what is not a mesh of connected, non-degenerate triangles, straight ones unless `bent` ones will do.

    With `folded`, bent sides may fold elements over, as they do in coarse meshes of second order by Gmsh: whoever moves
    nodes takes only the curves from such sides, and bends them anew.

    It must be exactly a `skfem.MeshTri`, or a `skfem.MeshTri2` if it may be `bent` (the message names the remedy), not
    empty, without isolated nodes, coordinates that are not finite, elements without area or folded over by their bent
    sides, or names for elements or facets that do not exist.
    """
    if bent and is_second_order(mesh):
        check_mesh(corners_of(mesh))
        check_middles(mesh)
        if not folded:
            check_bent(mesh)
        return
    if type(mesh) is not MeshTri1:
        wanted = "skfem.MeshTri or MeshTri2" if bent else "skfem.MeshTri"
        raise ValueError(f"mesh must be a {wanted}; got {type(mesh).__name__}. {remedy_for(mesh)}")
    if mesh.t.shape[1] == 0 or mesh.p.shape[1] == 0:
        raise ValueError("mesh must have at least one element; got an empty mesh.")
    if mesh.p.shape[0] != 2:
        raise ValueError(f"mesh must have coordinates of shape (2, n); got {mesh.p.shape}.")
    if not np.all(np.isfinite(mesh.p)):
        bad = int(np.flatnonzero(~np.isfinite(mesh.p).all(axis=0))[0])
        raise ValueError(f"mesh must have finite coordinates; node {bad} is at {tuple(mesh.p[:, bad].tolist())}.")
    check_nodes_used(mesh)
    check_areas(mesh)
    check_names(mesh)


def remedy_for(mesh: object) -> str:
    """What to do with a mesh of another class."""
    name = type(mesh).__name__
    if "Quad" in name:
        return "Split the quadrilaterals: mesh.to_meshtri()."
    if name.endswith("DG"):
        return "Connect its elements: MeshTri(mesh.p, mesh.dofs.element_dofs).remove_duplicate_nodes()."
    if name.startswith("MeshTri"):
        return "Keep its corners only: MeshTri(mesh.p[:, :mesh.nvertices], mesh.t)."
    if "Tet" in name or "Hex" in name or "Line" in name:
        return "Only two-dimensional meshes can be adapted."
    return "Build one with skfem.MeshTri or kohonen_adapt.read_mesh."


def check_nodes_used(mesh: MeshTri) -> None:
    """Refuse nodes that belong to no element, and elements whose nodes do not exist."""
    count = mesh.p.shape[1]
    if mesh.t.min() < 0 or mesh.t.max() >= count:
        raise ValueError(f"mesh.t must hold node numbers from 0 to {count - 1}; got {mesh.t.min()} to {mesh.t.max()}.")
    unused = np.flatnonzero(np.bincount(mesh.t.ravel(), minlength=count) == 0)
    if len(unused):
        raise ValueError(
            f"every node must belong to an element; {len(unused)} do not, the first is node {unused[0]}. "
            "Drop them with mesh.remove_unused_nodes()."
        )


def check_areas(mesh: MeshTri) -> None:
    """Refuse elements without area: less than 1e-14 of the square of their longest edge."""
    (ax, bx, cx), (ay, by, cy) = mesh.p[:, mesh.t]
    ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
    longest = np.maximum(np.maximum(ux**2 + uy**2, vx**2 + vy**2), (cx - bx) ** 2 + (cy - by) ** 2)
    flat = np.flatnonzero(~(np.abs(ux * vy - vx * uy) > 1e-14 * longest))
    if len(flat):
        raise ValueError(
            f"every element must have an area above zero; {len(flat)} have none, the first is element {flat[0]}. "
            "Mesh again, or take them out."
        )


def check_names(mesh: MeshTri) -> None:
    """Refuse named sets that do not hold numbers of elements or facets."""
    subdomains, boundaries = mesh.subdomains or {}, mesh.boundaries or {}
    if boundaries:
        number_facets(mesh)
    named = [("subdomain", name, rows, mesh.t.shape[1]) for name, rows in subdomains.items()]
    named += [("boundary", name, rows, mesh.facets.shape[1]) for name, rows in boundaries.items()]
    for kind, name, rows, count in named:
        if not isinstance(name, str):
            raise ValueError(f"the name of a {kind} must be text; got {name!r}.")
        if not is_own_name(name):
            continue
        rows = np.asarray(rows)
        if rows.ndim != 1 or rows.dtype.kind not in "iu":
            raise ValueError(
                f"{kind} '{name}' must be an array (k,) of integers; got {rows.dtype} of shape {rows.shape}. "
                "Masks: numpy.flatnonzero(mask)."
            )
        if len(rows) and (rows.min() < 0 or rows.max() >= count):
            raise ValueError(
                f"{kind} '{name}' must have indices from 0 to {count - 1}; got {rows.min()} to {rows.max()}."
            )
