"""What the loop gives back: status, passes, the result, its table and how a notebook shows it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum, auto
from html import escape
from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats

__all__ = ["AdaptResult", "Pass", "Status", "table_columns"]

WIDTH = 120  # of a printed table; what does not fit goes into another beneath
GAP = "  "

Columns = list[tuple[str, list[str]]]


class Status(StrEnum):
    """How the loop ended.

    ``CONVERGED``: the tolerance is met, or every indicator is zero. ``MAX_PASSES``: all passes asked for are done.
    ``STALLED``: no pass improves any more. ``NOT_MOVED``: nothing could move. ``STOPPED``: the callback returned True,
    or Ctrl-C, or it is a result so far. ``FAILED``: an exception after the input mesh was estimated; it stands in
    ``AdaptResult.error``.
    """

    CONVERGED = auto()
    MAX_PASSES = auto()
    STALLED = auto()
    NOT_MOVED = auto()
    STOPPED = auto()
    FAILED = auto()


@dataclass(frozen=True, eq=False, repr=False)
class Pass:
    """The mesh after ``number`` relocations, solved and estimated; number 0 is the input.

    Attributes
    ----------
    number
        How many relocations made this mesh.
    mesh
        The mesh.
    estimate
        Square root of the sum of the squared indicators.
    energy_norm
        Energy norm of the solution, None where the problem gives none.
    quantization_errors
        Mean distance of the training points to their winners, mesh units, one per epoch of the relocation that made
        this mesh; empty for the input.
    min_quality, mean_quality
        Of the elements: 1 for an equilateral triangle, 0 for a flat one.
    max_displacement
        The farthest that this relocation moved a node, mesh units; 0 for the input.
    seconds
        Wall time under the keys ``solve`` and ``estimate`` (on this mesh), ``relocate`` and ``polish`` (that made it).
    functional
        Ritz functional of the solution, in the problem's unit of energy; None where there is no polish.
    polish_gain
        What moves and flips of the polish that made this mesh took off the functional of the solution carried to it.
        The map gained the rest of the difference to the pass before.
    collapses, splits
        How often an edge was collapsed and split to make this mesh.
    outputs
        Name to value of every output asked for.
    """

    number: int
    mesh: MeshTri = field(repr=False)
    estimate: float
    energy_norm: float | None
    quantization_errors: tuple[float, ...] = field(repr=False)
    min_quality: float
    mean_quality: float
    max_displacement: float
    seconds: dict[str, float]
    functional: float | None = None
    polish_gain: float = 0.0
    collapses: int = 0
    splits: int = 0
    outputs: dict[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        nodes, least = self.mesh.p.shape[1], self.min_quality
        return f"<Pass {self.number}: estimate {self.estimate:.4g}, {nodes} nodes, min quality {least:.2f}>"


@dataclass(frozen=True, eq=False)
class AdaptResult:
    """The best pass of a loop and how the loop got there; ``print(result)`` and a notebook show a table.

    Attributes
    ----------
    mesh
        The mesh of the best pass.
    solution
        What the problem's ``solve`` returned for it.
    indicators
        (nelements,), what its ``indicators`` returned, unsquared.
    estimate
        Square root of the sum of the squared indicators.
    history
        Every pass in order; ``history[0]`` is the input.
    status
        How the loop ended.
    message
        One sentence: how it ended and what to do.
    nodes
        (nnodes,), index in the input mesh of every node, -1 for a new one.
    error
        The exception that ended the loop if ``status`` is ``FAILED``, else None.
    """

    mesh: MeshTri = field(repr=False)
    solution: Any = field(repr=False)
    indicators: Floats = field(repr=False)
    estimate: float
    history: tuple[Pass, ...] = field(repr=False)
    status: Status
    message: str
    nodes: NDArray[np.intp] = field(repr=False)
    error: Exception | None = None

    def __str__(self) -> str:
        marks = ["", *("  <- result" if step.mesh is self.mesh else "" for step in self.history)]
        blocks = _blocks(table_columns(self.history), width=WIDTH - max(map(len, marks)))
        rows = ([line + mark for line, mark in zip(block, marks, strict=True)] for block in blocks)
        return "\n".join([*chain.from_iterable(rows), self.message])

    def _repr_html_(self) -> str:
        """The table, for notebooks."""
        columns = chain.from_iterable(table_columns(self.history))
        bold = [step.mesh is self.mesh for step in self.history]
        return f"{_html_table(list(columns), bold)}\n<p>{escape(self.message)}</p>"


def _html_table(columns: Columns, bold: Sequence[bool]) -> str:
    """A table in HTML, some rows in bold; names are text in it, whatever they hold."""
    titles = "".join(f"<th>{escape(title)}</th>" for title, _ in columns)
    rows = zip(*(cells for _, cells in columns), strict=True)
    lines = [_html_row(cells, ' style="font-weight: bold"' * mark) for cells, mark in zip(rows, bold, strict=True)]
    caption = "<caption>The result is the pass in bold.</caption>"
    return "\n".join([f"<table>{caption}<thead><tr>{titles}</tr></thead><tbody>", *lines, "</tbody></table>"])


def _html_row(cells: Sequence[str], style: str) -> str:
    return f"<tr{style}>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


def table_columns(history: tuple[Pass, ...]) -> list[Columns]:
    """The columns of the table in groups that stay together: what was solved, what of it was asked, what was done."""
    solved = {
        "nodes": [str(step.mesh.p.shape[1]) for step in history],
        "estimate": [f"{step.estimate:.4g}" for step in history],
        "change %": _changes([step.estimate for step in history], ".1f"),
    }
    if any(step.energy_norm is not None for step in history):
        solved["Energy Error %"] = [_energy_error(step) for step in history]
    if any(energy is not None for energy in map(_energy, history)):
        solved["Delta Energy %"] = _changes([_energy(step) for step in history], ".2f")
    done = {
        "elements": [str(step.mesh.t.shape[1]) for step in history],
        "min quality": [f"{step.min_quality:.2f}" for step in history],
        "mean quality": [f"{step.mean_quality:.2f}" for step in history],
        "seconds": [f"{sum(step.seconds.values()):.2f}" for step in history],
    }
    if any(step.functional is not None for step in history):
        done["gain of map"] = ["-", *(f"{_gain_of_map(*pair):.2g}" for pair in pairwise(history))]
        done["gain of polish"] = ["-", *(f"{step.polish_gain:.2g}" for step in history[1:])]
    if any(step.splits for step in history):
        done["splits"] = [str(step.splits) for step in history]
        done["collapses"] = [str(step.collapses) for step in history]
    number = {"pass": [str(step.number) for step in history]}
    return [list(number.items()), list(solved.items()), *_outputs(history), list(done.items())]


def _outputs(history: tuple[Pass, ...]) -> list[Columns]:
    """One group per output: its values and their changes."""
    return [
        [(name, [f"{value:.5g}" for value in values]), ("Delta %", _changes(values, ".2f"))]
        for name in history[0].outputs
        for values in [[step.outputs[name] for step in history]]
    ]


def _energy(step: Pass) -> float | None:
    """What stands for the energy of a solution: the square of its energy norm, else the functional it minimises."""
    return step.functional if step.energy_norm is None else step.energy_norm**2


def _changes(values: Sequence[float | None], form: str) -> list[str]:
    """Change in per cent from each value to the next, a dash where there is none to compare."""
    return ["-", *(f"{100.0 * (b - a) / abs(a):+{form}}" if a and b is not None else "-" for a, b in pairwise(values))]


def _gain_of_map(before: Pass, after: Pass) -> float:
    """What a pass took off the Ritz functional beside its polish."""
    return (before.functional or 0.0) - (after.functional or 0.0) - after.polish_gain


def _energy_error(step: Pass) -> str:
    return f"{100.0 * step.estimate / step.energy_norm:.2f}" if step.energy_norm else "-"


def _blocks(groups: list[Columns], width: int) -> Iterator[list[str]]:
    """The lines of tables that are not wider than that, each with the first group; a group is never divided."""
    first, *others = (_aligned(group) for group in groups)
    block = first
    for lines in others:
        if block is not first and len(block[0]) + len(GAP) + len(lines[0]) > width:
            yield block
            block = first
        block = [GAP.join(pair) for pair in zip(block, lines, strict=True)]
    yield block


def _aligned(columns: Columns) -> list[str]:
    """Lines of the columns side by side, their titles first."""
    padded = []
    for title, cells in columns:
        width = max(map(len, [title, *cells]))
        padded.append([cell.rjust(width) for cell in [title, *cells]])
    return [GAP.join(row) for row in zip(*padded, strict=True)]
