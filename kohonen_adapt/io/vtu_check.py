"""Refuse a VTU file that meshio would misread, or unpack to far more than a mesh of its size holds."""

import base64
import lzma
import re
import zlib
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np

from kohonen_adapt.checks import listed
from kohonen_adapt.io.content import ALWAYS, PACKED

__all__ = ["checked_vtu", "plain_xml"]

Source = bytes | str
"""Bytes as they are, or as text in base64, where what is taken at once was encoded at once."""

DECOMPRESSORS: dict[str | None, Callable[[], Any]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}
HEADERS = {"UInt32": "u4", "UInt64": "u8"}
ORDERS = {"LittleEndian": "<", "BigEndian": ">"}

RAW = re.compile(rb"<AppendedData\b[^>]*\bencoding\s*=\s*[\"']raw[\"'][^>]*>")
NEWER = re.compile(rb"(<VTKFile\b[^>]*\bversion\s*=\s*[\"'])2\.[0-9]+")


class _Plain(ElementTree.TreeBuilder):
    """A tree without entities of its own: such can grow without bound, and no mesh file has any."""

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        raise ValueError("it declares a document type, which no mesh needs")


def plain_xml(text: bytes) -> ElementTree.Element:
    """The root of an XML file; a ValueError if it declares a document type."""
    if b"<!DOCTYPE" in text:
        _Plain().doctype("", None, None)
    return ElementTree.fromstring(text, ElementTree.XMLParser(target=_Plain()))


def checked_vtu(data: bytes) -> bytes:
    """A VTU file as meshio takes it; a ValueError if that would misread it, or unpack it without limit.

    VTK's version 2 has other polyhedra than version 1, and meshio refuses it for that.
    """
    text, raw = _without_raw(data)
    root = plain_xml(text)
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise ValueError("it holds no UnstructuredGrid")
    pieces = len(root.findall("UnstructuredGrid/Piece"))
    if pieces != 1:
        raise ValueError(f"it has {pieces} pieces where one is expected: merge them, in ParaView by Merge Blocks")
    order = _known(ORDERS, "byte order", root.get("byte_order", "LittleEndian"))
    head = np.dtype(order + _known(HEADERS, "header type", root.get("header_type", "UInt32")))
    decompressor = root.get("compressor") and _known(DECOMPRESSORS, "compressor", root.get("compressor"))
    appended: Source = root.findtext("AppendedData", "").strip()[1:] if raw is None else raw
    left = PACKED * len(data) + ALWAYS
    for array in root.iter("DataArray"):
        if array.get("format") in ("binary", "appended"):
            inline = array.get("format") == "binary"
            source = (array.text or "").strip() if inline else appended[int(array.attrib["offset"]) :]
            left -= _unpacked(source, head, left, decompressor or None)
    return NEWER.sub(rb"\g<1>1.0", data, count=1)


def _without_raw(data: bytes) -> tuple[bytes, bytes | None]:
    """The text of a file without its raw section, which is no XML, and the latter."""
    found = RAW.search(data)
    if not found:
        return data, None
    start, end = data.index(b"_", found.end()) + 1, data.rfind(b"</AppendedData>")
    if end < start:
        raise ValueError("its appended data has no end")
    return data[: found.end()] + data[end:], data[start:end]


def _unpacked(source: Source, head: np.dtype[Any], most: int, decompressor: Callable[[], Any] | None) -> int:
    """How many bytes an array has; a ValueError if they are more than `most`, or blocks unpack to more than they say.

    A header has the length, or of compressed data the number of blocks, the length of each and of the last one, and
    what each is packed to.
    """
    first, _ = _taken(source, 0, head.itemsize)
    count = int(np.frombuffer(first, head)[0])
    lengths = [min(count, len(source))]
    if decompressor:
        header, end = _taken(source, 0, (3 + count) * head.itemsize)
        _, full, last, *sizes = np.frombuffer(header, head).tolist()
        lengths = [full] * (count - 1) + [last or full] if count else []
    if sum(lengths) > most:  # arrays may name the same bytes
        raise ValueError("it unpacks to far more than a mesh of its size holds")
    if decompressor:
        packed, start = _taken(source, end, sum(sizes))[0], 0
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
        raise ValueError("a block of its data has another length than it says")


def _taken(source: Source, start: int, count: int) -> tuple[bytes, int]:
    """So many bytes from a place on, and where they end."""
    end = start + (count if isinstance(source, bytes) else -(-count // 3) * 4)
    if not 0 <= start <= end <= len(source):
        raise ValueError("its data ends before its last number")
    part = source[start:end]
    return (part if isinstance(part, bytes) else base64.b64decode(part, validate=True)[:count]), end


def _known(table: dict[Any, Any], what: str, word: str | None) -> Any:
    if word not in table:
        raise ValueError(f"its {what} is '{word}'; write it with {listed(table)}")
    return table[word]
