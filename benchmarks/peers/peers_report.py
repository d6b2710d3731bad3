"""Print the comparison with peers as README.md shows it: errors, seconds, qualities, names and numbers."""

from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.peers import methods
from benchmarks.peers.peers import OURS, Comparison, comparisons
from benchmarks.problems.variants import DEFAULT
from benchmarks.table import Cell, markdown

REFINEMENT, REMESHER = 0.75, 0.93  # targets of our error on C over that of refinement and of the better remesher
Method = methods.Refiner | methods.Remesher
PEERS = {method.name: method.numbering for method in (*methods.REFINERS, *methods.REMESHERS)} | {
    methods.POLISHED_GMSH: methods.GMSH.numbering
}
NUMBERING = PEERS | {variant.name: variant.numbering for variant in OURS}


def report(seeds: Sequence[int], quick: bool) -> str:
    """Run every method on every case; the tables, and which wheels are not there."""
    missing = sorted({remesher.missing for remesher in methods.REMESHERS} - {""})
    return "\n\n".join([tables(list(comparisons(seeds, quick))), *missing])


def tables(rows: list[Comparison]) -> str:
    """All tables, and what a peer does better."""
    columns = list(dict.fromkeys(name for row in rows for name in row.results))
    parts = [
        "Errors at equal N, in bold the best:",
        markdown(["", *columns], [[f"{row.label} ({row.figure})", *_errors(row, columns)] for row in rows]),
        _better(rows),
        "Seconds, with every solve and estimate on the way:",
        markdown(["", *columns], [[row.label, *_seconds(row, columns)] for row in rows]),
        "Worst quality, median of the mean qualities, names lost, and whether a node keeps its number:",
        markdown(["", "min q", "mean q", "names", "numbers"], [_properties(name, rows) for name in columns]),
        "\n".join(_verdicts(rows)),
    ]
    return "\n\n".join(part for part in parts if part)


def _errors(row: Comparison, columns: list[str]) -> Iterator[Cell]:
    best = min(result.error for result in row.results.values())
    for name in columns:
        result = row.results.get(name)
        yield f"**{best:#.4g}**" if result and result.error == best else result and result.error


def _seconds(row: Comparison, columns: list[str]) -> Iterator[Cell]:
    for name in columns:
        result = row.results.get(name)
        yield result and f"{result.seconds:.2f}"


def _better(rows: list[Comparison]) -> str:
    """Where a peer has the smaller error than the default of this package, and how many times."""
    lines = []
    for name in PEERS:
        ratios = {
            row.label: row.results[DEFAULT.name].error / row.results[name].error for row in rows if name in row.results
        }
        better = [f"{label} ({ratio:.3f})" for label, ratio in ratios.items() if ratio > 1]
        lines.append(f"* {name} has the smaller error on {'; '.join(better)}." if better else f"* {name}: nowhere.")
    return "\n".join([f"Where peers do better than {DEFAULT.name}, and how many times:", "", *lines])


def _properties(name: str, rows: list[Comparison]) -> list[Cell]:
    results = [row.results[name] for row in rows if name in row.results]
    lost = sorted({lost for result in results for lost in result.lost})
    return [
        name,
        f"{min(result.worst for result in results):.2f}",
        f"{np.median([result.mean for result in results]):.2f}",
        f"{', '.join(lost)} lost" if lost else "kept",
        NUMBERING[name],
    ]


def _verdicts(rows: list[Comparison]) -> Iterator[str]:
    """Problem C against its targets."""
    for row in rows:
        if row.letter == "C":
            ours = row.results[DEFAULT.name].error
            yield from _verdict(row, "refinement", ours, (methods.REFINED,), REFINEMENT)
            yield from _verdict(row, "the better remesher", ours, methods.REMESHERS, REMESHER)


def _verdict(row: Comparison, peer: str, ours: float, theirs: Sequence[Method], target: float) -> Iterator[str]:
    errors = [row.results[method.name].error for method in theirs if method.name in row.results]
    if errors:
        ratio = ours / min(errors)
        yield f"{row.label}: {ratio:.3f} of {peer} (target {target}: {'met' if ratio <= target else 'missed'})"
