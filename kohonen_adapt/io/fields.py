"""Fields of other programs: one number per node or element from a VTU file that is on the mesh at hand."""

from pathlib import Path

import meshio
import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTri

from .content import Floats, Ints
from .vtu import load_vtu

__all__ = ["read_field"]

NEAR = 1e-6  # of the size of the mesh: coordinates of single precision are that near


def read_field(path: Path, name: str, mesh: MeshTri) -> Floats:
    """Read a scalar field from a VTU file, one number per element.

    Parameters
    ----------
    path
        The file; cells other than triangles, and points that no triangle uses, have no say.
    name
        Of the cell data, or of the point data: then the mean over each element is taken.
    mesh
        The mesh that it must be on: the same nodes and triangles, in any order. Other programs number them as they
        like, so triangles are known by their centres.

    Returns
    -------
    ndarray (nelements,)
        Its values.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no VTU file, is on another mesh, lacks the field, has two of that name, or the field is no scalar.
    """
    if not path.is_file():
        raise FileNotFoundError(f"read_field expected a VTU file; there is none at '{path}'.")
    content = load_vtu(path, "read_field")
    blocks = [block.data for block in content.cells if block.type == "triangle"]
    triangles = np.concatenate([np.empty((0, 3), np.int64), *blocks])
    place = _places(mesh, content.points[:, :2], triangles, path)
    if _is_nodal(content, name, path):
        return np.mean(_scalar(content.point_data[name], name, path)[triangles[place]], axis=1)
    parts = zip(content.cells, content.cell_data[name], strict=True)
    return _scalar(np.concatenate([part for block, part in parts if block.type == "triangle"]), name, path)[place]


def _places(mesh: MeshTri, points: Floats, triangles: Ints, path: Path) -> Ints:
    """Where in the file every element of the mesh stands, (nelements,)."""
    used = np.unique(triangles)
    counts, own = (len(used), len(triangles)), (mesh.p.shape[1], mesh.t.shape[1])
    if counts != own:
        raise ValueError(
            f"read_field expected a field on the mesh, of {own[0]} nodes and {own[1]} triangles; '{path}' has "
            f"{counts[0]} and {counts[1]}."
        )
    _matched(mesh.p.T, points[used], mesh, path, "node")
    place = _matched(mesh.p[:, mesh.t].mean(axis=1).T, points[triangles].mean(axis=1), mesh, path, "triangle")
    if len(np.unique(place)) < len(place):
        raise ValueError(f"read_field expected a field on the mesh; '{path}' has other triangles.")
    return place


def _matched(wanted: Floats, given: Floats, mesh: MeshTri, path: Path, what: str) -> Ints:
    """The nearest of the given places to each that is wanted, (n, 2) -> (n,), if none is off."""
    if not np.all(np.isfinite(given)):
        raise ValueError(f"read_field expected finite coordinates; '{path}' has others.")
    distance, place = cKDTree(given).query(wanted)
    off = float(np.max(distance) / np.ptp(mesh.p, axis=1).max())
    if off > NEAR:
        raise ValueError(
            f"read_field expected a field on the mesh; in '{path}' a {what} is {off:.3g} sizes of the mesh off its "
            "place. Are both in the same unit, and of the same step?"
        )
    return place


def _is_nodal(content: meshio.Mesh, name: str, path: Path) -> bool:
    nodal, cellwise = name in content.point_data, name in content.cell_data
    if nodal and cellwise:
        raise ValueError(f"'{path}' has '{name}' at points and in cells; rename one of them.")
    if not (nodal or cellwise):
        known = ", ".join(f"'{known}'" for known in sorted([*content.point_data, *content.cell_data])) or "none"
        raise ValueError(f"'{path}' has no field '{name}'; its fields are: {known}.")
    return nodal


def _scalar(values: Floats, name: str, path: Path) -> Floats:
    flat = values.reshape(len(values), -1)
    if flat.shape[1] != 1 or flat.dtype.kind not in "iuf":
        raise ValueError(f"'{name}' of '{path}' must be one real number per node or element; got {flat.shape[1]}.")
    return flat[:, 0].astype(float)
