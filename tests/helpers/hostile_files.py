"""Good files of every kind, ways to spoil them, and what a reader may do with the outcome."""

import re
import struct
import zlib

import numpy as np
from hypothesis import strategies as st

# What makes readers count, allocate or look up wrongly.
NUMBERS = [
    b"0",
    b"-1",
    b"1e308",
    b"nan",
    b"inf",
    b"-inf",
    b"99999999999999999999",
    b"4294967296",
    b"2147483648",
    b"0.5",
]
WORDS = [
    *(b"$Nodes\n", b"$EndNodes\n", b"$Elements\n", b"$PhysicalNames\n1\n2 1 ", b'"', b"\x00", b"\xff\xfe", b"\n"),
    *(b"<", b"]]>", b"&amp;", b"<!--", b'View "f" {', b"[", b"= {", b"a.b.c = 1\n", b"x" * 5000),
]


@st.composite
def spoilt(draw, data):
    """Return a good file with up to four changes."""
    for _ in range(draw(st.integers(1, 4))):
        data = draw(st.sampled_from(CHANGES))(draw, data)
    return data


def _place(draw, data):
    return draw(st.integers(0, max(len(data) - 1, 0)))


def _flip(draw, data):
    place = _place(draw, data)
    return data[:place] + bytes([draw(st.integers(0, 255))]) + data[place + 1 :]


def _cut(draw, data):
    return data[: _place(draw, data)]


def _drop(draw, data):
    start = _place(draw, data)
    return data[:start] + data[start + draw(st.integers(1, 64)) :]


def _insert(draw, data):
    place = _place(draw, data)
    return data[:place] + draw(st.sampled_from(WORDS)) + data[place:]


def _count(draw, data):
    """Another number in place of one in the text."""
    found = list(re.finditer(rb"-?\d+(\.\d+)?", data))
    if not found:
        return data
    start, end = draw(st.sampled_from(found)).span()
    return data[:start] + draw(st.sampled_from(NUMBERS)) + data[end:]


def _lines(draw, data):
    """A line gone, twice, or in the place of another."""
    lines = data.split(b"\n")
    one, other = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
    change = draw(st.sampled_from(["drop", "double", "swap"]))
    if change == "swap":
        lines[one], lines[other] = lines[other], lines[one]
    else:
        lines[one : one + 1] = [] if change == "drop" else [lines[one]] * 2
    return b"\n".join(lines)


def _word(draw, data):
    """A number of a binary file: four or eight bytes."""
    place = _place(draw, data)
    number = draw(st.sampled_from([0, 1, -1, 2**31 - 1, -(2**31)]))
    return data[:place] + struct.pack("<i", number) + data[place + 4 :]


CHANGES = [_flip, _cut, _drop, _insert, _count, _lines, _word]


def raw_vtu():
    """Two triangles as ParaView writes them: appended, raw, compressed."""
    arrays = {
        "Points": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]),
        "connectivity": np.array([0, 1, 2, 1, 3, 2]),
        "offsets": np.array([3, 6]),
        "types": np.array([5, 5], np.uint8),
        "e": np.array([1.5, 2.5]),
    }
    blob, offsets = b"", {}
    for name, values in arrays.items():
        offsets[name] = len(blob)
        data = values.tobytes()
        packed = zlib.compress(data)
        blob += struct.pack("<4I", 1, len(data), 0, len(packed)) + packed
    kinds = {"Points": 'Float64" NumberOfComponents="3', "types": "UInt8", "e": "Float64"}

    def array(name):
        kind = kinds.get(name, "Int64")
        return f'<DataArray type="{kind}" Name="{name}" format="appended" offset="{offsets[name]}"/>'

    head = (
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" '
        'compressor="vtkZLibDataCompressor"><UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="2">'
        f"<Points>{array('Points')}</Points><Cells>{array('connectivity')}{array('offsets')}{array('types')}</Cells>"
        f'<CellData>{array("e")}</CellData></Piece></UnstructuredGrid>\n<AppendedData encoding="raw">\n_'
    )
    return head.encode() + blob + b"\n</AppendedData>\n</VTKFile>\n"
