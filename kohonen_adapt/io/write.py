"""Writer of meshes with their names and fields."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTet, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import FilePath, Floats, Ints
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.display import divisions_of
from kohonen_adapt.files import whole_file
from kohonen_adapt.io.assembly import of_positive_volume
from kohonen_adapt.io.content import MSH_VERSION, suffix_of
from kohonen_adapt.io.elmer import write_elmer
from kohonen_adapt.io.gmsh_writer import write_msh
from kohonen_adapt.io.groups import Groups
from kohonen_adapt.io.vtu import write_vtu
from kohonen_adapt.log import logger
from kohonen_adapt.mesh.curved import is_second_order, numbered_sides, with_midside_offsets
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["WRITTEN", "check_names_written", "write_mesh"]


WRITTEN = (*MSH_VERSION, ".vtu")
"""Suffixes of mesh files that can be written."""

BY_GMSH = (".med", ".inp", ".mesh", ".su2", ".vtk", ".unv", ".cgns", ".bdf")
CONVERTED = dict.fromkeys(BY_GMSH, " Write '{0}.msh' and convert it: gmsh '{0}.msh' -save -o '{1}'")
CONVERTED[".xdmf"] = " Write '{0}.vtu' and convert it: meshio convert '{0}.vtu' '{1}'"
"""Suffix to the way to a file of another format."""

LONGEST_NAME = 127
"""Bytes of a name; Gmsh cuts longer names."""


def write_mesh(
    path: FilePath,
    mesh: MeshTri | MeshTet,
    *,
    point_data: Mapping[str, ArrayLike] | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
    groups: Groups | None = None,
    positions: ArrayLike | None = None,
) -> None:
    """Write a mesh with its names and fields for Gmsh, ParaView or Elmer.

    `read_mesh` restores nodes, elements, coordinates and names exactly, in the same order. The orientation of a
    boundary is the direction of its lines, with the element in front on their left, or of its triangles, which run
    clockwise as seen from the element in front. Tetrahedra of negative volume are turned. Sets called ``gmsh:*``, which
    scikit-fem makes of Gmsh files, are left out. The file is written whole or not at all.

    Parameters
    ----------
    path
        ``.msh`` writes Gmsh MSH 4.1 and ``.msh2`` MSH 2.2, with a physical group per name and the fields as views.
        ``.vtu`` is for ParaView: an integer array ``region`` numbers the combinations of subdomain names, and the names
        are the arrays ``skfem:s:<name>`` and ``skfem:b:<name>``, which ``skfem.Mesh.load`` reads, too. A name without a
        suffix is the folder of a mesh for Elmer, which is created if missing; in such a mesh subdomains must not
        overlap, nor boundaries.
    mesh
        A `MeshTri` or `MeshTet`, or a `MeshTri2` or `MeshTet2`, whose elements are of second order in the file (Gmsh's
        types 9 and 8, or 11 and 9; VTK's 22 and 24).
    point_data
        Fields (nnodes,) by name. On curved sides a field has a value for all nodes, in the order of ``mesh.p``, like a
        potential of order 2, or for the corners; midside nodes then get the mean of both ends.

        On a `MeshTet` fields of order 2 have values (nunknowns,) at the nodes and then at the middles of
        ``mesh.edges``, for ``.vtu`` only, whose cells are then quadratic tetrahedra (VTK's type 24).

        For fields of order p above 1, or fields that jump between elements, ``.vtu`` takes values (k, nelements) at the
        k points of `kohonen_adapt.display.lattice_points` in every element, (p + 1) (p + 2) / 2 in the plane and
        (p + 1) (p + 2) (p + 3) / 6 in space, like ``field.potential_at_each(lattice_points(p, 3))``. The elements are
        Lagrange cells of order p (VTK's types 69 and 71) without common points, from order 4 on with sides on the arcs
        through the nodes of a `MeshTri2`.
    cell_data
        Fields (nelements,) or vectors (2, nelements), of tetrahedra (3, nelements), by name.
    groups
        Result of `read_groups`: names keep their numbers, groups of points with a node are written, and ``.msh`` has
        the version of MSH that was read, for programs that read one version only. Without `groups`, ``region_7`` and
        ``boundary_7`` are groups of that number and no name, and other names get new numbers. VTU files have no
        numbers.
    positions
        Positions (d, k * nelements) of values inside elements, if sides follow curves that `mesh` does not define, in
        the order of ``field.at_each(share).x``.

    Raises
    ------
    ValueError
        If the suffix is unknown, the mesh is empty, broken or of another class, a name or number cannot be stored, or a
        field has another shape or holds a value that is not finite.
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
    for_elmer = path.is_dir() or not path.suffix
    remedy = CONVERTED.get(path.suffix.lower(), "").format(path.stem, path.name)
    suffix = "" if for_elmer else suffix_of(path, "write_mesh", WRITTEN, remedy)
    check_mesh(mesh, inverted=True)
    inside = _checked_inside(mesh, point_data, path)
    mesh = mesh if inside else of_positive_volume(mesh)  # values inside have the order of the corners
    subdomains = _checked_sets(mesh.subdomains, "subdomain")
    boundaries = _checked_sets(mesh.boundaries, "boundary")
    nodal = {name: values for name, values in (point_data or {}).items() if name not in inside}
    mesh = _with_edges_of_values(mesh, nodal, suffix)
    points = _checked_fields(with_midside_means(mesh, nodal), mesh.p.shape[1], "point_data")
    points |= inside
    cells = _checked_fields(cell_data, mesh.nelements, "cell_data", len(mesh.p))
    place = _checked_positions(positions, inside, len(mesh.p))
    groups = groups or Groups()
    if for_elmer:
        if points or cells:
            raise ValueError("a mesh of Elmer holds no fields; write them to a file.")
        if is_second_order(mesh):
            raise ValueError(
                f"a mesh of Elmer is written with straight sides only; got a {type(mesh).__name__}. Write its corners: "
                f"{type(mesh).__name__[:-1]}(mesh.p[:, :mesh.nvertices], mesh.t, mesh.boundaries, mesh.subdomains)."
            )
        write_elmer(path, mesh, subdomains, boundaries, groups)
        return
    with whole_file(path) as draft:
        if suffix == ".vtu":
            write_vtu(draft, mesh, subdomains, boundaries, points, cells, place)
        else:
            version = groups.version if suffix == ".msh" and groups.version else MSH_VERSION[suffix]
            write_msh(draft, mesh, subdomains, boundaries, points, cells, version=version, groups=groups)


def check_names_written(mesh: Mesh) -> None:
    for kind, sets in (("subdomain", mesh.subdomains), ("boundary", mesh.boundaries)):
        for name in named_sets(sets):
            _check_name(name, kind)


def with_midside_means(mesh: Mesh, fields: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    """Return fields at all nodes, with the mean of both ends at midside nodes."""
    given = dict(fields)
    for name, values in given.items() if is_second_order(mesh) else ():
        array = np.asarray(values)
        if array.shape == (mesh.nvertices,) and array.dtype.kind in "biuf":
            given[name] = np.concatenate([array, array[numbered_sides(mesh)[0]].mean(axis=0)])
    return given


def _with_edges_of_values(mesh: Mesh, fields: Mapping[str, ArrayLike], suffix: str) -> Mesh:
    # tetrahedra with nodes in the middles of edges, if a field has values there
    count = count_unknowns(mesh, 2) if len(mesh.p) == 3 and not is_second_order(mesh) else 0
    of_order_2 = [name for name, values in fields.items() if count and np.shape(values) == (count,)]
    if of_order_2 and suffix != ".vtu":
        raise ValueError(
            f"point_data '{of_order_2[0]}' has values of order 2, for .vtu only. Write its first {mesh.nvertices} "
            "values, at the nodes, or a second file."
        )
    return with_midside_offsets(mesh, np.zeros(1)) if of_order_2 else mesh


def _checked_sets(sets: Mapping[str, Ints] | None, kind: str) -> dict[str, Ints]:
    checked: dict[str, Ints] = {}
    for name, indices in named_sets(sets).items():
        _check_name(name, kind)
        items, first = np.unique(indices, return_index=True)
        if isinstance(given := (sets or {})[name], OrientedBoundary):
            items = OrientedBoundary(items, given.ori[first])
        if len(items) == 0:
            logger.warning("%s '%s' is empty: Gmsh will not show it.", kind, name)
        checked[name] = items
    return checked


def _checked_inside(mesh: Mesh, fields: Mapping[str, ArrayLike] | None, path: Path) -> dict[str, Floats]:
    found: dict[str, Floats] = {}
    dim = len(mesh.p)
    for name, values in (fields or {}).items():
        if np.ndim(values) != 2:
            continue
        _check_name(name, "point_data")
        shape, count = np.shape(values), mesh.nelements
        if shape[1] != count or not divisions_of(shape[0], dim):
            points = {2: "(p + 1) (p + 2) / 2", 3: "(p + 1) (p + 2) (p + 3) / 6"}[dim]
            raise ValueError(
                f"point_data '{name}' must have shape ({mesh.p.shape[1]},), or (k, {count}) with k = {points} points "
                f"in every element for the order p; got {shape}."
            )
        if path.suffix.lower() != ".vtu":
            raise ValueError(
                f"point_data '{name}' has values inside elements, for .vtu only; got '{path.name}'. Write the field at "
                "nodes, or a second file."
            )
        found[name] = finite_reals(f"point_data '{name}'", values, {"k": shape[0], "nelements": count}, "element")
    shapes = {values.shape for values in found.values()}
    if len(shapes) > 1:
        raise ValueError(
            f"point_data with values inside elements must have one shape, that of one order; got "
            f"{' and '.join(map(str, sorted(shapes)))}."
        )
    return found


def _checked_positions(positions: ArrayLike | None, inside: dict[str, Floats], dim: int) -> Floats | None:
    if positions is None:
        return None
    if not inside:
        raise ValueError("positions are of values inside elements, but point_data has none of shape (k, nelements).")
    count = next(iter(inside.values())).size
    return finite_reals("positions", positions, {str(dim): dim, "k * nelements": count}, "point")


def _checked_fields(
    fields: Mapping[str, ArrayLike] | None, count: int, kind: str, components: int = 0
) -> dict[str, Floats]:
    expected = f"({count},) or ({components}, {count})" if components else f"({count},)"
    checked = {}
    for name, values in (fields or {}).items():
        _check_name(name, kind)
        array = np.asarray(values, float)
        if array.shape != (count,) and not (components and array.shape == (components, count)):
            raise ValueError(f"{kind} '{name}' must have shape {expected}; got {array.shape}.")
        if not np.all(np.isfinite(array)):
            number = np.sum(~np.isfinite(array))
            raise ValueError(f"{kind} '{name}' must be finite; {number} of its {array.size} values are not.")
        checked[name] = array
    return checked


def _check_name(name: object, kind: str) -> None:
    if not isinstance(name, str) or not name or not name.isprintable() or '"' in name:
        raise ValueError(
            f"the name of a {kind} must be printable text without a double quote, which Gmsh cannot read; got {name!r}."
        )
    if len(name.encode()) > LONGEST_NAME:
        raise ValueError(
            f"the name of a {kind} must have at most {LONGEST_NAME} bytes, because Gmsh cuts longer names; got "
            f"{name!r}."
        )
