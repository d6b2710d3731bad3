"""Case read from TOML, and its mesh."""

import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
from skfem import Mesh, MeshTri

from kohonen_adapt.cases.case import Case
from kohonen_adapt.cases.drawing import mesh_in
from kohonen_adapt.cases.potentials import POTENTIAL, TabulatedPotential
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
from kohonen_adapt.cases.turning import turned_mesh
from kohonen_adapt.checks import listed, nearest_name
from kohonen_adapt.io import HEADER, MSH_VERSION, check_names_written
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential
from kohonen_adapt.mesh.adjacency import check_overlap
from kohonen_adapt.mesh.cells import TRIANGLE, cell_of
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.names import named_sets

__all__ = ["ADAPT", "PROBLEM", "case_of", "fitting_mesh", "read_case", "with_options"]

PROBLEM = kinds_of(
    Magnetostatics, {"potential": table_of(POTENTIAL), "periodic": PAIRS, "antiperiodic": PAIRS, "goal": goal}
)
PROBLEM["applied_field"], PROBLEM["order"] = VECTOR, ORDER
"""Keys of a case that are arguments of `Magnetostatics`, besides ``materials``."""

SPACE = kinds_of(
    MagneticScalarPotential,
    {"potential": table_of(POTENTIAL), "applied_field": VECTOR, "goal": goal, "coils": table_of(coil)},
)
"""Keys of a case that are arguments of `MagneticScalarPotential`."""

ADAPT = kinds_of(adapt, {"curves": table_of(shape), "periodic": PAIRS, "schedule": schedule})
del ADAPT["checkpoint"]
"""Keys under ``adapt``: arguments of `kohonen_adapt.adapt`."""

LARGEST = 10**6  # bytes, because the parser is slow and needs much more memory than the file


def read_case(path: Path, options: Mapping[str, Any] | None = None) -> Case:
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


def with_options(given: Mapping[str, Any], options: Mapping[str, Any]) -> Mapping[str, Any]:
    before = given.get("adapt", {})
    return {**given, "adapt": {**before, **options}} if options and isinstance(before, Mapping) else given


def _remedy(path: Path) -> str:
    if path.suffix.lower() in (*MSH_VERSION, ".vtu"):
        return f"This is a mesh; create a case for it: kohonen-adapt init {path}."
    return "Text needs quotes (single quotes if it has a backslash); numbers need a decimal point, not a comma."


def case_of(given: Mapping[str, Any], folder: Path) -> Case:
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
        "turn": table_of(NUMBER),
        "rim": TEXT,
        "bracket": FLAG,
    }
    try:
        values = read_table(given, readers, "", required=("mesh", "materials"))
    except UnknownKeyError as error:
        raise ValueError(f"{error}{_table_hint(error.key, readers)}") from None
    problem = _problem(values)
    options, outputs, turn = (values.get(key, {}) for key in ("adapt", "outputs", "turn"))
    _check_outputs(options.get("output_rtol"), outputs, problem)
    return Case(
        values["mesh"],
        values.get("scale", 1.0),
        problem,
        options,
        outputs,
        turn,
        values.get("rim", ""),
        values.get("bracket", False),
    )


def _check_outputs(output_rtol: Any, outputs: Mapping[str, Any], problem: Any) -> None:
    for name in output_rtol if isinstance(output_rtol, Mapping) else ():
        if name not in outputs:
            raise ValueError(
                f"adapt.output_rtol.{name}: the case has no such output; outputs are {listed(outputs)}."
                f"{nearest_name(name, outputs)}"
            )
    if problem.goal is not None and "goal" in outputs:
        raise ValueError("outputs.goal: the goal of the case is shown under this name; rename the output.")


def _problem(values: Mapping[str, Any]) -> Magnetostatics | MagneticScalarPotential:
    # Cases that are valid in both dimensions are stated in the plane; `Case.problem` converts them for tetrahedra.
    solid = _keys_of_space(values["materials"], values)
    if not solid:
        return Magnetostatics(values["materials"], **{key: values[key] for key in PROBLEM if key in values})
    flat = sorted(key for key in values if key in PROBLEM and key not in SPACE)
    if flat:
        raise ValueError(
            f"{', '.join(flat)}: for meshes of triangles only, but the case has {', '.join(solid)}, for tetrahedra."
            f"{_remedy_in_plane(solid)}"
        )
    return MagneticScalarPotential(
        values["materials"], **{key: values[key] for key in SPACE if key in values and key != "materials"}
    )


def _keys_of_space(materials: Mapping[str, Material], given: Mapping[str, Any]) -> list[str]:
    vectors = {
        f"materials.{name}.{kind}": getattr(material, kind)
        for name, material in materials.items()
        for kind in ("remanence", "coercivity")
    }
    vectors["applied_field"] = given.get("applied_field")
    found = [key for key, each in vectors.items() if isinstance(each, tuple) and len(each) == 3]
    found += ["goal"] if getattr(given.get("goal"), "dimension", 2) == 3 else []
    found = [f"{key} of three components" for key in found]
    found += ["the estimator 'bracket'"] if given.get("estimator") == "bracket" else []
    return found + [key for key in ("symmetry", "coils") if key in given]


def _remedy_in_plane(keys: list[str]) -> str:
    if "coils" in keys:
        return (
            " A coil in the plane is a subdomain with ampere_turns; in space ampere_turns is a key of [coils.NAME], "
            "and the coil has no subdomain."
        )
    return " Vectors in the plane have two components, [x, y]."


def _table_hint(key: str, top: Mapping[str, Reader]) -> str:
    # In TOML, keys after a [table] belong to this table.
    if key in top:
        return f" But {key} is a key of the case itself: write it above all tables."
    home = "adapt" if key in ADAPT else "materials.NAME" if key in signature(Material).parameters else ""
    return f" But {key} is a key of [{home}]." if home else ""


def fitting_mesh(case: Case) -> MeshTri:
    """Read the mesh of a case, and run the checks of `adapt` without solving.

    Parameters
    ----------
    case
        The settings.

    Returns
    -------
    MeshTri
        The mesh in metres.

    Raises
    ------
    ValueError
        If the file is missing or damaged, names of the case are not in the mesh, an element has no material or two,
        conditions contradict one another, or an option, the goal or an output does not fit the mesh.
    OSError
        If the file cannot be read.
    """
    _check_file(case.mesh_file)
    with locate_errors("mesh"):
        drawn = case.drawn
        check_names_written(drawn)  # the results have the names of the mesh
        _ = case.groups  # read now, because the results need the groups after a long run
    _check_dimension(case.base_problem, drawn)
    if case.bracket and cell_of(drawn) is TRIANGLE:
        raise ValueError("bracket: for meshes of tetrahedra only, but the mesh is one of triangles. Remove the key.")
    mesh = turned_mesh(drawn, case.turn)
    if len(case.pins(mesh)) < len(case.pins(drawn)):
        raise ValueError("turn must not move groups of points; the mesh file has some in a turned subdomain.")
    with locate_errors("mesh"):
        check_overlap(mesh)  # before the check of the problem, whose message would concern the potential
    _check_names(case, mesh)
    case.problem.check(corners_of(mesh))  # curved sides may invert elements, which `adapt` repairs
    if case.bracket and isinstance(case.problem, MagneticScalarPotential):
        with locate_errors("bracket"):
            case.problem.vector_potential.check(mesh)
    blank = _zero_field(case.problem, mesh)
    if case.goal is not None:
        if case.adapt.get("rtol") is not None:
            raise ValueError(
                "adapt.rtol is relative to the energy norm, which does not measure a goal; give goal_rtol, the allowed "
                "error of the goal as a fraction of its value, instead."
            )
        with locate_errors("goal"):
            case.goal.derivative(blank)
    for name, each in case.outputs.items():
        with locate_errors(f"outputs.{name}"):
            each(blank)
    with locate_errors("adapt"), suppress(_ChecksDone):
        adapt(mesh, _CheckOnly(case.problem), outputs=case.labelled_outputs, **case.options(mesh))
    return mesh


def _check_file(path: Path) -> None:
    if path.is_file() or (path / HEADER).is_file():
        return
    beside = [file.name for file in path.parent.iterdir()] if path.parent.is_dir() else []
    near = nearest_name(path.name, beside)
    raise ValueError(f"mesh must be the path of a mesh file, relative to the case; there is no file '{path}'.{near}")


def _check_dimension(problem: Magnetostatics | MagneticScalarPotential, mesh: Mesh) -> None:
    if isinstance(problem, MagneticScalarPotential) and cell_of(mesh) is TRIANGLE:
        keys = _keys_of_space(problem.materials, {key: value for key, value in vars(problem).items() if value})
        raise ValueError(
            f"the mesh is one of triangles, but the case has {', '.join(keys) or 'symmetry'}, for tetrahedra."
            f"{_remedy_in_plane(keys)}"
        )


def _check_names(case: Case, mesh: MeshTri) -> None:
    problem = case.problem
    points = problem.boundaries.points if isinstance(problem, Magnetostatics) else {}
    given = problem.potential or {}
    if not named_sets(mesh.boundaries) and given.keys() - points.keys():
        raise ValueError(
            "potential must name a boundary, but no boundary of the mesh file has a name: write "
            'rim = "outer" above all tables to name the whole rim, or give its lines a physical group.'
        )
    for value in given.values():
        if isinstance(value, TabulatedPotential):
            value.check(mesh)


def _zero_field(problem: Magnetostatics | MagneticScalarPotential, mesh: MeshTri) -> Field | SolidField:
    if isinstance(problem, MagneticScalarPotential):
        return problem.functional_on(mesh)[1]
    given = coefficients(mesh, problem.materials, problem.ampere_turns)
    symmetry = AXISYMMETRIC if problem.axisymmetric else PLANAR
    return Field(mesh, np.zeros(mesh.nvertices), given, symmetry, problem.depth)


class _ChecksDone(Exception):
    """Exception that ends `adapt` at its first solve, after all checks."""


class _CheckOnly:
    def __init__(self, problem: Magnetostatics | MagneticScalarPotential) -> None:
        self._problem = problem

    def __getattr__(self, name: str) -> Any:
        return getattr(self._problem, name)

    def solve(self, mesh: MeshTri, *, order: int | None = None) -> Any:
        raise _ChecksDone

    def indicators(self, mesh: MeshTri, solution: Any) -> Any:
        raise _ChecksDone
