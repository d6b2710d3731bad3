"""Cost of a relocation beside one round of assembly, solve and indicators as scikit-fem users write it."""

import time
from collections.abc import Sequence

import numpy as np

import kohonen_adapt as ka
from benchmarks.l_shape import LShape, l_shaped_mesh
from benchmarks.reference_round import seconds_per_round
from benchmarks.table import aligned

PASSES = 3
TARGET = 2.5  # relocations per reference round, at N = 12 545


def report(seeds: Sequence[int], quick: bool) -> str:
    """Table of alternating runs, one per seed, and the ratio of their medians."""
    start = l_shaped_mesh(16 if quick else 64)
    ka.warmup()
    seconds_per_round(start)  # first calls of scikit-fem import and cache things
    runs = [(seconds_per_round(start), _relocations(start, seed)) for seed in seeds]
    reference, relocation = (
        float(np.median(column)) for column in zip(*((a, np.mean(b)) for a, b in runs), strict=True)
    )
    header = ["seed", "round s", *(f"pass {number + 1} s" for number in range(PASSES)), "mean s", "ratio"]
    rows = [
        [str(seed), a, *b, float(np.mean(b)), float(np.mean(b)) / a] for seed, (a, b) in zip(seeds, runs, strict=True)
    ]
    ratio = relocation / reference
    verdict = "met" if ratio <= TARGET else "missed"
    return "\n".join(
        [
            f"speed: density and relocation of L at N = {start.p.shape[1]}, mean over {PASSES} passes",
            aligned(header, rows),
            f"medians: {relocation:.4f} s / {reference:.4f} s = {ratio:.2f} rounds (target {TARGET}: {verdict}); "
            f"{1e6 * relocation / start.p.shape[1]:.1f} microseconds per node",
        ]
    )


def _relocations(mesh, seed: int) -> list[float]:
    problem, seconds = LShape(), []
    for number in range(PASSES):
        indicators = problem.indicators(mesh, problem.solve(mesh))
        start = time.perf_counter()
        mesh = ka.relocate(mesh, ka.density_from_indicators(mesh, indicators), seed=seed * PASSES + number)
        seconds.append(time.perf_counter() - start)
    return seconds
