"""Large linear problems: seconds of the direct solver and of multigrid for one system of equations."""

import time
from collections.abc import Callable, Sequence

import numpy as np
from skfem import MeshTri

from benchmarks.checks.round import PROBLEM
from benchmarks.problems.square_magnet import magnet_mesh
from benchmarks.table import aligned
from kohonen_adapt.magnetostatics.equations import multigrid
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, conditions_of
from kohonen_adapt.magnetostatics.equations.symmetry import PLANAR
from kohonen_adapt.magnetostatics.equations.system import equations, factorised, scalar_of
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients


def report(seeds: Sequence[int], quick: bool) -> str:
    """One run each, on square grids: both solvers of the same equations, and the largest difference."""
    rows = [_row(_mesh(n)) for n in ((160,) if quick else (320, 640, 900))]
    return aligned(["large: M over iron, unknowns", "direct, s", "multigrid, s", "difference"], rows)


def _mesh(n: int) -> MeshTri:
    mesh = magnet_mesh(n, iron=True)
    rest = np.setdiff1d(np.arange(mesh.t.shape[1]), np.concatenate(list(mesh.subdomains.values())))
    everywhere = mesh.with_boundaries({"outer": lambda x: np.ones(x.shape[1], dtype=bool)}, boundaries_only=True)
    return everywhere.with_subdomains({"air": rest})


def _row(mesh: MeshTri) -> list[str | int | float | None]:
    conditions = conditions_of(mesh, Boundaries({"outer": 0.0}), PLANAR)
    scalar = scalar_of(mesh, PLANAR, coefficients(mesh, PROBLEM.materials))
    matrix, right = equations(mesh, scalar, conditions.values, conditions.free)
    slow, direct = _timed(lambda: factorised(matrix).solve(right))
    limit, multigrid.LARGE = multigrid.LARGE, 0
    try:
        fast, iterated = _timed(lambda: multigrid.by_multigrid(matrix, right))
    finally:
        multigrid.LARGE = limit
    difference = None if iterated is None else f"{np.max(np.abs(iterated - direct)) / np.max(np.abs(direct)):.0e}"
    return [str(right.size), slow, fast, difference]


def _timed(run: Callable[[], np.ndarray]) -> tuple[float, np.ndarray]:
    start = time.perf_counter()
    result = run()
    return time.perf_counter() - start, result
