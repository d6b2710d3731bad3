"""VTU files for ParaView, and checks of files that meshio would misread."""

import base64
import lzma
import re
import zlib
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.io.content import ALLOWED_BYTES, MAX_EXPANSION
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.curved import nodes_of_elements
from kohonen_adapt.mesh.measures import is_in_front
from kohonen_adapt.mesh.names import combinations

__all__ = ["BOUNDARY", "SUBDOMAIN", "checked_vtu", "plain_xml", "sides_of", "write_vtu"]

Sets = dict[str, Ints]
Fields = dict[str, Floats]

REGION = "region"
SUBDOMAIN, BOUNDARY = "skfem:s:", "skfem:b:"
KINDS = {3: "triangle", 4: "tetra", 6: "triangle6"}
"""Nodes per element to the type in meshio (VTK's types 5, 10 and 22)."""
Source = bytes | str
"""Raw bytes, or base64 text in which header and data are encoded separately."""

DECOMPRESSORS: dict[str | None, Callable[[], Any]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}
HEADERS = {"UInt32": "u4", "UInt64": "u8"}
ORDERS = {"LittleEndian": "<", "BigEndian": ">"}

RAW = re.compile(rb"<AppendedData\b[^>]*\bencoding\s*=\s*[\"']raw[\"'][^>]*>")
NEWER = re.compile(rb"(<VTKFile\b[^>]*\bversion\s*=\s*[\"'])2\.[0-9]+")


def write_vtu(
    path: Path, mesh: Mesh, subdomains: Sets, boundaries: Sets, point_data: Fields, cell_data: Fields
) -> None:
    """Write a mesh and fields for ParaView.

    The names are integer arrays per element: ``region`` is the index of the combination of subdomain names,
    ``skfem:s:<name>`` is 1 in a subdomain, and bit k of ``skfem:b:<name>`` is set if side k is in a boundary.

    Raises
    ------
    ValueError
        If a field in `cell_data` has one of these names.
    """
    names: dict[str, Ints] = {REGION: combinations(list(subdomains.values()), mesh.t.shape[1])[0]}
    names |= {SUBDOMAIN + name: np.bincount(items, minlength=mesh.t.shape[1]) for name, items in subdomains.items()}
    names |= {BOUNDARY + name: _mark_sides(mesh, items) for name, items in boundaries.items()}
    taken = names.keys() & cell_data.keys()
    if taken:
        raise ValueError(
            f"cell_data '{min(taken)}' has a name that write_mesh reserves for the mesh; choose another name."
        )
    # meshio does not escape names in the XML.
    cells = {escape(name, quote=False): [_components(values)] for name, values in (names | cell_data).items()}
    nodal = {escape(name, quote=False): values for name, values in point_data.items()}
    points = np.column_stack([mesh.p.T, np.zeros((mesh.p.shape[1], 3 - len(mesh.p)))])
    nodes = nodes_of_elements(mesh)
    content = meshio.Mesh(points, [(KINDS[nodes.shape[1]], nodes)], point_data=nodal, cell_data=cells)
    meshio.vtu.write(str(path), content)


def _mark_sides(mesh: Mesh, facets: Ints) -> Ints:
    """Return the bits of marked sides per element, shape (nelements,).

    A facet is marked in one element, the first or that in front of the facet.
    """
    element = mesh.f2t[getattr(facets, "ori", 0), facets]
    side = np.argmax(mesh.t2f[:, element] == facets, axis=0)
    bits = np.zeros(mesh.t.shape[1], dtype=np.int64)
    np.add.at(bits, element, 1 << side)
    return bits


def _components(values: np.ndarray) -> np.ndarray:
    return values if values.ndim == 1 else np.column_stack([values.T, np.zeros((values.shape[1], 3 - len(values)))])


def sides_of(elements: Ints, bits: Ints, points: Floats) -> Ints:
    """Return the sides of elements (n, d + 1) whose bit is set, shape (m, d).

    The corners are ordered so that the element is in front.
    """
    d = elements.shape[1] - 1
    corners = np.sort(elements, axis=1) if d == 2 else elements  # as scikit-fem numbers the sides
    sides = []
    for bit, side in enumerate(CELLS[d].facets):
        marked = (bits >> bit) & 1 == 1
        own = corners[marked][:, list(side)]
        right = is_in_front(points[own, :d].T, points[corners[marked], :d].mean(axis=1).T)
        sides.append(np.where(right[:, None], own, own[:, [1, 0, *range(2, d)]]))
    return np.concatenate(sides)


class _Plain(ElementTree.TreeBuilder):
    """Builder of XML trees that refuses document types.

    Entities of a document type can expand without bound.
    """

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        raise ValueError("it declares a document type, which is not allowed")


def plain_xml(text: bytes) -> ElementTree.Element:
    if b"<!DOCTYPE" in text:
        _Plain().doctype("", None, None)
    return ElementTree.fromstring(text, ElementTree.XMLParser(target=_Plain()))


def checked_vtu(data: bytes) -> bytes:
    """Return the bytes of a VTU file in a form that meshio reads.

    Version 2 of VTK differs from version 1 in polyhedra only, and meshio refuses it.

    Raises
    ------
    ValueError
        If meshio would misread the file, or unpack it without limit.
    """
    text, raw = _without_raw(data)
    root = plain_xml(text)
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise ValueError("it has no UnstructuredGrid")
    pieces = len(root.findall("UnstructuredGrid/Piece"))
    if pieces != 1:
        raise ValueError(f"it has {pieces} pieces instead of one: merge them, in ParaView by Merge Blocks")
    order = _checked_word(ORDERS, "byte order", root.get("byte_order", "LittleEndian"))
    head = np.dtype(order + _checked_word(HEADERS, "header type", root.get("header_type", "UInt32")))
    decompressor = root.get("compressor") and _checked_word(DECOMPRESSORS, "compressor", root.get("compressor"))
    appended: Source = root.findtext("AppendedData", "").strip()[1:] if raw is None else raw
    left = MAX_EXPANSION * len(data) + ALLOWED_BYTES
    for array in root.iter("DataArray"):
        if array.get("format") in ("binary", "appended"):
            inline = array.get("format") == "binary"
            source = (array.text or "").strip() if inline else appended[int(array.attrib["offset"]) :]
            left -= _unpacked(source, head, left, decompressor or None)
    return NEWER.sub(rb"\g<1>1.0", data, count=1)


def _without_raw(data: bytes) -> tuple[bytes, bytes | None]:
    found = RAW.search(data)
    if not found:
        return data, None
    # The raw section is not valid XML.
    start, end = data.index(b"_", found.end()) + 1, data.rfind(b"</AppendedData>")
    if end < start:
        raise ValueError("its appended data has no end")
    return data[: found.end()] + data[end:], data[start:end]


def _unpacked(source: Source, head: np.dtype[Any], most: int, decompressor: Callable[[], Any] | None) -> int:
    """Return the number of bytes of an array, with the size of every block checked.

    A header has the number of bytes or, of compressed data, the number of blocks, the size of a block and of the last
    block, and the compressed size of each.

    Raises
    ------
    ValueError
        If the array has more than `most` bytes, or a block does not unpack to its size.
    """
    first, _ = _read_bytes(source, 0, head.itemsize)
    count = int(np.frombuffer(first, head)[0])
    lengths = [min(count, len(source))]
    if decompressor:
        header, end = _read_bytes(source, 0, (3 + count) * head.itemsize)
        _, full, last, *sizes = np.frombuffer(header, head).tolist()
        lengths = [full] * (count - 1) + [last or full] if count else []
    if sum(lengths) > most:  # arrays may refer to the same bytes
        raise ValueError("it unpacks to more data than plausible for its size")
    if decompressor:
        packed, start = _read_bytes(source, end, sum(sizes))[0], 0
        for length, size in zip(lengths, sizes, strict=True):
            _check_block(decompressor(), packed[start : start + size], length)
            start += size
    return sum(lengths)


def _check_block(decompressor: Any, block: bytes, length: int) -> None:
    try:
        unpacked = decompressor.decompress(block, length + 1)
    except (zlib.error, lzma.LZMAError, EOFError) as error:
        raise ValueError(f"a block of its data cannot be unpacked: {error}") from None
    if len(unpacked) != length:
        raise ValueError("a block of its data has a wrong length")


def _read_bytes(source: Source, start: int, count: int) -> tuple[bytes, int]:
    """Return `count` decoded bytes from `start`, and their end in `source`."""
    end = start + (count if isinstance(source, bytes) else -(-count // 3) * 4)
    if not 0 <= start <= end <= len(source):
        raise ValueError("its data ends before its last number")
    part = source[start:end]
    return (part if isinstance(part, bytes) else base64.b64decode(part, validate=True)[:count]), end


def _checked_word(table: dict[Any, Any], what: str, word: str | None) -> Any:
    if word not in table:
        raise ValueError(f"its {what} is '{word}'; write it with {listed(table)}")
    return table[word]
