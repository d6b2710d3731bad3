"""Checks of a mesh of triangles or tetrahedra, with straight or curved sides."""

import numpy as np
from skfem import Mesh

from kohonen_adapt.mesh.cells import LARGEST_EXTENT, LEAST_EXTENT, cell_of, check_kind, corner_positions, width_of
from kohonen_adapt.mesh.curved import check_curved_sides, check_midsides, corners_of, is_second_order
from kohonen_adapt.mesh.host import is_own_name, number_facets

__all__ = ["check_mesh"]


FLAT = 1e-9  # maximum difference of equal coordinates, relative to the size of the mesh


def check_mesh(mesh: Mesh, curved: bool = True, inverted: bool = False, space: bool = True) -> None:
    # With `inverted`, curved sides may invert elements, as in coarse second-order meshes of Gmsh. Callers that move
    # nodes accept these, because they use the sides only to recognise curves and set new midside offsets.
    check_kind(mesh, curved, space)
    if is_second_order(mesh):
        check_mesh(corners_of(mesh), curved=False, space=space)
        check_midsides(mesh)
        if not inverted:
            check_curved_sides(mesh)
        return
    dim = cell_of(mesh).dim
    if mesh.nelements == 0 or mesh.p.shape[1] == 0:
        raise ValueError("mesh must have at least one element; got an empty mesh.")
    if mesh.p.shape[0] != dim:
        raise ValueError(f"mesh must have coordinates of shape ({dim}, n); got {mesh.p.shape}.{_in_plane(mesh)}")
    if not np.all(np.isfinite(mesh.p)):
        bad = int(np.flatnonzero(~np.isfinite(mesh.p).all(axis=0))[0])
        raise ValueError(f"mesh must have finite coordinates; node {bad} is at {tuple(mesh.p[:, bad].tolist())}.")
    check_extent(mesh)
    check_nodes_used(mesh)
    check_sizes(mesh)
    check_names(mesh)


def check_extent(mesh: Mesh) -> None:
    with np.errstate(over="ignore"):
        extent = float(width_of(mesh))
    if extent > LARGEST_EXTENT or 0.0 < extent < LEAST_EXTENT:
        raise ValueError(
            f"mesh must be from {LEAST_EXTENT:g} to {LARGEST_EXTENT:g} wide, in its own units; it is {extent:.3g} "
            "wide. Choose another unit: mesh.scaled(factor), or read_mesh(path, scale=factor)."
        )


def _in_plane(mesh: Mesh) -> str:
    extent = np.ptp(mesh.p, axis=1)
    constant = np.flatnonzero(extent <= FLAT * extent.max())
    if mesh.p.shape[0] != 3 or cell_of(mesh).dim != 2 or len(constant) != 1 or constant[0] == 2:
        return ""
    axes = [axis for axis in range(3) if axis != constant[0]]
    plane = "".join("xyz"[axis] for axis in axes)
    return f" They are in the {plane}-plane: rotate them with MeshTri(mesh.p[{axes}], mesh.t)."


def check_nodes_used(mesh: Mesh) -> None:
    count = mesh.p.shape[1]
    if mesh.t.min() < 0 or mesh.t.max() >= count:
        raise ValueError(f"mesh.t must hold node numbers from 0 to {count - 1}; got {mesh.t.min()} to {mesh.t.max()}.")
    unused = np.flatnonzero(np.bincount(mesh.t.ravel(), minlength=count) == 0)
    if len(unused):
        raise ValueError(
            f"every node must belong to an element; {len(unused)} do not, the first is node {unused[0]}. "
            "Drop them with mesh.remove_unused_nodes()."
        )


def check_sizes(mesh: Mesh) -> None:
    # The limit in d dimensions is ``1e-14 / d!`` times the d-th power of the longest edge.
    cell = cell_of(mesh)
    corners = corner_positions(mesh)
    longest = np.zeros(mesh.nelements)
    for one, other in cell.edges:
        # for short columns many times faster than np.sum
        longest = np.maximum(longest, sum((corners[:, one] - corners[:, other]) ** 2))
    flat = np.flatnonzero(~(np.abs(cell.determinant(corners)) > 1e-14 * longest ** (cell.dim / 2)))
    if len(flat) == mesh.nelements and cell.dim == 2 and not np.ptp(mesh.p, axis=1).all():
        axis = "xy"[int(np.argmin(np.ptp(mesh.p, axis=1)))]
        raise ValueError(
            f"all nodes have the same {axis}, so no element has {cell.size}. If the drawing is in the "
            f"{'xz' if axis == 'y' else 'yz'}-plane, rotate it to the xy-plane."
        )
    if len(flat):
        raise ValueError(
            f"every element must have {cell.size} above zero; {len(flat)} have none, the first is element {flat[0]}. "
            "Mesh again, or take them out."
        )


def check_names(mesh: Mesh) -> None:
    subdomains, boundaries = mesh.subdomains or {}, mesh.boundaries or {}
    if boundaries:
        number_facets(mesh)
    named = [("subdomain", name, rows, mesh.nelements) for name, rows in subdomains.items()]
    named += [("boundary", name, rows, mesh.nfacets) for name, rows in boundaries.items()]
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
