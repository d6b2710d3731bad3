"""Time elements of order 2 in space: solvers of their equations, and graded meshes against polished ones of order 1."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.checks.magnets import CUBOIDS, MARKS, PLACES
from benchmarks.problems.magnets_in_space import blocks, graded
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics.equations.system import TOLERANCE, aggregated, as_csr, two_level_cycle

FAR = 0.06  # in m
REFERENCE = 12_000  # nodes
QUADRATIC = replace(CUBOIDS, order=2)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Conjugate gradients on graded grids; then error and seconds of adapted meshes, start and compilation left out."""
    solvers = [row for step in ((0.004,) if quick else (0.004, 0.0015)) for row in solved(step)]
    tables = [aligned(["preconditioner", "unknowns", "steps", "seconds"], solvers)]
    header = ["adapted", "nodes", "unknowns", "error %", "estimate %", "seconds"]
    return "\n\n".join([*tables, aligned(header, adapted(quick))])


def cuboids(step: float) -> MeshTet:
    return blocks([graded(each, step, FAR, max(2, round(0.011 / step))) for each in MARKS], PLACES)


def solved(step: float) -> list[list[Cell]]:
    energy, field = QUADRATIC.functional_on(cuboids(step))
    hessian, right = energy.hessian(field.unknown), -energy.linear_residual(field.unknown)
    matrix, diagonal = as_csr(hessian.matrix), hessian.matrix.diagonal()
    assert hessian.prolongation is not None
    ways: dict[str, Callable[[], Any]] = {
        "diagonal": lambda: lambda residual: residual / diagonal,
        "aggregation of all unknowns": lambda: aggregated(matrix).aspreconditioner().matvec,
        "two levels": lambda: two_level_cycle(matrix, hessian.prolongation),
    }
    return [[name, str(right.size), *_conjugate_gradients(matrix, right, make)] for name, make in ways.items()]


def _conjugate_gradients(matrix: Any, right: np.ndarray, make: Callable[[], Any]) -> list[Cell]:
    start, steps = time.process_time(), list[int]()
    cycle = LinearOperator(matrix.shape, matvec=make(), dtype=np.float64)
    cg(matrix, right, rtol=TOLERANCE, maxiter=5000, M=cycle, callback=lambda x: steps.append(1))
    return [str(len(steps)), time.process_time() - start]


def adapted(quick: bool) -> list[list[Cell]]:
    """Rows of both orders; the error is that of the energy norm, by the functional, relative to the norm."""
    mesh, rows = cuboids(0.006), list[list[Cell]]()
    sizes = {1: (3000, 10_000) if quick else (3000, 10_000, 30_000), 2: (1500, 3000) if quick else (1500, 3000, 6000)}
    reference, norm = _reference(mesh)
    for order, polish in ((1, True), (2, False), (2, True)):
        name = f"order {order}, {'polished' if polish else 'graded'}"
        problem = replace(CUBOIDS, order=order)
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
