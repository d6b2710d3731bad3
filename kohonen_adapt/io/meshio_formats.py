"""Formats of meshio, with checks and corrections of files."""

import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from kohonen_adapt.io.vtu import checked_vtu

__all__ = ["FORMATS", "MARKER", "is_ucd"]

COUNTS = re.compile(rb"(?m)^[ \t]*[A-Za-z_][^\s=]*[ \t]*[\s=][ \t]*([0-9]+)(?:[ \t]+([0-9]+))?")
"""First word of a line, and the counts after the word."""

MARKER = re.compile(rb"(?m)^(MARKER_TAG[ \t]*=)[ \t]*(.*?)[ \t\r]*$")
RANGE = re.compile(rb"(?im)^\*[^\n]*\bGENERATE\b[^\n]*\n\s*([0-9]+)\s*,\s*([0-9]+)\s*,\s*([0-9]+)")


# FreeFEM writes "Scalars Label int1"; counts of Medit may stand beside their keyword, and its versions 3 and 4 differ
# from 2 in binary files only.
SCALARS = re.compile(rb"(?im)^([ \t]*SCALARS[ \t]+\S+[ \t]+[a-z_]+)1(?=[ \t\r]*$)")
VERSION = re.compile(rb"(?m)^([ \t]*MeshVersionFormatted)\s+([0-9])")
COUNT = re.compile(rb"(?m)^([ \t]*(?!MeshVersionFormatted|Dimension)[A-Za-z]+)[ \t]+(?=[0-9]+[ \t\r]*$)")
UCD = re.compile(rb"(?:[ \t]*#[^\n]*\n)*[ \t]*[0-9]+(?:[ \t]+[0-9]+){4}[ \t\r]*\n")


def is_ucd(data: bytes) -> bool:
    # AVS shares its suffix with Abaqus.
    return UCD.match(data) is not None


def _check_counts(data: bytes) -> bytes:
    # meshio reserves memory for the counts of a file.
    most = max((int(number) for pair in COUNTS.findall(data) for number in pair if number), default=0)
    if most > len(data):
        raise ValueError(f"it announces {most} items in {len(data)} bytes")
    return data


def _vtk(data: bytes, path: Path) -> bytes:
    if not re.search(rb"(?im)^DATASET\s+UNSTRUCTURED_GRID\b", data):
        raise ValueError("it has no UNSTRUCTURED_GRID")
    _check_counts(b"\n".join(data.split(b"\n", 3)[2:]))  # without the title, a free text
    return SCALARS.sub(rb"\1 1", data)


def _medit(data: bytes, path: Path) -> bytes:
    found = VERSION.search(data)
    version = rb"\1 2" if found and found[2] in b"34" else rb"\1 \2"
    return COUNT.sub(rb"\1\n", VERSION.sub(version, _check_counts(data)))


# Plane strain, plane stress, axial symmetry and heat in triangles, and variants of tetrahedra.
TYPE = re.compile(rb"(?im)^(\*ELEMENT[ \t]*,[^\n]*?\bTYPE[ \t]*=[ \t]*)([A-Z0-9]+)")
SHAPES = {
    re.compile(rb"D?C(PS|PE|PEG|AX|GAX|2D)3[A-Z]*"): b"CPS3",
    re.compile(rb"D?C(PS|PE|PEG|AX|GAX|2D)6[A-Z]*"): b"CPE6",
    re.compile(rb"D?C3D4[A-Z]*"): b"C3D4",
    re.compile(rb"D?C3D10[A-Z]*"): b"C3D10",
}


def _known_type(found: re.Match[bytes]) -> bytes:
    name = found[2].upper()
    return found[1] + next((known for shape, known in SHAPES.items() if shape.fullmatch(name)), name)


def _abaqus(data: bytes, path: Path) -> bytes:
    if is_ucd(data):
        return data
    if re.search(rb"(?im)^\*INCLUDE\b", data):
        raise ValueError("it includes another file: put all into one")
    if re.search(rb"(?im)^\*ELSET\b[^\n]*\n\s*[^0-9\s*]", data):
        raise ValueError("it has a set of sets: list their elements")
    for first, last, step in RANGE.findall(data):
        if int(step) == 0 or (int(last) - int(first)) // int(step) > len(data):
            raise ValueError(f"it has a set from {int(first)} to {int(last)} in {len(data)} bytes")
    return TYPE.sub(_known_type, data)


def _su2(data: bytes, path: Path) -> bytes:
    # meshio has numbers only for markers, and may use one number for two names.
    number = iter(range(1, 1 + len(MARKER.findall(data))))
    return MARKER.sub(lambda found: found[1] + b" %d" % next(number), _check_counts(data))


def _med(data: bytes, path: Path) -> bytes:
    import h5py  # optional dependency

    buffer = BytesIO(data)
    with h5py.File(buffer, "r+") as file:
        bare = list[Any]()
        file.visititems(lambda name, item: bare.append(item) if _is_family(name, item) and "GRO" not in item else None)
        for family in bare:  # Gmsh writes families without groups, which meshio expects to have some
            groups = family.create_group("GRO")
            groups.attrs["NBR"] = 0
            groups.create_dataset("NOM", (0, 80), "i1")
    return buffer.getvalue() if bare else data


def _is_family(name: str, item: Any) -> bool:
    parts = name.split("/")
    return "FAS" in parts and parts[-2:-1] in (["ELEME"], ["NOEUD"]) and "NUM" in item.attrs


def _xdmf(data: bytes, path: Path) -> bytes:
    for item in ElementTree.fromstring(data).iter("DataItem"):
        form, (name, *_) = item.get("Format"), (item.text or "").strip().split(":")
        if form == "HDF":
            if Path(name).name != name or not path.with_name(name).is_file():
                raise ValueError(f"its data must be in a file in the same folder; there is no file '{name}' in it")
        elif form not in ("XML", None):
            raise ValueError(f"its data has the format '{form}'; write it with HDF or XML")
    return data


FORMATS: dict[str, tuple[str, str, Callable[[bytes, Path], bytes]]] = {
    ".vtu": ("a VTU", "vtu", lambda data, path: checked_vtu(data)),
    ".vtk": ("a VTK", "vtk", _vtk),
    ".inp": ("an Abaqus", "abaqus", _abaqus),
    ".mesh": ("a Medit", "medit", _medit),
    ".su2": ("an SU2", "su2", _su2),
    ".med": ("a MED", "med", _med),
    ".xdmf": ("an XDMF", "xdmf", _xdmf),
    ".vol": ("a Netgen", "netgen", lambda data, path: data),
}
"""Suffix to name, module of meshio, and a function that checks or corrects the bytes for this module."""
