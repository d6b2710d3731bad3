"""The loop: solve, estimate, relocate, and stop when it is enough."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Ints
from kohonen_adapt.checks import is_count
from kohonen_adapt.loop.checkpoint import Checkpoint
from kohonen_adapt.loop.growth import Growth
from kohonen_adapt.loop.history import UNSOLVED, Ending, Finished, Journal, StepFailed
from kohonen_adapt.loop.identity import fingerprint
from kohonen_adapt.loop.result import AdaptResult, Pass, Status
from kohonen_adapt.loop.step import Improvement, Settings
from kohonen_adapt.loop.stopping import StopTest, failed, interrupted, not_moved, remarked, under_way
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.outline.rules import Limits
from kohonen_adapt.problem.outputs import Output, check_outputs, output_value
from kohonen_adapt.problem.protocol import Problem, check_problem, energy_norm, estimate, norm_of, solve, solve_again
from kohonen_adapt.som.relocate import Relocation, guarded_map
from kohonen_adapt.som.schedule import Schedule, check_training

__all__ = ["PASSES", "adapt"]

# The measured best of the topologies.
_TOPOLOGY = "recycle"

# How a loop ends that nothing has cut short.
_AT_ITS_END = (Status.MAX_PASSES, Status.STALLED, Status.NOT_MOVED)

PASSES = 4

_NUMBERS = (int, float, np.integer, np.floating)


def adapt(
    mesh: MeshTri,
    problem: Problem,
    *,
    passes: int = PASSES,
    rtol: float | None = None,
    atol: float | None = None,
    schedule: Schedule | None = None,
    topology: str | None = None,
    min_quality: float = 0.3,
    pinned: Sequence[int | str] | Ints | str = (),
    seed: int = 0,
    callback: Callable[[Pass], Any] | None = None,
    polish: bool = True,
    target_nodes: int | None = None,
    curves: Mapping[str, Curve] | None = None,
    periodic: Sequence[tuple[str, str]] = (),
    layers: Mapping[str, int] | None = None,
    outputs: Mapping[str, Output] | None = None,
    output_rtol: float | None = None,
    interim: Callable[[AdaptResult], Any] | None = None,
    progress: Callable[[int, str], Any] | None = None,
    checkpoint: str | PathLike[str] | None = None,
) -> AdaptResult:
    """Adapt a mesh to a problem by moving its nodes to where the error is; their number is yours.

    A pass solves, estimates the error per element, and lets the Kohonen map learn the density that would make the
    error equal everywhere; then the polish moves nodes to where the energy of the solution, carried over, is lower.
    The mesh after the last pass is solved and estimated too, so `passes` relocations cost ``passes + 1`` solves. The
    result is the best mesh seen, the input included.

    Parameters
    ----------
    mesh
        A triangular mesh of straight elements; it is not modified.
    problem
        Anything with ``solve(mesh) -> solution`` and ``indicators(mesh, solution) -> (nelements,)``, error indicators
        of the energy norm, unsquared. Used where present: ``order`` (degree of the elements, 1), ``norm`` ("energy" or
        "L2": the norm in which the error is to be small), ``solve_from(mesh, old_mesh, old_solution)`` (in place of
        ``solve`` on every mesh but the first), ``energy_norm(mesh, solution) -> float``, and
        ``ritz(mesh, solution) -> kohonen_adapt.Ritz`` (the functional that the solution minimises; the polish needs
        it).
    passes
        Number of relocations, at most; 0 solves and estimates the input.
    rtol, atol
        Stop when the estimate is at most ``atol + rtol * energy norm``; `rtol` needs the problem's ``energy_norm``.
    schedule
        How the map learns; None for the default, which fits itself to every pass.
    topology
        "fixed" keeps the connectivity, "flip" makes each region Delaunay, "recycle" also takes nodes away where there
        are too many and puts as many where there are too few; None for the measured best of them, "recycle".
    min_quality
        No move, flip, collapse or split leaves an element of lower quality than this, or than there was.
    pinned
        What stays where it is: node indices, names of boundaries and of subdomains.
    seed
        An integer >= 0. Every pass draws its training points from a seed of its own, made from this one.
    callback
        Called with every `Pass`, the input's first; returning True stops the loop. What it raises is not caught.
    polish
        Whether to descend the energy after the map. Where the problem has no ``ritz``, elements of another degree than
        1, ``norm = "L2"``, or coefficients that vary inside a region, there is no polish, and the message says so.
    target_nodes
        Grow to that many nodes by splitting edges, a share in every pass but the last (edges around are flipped, with
        "fixed" too); names are kept. None keeps their number. Where the quality rule allows no further split there are
        fewer, and the message says so.
    curves
        The curves that named boundaries are on; see `relocate`. Nodes on curves slide with the map, and are not
        polished.
    periodic
        Pairs of names of boundaries that are one another's image, and stay so node by node; see `relocate`. Their nodes
        slide with the map, and are neither polished nor recycled.
    layers
        Layers of elements to keep across thin subdomains, by name; see `relocate`. Map, recycling, growth and polish
        all keep them.
    outputs
        Name to a function of the solution that returns a finite float. Every `Pass` carries the values, and the table
        shows them with their changes.
    output_rtol
        Stop when no output has changed by more than this fraction of its value in the pass before. With `rtol` or
        `atol` besides, both must be met. An output that is zero but for rounding (the force across a symmetry) never
        settles: leave it out.
    interim
        Called after every pass with the result so far, which is what would come back if the loop ended there: write it,
        and a process that is killed has not worked for nothing. What it raises is not caught.
    progress
        Called with the number of a pass and a step of it when that begins: "relocate", "polish", "solve", "estimate",
        "checkpoint" or "solve again". What it raises is not caught.
    checkpoint
        A folder, created if missing, that gets a file for every finished pass, whole or not at all. If it has passes
        of this run (the same mesh and arguments; those that say when to end may differ, and `passes` too without
        `target_nodes`), the loop goes on from the last of them: it hears its callback about each again, solves that
        mesh again, and the best one if that is another. A linear problem then has the same history and the same result,
        bit for bit, as without a break; a nonlinear one to the accuracy of its solver.

    Returns
    -------
    AdaptResult
        The best pass, never worse than the input: the one of the lowest Ritz functional where the polish can compare
        passes, else by estimate (with ``norm = "L2"`` by the square root of the sum of |K| times the squared
        indicators); with the history, the status and a message. Print it for a table.

    Raises
    ------
    ValueError
        If an argument is out of range, the mesh has fewer layers than are to be kept, the problem lacks a method, its
        indicators of the input mesh have the wrong shape or are not finite numbers >= 0, an output of it is not one
        finite number, or the passes in `checkpoint` are damaged, of another run or of another problem.
    OSError
        If `checkpoint` cannot be read; where it cannot be written, the loop ends like after any failure.
    Exception
        Whatever the problem or an output raises on the first mesh it is asked to solve, Ctrl-C included. Later that
        ends the loop, with the status ``FAILED`` and the exception in ``AdaptResult.error``, or ``STOPPED`` for Ctrl-C.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
    >>> mesh = skfem.MeshTri().refined(4).with_subdomains({"coil": lambda x: x[0] < 0.5, "air": lambda x: x[0] > 0.5})
    >>> mesh = mesh.with_boundaries({"outer": lambda x: x[0] < 2.0})
    >>> materials = {"coil": Material(current_density=1e6), "air": Material()}
    >>> result = ka.adapt(mesh, Magnetostatics(materials, potential={"outer": 0.0}), passes=2)
    >>> result.estimate < 0.9 * result.history[0].estimate
    True
    >>> result.mesh.p.shape == mesh.p.shape, list(result.mesh.boundaries), result.status.value
    (True, ['outer'], 'max_passes')
    """
    topology = _TOPOLOGY if topology is None else topology
    pinned = tuple(pinned) if isinstance(pinned, Iterator) else pinned
    _check_loop(passes, rtol, atol, polish)
    _check_hooks(callback=callback, interim=interim, progress=progress)
    outputs = check_outputs(outputs, output_rtol)
    check_training(schedule, seed)
    limits = Limits(topology, min_quality, pinned, curves, periodic, layers)
    guarded_map(mesh, limits)  # refuses what it would refuse later, before the first solve
    check_problem(problem, rtol)
    growth, settings = Growth.of(mesh, target_nodes, passes), Settings(schedule, limits, seed, polish)
    run = fingerprint(mesh, problem, settings, growth, outputs) if checkpoint is not None else {}
    kept = Checkpoint.at(checkpoint, mesh, run)
    stop = StopTest(passes, rtol, atol, output_rtol, callback)
    journal, improvement = Journal(norm_of(problem), progress), Improvement(problem, settings)
    return _Loop(problem, outputs, improvement, growth, stop, journal, kept, interim).adapted(mesh)


@dataclass(frozen=True)
class _Loop:
    """The algorithm, with what its steps need."""

    problem: Problem
    outputs: Mapping[str, Output]
    improvement: Improvement
    growth: Growth
    stop: StopTest
    journal: Journal
    checkpoint: Checkpoint
    interim: Callable[[AdaptResult], Any] | None

    def adapted(self, mesh: MeshTri) -> AdaptResult:
        """The result of the loop, however it ends."""
        try:
            ending = self.run(mesh)
        except KeyboardInterrupt:
            if not self.journal.begun:
                raise
            ending = interrupted(self.journal)
        except StepFailed as failure:
            ending = failed(self.journal, failure)
        ending = remarked(ending, self.improvement.remark)
        if ending.status in _AT_ITS_END:
            ending = remarked(ending, self.growth.shortfall(self.journal.history[-1].mesh.p.shape[1]))
        return self.result(ending)

    def run(self, mesh: MeshTri) -> Ending:
        """Solve and estimate; until it is enough, relocate and polish, solve and estimate again."""
        ending = self.resume()
        if not self.journal.history:
            ending = self.assess(mesh)
        while ending is None:
            move = self.improve()
            if _same(self.journal.history[-1].mesh, move.mesh) and not self.growth.goes_on(self.journal.number):
                return not_moved(self.journal, move)
            ending = self.assess(move.mesh, move)
        return ending

    def resume(self) -> Ending | None:
        """Go through the passes that were finished before; solve the last of them, unless the loop ended there."""
        for finished in self.checkpoint.passes():
            self.journal.record(finished, UNSOLVED)
            self.improvement.recall(finished.comparable, finished.skipped)
            if ending := self.ended(finished.move):
                return ending
        if self.journal.history:
            self.journal.solve_last(self.solve_again)
            self.improvement.resume(*self.journal.last)
        return None

    def assess(self, mesh: MeshTri, move: Relocation | None = None) -> Ending | None:
        """Solve and estimate the mesh that `move` made, and see whether that is enough."""
        journal, improvement = self.journal, self.improvement
        with journal.timed("solve"):
            solution = solve(self.problem, mesh, *journal.last)
        with journal.timed("estimate"):
            indicators = estimate(self.problem, mesh, solution)
            energy = energy_norm(self.problem, mesh, solution, self.stop.rtol)
            functional = improvement.functional(mesh, solution)
        values = {}
        for name, function in self.outputs.items():
            with journal.timed("estimate", f"output {name!r}"):
                values[name] = output_value(name, function, solution)
        comparable, skipped = improvement.comparable, improvement.skipped
        finished = Finished(mesh, indicators, energy, functional, values, comparable, skipped, move, journal.seconds)
        journal.record(finished, solution)
        self.keep(finished)
        return self.ended(move)

    def keep(self, finished: Finished) -> None:
        """Hand over the result so far before the pass counts as finished: who goes on from here has that."""
        if self.interim:
            self.interim(self.result(under_way(self.journal)))
        if self.checkpoint.folder:
            number = self.journal.number - 1
            with self.journal.timed("checkpoint", f"checkpoint of pass {number}", number):
                self.checkpoint.keep(number, finished)

    def improve(self) -> Relocation:
        """Let the map learn where the error wants nodes, and polish what it learnt."""
        journal, last = self.journal, self.journal.last_finished
        with journal.timed("relocate"):
            trained = self.improvement.train(
                last.mesh, last.indicators, journal.number, self.growth.nodes(journal.number)
            )
        with journal.timed("polish"):
            gain = self.improvement.polish(trained)
        with journal.timed("relocate"):
            return trained.relocation(gain)

    def ended(self, move: Relocation | None) -> Ending | None:
        """How the loop ends after the last pass, or None."""
        return self.stop(self.journal, move, self.growth.goes_on(self.journal.number - 1))

    def result(self, ending: Ending) -> AdaptResult:
        """The best pass with its solution."""
        return self.journal.result(ending, self.solve_again)

    def solve_again(self, finished: Finished) -> Any:
        """The solution of a pass that another process finished."""
        return solve_again(self.problem, finished.mesh, finished.indicators)


def _same(before: MeshTri, after: MeshTri) -> bool:
    """Whether nothing moved and nothing flipped: then there is nothing to solve again."""
    return np.array_equal(before.p, after.p) and np.array_equal(_triples(before), _triples(after))


def _triples(mesh: MeshTri) -> Ints:
    return np.unique(np.sort(mesh.t, axis=0), axis=1)


def _check_loop(passes: Any, rtol: Any, atol: Any, polish: Any) -> None:
    if not is_count(passes):
        raise ValueError(f"passes must be an integer >= 0; got {passes!r}.")
    for name, value in (("rtol", rtol), ("atol", atol)):
        if value is not None and not (isinstance(value, _NUMBERS) and 0.0 <= value < np.inf):
            raise ValueError(f"{name} must be a finite number >= 0, or None; got {value!r}.")
    if not isinstance(polish, bool | np.bool_):
        raise ValueError(f"polish must be True or False; got {polish!r}. Polish alone: kohonen_adapt.polish.")


def _check_hooks(callback: Any, interim: Any, progress: Any) -> None:
    told = {
        "callback": (callback, "the pass"),
        "interim": (interim, "the result so far"),
        "progress": (progress, "number and step"),
    }
    for name, (hook, of) in told.items():
        if hook is not None and not callable(hook):
            raise ValueError(f"{name} must be a function of {of}, or None; got {hook!r}.")
