"""Read VTU files: ASCII, base64 and raw data, inline or appended, compressed or not.

meshio reads these files, too, but it unpacks whatever it is given without a limit, keeps the cells of the last piece
only, prints that it skips a field, and refuses files of VTK's version 2.
"""

import base64
import lzma
import re
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.io.content import parsed, refusing

__all__ = ["NODES", "Grid", "read_grid"]

T = TypeVar("T")
Data = dict[str, NDArray[Any]]

TYPES = ["Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64", "Float32", "Float64"]
NUMBERS = {name: np.dtype(name.lower()).str[1:] for name in TYPES}
"""VTK's name of a type to numpy's."""

NODES = {1: 1, 3: 2, 21: 3, 5: 3, 22: 6}
"""VTK's number of a type (vertex, line, triangle, and these of second order) to how many nodes it has."""

DECOMPRESSORS: dict[str, Callable[[], Any]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}

HEADERS = {"UInt32": "u4", "UInt64": "u8"}
ORDERS = {"LittleEndian": "<", "BigEndian": ">"}

RAW = re.compile(rb"<AppendedData\b[^>]*\bencoding\s*=\s*[\"']raw[\"'][^>]*>")
END = b"</AppendedData>"

PACKED = 200  # times its size: what a file may unpack to, besides...
ALWAYS = 2**26  # bytes: ...what any may


@dataclass(frozen=True)
class Grid:
    """The content of a VTU file.

    Attributes
    ----------
    points
        (n, 3).
    types
        (m,): VTK's number for the type of every cell.
    count, connectivity
        (m,): how many nodes every cell has; and these, of all cells one after another.
    point_data, cell_data
        Arrays (n,) or (n, components), and (m,) or (m, components), by name.
    """

    points: Floats
    types: Ints
    count: Ints
    connectivity: Ints
    point_data: Data
    cell_data: Data

    def cells(self, kind: int) -> tuple[Ints, Ints]:
        """Select the cells of a type of `NODES`: their numbers, and their nodes (cells, nodes of each)."""
        which = np.flatnonzero(self.types == kind)
        first = np.cumsum(self.count) - self.count
        return which, self.connectivity[first[which][:, None] + np.arange(NODES[kind])]


def read_grid(path: Path, caller: str) -> Grid:
    """Read the content of a VTU file.

    Raises
    ------
    ValueError
        If it is none, is damaged, or unpacks to more memory than a mesh of its size needs; `caller` is who asked.
    """
    with refusing(path, f"{caller} expected a VTU file; '{path}' cannot be read: {{}}."):
        return _Reader(path.read_bytes()).grid()


class _Plain(ElementTree.TreeBuilder):
    """A tree without entities of its own: such can grow without bound, and no VTU file has any."""

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        raise ValueError("it declares a document type, which no mesh needs")


class _Reader:
    def __init__(self, data: bytes) -> None:
        text, raw = _without_raw(data)
        if b"<!DOCTYPE" in text:
            _Plain().doctype("", None, None)
        root = ElementTree.fromstring(text, ElementTree.XMLParser(target=_Plain()))
        if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
            raise ValueError("it holds no UnstructuredGrid")
        self._pieces = root.findall("UnstructuredGrid/Piece")
        self._budget = PACKED * len(data) + ALWAYS
        self._order = _known(ORDERS, "byte order", root.get("byte_order", "LittleEndian"))
        self._size = np.dtype(self._order + _known(HEADERS, "header type", root.get("header_type", "UInt32")))
        self._compressor = root.get("compressor")
        self._appended = root.findtext("AppendedData", "").strip()[1:] if raw is None else raw

    def grid(self) -> Grid:
        if not self._pieces:
            raise ValueError("it has no piece")
        grids: list[Grid] = []
        shift = 0
        for piece in self._pieces:
            grids.append(self._piece(piece, shift))
            shift += len(grids[-1].points)
        return Grid(
            np.concatenate([grid.points for grid in grids]),
            np.concatenate([grid.types for grid in grids]),
            np.concatenate([grid.count for grid in grids]),
            np.concatenate([grid.connectivity for grid in grids]),
            _joined([grid.point_data for grid in grids]),
            _joined([grid.cell_data for grid in grids]),
        )

    def _piece(self, piece: ElementTree.Element, shift: int) -> Grid:
        """One piece, `shift` added to the numbers of its nodes."""
        arrays = list(self._arrays(piece, "Points").values())
        if len(arrays) != 1:
            raise ValueError(f"a piece has {len(arrays)} arrays of points")
        points = arrays[0].reshape(len(arrays[0]), -1).astype(float)
        points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
        cells = self._arrays(piece, "Cells")
        connectivity, ends, types = (_whole(cells[name], name) for name in ("connectivity", "offsets", "types"))
        count = np.diff(ends, prepend=0)
        total = count.sum()
        if len(ends) != len(types) or np.any(count < 1) or total > len(connectivity):
            raise ValueError("its offsets do not fit its cells")
        connectivity = connectivity[:total]
        if np.any((connectivity < 0) | (connectivity >= len(points))):
            raise ValueError("a cell has a node that is not there")
        for kind, nodes in NODES.items():
            if np.any(count[types == kind] != nodes):
                raise ValueError(f"a cell of type {kind} has not {nodes} nodes")
        at_points = _of_length(self._arrays(piece, "PointData"), len(points))
        in_cells = _of_length(self._arrays(piece, "CellData"), len(types))
        return Grid(points, types, count, connectivity + shift, at_points, in_cells)

    def _arrays(self, piece: ElementTree.Element, section: str) -> Data:
        return {element.get("Name", ""): self._array(element) for element in piece.findall(f"{section}/DataArray")}

    def _array(self, element: ElementTree.Element) -> NDArray[Any]:
        code = _known(NUMBERS, "type of numbers", element.attrib["type"])
        form, text = element.get("format", "ascii"), (element.text or "").strip()
        if form == "ascii":
            values = parsed(text, code)
        elif form == "binary":
            values = np.frombuffer(self._unpacked(_Source(text, 0)), self._order + code)
        elif form == "appended":
            source = _Source(self._appended, int(element.attrib["offset"]))
            values = np.frombuffer(self._unpacked(source), self._order + code)
        else:
            raise ValueError(f"its data has the format '{form}'")
        components = int(element.get("NumberOfComponents") or 1)
        return values if components == 1 else values.reshape(-1, components)

    def _unpacked(self, source: "_Source") -> bytes:
        if self._compressor:
            return b"".join(self._blocks(source))
        data = source.sized(self._size)
        self._spend(len(data))  # arrays may name the same bytes
        return data

    def _spend(self, count: int) -> None:
        self._budget -= count
        if self._budget < 0:
            raise ValueError("it unpacks to far more than a mesh of its size holds")

    def _blocks(self, source: "_Source") -> Iterator[bytes]:
        """Unpacked blocks, each as long as the header says."""
        count = int(np.frombuffer(source.peek(self._size.itemsize), self._size)[0])
        _, full, last, *sizes = np.frombuffer(source.take((3 + count) * self._size.itemsize), self._size).tolist()
        packed, start = source.take(sum(sizes)), 0
        for number, size in enumerate(sizes):
            length = last if last and number == count - 1 else full
            self._spend(length)
            yield self._decompressed(packed[start : start + size], length)
            start += size

    def _decompressed(self, block: bytes, length: int) -> bytes:
        decompressor = _known(DECOMPRESSORS, "compressor", self._compressor or "")
        try:
            unpacked = decompressor().decompress(block, length + 1)
        except (zlib.error, lzma.LZMAError, EOFError) as error:
            raise ValueError(f"a block of its data cannot be unpacked: {error}") from None
        if len(unpacked) != length:
            raise ValueError("a block of its data has another length than it says")
        return unpacked


def _without_raw(data: bytes) -> tuple[bytes, bytes | None]:
    """The text of a file without its raw section, which is no XML, and the latter."""
    found = RAW.search(data)
    if not found:
        return data, None
    start, end = data.index(b"_", found.end()) + 1, data.rfind(END)
    if end < start:
        raise ValueError("its appended data has no end")
    return data[: found.end()] + data[end:], data[start:end]


class _Source:
    """Bytes from a place on, as they are or as text in base64; what is taken at once was encoded at once."""

    def __init__(self, data: bytes | str, position: int) -> None:
        self._data, self._position = data, position

    def _after(self, count: int) -> int:
        """Where `count` bytes end."""
        return self._position + (count if isinstance(self._data, bytes) else -(-count // 3) * 4)

    def peek(self, count: int) -> bytes:
        if not 0 <= self._position <= self._after(count) <= len(self._data):
            raise ValueError("its data ends before its last number")
        part = self._data[self._position : self._after(count)]
        return part if isinstance(part, bytes) else base64.b64decode(part, validate=True)[:count]

    def take(self, count: int) -> bytes:
        taken = self.peek(count)
        self._position = self._after(count)
        return taken

    def sized(self, size: np.dtype) -> bytes:
        """Writers encode the size by itself, or together with what follows; padding after it tells."""
        count = int(np.frombuffer(self.peek(size.itemsize), size)[0])
        if self._data[self._after(size.itemsize) - 1] == "=":  # never in bytes, which hold numbers
            self._position = self._after(size.itemsize)
            return self.take(count)
        return self.take(size.itemsize + count)[size.itemsize :]


def _known(table: dict[str, T], what: str, word: str) -> T:
    if word not in table:
        raise ValueError(f"its {what} is '{word}'; write it with {listed(table)}")
    return table[word]


def _whole(values: NDArray[Any], name: str) -> Ints:
    if values.dtype.kind not in "iu" or (values.size and values.max() > np.iinfo(np.int64).max):
        raise ValueError(f"its {name} are no whole numbers")
    return values.ravel().astype(np.int64)


def _of_length(arrays: Data, length: int) -> Data:
    for name, values in arrays.items():
        if len(values) != length:
            raise ValueError(f"its data '{name}' has {len(values)} rows and not {length}")
    return arrays


def _joined(parts: list[Data]) -> Data:
    """Arrays of all pieces together; what one of them lacks is left out."""
    names = [name for name in parts[0] if all(name in part for part in parts)]
    return {name: np.concatenate([part[name] for part in parts]) for name in names}
