"""Case read from TOML."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any

from kohonen_adapt.cases.case import Case, error_in_plane, keys_of_space
from kohonen_adapt.cases.drawing import Drawing, mesh_in
from kohonen_adapt.cases.potentials import POTENTIAL
from kohonen_adapt.cases.readers import (
    FLAG,
    NUMBER,
    ORDER,
    TEXT,
    VECTOR,
    Reader,
    UnknownKeyError,
    kinds_of,
    locate_errors,
    read_table,
    table_of,
)
from kohonen_adapt.cases.tables import PAIRS, coil, goal, material_in, quantity, schedule, shape
from kohonen_adapt.cases.turning import turn
from kohonen_adapt.checks import listed, nearest_name
from kohonen_adapt.io import MSH_VERSION
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential

__all__ = ["ADAPT", "PROBLEM", "case_of", "read_case", "with_options"]

PROBLEM = kinds_of(
    Magnetostatics, {"potential": table_of(POTENTIAL), "periodic": PAIRS, "antiperiodic": PAIRS, "goal": goal}
)
PROBLEM["applied_field"], PROBLEM["order"] = VECTOR, ORDER
"""Keys of a case that are arguments of `Magnetostatics`, besides ``materials``."""

SPACE = kinds_of(
    MagneticScalarPotential,
    {"potential": table_of(POTENTIAL), "applied_field": VECTOR, "goal": goal, "coils": table_of(coil)},
)
SPACE["order"] = ORDER
"""Keys of a case that are arguments of `MagneticScalarPotential`."""

ADAPT = kinds_of(adapt, {"curves": table_of(shape), "periodic": PAIRS, "schedule": schedule})
del ADAPT["checkpoint"]
"""Keys under ``adapt``: arguments of `kohonen_adapt.adapt`."""

LARGEST = 10**6  # bytes, because the parser is slow and needs much more memory than the file


Options = Mapping[str, Any]
"""Keys and values of a table."""


def read_case(path: Path, options: Options | None = None) -> Case:
    """Read a case from a TOML file.

    Parameters
    ----------
    path
        The file; paths in it are relative to its folder.
    options
        Keys of ``adapt`` that replace those of the file.

    Returns
    -------
    Case
        The settings.

    Raises
    ------
    ValueError
        If the file is not TOML, or not a case; the message names the file and the key.
    OSError
        If the file cannot be read.
    """
    if not path.is_file():
        raise FileNotFoundError(f"run expected a case; there is no file '{path}'. Create one: kohonen-adapt init MESH.")
    size = path.stat().st_size
    if size > LARGEST:
        raise ValueError(f"{path}: a case has at most {LARGEST} bytes; this has {size}.")
    content = path.read_bytes()
    try:
        text = content.decode("utf-8")
        given = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: is not TOML: {error}. {_remedy(path)}") from None
    with locate_errors(path):
        return replace(case_of(with_options(given, options or {}), path.parent), file=path.name, text=text)


def with_options(given: Options, options: Options) -> Options:
    before = given.get("adapt", {})
    return {**given, "adapt": {**before, **options}} if options and isinstance(before, Mapping) else given


def _remedy(path: Path) -> str:
    if path.suffix.lower() in (*MSH_VERSION, ".vtu"):
        return f"This is a mesh; create a case for it: kohonen-adapt init {path}."
    return "Text needs quotes (single quotes if it has a backslash); numbers need a decimal point, not a comma."


def case_of(given: Options, folder: Path) -> Case:
    """Return the settings in a table of keys, without reading the mesh file.

    Parameters
    ----------
    given
        The content of the TOML file.
    folder
        Folder of relative paths.

    Returns
    -------
    Case
        The settings.

    Raises
    ------
    ValueError
        If a key is unknown, missing, or has a wrong value; the message names the key.
    """
    readers: dict[str, Reader] = {
        "mesh": mesh_in(folder),
        "scale": NUMBER,
        "materials": table_of(material_in(folder)),
        **SPACE,
        **PROBLEM,
        "adapt": lambda value, location: read_table(value, ADAPT, location),
        "outputs": table_of(quantity),
        "turn": turn,
        "rim": TEXT,
        "bracket": FLAG,
        "trusted": FLAG,
    }
    try:
        values = read_table(given, readers, "", required=("mesh", "materials"))
    except UnknownKeyError as error:
        # In TOML, keys after a [table] belong to this table.
        key, hint = error.key, ""
        if key in readers:
            hint = f" But {key} is a key of the case itself: write it above all tables."
        elif key in ADAPT or key in signature(Material).parameters:
            hint = f" But {key} is a key of [{'adapt' if key in ADAPT else 'materials.NAME'}]."
        raise ValueError(f"{error}{hint}") from None
    problem = _problem({key: values.pop(key) for key in ("materials", *(SPACE | PROBLEM)) if key in values})
    values = {"scale": 1.0, "adapt": {}, "outputs": {}, **values}
    outputs, output_rtol = values["outputs"], values["adapt"].get("output_rtol")
    for name in output_rtol if isinstance(output_rtol, Mapping) else ():
        if name not in outputs:
            raise ValueError(
                f"adapt.output_rtol.{name}: the case has no such output; outputs are {listed(outputs)}."
                f"{nearest_name(name, outputs)}"
            )
    if problem.goal is not None and "goal" in outputs:
        raise ValueError("outputs.goal: the goal of the case is shown under this name; rename the output.")
    if "trusted" in values:
        if not isinstance(values["mesh"], Drawing):
            raise ValueError('trusted is for a drawing, mesh = {drawing = "NAME.geo"}; a mesh file runs nothing.')
        values["mesh"] = replace(values["mesh"], trusted=values.pop("trusted"))
    return Case(base_problem=problem, **values)


def _problem(given: Options) -> Magnetostatics | MagneticScalarPotential:
    # Cases that are valid in both dimensions are stated in the plane; `Case.problem` converts them for tetrahedra.
    solid = keys_of_space(given)
    flat = sorted(key for key in given if key in PROBLEM and key not in SPACE)
    if solid and flat:
        raise error_in_plane(
            solid, f"{', '.join(flat)} {'is' if len(flat) == 1 else 'are'} for meshes of triangles only"
        )
    return (MagneticScalarPotential if solid else Magnetostatics)(**given)
