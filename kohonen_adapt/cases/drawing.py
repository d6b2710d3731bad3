"""Drawings of Gmsh with parameters, as the meshes of cases."""

import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from kohonen_adapt.cases.drawing_script import Script
from kohonen_adapt.cases.readers import NUMBER, TEXT, Kind, Reader, locate_errors
from kohonen_adapt.checks import nearest_name

__all__ = ["Drawing", "mesh_in"]

SCRIPT = Path(__file__).with_name("gmsh_script.py")
SUFFIX = ".geo"
TIME_LIMIT = 600  # s; Gmsh does not end with some sizes and distances of zero


@dataclass(frozen=True)
class Drawing:
    """Drawing of Gmsh with values of its parameters.

    Attributes
    ----------
    file
        The drawing.
    parameters
        Constants of the drawing (``DefineConstant``) to the values that replace those of the drawing.
    trusted
        True to let the drawing run programs and write files.
    """

    file: Path
    parameters: Mapping[str, float]
    trusted: bool = False

    @property
    def name(self) -> str:
        return f"{self.file.name}{self._values()}"

    def __str__(self) -> str:
        return f"{self.file}{self._values()}"

    def _values(self) -> str:
        values = ", ".join(f"{name} = {value:g}" for name, value in self.parameters.items())
        return values and f" ({values})"

    def write_mesh(self, path: Path) -> None:
        """Draw and mesh in another process, and write the mesh to a Gmsh file.

        The same drawing, parameters and version of Gmsh give the same file. The mesh is of tetrahedra if the drawing
        has a volume. Gmsh gets a copy of the drawing that can only draw, unless the drawing is trusted.

        Raises
        ------
        ValueError
            If there is no drawing or no Gmsh, the drawing is not trusted and has words that may run programs or write
            files, the drawing does not use a parameter, or Gmsh fails.
        """
        if not self.file.is_file():
            beside = [file.name for file in self.file.parent.glob(f"*{SUFFIX}")]
            raise ValueError(
                f"mesh.drawing must be the path of a drawing, relative to the case; there is no file '{self.file}'."
                f"{nearest_name(self.file.name, beside)}"
            )
        if find_spec("gmsh") is None:
            raise ValueError('mesh.drawing needs Gmsh, which is not installed: pip install "kohonen-adapt[draw]".')
        values = [text for name, value in self.parameters.items() for text in (name, repr(value))]
        drawing, origins = str(self.file.resolve()), list[tuple[Path, int]]()
        if not self.trusted:
            copy = path.with_suffix(SUFFIX)
            drawing = copy.name
            with locate_errors(f"mesh.drawing '{self}'"):
                origins = Script.read(self.file).write(copy)
        command = [sys.executable, "-P", str(SCRIPT), drawing, path.name, *values]
        if reason := _error_of(command, path):
            found = re.search(rf"'{re.escape(drawing)}', line (\d+)", reason)
            if found and 0 < int(found[1]) <= len(origins):
                file, line = origins[int(found[1]) - 1]
                reason = reason.replace(found[0], f"'{file}', line {line}")
            raise ValueError(f"mesh.drawing '{self}': {reason}")


def _error_of(command: list[str], path: Path) -> str:
    try:
        done = subprocess.run(
            command,
            cwd=path.parent,  # for files that the drawing writes
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIME_LIMIT,
        )
    except subprocess.TimeoutExpired:
        return f"Gmsh has not finished in {TIME_LIMIT} s; is a size or a distance zero?"
    if done.returncode == 0 and path.is_file():
        return ""
    return [f"Gmsh wrote no mesh (exit code {done.returncode}).", *done.stderr.strip().splitlines()][-1]


def mesh_in(folder: Path) -> Reader:
    def read(given: Any, location: str) -> Path | Drawing:
        if isinstance(given, str):
            if given.endswith(SUFFIX):
                raise ValueError(f'{location} is a drawing, which needs a table: {location} = {{drawing = "{given}"}}.')
            return folder / given
        if "drawing" not in given:
            raise ValueError(f"{location}.drawing is missing; it is required.")
        name = TEXT(given["drawing"], f"{location}.drawing")
        if not name.endswith(SUFFIX):
            raise ValueError(
                f"{location}.drawing must be a drawing of Gmsh ({SUFFIX}); got {name!r}. A {SUFFIX} file may Merge "
                "others."
            )
        values = {key: NUMBER(value, f"{location}.{key}") for key, value in given.items() if key != "drawing"}
        return Drawing(folder / name, values)

    return Kind((str, dict), f'text in quotes, or {{drawing = "NAME{SUFFIX}", PARAMETER = ...}}', bool, read)
