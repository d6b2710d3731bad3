"""What the loop gives back: status, passes, the result and its table."""

from dataclasses import dataclass, field
from enum import StrEnum, auto
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

__all__ = ["AdaptResult", "Pass", "Status"]


class Status(StrEnum):
    """How the loop ended.

    ``CONVERGED``: the tolerance is met, or every indicator is zero. ``MAX_PASSES``: all passes asked for are done.
    ``STALLED``: no pass improves any more. ``NOT_MOVED``: nothing could move. ``STOPPED``: the callback returned True,
    or Ctrl-C. ``FAILED``: an exception after the input mesh was estimated; it stands in ``AdaptResult.error``.
    """

    CONVERGED = auto()
    MAX_PASSES = auto()
    STALLED = auto()
    NOT_MOVED = auto()
    STOPPED = auto()
    FAILED = auto()


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
class AdaptResult:
    """The best pass of a loop and how the loop got there; ``print(result)`` is a table.

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
    indicators: NDArray[np.float64] = field(repr=False)
    estimate: float
    history: tuple[Pass, ...] = field(repr=False)
    status: Status
    message: str
    nodes: NDArray[np.intp] = field(repr=False)
    error: Exception | None = None

    def __str__(self) -> str:
        rows = _aligned(_columns(self.history))
        marks = ["", *("  <- the result" if step.mesh is self.mesh else "" for step in self.history)]
        return "\n".join([row + mark for row, mark in zip(rows, marks, strict=True)] + [self.message])


def _columns(history: tuple[Pass, ...]) -> dict[str, list[str]]:
    columns = {
        "pass": [str(step.number) for step in history],
        "nodes": [str(step.mesh.p.shape[1]) for step in history],
        "elements": [str(step.mesh.t.shape[1]) for step in history],
        "estimate": [f"{step.estimate:.4g}" for step in history],
        "Energy Error %": [_energy_error(step) for step in history],
        "change %": ["-", *(_change(*pair) for pair in pairwise(history))],
        "min quality": [f"{step.min_quality:.2f}" for step in history],
        "mean quality": [f"{step.mean_quality:.2f}" for step in history],
        "seconds": [f"{sum(step.seconds.values()):.2f}" for step in history],
    }
    if all(step.energy_norm is None for step in history):
        del columns["Energy Error %"]
    if any(step.functional is not None for step in history):
        columns["gain of map"] = ["-", *(f"{_gain_of_map(*pair):.2g}" for pair in pairwise(history))]
        columns["of polish"] = ["-", *(f"{step.polish_gain:.2g}" for step in history[1:])]
    if any(step.splits for step in history):
        columns["splits"] = [str(step.splits) for step in history]
        columns["collapses"] = [str(step.collapses) for step in history]
    return columns


def _gain_of_map(before: Pass, after: Pass) -> float:
    """What a pass took off the Ritz functional beside its polish."""
    return (before.functional or 0.0) - (after.functional or 0.0) - after.polish_gain


def _energy_error(step: Pass) -> str:
    return f"{100.0 * step.estimate / step.energy_norm:.2f}" if step.energy_norm else "-"


def _change(before: Pass, after: Pass) -> str:
    return f"{100.0 * (after.estimate / before.estimate - 1.0):+.1f}" if before.estimate else "-"


def _aligned(columns: dict[str, list[str]]) -> list[str]:
    padded = []
    for title, cells in columns.items():
        width = max(map(len, [title, *cells]))
        padded.append([cell.rjust(width) for cell in [title, *cells]])
    return ["  ".join(row) for row in zip(*padded, strict=True)]
