"""Read a case from TOML: mesh file, problem, options of `adapt` and outputs."""

import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from skfem import MeshTri

from kohonen_adapt.cases.contents import Quantity, material_in, quantity, shape
from kohonen_adapt.cases.kinds import NUMBER, TEXT, Reader, about, kinds_of, read_table, table_of
from kohonen_adapt.io import MSH_VERSION, Groups, read_groups, read_mesh
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.magnetostatics import Field, Magnetostatics
from kohonen_adapt.magnetostatics.equations.conditions import conditions_of
from kohonen_adapt.magnetostatics.equations.elements import elements_on
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients
from kohonen_adapt.magnetostatics.quantities.bodies import elements_in

__all__ = ["ADAPT", "PROBLEM", "Case", "case_of", "read_case"]

PROBLEM = kinds_of(Magnetostatics)
"""Keys of a case that are arguments of `Magnetostatics`, besides ``materials``."""

ADAPT = {name: kind for name, kind in kinds_of(adapt, curves=table_of(shape)).items() if name != "checkpoint"}
"""Keys under ``adapt``: arguments of `kohonen_adapt.adapt`."""

LARGEST = 10**6  # bytes: the parser is slow, and takes much more memory than the file


@dataclass(frozen=True)
class Case:
    """Checked settings.

    Attributes
    ----------
    mesh
        The mesh file.
    scale
        Metres per unit of it.
    problem
        What is to be solved.
    adapt
        Arguments of `kohonen_adapt.adapt` by name.
    outputs
        Name to a function of the field.
    file, text
        The name of the file it was read from, and what that says; empty for a case from elsewhere.
    """

    mesh: Path
    scale: float
    problem: Magnetostatics
    adapt: dict[str, Any]
    outputs: dict[str, Quantity]
    file: str = ""
    text: str = ""

    @cached_property
    def groups(self) -> Groups:
        """The physical groups of the mesh file, in its unit; read once, so that the file may go after the mesh is read.

        Raises
        ------
        ValueError
            If the file is damaged.
        OSError
            If it cannot be read.
        """
        return read_groups(self.mesh)

    @property
    def labelled_outputs(self) -> dict[str, Quantity]:
        """The outputs by name and unit, as ``pull (N/m)``: per metre unless there is a depth or an axis."""
        totals = self.problem.axisymmetric or self.problem.depth is not None
        per_metre = "" if totals else "/m"
        return {f"{name} ({each.unit}{per_metre})": each for name, each in self.outputs.items()}

    @property
    def pinned(self) -> list[int | str]:
        """Names and numbers of what is to stay where it is."""
        given = self.adapt.get("pinned", [])
        return [given] if isinstance(given, str) else given

    def fitting_mesh(self) -> MeshTri:
        """Read the mesh, and refuse what `adapt` would refuse before it solves.

        Raises
        ------
        ValueError
            If the file is missing or damaged, names of the case are not in it, elements have no material or two,
            conditions contradict one another, or an option does not fit the mesh.
        OSError
            If the file cannot be read.
        """
        _check_file(self.mesh)
        with about("mesh"):
            mesh = read_mesh(self.mesh, scale=self.scale)
            _ = self.groups  # now, and not when hours later the results are written
        problem = self.problem
        with about("materials"):
            coefficients(mesh, problem.materials, problem.ampere_turns)
        with about("boundary conditions"):
            symmetry = AXISYMMETRIC if problem.axisymmetric else PLANAR
            conditions_of(elements_on(mesh, problem.order), problem.boundaries, symmetry)
        for name, each in self.outputs.items():
            with about(f"outputs.{name}"):
                for body in each.bodies:
                    elements_in(mesh, body)
        with about("adapt"), suppress(_Checked):
            unsolved = _Unsolved(**{field.name: getattr(problem, field.name) for field in fields(problem)})
            adapt(mesh, unsolved, outputs=self.outputs, **self.adapt)
        return mesh


class _Checked(Exception):
    """Ends `adapt` at its first solve: it has checked everything by then."""


class _Unsolved(Magnetostatics):
    """A problem that ends there."""

    def solve(self, mesh: MeshTri) -> Field:
        raise _Checked


def read_case(path: Path) -> Case:
    """Read a case from a TOML file.

    Parameters
    ----------
    path
        The file; paths in it are sought from its folder.

    Returns
    -------
    Case
        The settings.

    Raises
    ------
    ValueError
        If it is not TOML, or not a case; the message names the file and the key.
    OSError
        If it cannot be read.
    """
    if not path.is_file():
        raise FileNotFoundError(f"run expected a case; there is no file '{path}'. Make one: kohonen-adapt init MESH.")
    size = path.stat().st_size
    if size > LARGEST:
        raise ValueError(f"{path}: a case has at most {LARGEST} bytes; this has {size}.")
    content = path.read_bytes()
    try:
        said = content.decode("utf-8")
        given = tomllib.loads(said)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: is not TOML: {error}. {_remedy(path)}") from None
    with about(path):
        return replace(case_of(given, path.parent), file=path.name, text=said)


def _check_file(mesh: Path) -> None:
    if not mesh.is_file():
        raise ValueError(f"mesh must name a mesh file, as seen from the case; there is none at '{mesh}'.")


def _remedy(path: Path) -> str:
    """Advise about a file that is not TOML."""
    if path.suffix.lower() in (*MSH_VERSION, ".vtu"):
        return f"That is a mesh; make a case for it: kohonen-adapt init {path}."
    return "Texts need quotes, single ones where they have a backslash; numbers have a point, not a comma."


def case_of(given: Mapping[str, Any], folder: Path) -> Case:
    """The settings that a table of keys stands for; the mesh file is not looked at.

    Parameters
    ----------
    given
        What the TOML says.
    folder
        Where paths are sought from.

    Returns
    -------
    Case
        The settings.

    Raises
    ------
    ValueError
        If a key is unknown, missing, or holds a wrong value; the message names it.
    """
    readers: dict[str, Reader] = {
        "mesh": TEXT,
        "scale": NUMBER,
        "materials": table_of(material_in(folder)),
        **PROBLEM,
        "adapt": lambda value, place: read_table(value, ADAPT, place),
        "outputs": table_of(quantity),
    }
    values = read_table(given, readers, "", required=("mesh", "materials"))
    problem = Magnetostatics(values["materials"], **{key: values[key] for key in PROBLEM if key in values})
    return Case(
        folder / values["mesh"], values.get("scale", 1.0), problem, values.get("adapt", {}), values.get("outputs", {})
    )
