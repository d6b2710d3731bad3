"""A case, from TOML to checked settings: mesh file, problem, options of `adapt` and outputs."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from skfem import MeshTri

from kohonen_adapt.cases.kinds import Kind, about, checked, choice, flag, integer, number, pairs, pins, table_of, text
from kohonen_adapt.cases.materials import material_in
from kohonen_adapt.cases.quantities import Quantity, quantity
from kohonen_adapt.cases.shapes import shape
from kohonen_adapt.io import MSH_VERSION, Groups, read_groups, read_mesh
from kohonen_adapt.loop.growth import Growth
from kohonen_adapt.magnetostatics import Magnetostatics
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, conditions_of
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients
from kohonen_adapt.magnetostatics.quantities.bodies import elements_of
from kohonen_adapt.outline.rules import Limits
from kohonen_adapt.som.relocate import guarded_map

__all__ = ["Case", "case_of", "read_case"]

PROBLEM: dict[str, Kind] = {
    "potential": table_of(number()),
    "ampere_turns": table_of(number()),
    "depth": number(above=0.0),
    "axisymmetric": flag,
    "order": choice(1, 2),
    "estimator": choice("residual", "recovery", "equilibrated"),
    "open_boundary": text,
    "periodic": pairs,
    "antiperiodic": pairs,
}
"""Keys of a case that are arguments of `Magnetostatics`, besides ``materials``."""

ADAPT: dict[str, Kind] = {
    "passes": integer(),
    "rtol": number(least=0.0),
    "atol": number(least=0.0),
    "topology": choice("fixed", "flip", "recycle"),
    "min_quality": number(least=0.0, most=1.0),
    "pinned": pins,
    "seed": integer(),
    "polish": flag,
    "target_nodes": integer(least=1),
    "periodic": pairs,
    "curves": table_of(shape),
    "layers": table_of(integer(least=1)),
    "output_rtol": number(least=0.0),
}
"""Keys under ``adapt``: arguments of `kohonen_adapt.adapt`."""

LARGEST = 10**6  # bytes: the parser is slow, and takes much more memory than the file

LIMITS = ("topology", "min_quality", "pinned", "curves", "periodic", "layers")
"""Those of them that limit what nodes may do."""


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
        given = Boundaries(problem.potential or {}, problem.open_boundary, problem.periodic, problem.antiperiodic)
        with about("boundary conditions"):
            conditions_of(mesh, given, AXISYMMETRIC if problem.axisymmetric else PLANAR, problem.order)
        for name, each in self.outputs.items():
            with about(f"outputs.{name}"):
                for body in each.bodies:
                    elements_of(mesh, body)
        with about("adapt"):
            guarded_map(mesh, Limits(**{name: self.adapt[name] for name in LIMITS if name in self.adapt}))
            Growth.of(mesh, self.adapt.get("target_nodes"), self.adapt.get("passes", 1))
        return mesh


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
    """What to do about a file that is not TOML."""
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
    kinds: dict[str, Kind] = {
        "mesh": text,
        "scale": number(above=0.0),
        "materials": table_of(material_in(folder)),
        **PROBLEM,
        "adapt": lambda value, place: checked(value, ADAPT, place),
        "outputs": table_of(quantity),
    }
    values = checked(given, kinds, "", required=("mesh", "materials"))
    problem = Magnetostatics(values["materials"], **{key: values[key] for key in PROBLEM if key in values})
    adapt, outputs = values.get("adapt", {}), values.get("outputs", {})
    joined = [*problem.periodic, *problem.antiperiodic]
    if joined:
        adapt.setdefault("periodic", joined)  # what belongs together in the field must stay matched in the mesh
    if "output_rtol" in adapt and not outputs:
        raise ValueError("adapt.output_rtol limits the changes of outputs, and there are none; add [outputs.NAME].")
    return Case(folder / values["mesh"], values.get("scale", 1.0), problem, adapt, outputs)
