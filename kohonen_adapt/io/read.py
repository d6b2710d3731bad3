"""Read a mesh, the numbers of its groups or its curves from a file."""

import math
from collections.abc import Callable
from numbers import Real
from os import PathLike
from pathlib import Path

from skfem import MeshTet, MeshTri

from kohonen_adapt.io.assembly import is_second_order, to_curves, to_mesh
from kohonen_adapt.io.content import MSH_VERSION, Content, suffix_of
from kohonen_adapt.io.elmer import HEADER, read_elmer
from kohonen_adapt.io.femm import read_ans
from kohonen_adapt.io.gmsh_reader import read_msh
from kohonen_adapt.io.groups import Groups, to_groups
from kohonen_adapt.io.meshio_reader import FORMATS, read_content
from kohonen_adapt.io.solids import to_solid
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.outline.spline import Spline

__all__ = ["read_curves", "read_groups", "read_mesh", "shown_curves"]

Reader = Callable[[Path], Content]

CURVED: dict[str, Reader] = dict.fromkeys(MSH_VERSION, read_msh)
READERS: dict[str, Reader] = {**CURVED, **dict.fromkeys(FORMATS, read_content), ".ans": read_ans}
"""Suffix to what reads such a file."""


def read_mesh(path: str | PathLike[str], *, scale: float = 1.0) -> MeshTri | MeshTet:
    """Read a mesh of triangles or tetrahedra with the names of its groups.

    Surface groups become ``subdomains`` and line groups ``boundaries``, inside the mesh as well as on its rim; a
    dictionary without an entry is None. A file with tetrahedra is a solid: its volume groups become ``subdomains``, its
    surface groups ``boundaries``, and groups of lines are left out. Groups without a name are called ``region_<tag>``
    and ``boundary_<tag>``; `read_groups` reads the numbers of the others.
    Second-order triangles with a bent side become a `MeshTri2`, whose curves `relocate` and `adapt` know by themselves;
    where all sides are straight, and of higher orders, the corners are read. An element in several groups is read once,
    nodes that no element uses are dropped, tetrahedra of negative volume turned. Which part of the area or volume
    carries a name, and what was left out, is reported through ``logging``. A boundary inside has the orientation of its
    lines, with the element on their left in front of it, as in ``skfem.MeshTri.load``, or of its triangles, with the
    element in front of it that they run clockwise as seen from; none where they have no direction.

    Parameters
    ----------
    path
        A Gmsh file, MSH 2.2 or 4.1, text or binary (``.msh``, ``.msh2``), or what meshio reads well: ``.vtu`` of one
        piece, ``.vtk``, ``.inp`` (Abaqus), ``.mesh`` (Medit), ``.su2``, and with h5py ``.med`` and ``.xdmf`` with its
        ``.h5``. Names are those of sets, families and markers, and what scikit-fem saves; numbers of groups, where a
        format has no names, are ``region_<number>`` and ``boundary_<number>``. Or the folder in which Elmer has a mesh;
        or the solution of FEMM (``.ans``), which says its unit and comes in metres, with blocks as subdomains (the
        labels of a block that has several also as ``<block> 1``, ``<block> 2``, in their order) and the properties of
        segments and arcs as boundaries.
    scale
        Metres per unit of the file: 1e-3 for a drawing in millimetres. The files do not say.

    Returns
    -------
    MeshTri or MeshTet
        Nodes and elements in the order of their numbers in the file; a `MeshTri2` where a side of a triangle of second
        order is bent.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the suffix is unknown, the file is damaged, or it does not hold a plane mesh of triangles, or tetrahedra of
        first order and faces of theirs alone.
    ImportError
        If the format needs h5py, and that is not there.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> ka.write_mesh("square.msh", skfem.MeshTri().refined(2))
    >>> mesh = ka.read_mesh("square.msh", scale=1e-3)  # drawn in millimetres
    >>> mesh.p.shape, float(mesh.p.max())
    ((2, 25), 0.001)
    """
    path = Path(path)
    reader = _reader(path, scale, "read_mesh", READERS)
    content = reader(path)
    return (to_solid if content.dimension == 3 else to_mesh)(content, path, float(scale))


def read_groups(path: str | PathLike[str], *, scale: float = 1.0) -> Groups:
    """Read the numbers of the physical groups of a Gmsh file, by which GetDP and others know them.

    ``write_mesh(path, mesh, groups=groups)`` gives them to a mesh that was changed in between.

    Parameters
    ----------
    path
        A Gmsh file or a folder of Elmer. Of others there is nothing to read: their numbers, if any, are in the names.
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
    reader = _reader(path, scale, "read_groups", READERS)
    return to_groups(reader(path), path, float(scale)) if reader in (read_msh, read_elmer) else Groups()


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
    _reader(path, scale, "read_curves", CURVED)
    check_mesh(mesh, bent=True, folded=True)
    return to_curves(read_msh(path), mesh, path, float(scale))


def shown_curves(path: Path, mesh: MeshTri, scale: float) -> dict[str, Spline]:
    """As `read_curves`; none of a file that is not of second order, or of another kind."""
    content = read_msh(path) if path.suffix.lower() in MSH_VERSION else None
    return to_curves(content, mesh, path, scale) if content is not None and is_second_order(content) else {}


def _reader(path: Path, scale: float, caller: str, readers: dict[str, Reader]) -> Reader:
    """What reads a file, or a folder of Elmer, that is there."""
    if not (isinstance(scale, Real) and math.isfinite(scale) and scale > 0.0):
        raise ValueError(f"scale must be a positive number, 1e-3 for a drawing in millimetres; got {scale!r}.")
    if readers is READERS and (path / HEADER).is_file():
        return read_elmer
    remedy = f" Gmsh converts others, .unv and .cgns with all names: gmsh '{path.name}' -save -o NEW.msh"
    suffix = suffix_of(path, caller, tuple(readers), remedy)
    if not path.is_file():
        raise FileNotFoundError(f"{caller} expected a mesh file; there is none at '{path}'.")
    return readers[suffix]
