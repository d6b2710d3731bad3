"""Compare meshes adapted for a goal by the map alone with those polished for it."""

from collections.abc import Sequence

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.patch_mean import PatchMean, PolishedPatchMean, patched_mesh
from benchmarks.table import aligned

TARGET = 0.75  # of the map's product of both errors
SQUARES = (8, 16, 32)  # per unit: 225, 833 and 3201 nodes


def report(seeds: Sequence[int], quick: bool) -> str:
    """Medians of the product of the errors of solution and dual, and of the goal's, by map alone and polished."""
    header = [
        "goals",
        "N",
        "|e| |d| by map",
        "polished",
        "ratio",
        "target",
        "",
        "|J - J_h| by map",
        "polished",
        "ratio",
    ]
    return aligned(header, [_row(n, seeds) for n in (SQUARES[:1] if quick else SQUARES)])


def _row(n: int, seeds: Sequence[int]) -> list[str | int | float]:
    mesh = patched_mesh(n)
    (product, goal), (polished, polished_goal) = (
        np.median([problem.errors(ka.adapt(mesh, problem, seed=seed).mesh) for seed in seeds], axis=0)
        for problem in (PatchMean(), PolishedPatchMean())
    )
    ratio = polished / product
    verdict = "met" if ratio <= TARGET else "missed"
    figures = [product, polished, ratio, TARGET, verdict, goal, polished_goal, polished_goal / goal]
    return ["F, mean over a patch", mesh.p.shape[1], *figures]
