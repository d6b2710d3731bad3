"""Time elements of order 2 in space: solvers of their equations, and graded meshes against polished ones of order 1."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import diags_array
from scipy.sparse.linalg import cg
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.magnets_in_space import blocks, graded
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material

FAR = 0.06  # in m
REFERENCE = 12_000  # nodes
TOLERANCE = 1e-10  # residual, relative to the right-hand side, as in the solver
PLACES = {"a": ((-0.010, -0.010, -0.005), (0.010, 0.010, 0.005)), "b": ((-0.006, -0.010, 0.010), (0.014, 0.010, 0.020))}
MARKS = ([-0.010, -0.006, 0.010, 0.014], [-0.010, 0.010], [-0.005, 0.005, 0.010, 0.020])
POLES = {"a": Material(remanence=(0.0, 0.0, 1.2)), "b": Material(remanence=(0.0, 0.5, 1.0)), "air": Material()}
QUADRATIC = MagneticScalarPotential(POLES, {"outer": 0.0}, order=2)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Conjugate gradients on graded grids; then error and seconds of adapted meshes, start and compilation left out."""
    solvers = [row for step in ((0.004,) if quick else (0.004, 0.0015)) for row in solved(step)]
    tables = [markdown(["preconditioner", "unknowns", "seconds"], solvers)]
    header = ["adapted", "nodes", "unknowns", "error %", "estimate %", "seconds"]
    return "\n\n".join([*tables, markdown(header, adapted(quick))])


def cuboids(step: float) -> MeshTet:
    return blocks([graded(each, step, FAR, max(2, round(0.011 / step))) for each in MARKS], PLACES)


def solved(step: float) -> list[list[Cell]]:
    energy, field = QUADRATIC.functional_on(cuboids(step))
    hessian, right = energy.hessian(field.unknown), -energy.gradient(field.unknown)
    matrix, solver = hessian.matrix, QUADRATIC.method.solver
    inverse = diags_array(1.0 / matrix.diagonal())
    ways: dict[str, Callable[[], Any]] = {
        "diagonal": lambda: cg(matrix, right, rtol=TOLERANCE, M=inverse),
        "aggregation of all unknowns": lambda: solver.by_multigrid(matrix, right),
        "two levels": lambda: solver.by_multigrid(matrix, right, hessian.prolongation),
    }
    return [[name, str(right.size), seconds_of(solve)] for name, solve in ways.items()]


def seconds_of(solve: Callable[[], Any]) -> float:
    start = time.process_time()
    solve()
    return time.process_time() - start


def adapted(quick: bool) -> list[list[Cell]]:
    """Rows of both orders; the error is that of the energy norm, by the functional, relative to the norm."""
    mesh, rows = cuboids(0.006), list[list[Cell]]()
    sizes = {1: (3000, 10_000) if quick else (3000, 10_000, 30_000), 2: (1500, 3000) if quick else (1500, 3000, 6000)}
    reference, norm = _reference(mesh)
    for order, polish in ((1, True), (2, False), (2, True)):
        name = f"order {order}, {'polished' if polish else 'graded'}"
        problem = replace(QUADRATIC, order=order)
        ka.adapt(mesh, problem, passes=1, polish=polish)  # compiles
        for nodes in sizes[order]:
            start = time.process_time()
            result = ka.adapt(mesh, problem, passes=4, target_nodes=nodes, polish=polish)
            seconds = time.process_time() - start
            missing = np.sqrt(2.0 * max(0.0, _value(problem, result) - reference))
            found = result.mesh.nvertices, result.best.unknowns
            relative = 100.0 * missing / norm, 100.0 * result.estimate / norm
            rows.append([name, *(str(count) for count in found), *relative, seconds])
    return rows


def _value(problem: Any, result: Any) -> float:
    energy, _ = problem.functional_on(result.mesh)
    return float(energy.value(result.solution.unknown)[0])


def _reference(mesh: MeshTet) -> tuple[float, float]:
    """The functional, and the energy norm, extrapolated from graded meshes: the squared error falls by N^(-4/3)."""
    sizes = REFERENCE // 2, REFERENCE
    coarse, fine = (ka.adapt(mesh, QUADRATIC, passes=5, target_nodes=nodes, polish=False) for nodes in sizes)
    ratio = (coarse.best.unknowns / fine.best.unknowns) ** (4.0 / 3.0)
    high, low = _value(QUADRATIC, coarse), _value(QUADRATIC, fine)
    norm = fine.best.energy_norm
    assert norm is not None
    return low - (high - low) * ratio / (1.0 - ratio), norm
