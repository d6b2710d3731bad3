"""Fields of other programs, read onto a mesh."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from skfem import Mesh

from kohonen_adapt.arrays import Array, FilePath, Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.display import plural
from kohonen_adapt.io.content import check_finite, suffix_of
from kohonen_adapt.io.gmsh_reader import read_views
from kohonen_adapt.io.medit_solution import SOLUTION, read_solution
from kohonen_adapt.io.meshio_reader import WITH_FIELDS, read_arrays
from kohonen_adapt.io.read import read_mesh
from kohonen_adapt.mesh.cells import cell_of, centroids_of, width_of
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.shapes import checked_tensors, mean_tensors
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["FIELD_SUFFIXES", "read_field"]

FIELD_SUFFIXES = (*WITH_FIELDS, ".msh", ".msh2", ".pos", SOLUTION)

Order = Mapping[int, tuple[tuple[int, ...], ...]]
"""Number of components of a tensor to the matrix of their indices."""

FULL: Order = {4: ((0, 1), (2, 3)), 9: ((0, 1, 2), (3, 4, 5), (6, 7, 8))}
VTK = {**FULL, 3: ((0, 2), (2, 1)), 6: ((0, 3, 5), (3, 1, 4), (5, 4, 2))}  # XX, YY, XY; XX, YY, ZZ, XY, YZ, XZ
XDMF = {**FULL, 6: ((0, 1, 2), (1, 3, 4), (2, 4, 5))}  # XX, XY, XZ, YY, YZ, ZZ
ORDERS = {".vtu": VTK, ".vtk": VTK, ".xdmf": XDMF}
BINARY = " Write the binary solution as text: Mmg does so if the name of its output ends in .sol."
REMEDY = (
    " components. Write a component, or the magnitude, as a field of its own, a tensor with 9 components, row by row."
)

NEAR = 1e-6  # tolerance for positions in single precision, relative to the size of the mesh


def read_field(path: FilePath, mesh: Mesh, name: str | None = None, *, scale: float = 1.0) -> Floats:
    """Read a scalar or a metric tensor per element from a file.

    Parameters
    ----------
    path
        A file with views of Gmsh (``.msh``, ``.msh2``, ``.pos``: the formats of Gmsh and GetDP), ``.vtu``, ``.vtk``,
        ``.xdmf`` or ``.med``, or a solution of Medit and Mmg as text (``.sol``). Cells of another shape than the
        elements and unused points are ignored.
    mesh
        The mesh of the field, of triangles or tetrahedra: the same nodes and elements as in the file, in any order.
        Elements are matched by their centres, because programs renumber them. A ``.sol`` file has no positions: they
        are those of the ``.mesh`` file of the same name in its folder, or else the nodes of `mesh` in their order.
    name
        Name of the field, None for the only one in the file. Those of a ``.sol`` file are called ``solution 1``,
        ``solution 2`` and so on. The mean over each element is returned for a field at points or nodes.
    scale
        Units of the file per unit of the mesh; 1e-3 for a file in metres and a mesh in millimetres. Values are not
        converted.

    Returns
    -------
    ndarray (nelements,) or (nelements, d, d)
        Values of the field as they are in the file; a scalar for Mmg is an edge length. Tensors are checked like a
        metric of `density_from_sizes`.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the suffix is unknown, the file is damaged, on another mesh, without the field or with two fields of the
        name, or the scale is not a finite number > 0. If the field is neither a scalar nor a tensor, or if a tensor is
        not finite, not symmetric or not positive definite, or if its longest edge is more than 1e6 times its shortest.

    Notes
    -----
    A tensor has 9 components, row by row, or 4 in the plane. Of 9 or 6 components on triangles those in the plane are
    read. Symmetric tensors with 6 components have the order XX, YY, ZZ, XY, YZ, XZ in ``.vtu`` and ``.vtk``, with 3
    XX, YY, XY, if the last component is not zero everywhere, as it is in vectors. The order in ``.xdmf`` is XX, XY, XZ,
    YY, YZ, ZZ, and in ``.sol`` the lower triangle by rows, as Medit has it. Means of tensors are means of logarithms
    (Arsigny, Fillard, Pennec and Ayache, SIAM J. Matrix Anal. Appl. 29, 2007).

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)
    >>> ka.write_mesh("height.vtu", mesh, point_data={"height": mesh.p[1]})
    >>> ka.read_field("height.vtu", mesh, "height").shape
    (8,)

    The metric of a solution of Mmg:

    >>> rows = "\\n".join(["100 0 2500"] * 9)  # edges of 0.1 along x and of 0.02 along y, at 9 vertices
    >>> text = f"MeshVersionFormatted 2 Dimension 2 SolAtVertices 9 1 3 {rows} End"
    >>> _ = open("metric.sol", "w").write(text)
    >>> metric = ka.read_field("metric.sol", mesh)
    >>> metric.shape, ka.density_from_sizes(mesh, metric).shape
    ((8, 2, 2), (8, 2, 2))
    """
    path = Path(path)
    check_mesh(mesh)
    mesh = corners_of(mesh)
    if not 0.0 < scale < np.inf:
        raise ValueError(f"scale must be a finite number > 0; got {scale!r}.")
    if not path.is_file():
        raise FileNotFoundError(f"read_field expected a file with a field; there is none at '{path}'.")
    suffix = suffix_of(path, "read_field", FIELD_SUFFIXES, BINARY if path.suffix.lower() == ".solb" else "")
    shape = cell_of(mesh).name
    if suffix == SOLUTION:
        content = read_solution(path, mesh)
    else:
        content = (read_arrays if suffix in WITH_FIELDS else read_views)(path, shape)
    points = content.points[:, : len(mesh.p)]
    _check_unit(mesh, points[np.unique(content.cells)], path, scale)
    try:
        place = _match_cells(mesh, points / scale, content.cells, path, shape)
    except ValueError as error:
        raise ValueError(f"{error}{_owner_sentence(path, points / scale, content.cells, shape)}") from None
    known = listed({field.name for field in content.fields})
    if name is None and len(content.fields) != 1:
        raise ValueError(f"'{path}' must have one field if no name is given; its fields are: {known}.")
    found = [field for field in content.fields if name in (None, field.name)]
    if {field.nodal for field in found} == {True, False}:
        raise ValueError(f"'{path}' has '{name}' at points and in cells; rename one of them.")
    if len(found) > 1:
        raise ValueError(f"'{path}' has {len(found)} fields or steps '{name}'; write one only.")
    if not found:
        raise ValueError(f"'{path}' has no field '{name}'; its fields are: {known}.")
    field = found[0]
    values = field.values[content.cells[place] if field.nodal else place]
    return _of_elements(values, ORDERS.get(suffix, FULL), len(mesh.p), f"'{field.name}' of '{path}'")


def _match_cells(mesh: Mesh, points: Floats, cells: Ints, path: Path, shape: str) -> Ints:
    used = np.unique(cells)
    if len(cells) != mesh.nelements:  # programs with discontinuous elements write more points
        raise ValueError(
            f"read_field expected a field on the mesh, of {mesh.p.shape[1]} nodes and {mesh.nelements} "
            f"{plural(shape)}; '{path}' has {len(used)} and {len(cells)}."
        )
    _nearest(mesh.p.T, points[used], mesh, path, "node")
    place = _nearest(centroids_of(mesh).T, points[cells].mean(axis=1), mesh, path, shape)
    if len(np.unique(place)) < len(place):
        raise ValueError(f"read_field expected a field on the mesh; '{path}' has different {plural(shape)}.")
    return place


def _owner_sentence(path: Path, points: Floats, cells: Ints, shape: str) -> str:
    beside = path.with_suffix(".msh")
    try:
        _match_cells(corners_of(read_mesh(beside)), points, cells, path, shape)
    except (ValueError, OSError):
        return ""
    return f" The field belongs to '{beside}'."


def _check_unit(mesh: Mesh, points: Floats, path: Path, scale: float) -> None:
    if not (len(points) and np.all(np.isfinite(points))):
        return
    own, given = (np.array([np.min(p, axis=0), np.max(p, axis=0)]) for p in (mesh.p.T, points))
    size = np.ptp(own, axis=0).max()
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # for a damaged file
        factor = np.ptp(given, axis=0).max() / size
        alike = np.max(np.abs(given / factor - own)) < NEAR * size
    if alike and abs(factor / scale - 1.0) > NEAR:
        raise ValueError(
            f"read_field expected the mesh in '{path}' at a scale of {scale:g}; its scale is {factor:.6g}, so the "
            f"units differ. Use --scale {factor:.6g} (metres per unit of the mesh, for a field file in metres)."
        )


def _nearest(wanted: Floats, given: Floats, mesh: Mesh, path: Path, what: str) -> Ints:
    check_finite(given, path, "read_field", what)
    distance, place = cKDTree(given).query(wanted)
    off = float(np.max(distance) / width_of(mesh))
    if off > NEAR:
        raise ValueError(
            f"read_field expected a field on the mesh; in '{path}' a {what} is off by {off:.3g} times the size "
            "of the mesh. Do both files have the same unit and step?"
        )
    return place


def _of_elements(values: Array, order: Order, dim: int, what: str) -> Floats:
    # from corners (m, k, components) to elements
    place = order.get(values.shape[-1], ())
    in_plane = values.shape[-1] == 3 and not values[..., 2].any()  # a vector, which ParaView needs in space
    if not (values.dtype.kind in "iuf" and (values.shape[-1] == 1 or len(place) >= dim)) or in_plane:
        raise ValueError(
            f"{what} must be one real number or a tensor per node or element; got {values.shape[-1]}{REMEDY}"
        )
    values = values.astype(float)
    if values.shape[-1] == 1:
        return np.mean(values[..., 0], axis=1)
    return mean_tensors(checked_tensors(values[..., np.array(place)[:dim, :dim]], what))
