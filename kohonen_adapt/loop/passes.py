"""Records of passes of an adaptive loop, and timing of the steps."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum, auto
from time import perf_counter
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import check_hook
from kohonen_adapt.kernels.numba.clock import seconds_compiling
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.som.relocation_record import QUALITY_RULE, Moved


def shown(title: str, form: str) -> dict[str, str]:
    return {"title": title, "form": form}


@dataclass(frozen=True, kw_only=True)
class Work:
    quantization_errors: tuple[float, ...] = field(default=(), repr=False)
    max_displacement: float = 0.0
    moved: int = 0
    unmoved: int = 0
    refused_by_quality: int = 0
    refused_by_reach: int = 0
    held_in_polish: int = 0
    why_still: str = ""
    polish_gain: float = field(default=0.0, metadata=shown("gain of polish", "#.2g"))
    splits: int = field(default=0, metadata=shown("splits", "d"))
    collapses: int = field(default=0, metadata=shown("collapses", "d"))


def work_of(record: Moved[Any], now: Any) -> Work:
    old, position = record.recycled.old, now.tessellation.position
    survives = old >= 0
    distance = np.sqrt(np.sum((position[survives] - record.before.tessellation.position[old[survives]]) ** 2, axis=1))
    moved = int(np.count_nonzero(distance) + np.count_nonzero(~survives))
    why = "" if moved else record.why_still
    if why == QUALITY_RULE and (worst := float(quality(now.input_mesh).min())) < now.floor:
        why = (
            f"{why}: the worst element has a quality of {worst:.2g}, min_quality is {now.floor:g}, and nothing below "
            f"that may get worse. Give min_quality={0.5 * worst:.2g}"
        )
    unmoved = np.count_nonzero((distance == 0.0) & ~now.held_nodes[survives])
    return Work(
        quantization_errors=record.quantization_errors,
        max_displacement=float(distance.max()),
        moved=moved,
        unmoved=int(unmoved),
        refused_by_quality=int(record.refused[0]),
        refused_by_reach=int(record.refused[1]),
        held_in_polish=record.held_in_polish,
        why_still=why,
        splits=record.recycled.splits,
        collapses=record.recycled.collapses,
        polish_gain=record.polish_gain,
    )


TIMED = ("solve", "estimate", "relocate", "polish")


class Status(StrEnum):
    """Reason for the end of the loop.

    ``CONVERGED``: the tolerances are met, or every indicator is zero and no tolerance of a goal or an output is missed.
    ``MAX_PASSES``: all requested passes are done. ``STALLED``: the last passes improved nothing. ``NOT_MOVED``: no node
    could move. ``STOPPED``: the callback returned True, the user pressed Ctrl-C, or the result is interim.
    ``MAX_NODES``: the mesh has the largest number of nodes and the tolerance is not met. ``FAILED``: an exception was
    raised after the input mesh was estimated, see ``AdaptResult.error``.
    """

    CONVERGED = auto()
    MAX_PASSES = auto()
    STALLED = auto()
    NOT_MOVED = auto()
    STOPPED = auto()
    MAX_NODES = auto()
    FAILED = auto()


@dataclass(frozen=True)
class Ending:
    status: Status
    message: str
    error: Exception | None = None


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Pass(Work):
    """Mesh after ``number`` relocations, with the figures of its solution.

    Pass 0 is the input. The table, ``history.csv`` and the checkpoints contain the fields of this record.

    Attributes
    ----------
    number
        Number of relocations that made this mesh.
    mesh
        The mesh.
    indicators
        Unsquared indicators returned by the problem, shape (nelements,).
    nodes
        Index in the input mesh of every node, -1 for a new node, shape (nnodes,).
    order
        Degree of the elements. With an order above 3 only the last pass has it.
    unknowns
        Number of unknowns, Dirichlet values included. At order 1 the number of nodes.
    estimate
        Square root of the sum of the squared indicators. Within `rtol` or `atol` it includes what sides miss of their
        curves at orders 2 and 3.
    worth
        Error measure that compares passes if the functional cannot: the estimated error in the problem's norm. The mean
        density of the squared error also counts between straight sides or faces and their curves. The data oscillation
        is added if the mesh does not resolve the data of ``ritz``. Where smaller elements of another pass
        have more error, the comparison scales their error to the size of the larger elements.
    energy_norm
        Energy norm of the solution, None if the problem has no ``energy_norm``.
    calibrated
        True if the estimate is close to the error, see `Problem`.
    min_quality, mean_quality
        Quality of the elements: 1 for an equilateral triangle, 0 for a flat triangle.
    seconds
        Wall time in s: keys ``solve`` and ``estimate`` for this mesh, ``relocate`` and ``polish`` for the steps before.
        Without `compile_seconds`.
    compile_seconds
        Wall time in s of compiling loops in these steps.
    functional
        Value of the Ritz functional in the problem's unit of energy, None without a polish or with a functional that
        only shapes elements.
    comparable
        True if the functional can be compared with the functional of other passes.
    incomparable
        Reason for which a functional is not comparable, with the nodes that the polish holds, or an empty string.
    share
        Weight of the primal functional if there is a dual, taken from the first pass, see `Ritz`. None without a dual.
    unpolished
        Reason for having no polish, or an empty string.
    goal, goal_error
        Value of the problem's goal, and its estimated signed error for the best pass, else None. With a goal the square
        of the estimate is the sum of the elements' errors in the unit of the goal.
    goal_unit
        Unit of the goal, or an empty string.
    sagitta
        Largest distance between curves and their facets in mesh units, 0 for curved sides.
    outputs
        Values of the requested outputs by name.
    output_errors
        Estimated signed errors of the outputs by name, if known: with a tolerance of outputs, and for the best pass
        beside a goal.
    unimproved
        Exception of the method ``improved`` of the problem in words, or an empty string.
    doubts
        Estimated magnitudes of what the errors of outputs miss by name, and of the goal under "goal".
    smooth
        True in a run to a tolerance in space that may end with a high order, if no edge of the input is singular, see
        `singular_edges`. High orders gain more then.
    quantization_errors
        Mean distance of the training points to their winners in mesh units, for each epoch of the relocation. Empty for
        the input.
    max_displacement
        Largest displacement of a node by the relocation in mesh units, 0 for the input.
    moved, why_still
        Number of moved or new nodes, and the reason if there are none.
    unmoved
        Number of nodes that no rule holds and that did not move: their moves were refused, or the schedule had none.
    refused_by_quality, refused_by_reach
        Number of moves of the map and of the smoothing that were refused, because they would have broken the quality
        rule or would have turned facets too far from their curve. A node may count several times.
    held_in_polish
        Number of nodes that slide, but that the polish holds. `kohonen_adapt.why_held` returns their reasons.
    polish_gain
        Decrease of the functional of the interpolated solution by the polish. The rest of the decrease since the pass
        before is due to the map.
    splits, collapses
        Number of edge splits and edge collapses, by density and by energy.
    """

    number: int
    mesh: Mesh
    indicators: Floats
    nodes: Ints
    order: int = 1
    unknowns: int
    estimate: float
    worth: float
    energy_norm: float | None = None
    calibrated: bool = False
    min_quality: float = field(metadata=shown("min quality", ".2f"))
    mean_quality: float = field(metadata=shown("mean quality", ".2f"))
    seconds: dict[str, float] = field(default_factory=dict)
    compile_seconds: float = 0.0
    functional: float | None = None
    comparable: bool = False
    incomparable: str = ""
    share: float | None = None
    unpolished: str = ""
    goal: float | None = None
    goal_error: float | None = None
    goal_unit: str = ""
    sagitta: float = 0.0
    outputs: dict[str, float] = field(default_factory=dict)
    output_errors: dict[str, float] = field(default_factory=dict)
    unimproved: str = ""
    doubts: dict[str, float] = field(default_factory=dict)
    smooth: bool = False

    @property
    def shown_estimate(self) -> float:
        """Estimate as shown in tables, with a goal its square in the unit of the goal."""
        return self.estimate if self.goal is None else self.estimate**2

    @property
    def estimate_text(self) -> str:
        """Estimate as shown in tables, with four digits and a unit."""
        return f"{self.shown_estimate:.4g} {self.goal_unit}".rstrip()

    def __repr__(self) -> str:
        nodes, least = self.mesh.nvertices, self.min_quality
        return f"<Pass {self.number}: estimate {self.estimate_text}, {nodes} nodes, min quality {least:.2f}>"


Passes = tuple[Pass, ...]


class StepFailed(Exception):
    def __init__(self, step: str, number: int) -> None:
        super().__init__(step, number)
        self.step, self.number = step, number


def text_of(error: BaseException | None) -> str:
    return ": ".join([type(error).__name__, *str(error).splitlines()[:1]]).rstrip(".")


class Steps:
    """Timer of the steps of the pass in progress.

    Attributes
    ----------
    number
        Index of the pass in progress.
    has_solved
        True after the first solve of this process, when a failure no longer leaves the loop without a result.
    compile_seconds
        Wall time in s of compiling in this pass, not part of `seconds`.
    """

    def __init__(self, progress: Callable[[int, str], Any] | None = None) -> None:
        check_hook("progress", progress, "number and step")
        self.number, self.has_solved = 0, False
        self._progress = progress
        self._seconds: dict[str, float] = {}
        self.compile_seconds = 0.0

    @property
    def seconds(self) -> dict[str, float]:
        return {step: self._seconds.get(step, 0.0) for step in TIMED}

    def next_pass(self, number: int) -> None:
        self.number, self._seconds, self.compile_seconds = number, {}, 0.0

    def begin(self, number: int, step: str) -> None:
        if self._progress is not None:
            self._progress(number, step)

    @contextmanager
    def __call__(self, step: str, label: str = "", number: int | None = None) -> Iterator[None]:
        # Exceptions before the first solve pass unchanged, later exceptions are raised as `StepFailed`, which names
        # `label` instead of the step if given.
        number = self.number if number is None else number
        self.begin(number, step)
        start, compiled = perf_counter(), seconds_compiling()
        try:
            yield
        except Exception as error:
            if not self.has_solved:
                raise
            raise StepFailed(label or step, number) from error
        compiled = seconds_compiling() - compiled
        self._seconds[step] = self._seconds.get(step, 0.0) + perf_counter() - start - compiled
        self.compile_seconds += compiled
