"""The record that the loop keeps: its passes, the time they took, and the best of them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.loop.result import AdaptResult, Pass, Status
from kohonen_adapt.mesh.measures import area, quality
from kohonen_adapt.som.relocate import Relocation

__all__ = ["UNSOLVED", "Ending", "Finished", "Journal", "StepFailed"]

STEPS = ("solve", "estimate", "relocate", "polish")

UNSOLVED = object()
"""In place of the solution of a pass that was not solved in this process."""


class StepFailed(Exception):
    """A step of the loop raised when there was a pass to give back; what it raised is the ``__cause__``."""

    def __init__(self, step: str) -> None:
        super().__init__(step)
        self.step = step


@dataclass(frozen=True)
class Ending:
    """How the loop ended: status, message, and the exception of a failure."""

    status: Status
    message: str
    error: Exception | None = None


class Finished(NamedTuple):
    """What is known of a mesh that was solved and estimated, beside the solution.

    Attributes
    ----------
    mesh, indicators, energy_norm, functional, outputs
        As in `AdaptResult` and `Pass`.
    comparable
        Whether the functional may be compared with those of other passes.
    skipped
        Why there is no polish, or empty.
    move
        What made the mesh, None for the input.
    seconds
        Step to the wall time it took.
    """

    mesh: MeshTri
    indicators: Floats
    energy_norm: float | None
    functional: float | None
    outputs: dict[str, float]
    comparable: bool
    skipped: str
    move: Relocation | None
    seconds: dict[str, float]


@dataclass
class _Solved:
    """A finished pass, its solution, its nodes in the input mesh, and what it is judged by: the less, the better."""

    finished: Finished
    solution: Any
    nodes: NDArray[np.intp]
    worth: float

    @property
    def mesh(self) -> MeshTri:
        return self.finished.mesh

    @property
    def functional(self) -> float | None:
        return self.finished.functional

    def lies_below(self, other: "_Solved") -> bool:
        """Whether its functional is the lower one, as far as there are two."""
        return self.functional is not None and other.functional is not None and self.functional < other.functional


class Journal:
    """History of a loop. Of the solutions it keeps two, the last (for a warm start) and the best.

    `progress` hears of every step when it begins, with the number of its pass.
    """

    def __init__(self, norm: str, progress: Callable[[int, str], Any] | None = None) -> None:
        self.history: tuple[Pass, ...] = ()
        self.worths: tuple[float, ...] = ()
        self._norm = norm
        self._progress = progress
        self._last: _Solved | None = None
        self._least: _Solved | None = None  # by worth
        self._lowest: _Solved | None = None  # by functional
        self._comparable = True
        self._seconds: dict[str, float] = {}

    @property
    def number(self) -> int:
        """Number of the pass in the making."""
        return len(self.history)

    @property
    def best_number(self) -> int:
        """Number of the best pass so far."""
        functionals = [entry.functional for entry in self.history if entry.functional is not None]
        return int(np.argmin(functionals if self._comparable else self.worths))

    @property
    def last(self) -> tuple[MeshTri | None, Any]:
        """Mesh and solution of the last pass, (None, None) before the first."""
        return (self._last.mesh, self._last.solution) if self._last else (None, None)

    @property
    def last_finished(self) -> Finished:
        """The last pass."""
        if self._last is None:
            raise RuntimeError("the journal has no pass yet.")
        return self._last.finished

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time of the steps of the pass in the making."""
        return {step: self._seconds.get(step, 0.0) for step in STEPS}

    @property
    def begun(self) -> bool:
        """Whether a mesh was solved in this process, so that there is something to give back."""
        return self._last is not None and self._last.solution is not UNSOLVED

    @contextmanager
    def timed(self, step: str, failing: str = "", number: int | None = None) -> Iterator[None]:
        """Time one step of a pass; what goes wrong on the first mesh stays as it is, later it is a `StepFailed`.

        That says what was `failing`, where it is not the step as a whole. The pass is the one in the making, if no
        `number` of another is given.
        """
        self._begin(self.number if number is None else number, step)
        start = perf_counter()
        try:
            yield
        except Exception as error:
            if not self.begun:
                raise
            raise StepFailed(failing or step) from error
        self._seconds[step] = self._seconds.get(step, 0.0) + perf_counter() - start

    def record(self, finished: Finished, solution: Any) -> None:
        """Add a pass that is solved and estimated.

        The best pass has the lowest functional if all passes are comparable by it, else the lowest estimate.
        """
        entry = _entry(self.number, finished)
        worth = _weighted(finished) if self._norm == "L2" else entry.estimate
        solved = _Solved(finished, solution, self._nodes_after(finished), worth)
        least = solved if self._least is None or worth < self._least.worth else self._least
        lowest = solved if self._lowest is None or solved.lies_below(self._lowest) else self._lowest
        history, worths = (*self.history, entry), (*self.worths, worth)
        comparable = self._comparable and finished.comparable and finished.functional is not None
        # One statement without a call: Ctrl-C cannot fall in the middle of it.
        self.history, self.worths, self._last, self._least, self._lowest, self._comparable, self._seconds = (
            history, worths, solved, least, lowest, comparable, {}
        )  # fmt: skip

    def _nodes_after(self, finished: Finished) -> NDArray[np.intp]:
        """Number in the input of every node of a mesh, -1 for a new one."""
        if finished.move is None or self._last is None:
            return np.arange(finished.mesh.p.shape[1])
        old = finished.move.old
        return np.where(old >= 0, self._last.nodes[old], -1)

    def solve_last(self, solve: Callable[[Finished], Any]) -> None:
        """Solve the last pass if that was not done in this process."""
        self._solved_now(self._last, self.number - 1, solve)

    def result(self, ending: Ending, solve: Callable[[Finished], Any]) -> AdaptResult:
        """The best pass, solved if that was not done in this process, with the history and the way the loop ended."""
        best = self._solved_now(self._lowest if self._comparable else self._least, self.best_number, solve)
        return AdaptResult(
            mesh=best.mesh,
            solution=best.solution,
            indicators=best.finished.indicators,
            estimate=_root_sum(best.finished.indicators),
            history=self.history,
            status=ending.status,
            message=ending.message,
            nodes=best.nodes,
            error=ending.error,
        )

    def _solved_now(self, chosen: _Solved | None, number: int, solve: Callable[[Finished], Any]) -> _Solved:
        if chosen is None:
            raise RuntimeError("the journal has no pass to give back.")
        if chosen.solution is UNSOLVED:
            self._begin(number, "solve again")
            chosen.solution = solve(chosen.finished)
        return chosen

    def _begin(self, number: int, step: str) -> None:
        if self._progress is not None:
            self._progress(number, step)


def _entry(number: int, finished: Finished) -> Pass:
    """The pass as users see it."""
    qualities, move = quality(finished.mesh), finished.move
    return Pass(
        number=number,
        mesh=finished.mesh,
        estimate=_root_sum(finished.indicators),
        energy_norm=finished.energy_norm,
        quantization_errors=move.quantization_errors if move else (),
        min_quality=float(qualities.min()),
        mean_quality=float(qualities.mean()),
        max_displacement=move.max_displacement if move else 0.0,
        seconds=finished.seconds,
        functional=finished.functional,
        polish_gain=move.polish_gain if move else 0.0,
        collapses=move.collapses if move else 0,
        splits=move.splits if move else 0,
        outputs=finished.outputs,
    )


def _weighted(finished: Finished) -> float:
    """The estimate of the error in L2."""
    return _root_sum(finished.indicators * np.sqrt(area(finished.mesh)))


def _root_sum(values: Floats) -> float:
    """Square root of the sum of squares, scaled so that neither tiny nor huge values are lost."""
    largest = values.max()
    return float(largest * np.linalg.norm(values / largest)) if largest > 0.0 else 0.0
