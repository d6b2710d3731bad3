"""The record that the loop keeps: its passes, the time they took, and the best of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from .relocation import Relocation
from .result import AdaptResult, Pass, Status
from .triangles import area, quality

__all__ = ["Ending", "Journal", "StepFailed"]

STEPS = ("solve", "estimate", "relocate", "polish")

Floats = NDArray[np.float64]


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


class _Solved(NamedTuple):
    """A mesh with what is known on it, its nodes in the input mesh, and what it is judged by: the less, the better."""

    mesh: MeshTri
    solution: Any
    indicators: Floats
    nodes: NDArray[np.intp]
    worth: float
    functional: float | None

    def lies_below(self, other: "_Solved") -> bool:
        """Whether its functional is the lower one, as far as there are two."""
        return self.functional is not None and other.functional is not None and self.functional < other.functional


class Journal:
    """History of a loop. Of the solutions it keeps two, the last (for a warm start) and the best."""

    def __init__(self, norm: str) -> None:
        self.history: tuple[Pass, ...] = ()
        self.worths: tuple[float, ...] = ()
        self._norm = norm
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

    @contextmanager
    def timed(self, step: str, failing: str = "") -> Iterator[None]:
        """Time one step of a pass; what goes wrong on the input mesh stays as it is, later it is a `StepFailed`.

        That says what was `failing`, where it is not the step as a whole.
        """
        start = perf_counter()
        try:
            yield
        except Exception as error:
            if not self.history:
                raise
            raise StepFailed(failing or step) from error
        self._seconds[step] = self._seconds.get(step, 0.0) + perf_counter() - start

    def record(
        self,
        mesh: MeshTri,
        solution: Any,
        indicators: Floats,
        energy_norm: float | None,
        functional: float | None,
        outputs: dict[str, float],
        comparable: bool,
        move: Relocation | None,
    ) -> None:
        """Add the pass whose mesh was just solved and estimated; `move` made it, None for the input.

        The best pass has the lowest functional if all passes are `comparable` by it, else the lowest estimate.
        """
        qualities = quality(mesh)
        entry = Pass(
            number=self.number,
            mesh=mesh,
            estimate=_root_sum(indicators),
            energy_norm=energy_norm,
            quantization_errors=move.quantization_errors if move else (),
            min_quality=float(qualities.min()),
            mean_quality=float(qualities.mean()),
            max_displacement=move.max_displacement if move else 0.0,
            seconds={step: self._seconds.get(step, 0.0) for step in STEPS},
            functional=functional,
            polish_gain=move.polish_gain if move else 0.0,
            collapses=move.collapses if move else 0,
            splits=move.splits if move else 0,
            outputs=outputs,
        )
        worth = _root_sum(indicators * np.sqrt(area(mesh))) if self._norm == "L2" else entry.estimate
        solved = _Solved(mesh, solution, indicators, self._nodes_after(mesh, move), worth, functional)
        least = solved if self._least is None or worth < self._least.worth else self._least
        lowest = solved if self._lowest is None or solved.lies_below(self._lowest) else self._lowest
        history, worths = (*self.history, entry), (*self.worths, worth)
        comparable = self._comparable and comparable and functional is not None
        # One statement without a call: Ctrl-C cannot fall in the middle of it.
        self.history, self.worths, self._last, self._least, self._lowest, self._comparable, self._seconds = (
            history, worths, solved, least, lowest, comparable, {}
        )  # fmt: skip

    def _nodes_after(self, mesh: MeshTri, move: Relocation | None) -> NDArray[np.intp]:
        """Number in the input of every node of the mesh that `move` made, -1 for a new one."""
        if move is None or self._last is None:
            return np.arange(mesh.p.shape[1])
        return np.where(move.old >= 0, self._last.nodes[move.old], -1)

    def result(self, ending: Ending) -> AdaptResult:
        """The best pass with the history and the way the loop ended."""
        best = self._lowest if self._comparable else self._least
        if best is None:
            raise RuntimeError("the journal has no pass to give back.")
        return AdaptResult(
            mesh=best.mesh,
            solution=best.solution,
            indicators=best.indicators,
            estimate=_root_sum(best.indicators),
            history=self.history,
            status=ending.status,
            message=ending.message,
            nodes=best.nodes,
            error=ending.error,
        )


def _root_sum(values: Floats) -> float:
    """Square root of the sum of squares, scaled so that neither tiny nor huge values are lost."""
    largest = values.max()
    return float(largest * np.linalg.norm(values / largest)) if largest > 0.0 else 0.0
