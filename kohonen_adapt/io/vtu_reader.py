"""Read VTU files: ASCII, base64 and raw data, inline or appended, compressed or not.

meshio reads these files, too, but it takes memory by what a file declares and not by what it holds, loops without end
on some, and decodes all that follows an appended array for each of them.
"""

import base64
import binascii
import lzma
import re
import warnings
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.io.content import refusing

__all__ = ["NODES", "Grid", "read_grid"]

Data = dict[str, NDArray[Any]]

SIZES = (1, 2, 4, 8)
NUMBERS = {f"Int{8 * size}": f"i{size}" for size in SIZES} | {f"UInt{8 * size}": f"u{size}" for size in SIZES}
NUMBERS |= {"Float32": "f4", "Float64": "f8"}
"""VTK's name of a type to numpy's."""

NODES = {1: 1, 3: 2, 21: 3, 5: 3, 22: 6}
"""VTK's number of a type (vertex, line, triangle, and these of second order) to how many nodes it has."""

DECOMPRESSORS: dict[str, Callable[[], Any]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}

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
    first, connectivity
        The nodes of cell k are `connectivity` from `first[k]` to `first[k + 1]`.
    point_data, cell_data
        Arrays (n,) or (n, components), and (m,) or (m, components), by name.
    """

    points: Floats
    types: Ints
    first: Ints
    connectivity: Ints
    point_data: Data
    cell_data: Data

    def cells(self, kind: int) -> tuple[Ints, Ints]:
        """Select the cells of a type of `NODES`: their numbers, and their nodes (cells, nodes of each)."""
        which = np.flatnonzero(self.types == kind)
        return which, self.connectivity[self.first[which][:, None] + np.arange(NODES[kind])]


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
        self._raw: bytes | None = None
        text = data
        if found := RAW.search(data):
            end = data.rfind(END)
            start = data.index(b"_", found.end()) + 1
            if end < start:
                raise ValueError("its appended data has no end")
            self._raw, text = data[start:end], data[: found.end()] + data[end:]
        if b"<!DOCTYPE" in text:
            _Plain().doctype("", None, None)
        self._root = ElementTree.fromstring(text, ElementTree.XMLParser(target=_Plain()))
        if self._root.tag != "VTKFile" or self._root.get("type") != "UnstructuredGrid":
            raise ValueError("it holds no UnstructuredGrid")
        self._budget = PACKED * len(data) + ALWAYS
        order = {"LittleEndian": "<", "BigEndian": ">"}.get(self._root.get("byte_order", "LittleEndian"))
        if order is None:
            raise ValueError("its byte order is unknown")
        self._order = order
        self._size = np.dtype(order + {"UInt32": "u4", "UInt64": "u8"}[self._root.get("header_type", "UInt32")])
        self._compressor = self._root.get("compressor")
        appended = self._root.find("AppendedData")
        self._appended = "" if appended is None or self._raw is not None else (appended.text or "").strip()[1:]

    def grid(self) -> Grid:
        pieces = self._root.findall("UnstructuredGrid/Piece")
        if not pieces:
            raise ValueError("it has no piece")
        grids = [self._piece(piece) for piece in pieces]
        shift = np.cumsum([0, *(len(grid.points) for grid in grids)])
        start = np.cumsum([0, *(len(grid.connectivity) for grid in grids)])
        return Grid(
            np.concatenate([grid.points for grid in grids]),
            np.concatenate([grid.types for grid in grids]),
            np.concatenate([[0], *(grid.first[1:] + begin for grid, begin in zip(grids, start, strict=False))]),
            np.concatenate([grid.connectivity + begin for grid, begin in zip(grids, shift, strict=False)]),
            _joined([grid.point_data for grid in grids]),
            _joined([grid.cell_data for grid in grids]),
        )

    def _piece(self, piece: ElementTree.Element) -> Grid:
        arrays = list(self._arrays(piece, "Points").values())
        if len(arrays) != 1:
            raise ValueError(f"a piece has {len(arrays)} arrays of points")
        (places,) = arrays
        points = places.reshape(len(places), -1).astype(float)
        points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
        cells = self._arrays(piece, "Cells")
        connectivity, ends, types = (_whole(cells[name], name) for name in ("connectivity", "offsets", "types"))
        first = np.concatenate([[0], ends])
        if len(ends) != len(types) or np.any(np.diff(first) < 1) or first[-1] > len(connectivity):
            raise ValueError("its offsets do not fit its cells")
        connectivity = connectivity[: first[-1]]
        if len(connectivity) and not 0 <= connectivity.min() <= connectivity.max() < len(points):
            raise ValueError("a cell has a node that is not there")
        for kind, nodes in NODES.items():
            if np.any(np.diff(first)[types == kind] != nodes):
                raise ValueError(f"a cell of type {kind} has not {nodes} nodes")
        at_points = _of_length(self._arrays(piece, "PointData"), len(points))
        in_cells = _of_length(self._arrays(piece, "CellData"), len(types))
        return Grid(points, types, first, connectivity, at_points, in_cells)

    def _arrays(self, piece: ElementTree.Element, section: str) -> Data:
        elements = piece.findall(f"{section}/DataArray")
        return {element.get("Name", ""): self._array(element) for element in elements}

    def _array(self, element: ElementTree.Element) -> NDArray[Any]:
        code = NUMBERS[element.attrib["type"]]
        form, text = element.get("format", "ascii"), (element.text or "").strip()
        if form == "ascii":
            values = _parsed(text, np.dtype(code))
        elif form == "binary":
            values = self._unpacked(_Encoded(text, 0), code)
        elif form == "appended":
            offset = int(element.attrib["offset"])
            if not 0 <= offset < len(self._appended if self._raw is None else self._raw):
                raise ValueError(f"its appended data has no byte {offset}")
            source = _Encoded(self._appended, offset) if self._raw is None else _Plainly(self._raw, offset)
            values = self._unpacked(source, code)
        else:
            raise ValueError(f"its data has the format '{form}'")
        components = int(element.get("NumberOfComponents") or 1)
        return values if components == 1 else values.reshape(-1, components)

    def _unpacked(self, source: "_Encoded | _Plainly", code: str) -> NDArray[Any]:
        data = b"".join(self._blocks(source)) if self._compressor else self._as_it_is(source)
        return np.frombuffer(data, self._order + code)

    def _as_it_is(self, source: "_Encoded | _Plainly") -> bytes:
        data = source.sized(self._size)
        self._spend(len(data))  # arrays may name the same bytes
        return data

    def _spend(self, count: int) -> None:
        self._budget -= count
        if self._budget < 0:
            raise ValueError("it unpacks to far more than a mesh of its size holds")

    def _blocks(self, source: "_Encoded | _Plainly") -> Iterator[bytes]:
        """Unpacked blocks, each as long as the header says."""
        count = int(np.frombuffer(source.peek(self._size.itemsize), self._size)[0])
        head = np.frombuffer(source.take((3 + count) * self._size.itemsize), self._size)
        full, last, sizes = int(head[1]), int(head[2]), [int(size) for size in head[3:]]
        packed, start = source.take(sum(sizes)), 0
        for number, size in enumerate(sizes):
            length = last if last and number == count - 1 else full
            self._spend(length)
            yield self._decompressed(packed[start : start + size], length)
            start += size

    def _decompressed(self, block: bytes, length: int) -> bytes:
        if self._compressor not in DECOMPRESSORS:
            raise ValueError(f"its compressor '{self._compressor}' is unknown; write it with zlib")
        try:
            unpacked = DECOMPRESSORS[self._compressor]().decompress(block, length + 1)
        except (zlib.error, lzma.LZMAError, EOFError) as error:
            raise ValueError(f"a block of its data cannot be unpacked: {error}") from None
        if len(unpacked) != length:
            raise ValueError("a block of its data has another length than it says")
        return unpacked


class _Plainly:
    """Bytes of a raw section from an offset on."""

    def __init__(self, data: bytes, offset: int) -> None:
        self._data, self._position = data, offset

    def peek(self, count: int) -> bytes:
        if not 0 <= count <= len(self._data) - self._position:
            raise ValueError("its data ends before its last number")
        return self._data[self._position : self._position + count]

    def take(self, count: int) -> bytes:
        taken = self.peek(count)
        self._position += count
        return taken

    def sized(self, size: np.dtype) -> bytes:
        return self.take(int(np.frombuffer(self.take(size.itemsize), size)[0]))


class _Encoded:
    """Bytes in base64 from an offset on; what is taken at once was encoded at once."""

    def __init__(self, text: str, offset: int) -> None:
        self._text, self._position = text, offset

    def peek(self, count: int) -> bytes:
        characters = -(-count // 3) * 4
        if not 0 <= characters <= len(self._text) - self._position:
            raise ValueError("its data ends before its last number")
        try:
            return base64.b64decode(self._text[self._position : self._position + characters], validate=True)[:count]
        except binascii.Error as error:
            raise ValueError(f"its data is no base64: {error}") from None

    def take(self, count: int) -> bytes:
        taken = self.peek(count)
        self._position += -(-count // 3) * 4
        return taken

    def sized(self, size: np.dtype) -> bytes:
        """Writers encode the size by itself, or together with what follows; padding after it tells."""
        head, width = self.peek(size.itemsize), -(-size.itemsize // 3) * 4
        count = int(np.frombuffer(head, size)[0])
        if self._text[self._position + width - 1] == "=":
            self._position += width
            return self.take(count)
        return self.take(size.itemsize + count)[size.itemsize :]


def _parsed(text: str, kind: np.dtype) -> NDArray[Any]:
    if not text:
        return np.empty(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy warns of what is no number
        try:
            return np.fromstring(text, kind, sep=" ")
        except (DeprecationWarning, RuntimeWarning):
            raise ValueError("an array of numbers holds something else") from None


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
