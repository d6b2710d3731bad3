"""Meshes and fields from the formats that meshio reads well, with all names.

Only `meshio.<format>.read` is called, because `meshio.read` prints errors and ends the process.
"""

import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import meshio
import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.io.abaqus_sets import add_names
from kohonen_adapt.io.content import (
    CORNERS,
    DIMENSION,
    EXACT_INTEGERS,
    GMSH_TETRAHEDRON,
    CellFields,
    Content,
    Field,
    Named,
    as_value_error,
    check_nodes,
    content_of_sets,
    in_space,
    nodes_per_element,
    shape_of,
)
from kohonen_adapt.io.groups import UNNAMED
from kohonen_adapt.io.meshio_formats import FORMATS, MARKER, is_ucd
from kohonen_adapt.io.vtu import BOUNDARY, LAGRANGE, SUBDOMAIN, mean_weights, sides_of
from kohonen_adapt.log import logger

__all__ = ["FORMATS", "WITH_FIELDS", "read_arrays", "read_content"]


WITH_FIELDS = (".vtu", ".vtk", ".xdmf", ".med")

LINE, TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON, PRISM, PYRAMID = range(1, 8)
KINDS = {"vertex": 15, "line": LINE, "line3": 8, "triangle": TRIANGLE, "triangle6": 9, "tetra": TETRAHEDRON}
KINDS |= {"tetra10": (TEN_NODES := 11), **dict(zip(LAGRANGE, (TRIANGLE, TETRAHEDRON), strict=True))}
"""Type in meshio to Gmsh's number."""

REFUSED = {"tetra": 11, "wedge": PRISM, "pyramid": PYRAMID}
"""Beginning of a refused type in meshio to Gmsh's number for its shape."""

SIDES = {"triangle": LINE, "tetrahedron": TRIANGLE}  # by shape

NUMBERS = ("gmsh:physical", "cell_tags", "medit:ref", "su2:tag", "avsucd:material", "netgen:index", "CellEntityIds")
"""Names of cell data with group numbers, in meshio and in Gmsh's VTK."""

GROUPING = re.compile(r"(?i)mat|region|label|attrib|domain|group|zone|tag|physical|marker")
"""Parts of names of cell data with group numbers, in other programs."""


def _read_with_meshio(path: Path, caller: str) -> Any:
    suffix = path.suffix.lower()
    name, own, correct = FORMATS[suffix]
    if suffix in (".med", ".xdmf") and not find_spec("h5py"):
        raise ImportError(f'{caller} needs h5py for {name} file: pip install "kohonen-adapt[files]".')
    with as_value_error(path, f"{caller} expected {name} file; '{path}' cannot be read: {{}}."):
        data = path.read_bytes()
        module = getattr(meshio, "avsucd" if suffix == ".inp" and is_ucd(data) else own)
        try:
            changed = correct(data, path)
            if changed == data:
                mesh = _read_logged(module.read, path)
            else:
                with TemporaryDirectory() as folder:
                    draft = Path(folder, f"mended{suffix}")
                    draft.write_bytes(changed)
                    mesh = _read_logged(module.read, draft)
        except (MemoryError, ValueError, SyntaxError):
            raise
        except Exception as error:  # meshio raises errors of any type for a damaged file
            raise ValueError(f"{type(error).__name__} {error}".strip()) from error
        if suffix == ".su2":
            markers = [marker.decode("utf-8", "replace") for _, marker in MARKER.findall(data)]
            mesh.cell_tags = {number: [marker] for number, marker in enumerate(markers, 1)}
        if module is meshio.abaqus and (left_out := add_names(mesh, data.decode("utf-8", "replace"))):
            logger.warning(
                "the sets %s of '%s' are left out: no sides on the outline or between element sets are in them.",
                *(listed(left_out), path),
            )
        return mesh


def _read_logged(read: Callable[[str], Any], path: Path) -> Any:
    printed = StringIO()
    with warnings.catch_warnings(), redirect_stderr(printed):
        warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
        mesh = read(str(path))
    words = " ".join(printed.getvalue().split())
    if "cannot handle" in words:
        raise ValueError(words)
    if words:
        logger.warning("meshio reports for '%s': %s", path, words)
    return mesh


def read_content(path: Path) -> Content:
    mesh = _read_with_meshio(path, "read_mesh")
    with as_value_error(path, f"'{path}' cannot be read: {{}}."):
        points = _points(mesh)
        return content_of_sets(points, _all_sets(mesh, points, _number_key(mesh, path)))


def _number_key(mesh: Any, path: Path) -> str | None:
    known = next((key for key in NUMBERS if key in mesh.cell_data), None)
    if known or any(key.startswith((SUBDOMAIN, BOUNDARY)) for key in mesh.cell_data):
        return known
    arrays = [key for key, parts in mesh.cell_data.items() if _may_group(key, parts)]
    named = [key for key in arrays if GROUPING.search(key)]
    chosen = arrays[0] if len(arrays) == 1 else named[0] if len(named) == 1 else None
    left_out = [key for key in arrays if key != chosen]
    if left_out:
        logger.warning(
            "the integers %s of the cells of '%s' are left out, %s; keep the one array whose numbers are those of "
            "regions and boundaries.",
            listed(left_out),
            path,
            f"'{chosen}' is read as groups" if chosen else "because several may be groups",
        )
    return chosen


def _may_group(key: str, parts: list[Any]) -> bool:
    if not all(part.dtype.kind in "iu" and part.size == len(part) for part in parts):
        return False
    values = np.concatenate([np.ravel(part) for part in parts])
    return bool(np.any(values)) and (len(np.unique(values)) < len(values) or bool(GROUPING.search(key)))


def _kind(block: Any) -> int:
    others = (kind for beginning, kind in REFUSED.items() if block.type.startswith(beginning))
    return KINDS.get(block.type) or next(others, HEXAHEDRON if block.dim == 3 else QUADRILATERAL)


def _all_sets(mesh: Any, points: Floats, key: str | None) -> Iterator[Named]:
    # (type, name, nodes, numbers) of all cells, and of the cells of every set
    first = 0
    for k, block in enumerate(mesh.cells):
        if block.type in LAGRANGE:
            raise ValueError("its Lagrange cells hold a field inside elements; read the mesh from its own file")
        kind = _kind(block)
        nodes, shape = _nodes(block, kind, len(points)), shape_of(kind)
        number = first + np.arange(len(nodes))
        first += len(nodes)
        yield kind, "", nodes, number
        for name, which in _members(mesh, k, shape, key):
            yield kind, name, nodes[which], number[which]
        for name, values in mesh.cell_data.items() if shape in SIDES else ():
            if name.startswith(BOUNDARY):
                sides = sides_of(nodes[:, : CORNERS[shape]], _as_integers(values[k], name), points)
                yield SIDES[shape], name.removeprefix(BOUNDARY), sides, np.arange(len(sides))
    for name, sides in getattr(mesh, "side_sets", {}).items():
        yield {2: LINE, 3: TRIANGLE}[sides.shape[1]], name, sides, first + np.arange(len(sides))


def _points(mesh: Any) -> Floats:
    return in_space(np.asarray(mesh.points, float).reshape(len(mesh.points), -1)[:, :3])


def _as_rows(values: Any) -> Any:
    return values.reshape(len(values), -1)


def _inside(values: Any, parts: list[Ints], cells: Ints) -> Any:
    # means of one component over the cells, or the values of several at the corners
    if values.shape[1] > 1:
        return values[cells]
    weights = [mean_weights(part.shape[1], cells.shape[1] - 1) for part in parts]
    means = [np.einsum("i,mic->mc", own, values[part]) for own, part in zip(weights, parts, strict=True)]
    return np.concatenate(means)[:, None]


def _nodes(block: Any, kind: int, count: int) -> Ints:
    if kind not in KINDS.values():
        return np.zeros((len(block.data), nodes_per_element(kind)), int)
    nodes = np.asarray(block.data, int)
    nodes = nodes if block.type in LAGRANGE else nodes.reshape(-1, nodes_per_element(kind))
    check_nodes(nodes, count)
    return nodes[:, GMSH_TETRAHEDRON] if kind == TEN_NODES else nodes


def _members(mesh: Any, k: int, shape: str, key: str | None) -> Iterator[tuple[str, Ints]]:
    # names and rows of the sets of a block, by the array `key` of group numbers as well
    for name, parts in mesh.cell_sets.items():
        if k < len(parts) and len(parts[k]):
            yield name, parts[k]
    for name, values in mesh.cell_data.items() if shape in SIDES else ():
        if name.startswith(SUBDOMAIN):
            yield name.removeprefix(SUBDOMAIN), np.flatnonzero(_as_integers(values[k], name))
    if key:
        numbers, dimension = _as_integers(mesh.cell_data[key][k], key), DIMENSION[shape]
        highest = max(block.dim for block in mesh.cells)
        has_zero = key not in NUMBERS and dimension == highest  # zero may be a region
        texts, unnamed = getattr(mesh, "cell_tags", {}), UNNAMED[max(2, highest)][dimension]
        for tag in np.unique(numbers if has_zero else numbers[numbers != 0]).tolist():
            named = [name for name, given in mesh.field_data.items() if np.array_equal(given, [tag, dimension])]
            # Families of MED have negative numbers, and no name outside all groups.
            for name in texts.get(tag) or named or ([] if texts else [unnamed.format(abs(tag))]):
                yield name, np.flatnonzero(numbers == tag)


def _as_integers(values: Any, key: str) -> Ints:
    values = values.ravel() if values.shape[1:] == (1,) else values
    if not (values.ndim == 1 and values.dtype.kind in "iuf" and np.all(np.abs(values) < EXACT_INTEGERS)):
        raise ValueError(f"'{key}' must have one integer per cell")
    return values.astype(int)


def read_arrays(path: Path, shape: str) -> CellFields:
    mesh = _read_with_meshio(path, "read_field")
    with as_value_error(path, f"'{path}' cannot be read: {{}}."):
        points = _points(mesh)
        kinds = [_kind(block) for block in mesh.cells]
        blocks = [k for k, kind in enumerate(kinds) if shape_of(kind) == shape and kind in KINDS.values()]
        parts = [_nodes(mesh.cells[k], kinds[k], len(points)) for k in blocks]
        cells = np.concatenate([np.empty((0, CORNERS[shape]), int), *(part[:, : CORNERS[shape]] for part in parts)])
        is_nodal = all(mesh.cells[k].type not in LAGRANGE for k in blocks)
        fields = [
            Field(name, is_nodal, rows if is_nodal else _inside(rows, parts, cells))
            for name, values in mesh.point_data.items()
            for rows in [_as_rows(values)]
        ]
        fields += [
            Field(name, False, _as_rows(np.concatenate([values[k] for k in blocks]))[:, None])
            for name, values in mesh.cell_data.items()
            if blocks
        ]
        return CellFields(points, cells, fields)
