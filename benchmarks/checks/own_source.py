"""Measure what the polish takes off the error where the source varies inside regions."""

from collections.abc import Sequence

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.gaussian_sources import GaussianSources
from benchmarks.table import aligned

COUNT = 96
TARGET = 0.9  # of the error without a polish, at order 1
EXACT = 3  # order of the reference, on the mesh refined twice


def report(seeds: Sequence[int], quick: bool) -> str:
    """Ratios of errors in the H1 seminorm, polished to not, over random problems on uniform meshes."""
    rows = []
    for order in (1, 2, 3):
        ratios = np.array([_ratio(number, order) for number in range(8 if quick else COUNT)])
        verdict = "" if order > 1 else "met" if ratios.max() <= 1.0 and np.median(ratios) <= TARGET else "missed"
        figures = [f"{value:.3f}" for value in (ratios.mean(), np.median(ratios), ratios.max())]
        rows.append([str(order), str(len(ratios)), *figures, f"{TARGET}" if order == 1 else "", verdict])
    header = ["own source, order", "problems", "mean ratio", "median", "worst", "target", ""]
    return aligned(header, rows)


def _ratio(number: int, order: int) -> float:
    rng = np.random.default_rng(number)
    problem, side = GaussianSources.random(rng, order), np.linspace(0.0, 1.0, int(rng.integers(12, 24)))
    mesh = MeshTri.init_tensor(side, side)
    exact = problem.energy(mesh.refined(2), EXACT)
    return problem.error(ka.polish(mesh, problem), exact) / problem.error(mesh, exact)
