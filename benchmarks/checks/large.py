"""Time the solution of large linear problems by the direct solver and by multigrid."""

import sys
import time
from collections.abc import Sequence
from unittest.mock import patch

import numpy as np
from skfem import MeshTri

from benchmarks.checks.round import PROBLEM
from benchmarks.problems.square_magnet import magnet_mesh
from benchmarks.table import aligned


def report(seeds: Sequence[int], quick: bool) -> str:
    """One run each, on square grids of more unknowns than the direct solver is taken for where pyamg is installed."""
    rows = [_row(_mesh(n)) for n in ((560,) if quick else (640, 900))]
    return aligned(["large: M over iron, nodes", "direct, s", "multigrid, s", "difference"], rows)


def _mesh(n: int) -> MeshTri:
    mesh = magnet_mesh(n, iron=True)
    rest = np.setdiff1d(np.arange(mesh.t.shape[1]), np.concatenate(list(mesh.subdomains.values())))
    everywhere = mesh.with_boundaries({"outer": lambda x: np.ones(x.shape[1], dtype=bool)}, boundaries_only=True)
    return everywhere.with_subdomains({"air": rest})


def _row(mesh: MeshTri) -> list[str | float]:
    with patch.dict(sys.modules, {"pyamg": None}):  # as where it is not installed
        slow, direct = _timed(mesh)
    fast, iterated = _timed(mesh)
    return [str(direct.size), slow, fast, f"{np.max(np.abs(iterated - direct)) / np.max(np.abs(direct)):.0e}"]


def _timed(mesh: MeshTri) -> tuple[float, np.ndarray]:
    """Seconds from the mesh to the potential, and that."""
    start = time.perf_counter()
    potential = PROBLEM.solve(mesh).potential
    return time.perf_counter() - start, potential
