"""Fields of other programs, read onto a mesh."""

from os import PathLike
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.display import plural
from kohonen_adapt.io.content import CellFields, Field, check_finite, suffix_of
from kohonen_adapt.io.gmsh_reader import read_views
from kohonen_adapt.io.meshio_reader import WITH_FIELDS, read_arrays
from kohonen_adapt.io.read import read_mesh
from kohonen_adapt.mesh.cells import cell_of
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["FIELD_SUFFIXES", "read_field"]

FIELD_SUFFIXES = (*WITH_FIELDS, ".msh", ".msh2", ".pos")

NEAR = 1e-6  # tolerance for positions in single precision, relative to the size of the mesh


def read_field(path: str | PathLike[str], mesh: Mesh, name: str, *, scale: float = 1.0) -> Floats:
    """Read a scalar field from a file, one number per element.

    Parameters
    ----------
    path
        A file with views of Gmsh (``.msh``, ``.msh2``, ``.pos``: the formats of Gmsh and GetDP), or ``.vtu``, ``.vtk``,
        ``.xdmf`` or ``.med``. Cells of another shape than the elements and unused points are ignored.
    mesh
        The mesh of the field, of triangles or tetrahedra: the same nodes and elements as in the file, in any order.
        Elements are matched by their centres, because programs renumber them.
    name
        Name of the field. A field at points or nodes is averaged over each element.
    scale
        Units of the file per unit of the mesh; 1e-3 for a file in metres and a mesh in millimetres.

    Returns
    -------
    ndarray (nelements,)
        Values of the field.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the suffix is unknown, the file is damaged, on another mesh, without the field or with two fields of the
        name, the field is not a scalar, or the scale is not a finite number > 0.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)
    >>> ka.write_mesh("height.vtu", mesh, point_data={"height": mesh.p[1]})
    >>> ka.read_field("height.vtu", mesh, "height").shape
    (8,)
    """
    path = Path(path)
    check_mesh(mesh, curved=True, space=True)
    mesh = corners_of(mesh)
    if not 0.0 < scale < np.inf:
        raise ValueError(f"scale must be a finite number > 0; got {scale!r}.")
    if not path.is_file():
        raise FileNotFoundError(f"read_field expected a file with a field; there is none at '{path}'.")
    suffix = suffix_of(path, "read_field", FIELD_SUFFIXES)
    shape = cell_of(mesh).name
    content = (read_arrays if suffix in WITH_FIELDS else read_views)(path, shape)
    points = content.points[:, : len(mesh.p)]
    _check_unit(mesh, points[np.unique(content.cells)], path, scale)
    try:
        place = _match_cells(mesh, points / scale, content.cells, path, shape)
    except ValueError as error:
        raise ValueError(f"{error}{_owner_sentence(path, points / scale, content.cells, shape)}") from None
    field = _field(content, name, path)
    values = _scalar(field.values, name, path)
    return np.mean(values[content.cells[place]], axis=1) if field.nodal else values[place]


def _match_cells(mesh: Mesh, points: Floats, cells: Ints, path: Path, shape: str) -> Ints:
    used = np.unique(cells)
    counts, own = (len(used), len(cells)), (mesh.p.shape[1], mesh.t.shape[1])
    # Programs with discontinuous elements write a point for every corner.
    if counts != own and (_distinct(points[used]), counts[1]) != (_distinct(mesh.p.T), own[1]):
        raise ValueError(
            f"read_field expected a field on the mesh, of {own[0]} nodes and {own[1]} {plural(shape)}; '{path}' has "
            f"{counts[0]} and {counts[1]}."
        )
    _nearest(mesh.p.T, points[used], mesh, path, "node")
    place = _nearest(mesh.p[:, mesh.t].mean(axis=1).T, points[cells].mean(axis=1), mesh, path, shape)
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


def _distinct(points: Floats) -> int:
    return len(np.unique(points, axis=0))


def _nearest(wanted: Floats, given: Floats, mesh: Mesh, path: Path, what: str) -> Ints:
    check_finite(given, path, "read_field", what)
    distance, place = cKDTree(given).query(wanted)
    off = float(np.max(distance) / np.ptp(mesh.p, axis=1).max())
    if off > NEAR:
        raise ValueError(
            f"read_field expected a field on the mesh; in '{path}' a {what} is off by {off:.3g} times the size "
            "of the mesh. Do both files have the same unit and step?"
        )
    return place


def _field(content: CellFields, name: str, path: Path) -> Field:
    found = [field for field in content.fields if field.name == name]
    if {field.nodal for field in found} == {True, False}:
        raise ValueError(f"'{path}' has '{name}' at points and in cells; rename one of them.")
    if len(found) > 1:
        raise ValueError(f"'{path}' has {len(found)} fields or steps '{name}'; write one only.")
    if not found:
        known = listed({field.name for field in content.fields})
        raise ValueError(f"'{path}' has no field '{name}'; its fields are: {known}.")
    return found[0]


def _scalar(values: Floats, name: str, path: Path) -> Floats:
    flat = values.reshape(len(values), -1)
    if flat.shape[1] != 1 or flat.dtype.kind not in "iuf":
        raise ValueError(
            f"'{name}' of '{path}' must be one real number per node or element; got {flat.shape[1]}. Write a "
            "component, or the magnitude, as a field of its own."
        )
    return flat[:, 0].astype(float)
