"""Compare goals by elements of order 1, 2 and 3: their errors at equal unknowns, and the time they take."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import spot, undulator
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import Magnetostatics

PASSES = 4


@dataclass(frozen=True)
class Case:
    """A start mesh, a problem with a goal, and the goal's exact value."""

    name: str
    mesh: MeshTri
    problem: Magnetostatics
    exact: float


def report(seeds: Sequence[int], quick: bool) -> str:
    """Medians over the seeds of the goal's error in %, adapted for the energy and for the goal, and of what is told."""
    ka.warmup()
    header = ["goals by order", "order", "N", "unknowns", "uniform %", "for the energy", "for the goal"]
    header += ["goal_error / error", "s"]
    pairs = [(1, 2), (2, 1)] if quick else [(1, 2), (1, 4), (2, 1), (2, 2), (3, 1)]
    rows = [_row(case, order, seeds) for order, fineness in pairs for case in cases(fineness)]
    return markdown(header, sorted(rows, key=lambda row: str(row[0])))


def cases(fineness: int) -> list[Case]:
    """The force between the arrays of an undulator, and B in a spot of air beside a magnet over iron."""
    model, mesh = undulator.Undulator(1), undulator.Undulator(1).start(0.0)
    force = replace(model.problem(0.0), goal=model.goal)
    finer = mesh.refined(fineness.bit_length() - 1)
    return [
        Case("undulator, force", finer, force, -undulator.attraction()),
        Case("M, B in a spot", spot.spot_mesh(20 * fineness), spot.PROBLEM, spot.GOAL),
    ]


def _row(case: Case, order: int, seeds: Sequence[int]) -> list[Cell]:
    problem, goal = replace(case.problem, order=order), case.problem.goal
    uniform = goal(problem.solve(case.mesh))
    by_energy = [ka.adapt(case.mesh, replace(problem, goal=None), passes=PASSES, seed=seed) for seed in seeds]
    began = time.process_time()
    by_goal = [ka.adapt(case.mesh, problem, passes=PASSES, seed=seed) for seed in seeds]
    seconds = (time.process_time() - began) / len(by_goal)
    told = [problem.goal_error(each.solution) / (case.exact - goal(each.solution)) for each in by_goal]
    values = [uniform, *(np.array([goal(each.solution) for each in found]) for found in (by_energy, by_goal))]
    errors = [100.0 * float(np.median(np.abs(each / case.exact - 1.0))) for each in values]
    unknowns = by_goal[0].solution.unknown.size
    return [case.name, order, case.mesh.p.shape[1], unknowns, *errors, float(np.median(told)), seconds]
