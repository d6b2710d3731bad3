"""Call `relocate` again and again, each time on a fresh estimate: eight calls must end no worse than four."""

from collections.abc import Sequence

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.cases import Case, cases
from benchmarks.table import aligned

CALLS = 8
HALF = 4
NOISE = 1.01  # medians of five seeds differ by this much between two sets of seeds


def report(seeds: Sequence[int], quick: bool) -> str:
    """Median of the judged figure after every call, for L and M."""
    chosen = [case for letter in "LM" for case in cases(letter, quick) if case.start().p.shape[1] < 5000]
    rows = []
    for case in chosen:
        medians = [float(value) for value in np.median([figures(case, seed) for seed in seeds], axis=0)]
        ratio = medians[CALLS] / medians[HALF]
        rows.append(
            [
                f"{case.title.split(';')[0]}: {case.judged}",
                *medians,
                ratio,
                NOISE,
                "met" if ratio <= NOISE else "missed",
            ]
        )
    header = ["drift: after call", *(str(call) for call in range(CALLS + 1)), f"{CALLS} over {HALF}", "limit", ""]
    return aligned(header, rows)


def figures(case: Case, seed: int) -> list[float]:
    """The judged figure of the start mesh and after every call."""
    mesh, values = case.start(), []
    for call in range(CALLS + 1):
        solution = case.problem.solve(mesh)
        values.append(case.figures(mesh, solution)[case.judged])
        if call < CALLS:
            density = ka.density_from_indicators(mesh, case.problem.indicators(mesh, solution))
            mesh = ka.relocate(mesh, density, seed=seed * CALLS + call)
    return values
