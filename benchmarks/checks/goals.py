"""Compare meshes adapted for a goal by the map alone with those polished for it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import spot
from benchmarks.problems.patch_mean import (
    PatchMean,
    PatchMeanOfOrder,
    PolishedPatchMean,
    PolishedPatchMeanOfOrder,
    patched_mesh,
)
from benchmarks.table import aligned

TARGET = 0.75  # of the map's product of both errors
SQUARES = (8, 16, 32)  # per unit: 225, 833 and 3201 nodes
Case = tuple[MeshTri, Any, Any, Callable[[MeshTri], tuple[float, float]]]


def report(seeds: Sequence[int], quick: bool) -> str:
    """Medians of the product of the errors of solution and dual, and of the goal's, by map alone and polished."""
    header = ["goals", "N", "|e| |d| by map", "polished", "ratio", "target", "", "of J by map", "polished", "ratio"]
    rows = [
        _row("F, mean over a patch", (patched_mesh(n), PatchMean(), PolishedPatchMean(), PatchMean().errors), seeds)
        for n in (SQUARES[:1] if quick else SQUARES)
    ]
    rows += [_row(f"the same, order {order}", _of_order(order, n), seeds) for order, n in _higher(quick)]
    spots = [spot.spot_mesh(n) for n in (() if quick else (20, 40))]
    rows += [_row("M, B in a spot", (mesh, spot.MAP_ONLY, spot.PROBLEM, spot.errors), seeds) for mesh in spots]
    return aligned(header, rows)


def _higher(quick: bool) -> tuple[tuple[int, int], ...]:
    """Orders, and squares per unit: of order 2 225, 833 and 3201 nodes, of order 3 225 and 833."""
    return ((2, 8),) if quick else ((2, 8), (2, 16), (2, 32), (3, 8), (3, 16))


def _of_order(order: int, n: int) -> Case:
    by_map = PatchMeanOfOrder(order)
    return patched_mesh(n), by_map, PolishedPatchMeanOfOrder(order), by_map.errors


def _row(name: str, case: Case, seeds: Sequence[int]) -> list[str | int | float]:
    mesh, by_map, polished, errors = case
    (product, goal), (better, better_goal) = (
        np.median([errors(ka.adapt(mesh, problem, seed=seed).mesh) for seed in seeds], axis=0)
        for problem in (by_map, polished)
    )
    ratio = better / product
    verdict = "met" if ratio <= TARGET else "missed"
    return [name, mesh.p.shape[1], product, better, ratio, TARGET, verdict, goal, better_goal, better_goal / goal]
