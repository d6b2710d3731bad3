"""Meshes and fields from the formats that meshio reads well, with all names.

Only `meshio.<format>.read` is called, because `meshio.read` prints errors and ends the process.
"""

import logging
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
from kohonen_adapt.io.content import (
    ALLOWED_BYTES,
    CORNERS,
    DIMENSION,
    EXACT_INTEGERS,
    GMSH_TETRAHEDRON,
    MAX_EXPANSION,
    CellFields,
    Content,
    Field,
    as_value_error,
    content_of_sets,
    nodes_per_element,
    shape_of,
)
from kohonen_adapt.io.groups import UNNAMED
from kohonen_adapt.io.vtu import BOUNDARY, LAGRANGE, SUBDOMAIN, checked_vtu, mean_weights, plain_xml, sides_of

__all__ = ["FORMATS", "WITH_FIELDS", "read_arrays", "read_content"]

logger = logging.getLogger("kohonen_adapt")

WITH_FIELDS = (".vtu", ".vtk", ".xdmf", ".med")

LINE, TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON, PRISM, PYRAMID = range(1, 8)
KINDS = {"vertex": 15, "line": LINE, "line3": 8, "triangle": TRIANGLE, "triangle6": 9, "tetra": TETRAHEDRON}
KINDS |= {"tetra10": (TEN_NODES := 11)}
"""Type in meshio to Gmsh's number."""

REFUSED = {"tetra": 11, "wedge": PRISM, "pyramid": PYRAMID}
"""Beginning of a refused type in meshio to Gmsh's number for its shape."""

SIDES = {TRIANGLE: LINE, TETRAHEDRON: TRIANGLE}

NUMBERS = ("gmsh:physical", "cell_tags", "medit:ref", "su2:tag", "CellEntityIds")
"""Names of cell data with group numbers, in meshio and in Gmsh's VTK."""

COUNTS = re.compile(rb"(?m)^[ \t]*[A-Za-z_][^\s=]*[ \t]*[\s=][ \t]*([0-9]+)(?:[ \t]+([0-9]+))?")
"""First word of a line, and the counts after the word."""

MARKER = re.compile(rb"(?m)^(MARKER_TAG[ \t]*=)[ \t]*(.*?)[ \t\r]*$")
RANGE = re.compile(rb"(?im)^\*[^\n]*\bGENERATE\b[^\n]*\n\s*([0-9]+)\s*,\s*([0-9]+)\s*,\s*([0-9]+)")
BLOCK = re.compile(r"(?im)^[ \t]*\*ELEMENT[ \t]*(?:,(?:.*?\bELSET[ \t]*=[ \t]*([^,\r\n]*))?.*)?\r?$")


def _check_counts(data: bytes, path: Path) -> bytes:
    # meshio reserves memory for the counts of a file.
    most = max((int(number) for pair in COUNTS.findall(data) for number in pair if number), default=0)
    if most > len(data):
        raise ValueError(f"it announces {most} items in {len(data)} bytes")
    return data


def _vtk(data: bytes, path: Path) -> bytes:
    if not re.search(rb"(?im)^DATASET\s+UNSTRUCTURED_GRID\b", data):
        raise ValueError("it has no UNSTRUCTURED_GRID")
    _check_counts(b"\n".join(data.split(b"\n", 3)[2:]), path)  # without the title, a free text
    return data


def _abaqus(data: bytes, path: Path) -> bytes:
    if re.search(rb"(?im)^\*INCLUDE\b", data):
        raise ValueError("it includes another file: put all into one")
    if re.search(rb"(?im)^\*ELSET\b[^\n]*\n\s*[^0-9\s*]", data):
        raise ValueError("it has a set of sets: list their elements")
    for first, last, step in RANGE.findall(data):
        if int(step) == 0 or (int(last) - int(first)) // int(step) > len(data):
            raise ValueError(f"it has a set from {int(first)} to {int(last)} in {len(data)} bytes")
    return data


def _su2(data: bytes, path: Path) -> bytes:
    # meshio has numbers only for markers, and may use one number for two names.
    number = iter(range(1, 1 + len(MARKER.findall(data))))
    return MARKER.sub(lambda found: found[1] + b" %d" % next(number), _check_counts(data, path))


def _med(data: bytes, path: Path) -> bytes:
    _check_hdf(path)
    return data


def _xdmf(data: bytes, path: Path) -> bytes:
    for item in plain_xml(data).iter("DataItem"):
        form, (name, *_) = item.get("Format"), (item.text or "").strip().split(":")
        if form == "HDF":
            if Path(name).name != name or not path.with_name(name).is_file():
                raise ValueError(f"its data must be in a file in the same folder; there is no file '{name}' in it")
            _check_hdf(path.with_name(name))
        elif form not in ("XML", None):
            raise ValueError(f"its data has the format '{form}'; write it with HDF or XML")
    return data


def _check_hdf(path: Path) -> None:
    import h5py  # optional dependency

    def nbytes(group: Any) -> Iterator[int]:
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise ValueError(f"'{name}' in it is a link")
            item = group[name]
            if isinstance(item, h5py.Group):
                yield from nbytes(item)
            elif item.external or item.is_virtual:
                raise ValueError(f"'{name}' in it has its data in another file")
            else:
                yield item.nbytes

    with h5py.File(path, "r") as file:
        if sum(nbytes(file)) > MAX_EXPANSION * path.stat().st_size + ALLOWED_BYTES:
            raise ValueError("it unpacks to more data than plausible for its size")


FORMATS: dict[str, tuple[str, Any, Callable[[bytes, Path], bytes]]] = {
    ".vtu": ("a VTU", meshio.vtu, lambda data, path: checked_vtu(data)),
    ".vtk": ("a VTK", meshio.vtk, _vtk),
    ".inp": ("an Abaqus", meshio.abaqus, _abaqus),
    ".mesh": ("a Medit", meshio.medit, _check_counts),
    ".su2": ("an SU2", meshio.su2, _su2),
    ".med": ("a MED", meshio.med, _med),
    ".xdmf": ("an XDMF", meshio.xdmf, _xdmf),
}
"""Suffix to name, module of meshio, and a function that checks or corrects the bytes for this module."""


def _read_with_meshio(path: Path, caller: str) -> Any:
    suffix = path.suffix.lower()
    name, module, correct = FORMATS[suffix]
    if suffix in (".med", ".xdmf") and not find_spec("h5py"):
        raise ImportError(f'{caller} needs h5py for {name} file: pip install "kohonen-adapt[files]".')
    with as_value_error(path, f"{caller} expected {name} file; '{path}' cannot be read: {{}}."):
        data = path.read_bytes()
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
        _add_names(mesh, suffix, data)
        return mesh


def _add_names(mesh: Any, suffix: str, data: bytes) -> None:
    if suffix == ".su2":
        markers = [marker.decode("utf-8", "replace") for _, marker in MARKER.findall(data)]
        mesh.cell_tags = {number: [marker] for number, marker in enumerate(markers, 1)}
    if suffix == ".inp":
        names = [name.strip() for name in BLOCK.findall(data.decode("utf-8", "replace"))]
        for name in filter(None, names):
            sizes = [len(block) if name == own else 0 for own, block in zip(names, mesh.cells, strict=True)]
            mesh.cell_sets[name] = [np.arange(size) for size in sizes]


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
        return content_of_sets(points, _all_sets(mesh, points))


def _kind(block: Any) -> int:
    others = {beginning: kind for beginning, kind in REFUSED.items() if block.type.startswith(beginning)}
    return KINDS.get(block.type) or next(iter(others.values()), HEXAHEDRON if block.dim == 3 else QUADRILATERAL)


def _all_sets(mesh: Any, points: Floats) -> Iterator[tuple[int, str, Ints, Ints]]:
    # (type, name, nodes, numbers) of all cells, and of the cells of every set
    first = 0
    for k, block in enumerate(mesh.cells):
        if block.type == LAGRANGE:
            raise ValueError("its Lagrange cells hold a field inside elements; read the mesh from its own file")
        kind = _kind(block)
        nodes = _nodes(block, kind, len(points))
        yield kind, "", nodes, first + np.arange(len(nodes))
        yield from _sets(mesh, k, kind, nodes, first, points)
        first += len(nodes)


def _points(mesh: Any) -> Floats:
    points = np.asarray(mesh.points, dtype=float).reshape(len(mesh.points), -1)[:, :3]
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])


def _means(values: Any, parts: list[Ints]) -> Any:
    weights = [mean_weights(part.shape[1]) for part in parts]
    return np.concatenate(
        [np.einsum("i,mi...->m...", own, values[part]) for own, part in zip(weights, parts, strict=True)]
    )


def _nodes(block: Any, kind: int, count: int) -> Ints:
    if kind not in KINDS.values():
        return np.empty((len(block.data), 0), np.int64)
    nodes = np.asarray(block.data, np.int64)
    nodes = nodes if block.type == LAGRANGE else nodes.reshape(-1, nodes_per_element(kind))
    if np.any((nodes < 0) | (nodes >= count)):
        raise ValueError("a cell has a node that does not exist")
    return nodes[:, GMSH_TETRAHEDRON] if kind == TEN_NODES else nodes


def _sets(
    mesh: Any, k: int, kind: int, nodes: Ints, first: int, points: Floats
) -> Iterator[tuple[int, str, Ints, Ints]]:
    for name, parts in mesh.cell_sets.items():
        if k < len(parts) and len(parts[k]):
            yield kind, name, nodes[parts[k]], first + np.asarray(parts[k])
    key = next((key for key in NUMBERS if key in mesh.cell_data), None)
    if key:
        numbers = _as_integers(mesh.cell_data[key][k], key)
        for tag in np.unique(numbers[numbers != 0]).tolist():
            which = np.flatnonzero(numbers == tag)
            for name in _names(mesh, key, tag, DIMENSION[shape_of(kind)]):
                yield kind, name, nodes[which], first + which
    first_order = _first_order(kind)
    for key, values in mesh.cell_data.items() if first_order in SIDES else ():
        if key.startswith(SUBDOMAIN):
            which = np.flatnonzero(_as_integers(values[k], key))
            yield kind, key.removeprefix(SUBDOMAIN), nodes[which], first + which
        elif key.startswith(BOUNDARY):
            sides = sides_of(nodes[:, : nodes_per_element(first_order)], _as_integers(values[k], key), points)
            yield SIDES[first_order], key.removeprefix(BOUNDARY), sides, np.arange(len(sides))


def _first_order(kind: int) -> int:
    return next((first_order for first_order in SIDES if shape_of(first_order) == shape_of(kind)), kind)


def _names(mesh: Any, key: str, tag: int, dimension: int) -> list[str]:
    texts = getattr(mesh, "cell_tags", {})
    named = [name for name, given in mesh.field_data.items() if np.array_equal(given, [tag, dimension])]
    # Families of MED have negative numbers, and no name outside all groups.
    unnamed = UNNAMED[max(2, *(block.dim for block in mesh.cells))][dimension]
    return texts.get(tag) or named or ([] if texts else [unnamed.format(abs(tag))])


def _as_integers(values: Any, key: str) -> Ints:
    values = values.ravel() if values.shape[1:] == (1,) else values
    if not (values.ndim == 1 and values.dtype.kind in "iuf" and np.all(np.abs(values) < EXACT_INTEGERS)):
        raise ValueError(f"'{key}' must have one integer per cell")
    return values.astype(np.int64)


def read_arrays(path: Path, shape: str) -> CellFields:
    mesh = _read_with_meshio(path, "read_field")
    with as_value_error(path, f"'{path}' cannot be read: {{}}."):
        points = _points(mesh)
        kinds = [TRIANGLE if block.type == LAGRANGE else _kind(block) for block in mesh.cells]
        blocks = [k for k, kind in enumerate(kinds) if shape_of(kind) == shape and kind in KINDS.values()]
        parts = [_nodes(mesh.cells[k], kinds[k], len(points)) for k in blocks]
        cells = np.concatenate(
            [np.empty((0, CORNERS[shape]), np.int64), *(part[:, : CORNERS[shape]] for part in parts)]
        )
        is_nodal = all(mesh.cells[k].type != LAGRANGE for k in blocks)
        nodal = [
            Field(name, True, values) if is_nodal else Field(name, False, _means(values, parts))
            for name, values in mesh.point_data.items()
        ]
        cellwise = [
            Field(name, False, np.concatenate([values[k] for k in blocks]))
            for name, values in mesh.cell_data.items()
            if blocks
        ]
        return CellFields(points, cells, [*nodal, *cellwise])
