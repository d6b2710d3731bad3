"""Hold every estimate of the energy norm's error, and told errors of values, against the errors."""

import runpy
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import magnet_over_iron, square_magnet
from benchmarks.problems.c_core import EXAMPLES, c_core_mesh
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.problems.poisson_l import PoissonL
from benchmarks.table import Cell, markdown
from kohonen_adapt import estimators
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material
from kohonen_adapt.problem.uncertain import corrected, error_of

NAMES = ("residual", "recovery", "equilibrated")
SCALE = 1 / 3.6  # of the bare residual; see `kohonen_adapt.magnetostatics.estimation`
PASSES = 4
POINTS, ORDERS, REFERENCE = 24, (1, 2, 3, "auto"), 1e-4
WITHIN = (0.5, 5.0)  # told over true
SHIFTS = (0, 5, 10, 15, 20)  # steps of the magnet over iron
Outputs = Mapping[Any, Callable[[Any], float]]
AIR, IRON, STEEL = Material(), Material(1000.0), Material(bh=Froehlich(2000.0, 0.8))


@dataclass(frozen=True)
class Case:
    """A start mesh, the problem with an estimator of that name, and the error of a solution in the energy norm."""

    name: str
    start: Callable[[], MeshTri]
    problem: Callable[[str], Any]
    error: Callable[[MeshTri, Any], float]
    names: Sequence[str] = NAMES


class Estimated:
    """A problem of the comparisons with a constant source, and indicators by an estimator of the package."""

    def __init__(self, problem: Any, source: float, name: str) -> None:
        self.solve, self.ritz, self.energy_norm = problem.solve, problem.ritz, problem.energy_norm
        self.source, self.name = source, name

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """By the name, the residual scaled."""
        one = np.ones(mesh.t.shape[1])
        found = getattr(estimators, self.name)(mesh, solution, one, source=self.source * one)
        return found * (SCALE if self.name == "residual" else 1.0)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Estimate over error on the first mesh and on the mesh adapted by that estimate, then told over true of values."""
    rows = [_row(case, list(seeds)[: 1 if quick else None]) for case in cases()]
    header = [f"{name}, {when}" for name in NAMES for when in ("before", "after")]
    table = markdown(["effectivity (of the residual / 3.6)", "N", "error %", "after", *header], rows)
    orders = ORDERS[1:2] if quick else ORDERS
    columns = ["values, told over true: median, least to greatest", *(f"order {order}" for order in orders)]
    return f"{table}\n\n{markdown([*columns, 'outside 0.5 to 5', 'corrected is worse'], list(_rows_of_values(orders)))}"


def _rows_of_values(orders: Sequence[int | str]) -> Iterator[list[Cell]]:
    for name, mesh, problem in models():
        outputs = b_at_points(mesh)
        exact = reference(mesh, problem, outputs)
        yield summary(f"B at points, {name}", [told(mesh, problem, order, outputs, exact) for order in orders])
    forces = {axis: lambda field, axis=axis: float(field.force("magnet")[axis]) for axis in (0, 1)}
    devices = [over_iron(shift) for shift in SHIFTS]
    exact = [reference(*device, forces) for device in devices]
    found = [
        np.concatenate(
            [told(*device, order, forces, best) for device, best in zip(devices, exact, strict=True)], axis=1
        )
        for order in orders
    ]
    yield summary("forces, magnet over iron", found)


def models() -> list[tuple[str, MeshTri, Magnetostatics]]:
    """The devices at whose points B is held against the reference."""
    magnet, steel = Material(1.05, remanence=(0.0, 1.2)), Material(bh=Froehlich(2000.0, 1.9))
    plunger = {"core": steel, "plunger": steel, "coil": AIR, "air": AIR}
    core, outer = c_core_mesh("c_core.msh"), {"outer": 0.0}
    around = Magnetostatics(plunger, outer, ampere_turns={"coil": 1500.0}, axisymmetric=True)
    return [
        ("C", core, Magnetostatics({"iron": IRON, "magnet": magnet, "air": AIR}, outer)),
        ("C, saturated", core, Magnetostatics({"iron": STEEL, "magnet": magnet, "air": AIR}, outer)),
        ("plunger", ka.read_mesh(EXAMPLES / "actuator_1.msh", scale=1e-3), around),
        ("magnet over iron", *over_iron(6)),
    ]


def over_iron(shift: int) -> tuple[MeshTri, Magnetostatics]:
    return magnet_over_iron.gmsh_mesh(shift, 1.6e-3), replace(magnet_over_iron.PROBLEM, order="auto")


def b_at_points(mesh: MeshTri) -> dict[int, Callable[[Any], float]]:
    """|B| at random points of random elements of the first mesh, which are small near bodies."""
    rng = np.random.default_rng(5)
    element, share = rng.choice(mesh.t.shape[1], POINTS, replace=False), rng.dirichlet((2, 2, 2), POINTS).T
    x = np.einsum("in,cin->cn", share, mesh.p[:, mesh.t[:, element]])
    return {k: lambda field, k=k: float(np.hypot(*field.flux_density_at(x[:, k : k + 1]))[0]) for k in range(POINTS)}


def reference(mesh: MeshTri, problem: Magnetostatics, outputs: Outputs) -> dict[Any, float]:
    """Values by order 8 on layers, to 1e-4 in the energy norm, with the change by further orders."""
    result = ka.adapt(mesh, problem, rtol=REFERENCE)
    return {name: float(value) for name, value in problem.improved(result.mesh, result.solution, outputs).items()}


def told(mesh: MeshTri, problem: Magnetostatics, order: int | str, outputs: Outputs, exact: Any) -> np.ndarray:
    """Told over true, and what a correction leaves over true, (2, n), on meshes of two passes, or of rtol=0.002."""
    problem = replace(problem, order=order)
    tolerance = {"rtol": 0.002} if order == "auto" else {"passes": 2}
    result = ka.adapt(mesh, problem, **tolerance)
    field, columns = result.solution, []
    for name, better in problem.improved(result.mesh, field, outputs).items():
        value = outputs[name](field)
        error, true = error_of(value, better), exact[name] - value
        columns.append((abs(error / true), abs(corrected(value, error, error.doubt) - exact[name]) / abs(true)))
    return np.array(columns).T


def summary(name: str, found: Sequence[np.ndarray]) -> list[Cell]:
    """Median, least and greatest of told over true by order, and how many of all are outside and made worse."""
    cells = [f"{np.median(ratio):.2f}, {ratio.min():.2g} to {ratio.max():.2g}" for ratio, _ in found]
    ratio, left = np.concatenate(found, axis=1)
    outside, worse = np.sum((ratio < WITHIN[0]) | (ratio > WITHIN[1])), np.sum(left > 1.0)
    return [name, *cells, f"{outside} of {ratio.size}", int(worse)]


def effectivities(case: Case, name: str, seeds: Sequence[int]) -> tuple[float, float]:
    """Estimate over error of that estimator on the first mesh, and the median on those adapted by it."""
    problem, mesh = case.problem(name), case.start()
    before = float(np.linalg.norm(problem.indicators(mesh, problem.solve(mesh)))) / _error_before(case)
    after = [ka.adapt(mesh, problem, passes=PASSES, seed=seed) for seed in seeds]
    ratio = [result.estimate / case.error(result.mesh, result.solution) for result in after]
    return before, float(np.median(ratio))


@cache
def _error_before(case: Case) -> float:
    """That of the first mesh, which all estimators share."""
    mesh = case.start()
    return case.error(mesh, case.problem(NAMES[0]).solve(mesh))


def _row(case: Case, seeds: Sequence[int]) -> list[str | float | int | None]:
    mesh, problem = case.start(), case.problem(NAMES[0])
    results = [ka.adapt(mesh, problem, passes=passes, seed=seeds[0]) for passes in (0, PASSES)]
    errors = [
        100.0 * case.error(result.mesh, result.solution) / problem.energy_norm(result.mesh, result.solution)
        for result in results
    ]
    pairs = [effectivities(case, name, seeds) if name in case.names else (None, None) for name in NAMES]
    return [case.name, mesh.p.shape[1], *errors, *(ratio for pair in pairs for ratio in pair)]


def cases() -> list[Case]:
    """All that are compared."""
    laplace, poisson = LShape(), PoissonL()
    core = {"magnet": Material(1.05, remanence=(0.0, 1.2)), "air": AIR}
    motor = runpy.run_path(str(EXAMPLES / "motor.py"))
    pole = motor["sector"](motor["materials"]())
    return [
        Case("L", lambda: l_shaped_mesh(16), lambda name: Estimated(laplace, 0.0, name), laplace.error),
        Case("F", lambda: l_shaped_mesh(16), lambda name: Estimated(poisson, 1.0, name), poisson.error),
        *(_of_problem(f"M, mu_r = {1000 if iron else 1}", *_square(iron), NAMES) for iron in (False, True)),
        _magnetic("C", lambda: c_core_mesh("c_core.msh"), core | {"iron": IRON}),
        _magnetic("C, saturated", lambda: c_core_mesh("c_core.msh"), core | {"iron": STEEL}),
        _of_problem("motor", lambda: ka.read_mesh(EXAMPLES / "motor.msh", scale=1e-3), pole, NAMES[:2]),
    ]


def _square(iron: bool) -> tuple[Callable[[], MeshTri], Magnetostatics]:
    return lambda: square_magnet.named(square_magnet.magnet_mesh(40, iron)), square_magnet.MagnetOfOrder.of(1, iron)


def _magnetic(name: str, start: Callable[[], MeshTri], materials: dict[str, Material]) -> Case:
    return _of_problem(name, start, Magnetostatics(materials, {"outer": 0.0}, order=1), NAMES)


def _of_problem(name: str, start: Callable[[], MeshTri], problem: Magnetostatics, names: Sequence[str]) -> Case:
    """The error by co-energies: that of a Galerkin solution falls short by half the square of its error.

    In place of the exact one is that of P2 elements on the same mesh, refined once.
    """

    def error(mesh: MeshTri, field: Any) -> float:
        better = replace(problem, order=2).solve(mesh.refined())
        return float(np.sqrt(2.0 * (better.coenergy - field.coenergy)))

    return Case(name, start, lambda estimator: replace(problem, estimator=estimator), error, names)
