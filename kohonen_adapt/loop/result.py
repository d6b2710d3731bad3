"""Result of an adaptive loop, with a table of the passes as text and in HTML."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from html import escape
from itertools import chain, pairwise
from math import floor, log10
from typing import Any

from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.display import by_error, significant
from kohonen_adapt.loop.figures import (
    ERROR_DIGITS,
    GOAL,
    OutputValue,
    energy_error,
    energy_norm_error,
    values_of,
    with_unit,
    word_for_estimate,
)
from kohonen_adapt.loop.passes import Pass, Passes, Status, Work

WIDTH = 120  # characters; further columns are printed as a second table below
GAP = "  "
DASH = "-"
SIGN_CHANGE = "sign"

Columns = list[tuple[str, list[str]]]


def table_columns(history: Passes) -> list[Columns]:
    return [
        [("pass", [str(step.number) for step in history])],
        _solution_columns(history),
        *(_columns_of(name, history) for name in [*[GOAL] * (history[0].goal is not None), *history[0].outputs]),
        _work_columns(history),
    ]


def html_table(history: Passes, attributes: Sequence[str]) -> str:
    columns = list(chain.from_iterable(table_columns(history)))
    titles = _html_row("", "th", [title for title, _ in columns])
    rows = zip(attributes, *(cells for _, cells in columns), strict=True)
    lines = [_html_row(row_attributes, "td", cells) for row_attributes, *cells in rows]
    return "\n".join([f"<table><thead>{titles}</thead><tbody>", *lines, "</tbody></table>"])


def _html_row(attributes: str, kind: str, cells: Sequence[str]) -> str:
    return f"<tr{attributes}>" + "".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in cells) + "</tr>"


def _solution_columns(history: Passes) -> Columns:
    columns = [("nodes", [str(step.mesh.nvertices) for step in history])]
    if len({step.order for step in history}) > 1:
        columns.append(("order", [str(step.order) for step in history]))
    if any(step.unknowns != step.mesh.nvertices for step in history):
        columns.append(("unknowns", [str(step.unknowns) for step in history]))
    columns += [
        (word_for_estimate(history), [significant(step.shown_estimate, 4) for step in history]),
        ("change %", _changes([step.shown_estimate for step in history], ".1f")),
    ]
    if any(step.calibrated and step.energy_norm is not None for step in history):
        errors = [error for error in map(energy_norm_error, history) if error]
        decimals = _decimals(errors) if min(errors, default=1.0) < 0.01 else 2
        columns.append(("Energy-norm error %", _cells(map(energy_norm_error, history), f"{{:.{decimals}f}}".format)))
        energies = [*map(energy_error, history)]
        columns.append(("Energy error %", _cells(energies, f"{{:.{_decimals(energies)}f}}".format)))
    if any(energy is not None for energy in map(_energy, history)):
        columns.append(("Delta Energy %", _changes([_energy(step) for step in history], ".2f")))
    return columns


_of_errors = partial(significant, digits=ERROR_DIGITS)


def _cells(values: Iterable[float | None], text: Callable[[float], str]) -> list[str]:
    return [DASH if value is None else text(value) for value in values]


def _columns_of(name: str, history: Passes) -> Columns:
    found = [values_of(step)[name] for step in history]
    values, errors = [each.value for each in found], [each.error for each in found]
    with_digits = partial(by_error, error=min((abs(error) for error in errors if error is not None), default=None))
    shown, corrected = _cells(values, with_digits), _cells((each.corrected for each in found), with_digits)
    if history[0].goal is not None and name == GOAL:  # the estimate has its column in `_solution_columns`
        columns = [("goal", shown), ("error", _cells(errors, _of_errors)), ("goal + error", corrected)]
        return [(with_unit(title, history[0]), cells) for title, cells in columns]
    columns = [(name, shown), ("Delta %", [DASH, *map(_output_change, values, values[1:])])]
    if not any(error is not None for error in errors):
        return columns
    return [
        *columns,
        ("error %", _cells((each.relative_error for each in found), _of_errors)),
        ("corrected", corrected),
    ]


def _output_change(before: float, after: float) -> str:
    if min(before, after) < 0.0 < max(before, after):
        return SIGN_CHANGE
    return f"{100.0 * (abs(after) - abs(before)) / abs(before):+.2f}" if before else DASH


def _work_columns(history: Passes) -> Columns:
    figures, work = Columns(), Columns()
    for entry in fields(history[0]):
        if "title" in entry.metadata:
            values = [getattr(step, entry.name) for step in history]
            cells = [format(value, entry.metadata["form"]).removesuffix(".") for value in values]
            if not hasattr(Work, entry.name):
                figures.append((entry.metadata["title"], cells))
            elif any(values):
                work.append((entry.metadata["title"], [DASH, *cells[1:]]))
    if any(step.functional is not None for step in history):
        work.insert(0, ("gain of map", [DASH, *(_gain_of_map(*pair) for pair in pairwise(history))]))
    return [
        ("elements", [str(step.mesh.nelements) for step in history]),
        *figures,
        ("seconds", [f"{sum(step.seconds.values()):.2f}" for step in history]),
        *work,
    ]


def _decimals(values: Iterable[float | None]) -> int:
    least = min((value for value in values if value), default=1.0)
    return max(2, 1 - floor(log10(least)))


def _energy(step: Pass) -> float | None:
    if step.energy_norm is None:
        return step.functional if step.share is None else None
    return step.energy_norm**2


def _changes(values: Sequence[float | None], form: str) -> list[str]:
    return [
        DASH,
        *(f"{100.0 * (b - a) / abs(a):+{form}}" if a and b is not None else DASH for a, b in pairwise(values)),
    ]


def _gain_of_map(before: Pass, after: Pass) -> str:
    if before.functional is None or after.functional is None:
        return DASH
    return significant(before.functional - after.functional - after.polish_gain, 2)


def table_blocks(groups: list[Columns], width: int = WIDTH) -> Iterator[list[str]]:
    first, *others = (_aligned(group) for group in groups)
    lines_so_far = first
    for lines in others:
        if lines_so_far is not first and len(lines_so_far[0]) + len(GAP) + len(lines[0]) > width:
            yield lines_so_far
            lines_so_far = first
        lines_so_far = [GAP.join(pair) for pair in zip(lines_so_far, lines, strict=True)]
    yield lines_so_far


def _aligned(columns: Columns) -> list[str]:
    padded = []
    for title, cells in columns:
        width = max(map(len, [title, *cells]))
        padded.append([cell.rjust(width) for cell in [title, *cells]])
    return [GAP.join(row) for row in zip(*padded, strict=True)]


@dataclass(frozen=True, eq=False)
class AdaptResult:
    """Best pass of an adaptive loop, with the history of all passes.

    ``print(result)`` and notebooks show the history as a table.

    Attributes
    ----------
    mesh
        Mesh of the best pass.
    solution
        Solution on this mesh, as returned by the problem's ``solve``.
    indicators
        Unsquared indicators of this solution, shape (nelements,).
    estimate
        Square root of the sum of the squared indicators. Within `rtol` or `atol` it includes what sides miss of their
        curves at orders 2 and 3.
    history
        All passes in order. ``history[0]`` is the input.
    status
        Reason for the end of the loop.
    message
        Reason for the end of the loop, best pass and advice, as text.
    nodes
        Index in the input mesh of every node, -1 for a new node, shape (nnodes,).
    error
        Exception that ended the loop if ``status`` is ``FAILED``, else None.
    """

    mesh: Mesh = field(repr=False)
    solution: Any = field(repr=False)
    indicators: Floats = field(repr=False)
    estimate: float
    history: Passes = field(repr=False)
    status: Status
    message: str
    nodes: Ints = field(repr=False)
    error: Exception | None = None

    @property
    def best(self) -> Pass:
        """Pass that is the result."""
        return next(step for step in self.history if step.mesh is self.mesh)

    @property
    def outputs(self) -> dict[str, OutputValue]:
        """Outputs of the best pass by name, and the goal under "goal"."""
        return values_of(self.best)

    def __str__(self) -> str:
        marks = ["", *("  <- best" if step is self.best else "" for step in self.history)]
        blocks = table_blocks(table_columns(self.history), WIDTH - max(map(len, marks)))
        lines = [line + mark for block in blocks for line, mark in zip(block, marks, strict=True)]
        return "\n".join([*lines, self.message])

    def _repr_html_(self) -> str:
        bold = [' style="font-weight: bold"' * (step is self.best) for step in self.history]
        return f"{html_table(self.history, bold)}\n<p>The best pass is in bold. {escape(self.message)}</p>"
