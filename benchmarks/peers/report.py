"""Print the comparison of one case as a table: a row per method, medians over the seeds."""

from collections.abc import Sequence

import numpy as np

import kohonen_adapt as ka
from benchmarks.peers import compare
from benchmarks.peers.compare import Outcome
from benchmarks.problems.cases import Case
from benchmarks.problems.variants import Variant
from benchmarks.table import Cell, aligned


def comparison(case: Case, seeds: Sequence[int]) -> str:
    """Run every method on the case and return the table."""
    ka.warmup()
    start = compare.uniform(case)
    nodes = start.mesh.p.shape[1]
    refined = compare.refinement(case, nodes)
    rows = [_row("uniform", case, [start], start), _row(f"refined {_indicators(case)}", case, [refined], start)]
    notes = []
    for variant in case.variants:
        outcomes = [compare.adapted(case, variant, seed) for seed in seeds]
        rows.append(_row(variant.title, case, outcomes, start, variant))
        notes += _note(case, variant, outcomes)
    header = ["", "N", "T", *start.figures, "ratio", "worst", "target", "", "min q", "mean q"]
    header += [f"{step} s" for step in compare.STEPS]
    return "\n".join([case.title, aligned(header, rows), *notes])


def _row(name: str, case: Case, outcomes: list[Outcome], start: Outcome, variant: Variant | None = None) -> list[Cell]:
    """N, T, figures, ratio to the uniform mesh, worst seed, target and whether met, qualities, seconds by step."""
    error = next(iter(start.figures))
    target = case.targets.get(variant.key) if variant else None
    judged = [outcome.figures[case.judged] for outcome in outcomes]
    qualities = [ka.quality(outcome.mesh) for outcome in outcomes]
    return [
        name,
        int(_median([outcome.mesh.p.shape[1] for outcome in outcomes])),
        int(_median([outcome.mesh.t.shape[1] for outcome in outcomes])),
        *(_median([outcome.figures[figure] for outcome in outcomes]) for figure in start.figures),
        _median([outcome.figures[error] for outcome in outcomes]) / start.figures[error],
        max(judged) if variant else None,
        target,
        compare.verdict(target, judged),
        min(float(values.min()) for values in qualities),
        _median([float(values.mean()) for values in qualities]),
        *(f"{_median([outcome.seconds[step] for outcome in outcomes]):.4f}" for step in compare.STEPS),
    ]


def _note(case: Case, variant: Variant, outcomes: list[Outcome]) -> list[str]:
    """Say so where the returned mesh, the best by its estimate, is not that of the last pass."""
    earlier = sum(outcome.last is not None for outcome in outcomes)
    if not earlier:
        return []
    last = [(outcome.last or outcome.figures)[case.judged] for outcome in outcomes]
    note = (
        f"  {variant.title}: {earlier} of {len(outcomes)} seeds returned an earlier pass than the last; "
        f"{case.judged} of the last pass {_median(last):#.4g}, worst {max(last):#.4g}"
    )
    return [" ".join((note, compare.verdict(case.targets.get(variant.key), last))).rstrip()]


def _indicators(case: Case) -> str:
    return "(squared)" if case.squared else "(unsquared)"


def _median(values: Sequence[float]) -> float:
    return float(np.median(values))
