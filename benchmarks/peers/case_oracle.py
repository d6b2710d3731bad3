"""Comparison of a case with NGSolve, or with values of another program."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.peers.ngsolve_field import NgsolveField
from benchmarks.table import Cell, markdown
from kohonen_adapt.cases import Case, fitting_mesh, read_case
from kohonen_adapt.checks import is_number, listed, nearest_name
from kohonen_adapt.magnetostatics import (
    FluxDensityAt,
    FluxLinkage,
    Force,
    Goal,
    Magnetostatics,
    StoredEnergy,
    Torque,
)
from kohonen_adapt.mesh.curved import refined

LEAST_ORDER = 3
OR_VALUES = "or compare with values of another program by --values FILE"
ENERGY, GOAL = "energy", "goal"


@dataclass(frozen=True)
class Row:
    """An output by this package, and its estimated error, None if unknown."""

    label: str
    value: float
    error: float | None


def report(path: Path, fine: int, values: Path | None) -> str:
    """Solve a case by `adapt`, and show its outputs beside reference values.

    The reference is NGSolve on the final mesh, refined `fine` times, in elements of one order more, or a TOML file with
    values by output.

    Raises
    ------
    ValueError
        If the case is invalid or NGSolve's field does not offer it, or for values that the case has no output for.
    OSError
        If a file cannot be read.
    """
    case = read_case(path)
    mesh = fitting_mesh(case)
    given = None if values is None else read_values(values, names_of(case))
    if given is None:
        check_ngsolve()
        check_case(case)
    result = ka.adapt(mesh, case.problem, outputs=case.labelled_outputs or None, **case.options(mesh))
    rows = own_rows(case, result)
    if given is not None:
        return f"{result.message}\n{against_values(rows, given, str(values))}"
    return f"{result.message}\n{against_ngsolve(case, result, rows, fine)}"


def names_of(case: Case) -> list[str]:
    """Return the names of values that a case has, in the order of the rows."""
    energy, goal = [] if ENERGY in case.outputs else [ENERGY], [] if case.goal is None else [GOAL]
    return [*energy, *goal, *case.outputs]


def read_values(path: Path, names: list[str]) -> dict[str, float]:
    """Read values from a TOML file of lines ``name = value``."""
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path}: is not TOML: {error}. Write one line for each output, as pull = -133.0.") from None
    for name, value in given.items():
        if name not in names:
            raise ValueError(
                f"{path}: the case has no output {name!r}; it has {listed(names)}.{nearest_name(name, names)}"
            )
        if not is_number(value) or not np.isfinite(value):
            raise ValueError(f"{path}: {name} must be a finite number; got {value!r}.")
    if not given:
        raise ValueError(f"{path}: there are no values. Write one line for each output, as pull = -133.0.")
    return {name: float(value) for name, value in given.items()}


def check_ngsolve() -> None:
    """Raise ValueError if NGSolve cannot be imported."""
    try:
        import ngsolve  # noqa: F401
    except ImportError as error:
        raise ValueError(f"NGSolve cannot be imported ({error}); install the extra 'bench', {OR_VALUES}.") from None


def check_case(case: Case) -> None:
    """Raise ValueError for a case that `NgsolveField` does not solve."""
    if not isinstance(case.problem, Magnetostatics):
        raise ValueError(
            f"the oracle solves cases on triangles; the mesh is one of tetrahedra. Take another mesh, {OR_VALUES}."
        )
    if case.problem.points:
        raise ValueError(
            f"the oracle takes potentials on boundaries only; the case fixes A at points. Name a boundary, {OR_VALUES}."
        )


def own_rows(case: Case, result: ka.AdaptResult) -> list[Row]:
    """Return energy, goal and outputs of a result, in the order of `names_of`."""
    labels = {GOAL: GOAL, **dict(zip(case.outputs, case.labelled_outputs, strict=True))}
    rows = []
    for name in names_of(case):
        if name in labels:
            found = result.outputs[labels[name]]
            rows.append(Row(labels[name], found.value, found.error))
        else:
            rows.append(_energy_row(case, result))
    return rows


def _energy_row(case: Case, result: ka.AdaptResult) -> Row:
    # Of the functional half the square of the error in the energy norm is missing, of the energy about as much.
    depth = getattr(case.problem, "depth", None)
    calibrated = case.goal is None and case.adapt.get("norm", "energy") == "energy"
    missing = 0.5 * (depth or 1.0) * result.estimate**2 if calibrated else None
    return Row(f"{ENERGY} ({'J' if depth else case.energy_unit})", float(result.solution.energy), missing)


def against_values(rows: list[Row], given: Mapping[str, float], source: str) -> str:
    """Return the table of given values, by the first word of the labels."""
    header = ["output", "this package", "estimated error %", source, "difference %"]
    wanted = [(row, given[name]) for row in rows if (name := row.label.partition(" (")[0]) in given]
    return markdown(header, [[*own_cells(row), digits(value), difference(row.value, value)] for row, value in wanted])


def against_ngsolve(case: Case, result: ka.AdaptResult, rows: list[Row], fine: int) -> str:
    """Return the table of NGSolve's values, with their change from one order less."""
    mesh = result.mesh
    for _ in range(fine):
        mesh = refined(mesh)
    order = max(LEAST_ORDER, result.solution.order + 1)
    before, now = (ngsolve_values(case, mesh, each) for each in (order - 1, order))
    cells = [
        [*own_cells(row), digits(value), difference(row.value, value), difference(coarse, value)]
        for row, coarse, value in zip(rows, before, now, strict=True)
    ]
    header = ["output", "this package", "estimated error %", f"NGSolve, order {order}", "difference %"]
    return markdown([*header, f"change from order {order - 1} %"], cells)


def ngsolve_values(case: Case, mesh: MeshTri, order: int) -> list[float | None]:
    """Return energy, goal and outputs by NGSolve, in the order of `names_of`."""
    field = NgsolveField(mesh, case.problem, order)
    found = {ENERGY: field.energy, GOAL: None if case.goal is None else goal_value(field, case.goal)}
    found |= {name: float(each.function(field)) for name, each in case.outputs.items()}
    return [found[name] for name in names_of(case)]


def goal_value(field: NgsolveField, goal: Goal) -> float | None:
    """Return the value of a goal, None for means over spots and goals of users."""
    match goal:
        case Force():
            return float(np.dot(goal.direction, field.force(goal.body)))
        case Torque():
            return field.torque(goal.body, goal.centre)
        case FluxLinkage():
            return sum(field.flux_linkage(name, turns) for name, turns in goal.circuit.items())
        case StoredEnergy():
            return field.energy_in(goal.part)
        case FluxDensityAt(radius=None):
            return float(np.dot(goal.direction, field.flux_density_at(np.reshape(goal.x, (2, 1)))[:, 0]))
    return None


def own_cells(row: Row) -> list[Cell]:
    return [row.label, digits(row.value), None if row.error is None else difference(row.value + row.error, row.value)]


def digits(value: float | None) -> str | None:
    return None if value is None else f"{value:.8g}"


def difference(value: float | None, reference: float | None) -> float | None:
    """Return the relative difference in per cent, None if a value is unknown or zero."""
    return None if value is None or not reference else 100 * abs(value / reference - 1)
