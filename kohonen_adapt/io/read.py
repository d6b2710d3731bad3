"""Meshes, group numbers and curves read from files."""

import math
from collections.abc import Callable
from numbers import Real
from pathlib import Path

from skfem import MeshTet, MeshTri

from kohonen_adapt.arrays import FilePath
from kohonen_adapt.geometry.plane.spline import Spline
from kohonen_adapt.io.assembly import to_mesh
from kohonen_adapt.io.content import MSH_VERSION, Content, suffix_of
from kohonen_adapt.io.curved_sides import order_of_sides, to_curves
from kohonen_adapt.io.elmer import HEADER, read_elmer
from kohonen_adapt.io.femm import read_ans
from kohonen_adapt.io.gmsh_reader import read_msh
from kohonen_adapt.io.groups import Groups, to_groups
from kohonen_adapt.io.meshio_reader import FORMATS, read_content
from kohonen_adapt.io.plain_text import is_mfem, read_mfem
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["curves_in_file", "read_curves", "read_groups", "read_mesh"]

Reader = Callable[[Path], Content]

CURVED: dict[str, Reader] = dict.fromkeys(MSH_VERSION, read_msh)
READERS: dict[str, Reader] = {**CURVED, **dict.fromkeys(FORMATS, read_content), ".ans": read_ans}
"""Suffix to reader."""

BY_GMSH = (".unv", ".cgns", ".bdf", ".nas", ".neu", ".p3d", ".diff", ".stl")
BY_MESHIO = (".e", ".ex2", ".exo", ".avs", ".ugrid", ".f3grid", ".dat", ".tec", ".post")
DRAWINGS = (".geo", ".geo_unrolled", ".step", ".stp", ".brep", ".iges", ".igs")
REMEDIES = {
    ".fem": " This is a model of FEMM: analyse it there, and read the solution, the .ans file beside it.",
    **dict.fromkeys(DRAWINGS, " This is a drawing. Gmsh meshes it, a solid with -3: gmsh -2 '{0}' -o NEW.msh"),
    **dict.fromkeys(BY_GMSH, " Gmsh converts it (.unv and .cgns with all names): gmsh '{0}' -save -o NEW.msh"),
    **dict.fromkeys(BY_MESHIO, " meshio converts it: meshio convert '{0}' NEW.vtu"),
}
"""Suffix of another format to the way from it to a file that can be read."""

IN_PYTHON = (
    " Of nodes p (2, n) and triangles t (3, m) in a text file, numpy.loadtxt and skfem.MeshTri(p, t) make a mesh."
)


def read_mesh(path: FilePath, *, scale: float = 1.0) -> MeshTri | MeshTet:
    """Read a mesh of triangles or tetrahedra with the names of its groups.

    Surface groups are read as ``subdomains`` and line groups as ``boundaries``, inside the mesh as well as on its rim;
    a dictionary without an entry is None. A file with tetrahedra is a solid: its volume groups are read as
    ``subdomains``, its surface groups as ``boundaries``, and groups of lines are left out. Groups without a name are
    called ``region_<tag>`` and ``boundary_<tag>``; `read_groups` reads the numbers of all groups.

    Triangles of order 2 to 5 with a curved side make a `MeshTri2`, whose curves `relocate` and `adapt` follow. Midside
    nodes are the middles of the polynomials along the sides, and the distance of the other nodes from the curves read
    is reported. Tetrahedra of ten nodes with a curved edge make a `MeshTet2`. If all sides are straight, only the
    corners are read. An element in several groups is read once,
    unused nodes are dropped, and tetrahedra of negative volume are turned. The part of the area or volume without a
    name, and everything left out, is reported through ``logging``.

    A boundary inside the mesh has the orientation of its lines, with the element on their left in front, as in
    ``skfem.MeshTri.load``; of triangles, the element in front is the side from which they run clockwise. Lines without
    a common direction make a boundary without orientation.

    Parameters
    ----------
    path
        A Gmsh file, MSH 2.2 or 4.1, text or binary (``.msh``, ``.msh2``), or a format that meshio reads well: ``.vtu``
        of one piece, ``.vtk``, ``.inp`` (Abaqus, CalculiX, AVS UCD), ``.mesh`` (Medit), ``.su2``, ``.vol`` (Netgen),
        and with h5py ``.med`` and ``.xdmf`` with its ``.h5``. Also ``.msh`` of FreeFEM and ``.mesh`` of MFEM. Names are
        those of sets, families and markers, and of scikit-fem's arrays; groups in a format without names are called
        ``region_<number>`` and ``boundary_<number>``. These numbers may be integers per cell of any name, if one array
        of these only can be meant. A node set of Abaqus is the sides on the outline, or between element sets, with all
        nodes in the set.

        Or the folder of a mesh of Elmer, or the solution of FEMM (``.ans``). The latter is read in metres, because the
        file has its unit; blocks are subdomains (the labels of a block with several also as ``<block> 1``,
        ``<block> 2``, in their order) and properties of segments and arcs are boundaries.
    scale
        Metres per unit of the file: 1e-3 for a drawing in millimetres. Most files do not store their unit.

    Returns
    -------
    MeshTri or MeshTet
        Nodes and elements in the order of their numbers in the file; a `MeshTri2` or `MeshTet2` if a side is curved.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the suffix is unknown, the file is damaged, or it does not hold a plane mesh of triangles, or tetrahedra of
        first or second order and faces of these only.
    ImportError
        If the format needs h5py, which is not installed.

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
    return to_mesh(content, path, float(scale))


def read_groups(path: FilePath, *, scale: float = 1.0) -> Groups:
    """Read the numbers of the physical groups of a mesh file.

    GetDP and other programs refer to groups by these numbers. ``write_mesh(path, mesh, groups=groups)`` writes them
    with a mesh that was changed in between.

    Parameters
    ----------
    path
        A Gmsh file or a folder of Elmer. Other formats have no numbers besides those in their names.
    scale
        The same as for `read_mesh`.

    Returns
    -------
    Groups
        Numbers and names of the groups, as in the mesh of `read_mesh`, and the positions of groups of points.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the suffix is unknown or the file is damaged.
    """
    path = Path(path)
    reader = _reader(path, scale, "read_groups", READERS)
    return to_groups(reader(path), path, float(scale)) if reader in (read_msh, read_elmer) else Groups()


def read_curves(path: FilePath, mesh: MeshTri, *, scale: float = 1.0) -> dict[str, Spline]:
    """Read the curves through the midside nodes of the boundaries of a Gmsh file.

    With ``Mesh.ElementOrder = 2`` and above Gmsh puts nodes between the ends of facets on the curves of the drawing.
    The spline through these and the ends is much nearer to the curves than a spline through the ends alone. Its pieces
    are those of `Spline.through`.

    Parameters
    ----------
    path
        The Gmsh file, of order 2 to 5.
    mesh
        The mesh that `read_mesh` returned for the file, with its present names; interior boundaries are read, too.
    scale
        The same as for `read_mesh`.

    Returns
    -------
    dict
        Name to `Spline` for every boundary of `mesh` with a midside node off its facet by more than rounding. Straight
        boundaries are left out.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the suffix is not that of a Gmsh file, the file is damaged or of first order, or `mesh` is another mesh.
    """
    path = Path(path)
    _reader(path, scale, "read_curves", CURVED)
    check_mesh(mesh, inverted=True, space=False)
    return to_curves(read_msh(path), mesh, path, float(scale))


def curves_in_file(path: Path, mesh: MeshTri, scale: float) -> dict[str, Spline]:
    content = read_msh(path) if path.suffix.lower() in MSH_VERSION else None
    return to_curves(content, mesh, path, scale) if content is not None and order_of_sides(content) else {}


def _reader(path: Path, scale: float, caller: str, readers: dict[str, Reader]) -> Reader:
    if not (isinstance(scale, Real) and math.isfinite(scale) and scale > 0.0):
        raise ValueError(f"scale must be a positive number, 1e-3 for a drawing in millimetres; got {scale!r}.")
    if readers is READERS and (path / HEADER).is_file():
        return read_elmer
    suffix = suffix_of(path, caller, tuple(readers), REMEDIES.get(path.suffix.lower(), IN_PYTHON).format(path.name))
    if not path.is_file():
        raise FileNotFoundError(f"{caller} expected a mesh file; there is none at '{path}'.")
    return read_mfem if suffix == ".mesh" and is_mfem(path) else readers[suffix]
