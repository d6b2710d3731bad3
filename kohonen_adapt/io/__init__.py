"""Mesh files in and out: Gmsh MSH 2.2 and 4.1 with physical groups, curves of second order too; VTU for ParaView."""

import math
from collections.abc import Mapping
from numbers import Real
from os import PathLike
from pathlib import Path

from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.files import whole_file
from kohonen_adapt.io.assembly import to_mesh
from kohonen_adapt.io.checks import checked_fields, checked_sets
from kohonen_adapt.io.gmsh_reader import read_msh
from kohonen_adapt.io.gmsh_writer import write_msh
from kohonen_adapt.io.groups import Groups, to_groups
from kohonen_adapt.io.second_order import to_curves
from kohonen_adapt.io.vtu import read_vtu, write_vtu
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.outline.spline import Spline

__all__ = ["Groups", "read_curves", "read_groups", "read_mesh", "write_mesh"]

MSH_VERSION = {".msh": "4.1", ".msh2": "2.2"}
"""Which version of MSH a suffix asks for; `.msh2` is what Gmsh itself takes for 2.2."""


def read_mesh(path: str | PathLike[str], *, scale: float = 1.0) -> MeshTri:
    """Read a mesh of triangles with the names of its surface and line groups.

    Surface groups become ``subdomains`` and line groups ``boundaries``, inside the mesh as well as on its rim; a
    dictionary without an entry is None. Groups without a name are called ``region_<tag>`` and ``boundary_<tag>``;
    `read_groups` reads the numbers of the others.
    Second-order triangles are read as their corners (`read_curves` reads what their mid-side nodes say), an element in
    several groups is read once, nodes that no triangle uses are dropped. Which part of the area carries a name, and
    what was left out, is reported through ``logging``. Boundaries come without orientation: the files hold none that
    Gmsh keeps.

    Parameters
    ----------
    path
        A Gmsh file, MSH 2.2 or 4.1, text or binary (``.msh``, ``.msh2``), or a ``.vtu`` file.
    scale
        Metres per unit of the file: 1e-3 for a drawing in millimetres. The files do not say.

    Returns
    -------
    MeshTri
        Nodes and elements in the order of their numbers in the file.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the suffix is unknown, the file is damaged, or it does not hold a plane mesh of triangles.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> ka.write_mesh("square.msh", skfem.MeshTri().refined(2))
    >>> mesh = ka.read_mesh("square.msh", scale=1e-3)  # drawn in millimetres
    >>> mesh.p.shape, float(mesh.p.max())
    ((2, 25), 0.001)
    """
    path = Path(path)
    suffix = _suffix(path, "read_mesh", (*MSH_VERSION, ".vtu"))
    _check_source(path, scale, "read_mesh")
    content = read_vtu(path) if suffix == ".vtu" else read_msh(path)
    return to_mesh(content, path, float(scale))


def read_groups(path: str | PathLike[str], *, scale: float = 1.0) -> Groups:
    """Read the numbers of the physical groups of a Gmsh file, by which GetDP and others know them.

    ``write_mesh(path, mesh, groups=groups)`` gives them to a mesh that was changed in between.

    Parameters
    ----------
    path
        A Gmsh file. A ``.vtu`` file has names and no numbers, so there is nothing to read.
    scale
        The same as for `read_mesh`.

    Returns
    -------
    Groups
        What the groups of each number are called in the mesh that `read_mesh` makes, and where groups of points are.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the suffix is unknown or the file is damaged.
    """
    path = Path(path)
    suffix = _suffix(path, "read_groups", (*MSH_VERSION, ".vtu"))
    _check_source(path, scale, "read_groups")
    return Groups() if suffix == ".vtu" else to_groups(read_msh(path), path, float(scale))


def read_curves(path: str | PathLike[str], mesh: MeshTri, *, scale: float = 1.0) -> dict[str, Spline]:
    """Read the curves on which a second-order Gmsh file has the mid-side nodes of its named boundaries.

    With ``Mesh.ElementOrder = 2`` Gmsh puts these nodes on the curves of the drawing; the spline through them and the
    ends of the facets is much nearer to the curves than one through the ends alone. It has pieces as
    `Spline.through` has.

    Parameters
    ----------
    path
        The Gmsh file.
    mesh
        What `read_mesh` made of it, with the names that it now has; interior boundaries too.
    scale
        The same as for `read_mesh`.

    Returns
    -------
    dict
        A `Spline` by name for every boundary of `mesh` with a mid-side node off its facet by more than rounding. What
        is straight is left out.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the suffix is not that of a Gmsh file, the file is damaged or of first order, or `mesh` is another mesh.
    """
    path = Path(path)
    _suffix(path, "read_curves", tuple(MSH_VERSION))
    _check_source(path, scale, "read_curves")
    check_mesh(mesh)
    return to_curves(read_msh(path), mesh, path, float(scale))


def write_mesh(
    path: str | PathLike[str],
    mesh: MeshTri,
    *,
    point_data: Mapping[str, ArrayLike] | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
    groups: Groups | None = None,
) -> None:
    """Write a mesh with its names, and fields on it, for Gmsh or ParaView.

    Nodes, elements and coordinates come back from `read_mesh` bit for bit in the same order, names to the letter. Sets
    called ``gmsh:*``, which scikit-fem brings from Gmsh files, are left out, and so is the orientation of boundaries.
    The file is written whole or not at all.

    Parameters
    ----------
    path
        ``.msh`` writes Gmsh MSH 4.1 and ``.msh2`` MSH 2.2, with a physical group per name and the fields as views.
        ``.vtu`` is for ParaView: an integer array ``region`` that numbers the combinations of subdomain names, and the
        names as the arrays ``skfem:s:<name>`` and ``skfem:b:<name>``, which ``skfem.Mesh.load`` understands, too.
    mesh
        A `MeshTri`.
    point_data
        Fields (nnodes,) by name.
    cell_data
        Fields (nelements,) or vectors (2, nelements) by name.
    groups
        What `read_groups` read: names keep their numbers, and groups of points are written where they have a node.
        Without it, ``region_7`` and ``boundary_7`` are groups of that number and no name, and others are numbered
        anew. VTU files have no numbers.

    Raises
    ------
    ValueError
        If the suffix is unknown, the mesh is empty, broken or not exactly a `MeshTri`, a name or number cannot be
        stored, or a field has another shape or holds a value that is not finite.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(2).with_boundaries({"left": lambda x: x[0] == 0.0})
    >>> ka.write_mesh("square.msh", mesh, point_data={"height": mesh.p[1]}, cell_data={"quality": ka.quality(mesh)})
    >>> list(ka.read_mesh("square.msh").boundaries)
    ['left']
    """
    path = Path(path)
    suffix = _suffix(path, "write_mesh", (*MSH_VERSION, ".vtu"))
    check_mesh(mesh)
    subdomains = checked_sets(mesh.subdomains, "subdomain")
    boundaries = checked_sets(mesh.boundaries, "boundary")
    points = checked_fields(point_data, mesh.p.shape[1], "point_data", vectors=False)
    cells = checked_fields(cell_data, mesh.t.shape[1], "cell_data", vectors=True)
    with whole_file(path) as draft:
        if suffix == ".vtu":
            write_vtu(draft, mesh, subdomains, boundaries, points, cells)
        else:
            version = MSH_VERSION[suffix]
            write_msh(draft, mesh, subdomains, boundaries, points, cells, version=version, groups=groups or Groups())


def _suffix(path: Path, caller: str, known: tuple[str, ...]) -> str:
    suffix = path.suffix.lower()
    if suffix not in known:
        raise ValueError(f"{caller} expected a file name that ends in {', '.join(known)}; got '{path.name}'.")
    return suffix


def _check_source(path: Path, scale: float, caller: str) -> None:
    if not (isinstance(scale, Real) and math.isfinite(scale) and scale > 0.0):
        raise ValueError(f"scale must be a positive number, 1e-3 for a drawing in millimetres; got {scale!r}.")
    if not path.is_file():
        raise FileNotFoundError(f"{caller} expected a mesh file; there is none at '{path}'.")
