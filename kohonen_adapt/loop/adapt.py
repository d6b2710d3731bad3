"""Adaptive loop of solving, estimating, relocating and polishing."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from skfem import Mesh

from kohonen_adapt.arrays import FilePath
from kohonen_adapt.checks import check_hook, with_nearest_names
from kohonen_adapt.geometry.plane.curves import Curves
from kohonen_adapt.geometry.rules import LeastQuality, Pinned, Rules
from kohonen_adapt.geometry.space.surfaces import NamedSurfaces
from kohonen_adapt.loop.checkpoint import Checkpoint
from kohonen_adapt.loop.final_order import raise_order
from kohonen_adapt.loop.passes import Pass, StepFailed, Steps, work_of
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.settings import Settings, Tolerance
from kohonen_adapt.loop.setup import aimed, check_goal, graded, node_counts, rules_for, stop_test
from kohonen_adapt.loop.state import UNSOLVED, Solved, State
from kohonen_adapt.loop.step import Adaptation
from kohonen_adapt.loop.stopping import (
    StopTest,
    ending_so_far,
    failed_ending,
    outcome,
    stay_ending,
    with_errors,
    with_worse_outputs,
)
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.problem.evaluation import Output, check_outputs, solve_again
from kohonen_adapt.problem.protocol import Problem, checked_problem
from kohonen_adapt.som.schedule import Schedule

TOPOLOGY = "recycle"  # smallest errors in the benchmarks
SYNONYMS = {
    "iterations": "passes",
    "steps": "passes",
    "tol": "rtol",
    "tolerance": "rtol",
    "nodes": "target_nodes",
    "fixed": "pinned",
    "pairs": "periodic",
    "folder": "checkpoint",
}


@with_nearest_names(SYNONYMS)
def adapt(
    mesh: Mesh,
    problem: Problem,
    *,
    passes: int | None = None,
    rtol: float | None = None,
    target_nodes: int | None = None,
    pinned: Pinned = (),
    curves: Curves | None = None,
    outputs: Mapping[str, Output] | None = None,
    atol: float | None = None,
    output_rtol: float | Mapping[str, float] | None = None,
    polish: bool = True,
    surfaces: NamedSurfaces | None = None,
    periodic: Sequence[Pair] | None = None,
    layers: Mapping[str, int] | None = None,
    topology: str | None = None,
    min_quality: LeastQuality = "auto",
    schedule: Schedule | None = None,
    seed: int = 0,
    callback: Callable[[Pass], Any] | None = None,
    progress: Callable[[int, str], Any] | None = None,
    interim: Callable[[AdaptResult], Any] | None = None,
    checkpoint: FilePath | None = None,
    max_nodes: int | None = None,
    goal_rtol: float | None = None,
    anisotropic: bool | str = "auto",
) -> AdaptResult:
    """Adapt a mesh to a problem until the error is within a tolerance.

    A pass solves the problem, estimates the error of every element, relocates the nodes by a Kohonen map towards equal
    errors of all elements, and polishes: nodes move, and are recycled, to lower the energy of the solution interpolated
    onto the moved mesh. The mesh after the last pass is solved and estimated as well, so `passes` relocations cost
    ``passes + 1`` solves. After a pass that is worse than the best pass, the next pass starts from the best mesh and
    lowers the energy alone, without the map. The result is the best mesh of the run, the input included.

    Most runs need the first six keywords at most. By purpose:

    - accuracy: `passes`, `rtol`, `atol`, `output_rtol`, `goal_rtol`, `polish`
    - number of nodes: `target_nodes`, `max_nodes`
    - positions of nodes: `pinned`, `curves`, `surfaces`, `periodic`, `layers`, `topology`, `min_quality`, `schedule`,
      `anisotropic`, `seed`
    - records and display: `outputs`, `callback`, `progress`, `interim`, `checkpoint`

    Parameters
    ----------
    mesh
        Mesh of triangles or tetrahedra, not modified. The corners of a `skfem.MeshTri2` are moved, see `relocate`.
    problem
        Object with the methods ``solve(mesh) -> solution`` and ``indicators(mesh, solution) -> (nelements,)``,
        unsquared error indicators in the energy norm. The optional methods and attributes are listed in `Problem`.
    passes
        Maximum number of relocations, by default 12 with a tolerance and 4 without. With 0 the input is solved and
        estimated only. A single pass that is worse than the input is followed by a pass without the map.
    rtol
        Relative tolerance. The loop stops if the estimate is at most ``atol + rtol * energy norm``. The problem needs
        the method ``energy_norm``. Without `target_nodes` the number of nodes follows the tolerance, up and down by at
        most a factor of 3 per pass: with equal indicators of degree p in d dimensions ``(sum eta^(2d / (d + 2p)))^((d +
        2p) / 2p) / tolerance^(d / p)`` elements suffice. A problem with `orders` whose order is "auto", the default of
        `Magnetostatics`, gets layers at corners and a higher order where these take less time.
    target_nodes
        Number of nodes to grow to, by splitting edges in every pass. None without a tolerance keeps the number. Usually
        the last of several passes adds no nodes, so that the estimate that places its nodes has as many. With a polish
        at order 1 on triangles, which corrects misplaced nodes, the last pass adds up to two thirds of the nodes, and
        none below 500 nodes. If the quality rule forbids further splits, the mesh stays smaller and the message gives
        the reason. Splits flip triangle edges nearby even with ``topology="fixed"``, but swap no tetrahedra.
    pinned
        Nodes that stay where they are, as node numbers and names of boundaries and subdomains, see `Rules`.
    curves
        Curves of named boundaries, on which their nodes slide, for triangles, see `Rules`.
    outputs
        Functions of the solution by name, each returning a finite float. Every `Pass` contains the values, and the
        table shows the values with their changes. Beside a goal the best pass contains their estimated errors. If a
        run stalls, the message lists the outputs that are less accurate than on the input, provided that the problem
        has the method ``improved``.
    atol
        Absolute tolerance, added to that of `rtol`.
    output_rtol
        Relative tolerance of the outputs, one fraction or a mapping from name to fraction. The loop stops if the
        estimated errors of the outputs are at most these fractions of their values. The method ``improved`` of the
        problem estimates them, or else the difference from a pass with half the unknowns. With several tolerances all
        must be met. An output that is zero, such as a force across a symmetry, never meets its tolerance: the loop
        stops, and the mapping has to leave it out. A problem with ``aimed_at`` may take the only output for its goal.
    polish
        True to lower the energy after the map (energy descent). Without ``ritz``, with ``norm = "L2"`` unless the
        indicators are ``calibrated``, or with coefficients that vary inside a region, there is no polish, and the
        message gives the reason.
    surfaces
        Surfaces of named boundaries of tetrahedra, see `Rules`.
    periodic
        Pairs of periodic boundaries, see `Rules`. None means ``pairs`` of the problem, ``()`` means no pairs.
    layers
        Numbers of element layers to preserve across thin subdomains, see `Rules`.
    topology
        ``"recycle"``, ``"flip"`` or ``"fixed"``, see `Rules`. None means ``"recycle"``, which renumbers the nodes (see
        `AdaptResult.nodes`) and gives the smallest errors.
    min_quality
        Minimum quality of elements, see `Rules`.
    schedule
        Schedule of the map. None means the default, which depends on every pass. For tetrahedra the default has sweeps
        and no stages, because training points after recycling increase the error. With a polish, only the first two
        passes on tetrahedra are relocated by the map, and all passes that add nodes.
    seed
        Seed >= 0 of all random numbers. Every pass derives a seed from it.
    callback
        Function called with every `Pass`, the input first. Returning True stops the loop. Exceptions are not caught.
    progress
        Function called with the pass number and the name of a step at its beginning: "relocate", "polish", "solve",
        "estimate", "checkpoint" or "solve again". Exceptions are not caught.
    interim
        Function called after every pass with the result so far, for example to save the result of a long run.
        Exceptions are not caught.
    checkpoint
        Folder, created if missing, for a file per finished pass. If the folder has passes of this run, the loop resumes
        after the last of them. Mesh and arguments must be the same, except those that end the loop; `passes` may differ
        without `target_nodes`, and so may a tolerance, or an order above 3. The callback is called again for every
        stored pass. The mesh of the last pass, and of the best one if different, is solved again; if the latter fails,
        the last pass is the result. For a linear problem history and result are identical, bit for bit, to those of an
        uninterrupted run, for a nonlinear problem up to the accuracy of the solver.
    goal_rtol
        Relative tolerance of the goal of the problem. The loop stops if its ``goal_error`` is at most this fraction of
        its value.
    anisotropic
        True to give elements the directions of the solution, by the metric of `metric_from_hessian` or of the method
        ``metric`` of the problem. ``"auto"`` takes a metric of the problem, and recovered directions if the values of
        the solution are known and, in the plane, directions promise to lower the error by a tenth. It does neither
        with a goal nor with ``topology="fixed"``, on tetrahedra not with a tolerance. False gives elements the same
        length in all directions before the polish.
    max_nodes
        Largest number of nodes that a tolerance leads to, by default 200 000.

    Returns
    -------
    AdaptResult
        Best pass, with history, status and message. The best pass has the lowest Ritz functional if the polish makes
        passes comparable, else the least estimate (with ``norm = "L2"`` the square root of the sum of the squared
        indicators times ``|K|^(2/d)``). It is never worse than the input, except if only the last pass meets the
        tolerances, which is the result then. Printing the result shows a table.

    Raises
    ------
    ValueError
        If an argument is out of range, if the mesh has fewer layers than requested, if the problem lacks a method, if
        the indicators of the input mesh have the wrong shape or are not finite numbers >= 0, if an output is not one
        finite number, or if the passes in `checkpoint` are damaged, or of another run or problem.
    OSError
        If `checkpoint` cannot be read. A failure to write ends the loop like other failures.
    Exception
        Exceptions of the problem and the outputs on the first mesh, and Ctrl-C. Later exceptions end the loop with the
        status ``FAILED`` and the exception in ``AdaptResult.error``, and Ctrl-C with the status ``STOPPED``.

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
    asked = Tolerance(rtol, atol, output_rtol, goal_rtol)
    stop = stop_test(mesh, passes, asked, target_nodes, callback, max_nodes)
    checked = checked_problem(problem, rtol)
    check_goal(checked, goal_rtol, outputs)
    check_mesh(mesh, inverted=True)
    given = Rules(TOPOLOGY if topology is None else topology, min_quality, pinned, curves, (), layers, surfaces)
    rules = rules_for(checked, mesh, given, periodic)
    functions = check_outputs(outputs, output_rtol)
    checked = aimed(checked, functions, stop)
    stop, in_passes = graded(stop, checked, mesh.dim())
    growth = node_counts(in_passes, mesh, rules, target_nodes, stop)
    settings = Settings(rules, schedule, seed, polish, growth, functions, anisotropic, asked)
    adaptation = Adaptation.of(mesh, in_passes, settings, Steps(progress))
    files = Checkpoint.at(checkpoint, adaptation.movable.input_mesh, checked, settings)
    return Loop(adaptation, stop, files, interim).run()


@dataclass
class Loop:
    """Passes of one run, from the input to the result.

    The input is solved and estimated. Every step then moves the nodes of the last or the best pass to the density of
    equal errors, transfers the solution, polishes, and solves and estimates again, until the stop test gives a reason
    to end. A solve of a higher order on layers at corners is a step like the others, after the passes that grade the
    mesh for it.

    Attributes
    ----------
    adaptation
        Steps of a pass, with the mesh that they change.
    stop
        Test for the end, called once for every pass.
    checkpoint
        Files of the passes, or None.
    interim
        Function called after every pass with the result so far, or None.
    state
        Passes so far, with the solutions of the last and the best one.
    """

    adaptation: Adaptation
    stop: StopTest
    checkpoint: Checkpoint | None
    interim: Callable[[AdaptResult], Any] | None
    state: State = field(init=False)

    def __post_init__(self) -> None:
        check_hook("interim", self.interim, "the result so far")

    def run(self) -> AdaptResult:
        with self.catching_failures():
            if not self.resume():
                self.add(State.first(self.adaptation.assess()))
            while not self.state.ending or self.stop.wants_order(self.state):
                self.step()
        result = self.result()
        if self.state.raised and self.interim:
            self.interim(result)
        return result

    def step(self) -> None:
        if self.state.ending:
            self.solve_best()
            self.state = with_errors(self.adaptation, self.state)
            self.state = raise_order(self.adaptation, self.stop, self.state)
            return
        start, adaptation = self.start(), self.adaptation
        moved = adaptation.relocate(start, by_energy=self.state.returns_to_best)
        moved = adaptation.polish(start, moved)
        if moved.changed(adaptation.movable) or self.growing:
            self.add(self.state.with_pass(adaptation.assess(start, moved)))
        else:
            self.state = self.state.ended(stay_ending(self.state, work_of(moved, adaptation.movable)))

    def start(self) -> Solved:
        """Return the pass from which the next pass starts, and restore its mesh."""
        if not self.state.returns_to_best:
            return self.state.last
        best = self.state.best
        self.adaptation.movable.restore(best.movable.state())
        if best.solution is UNSOLVED:
            self.solve_again(best)
        return self.state.best

    def add(self, state: State) -> None:
        """Set the state, report and store its last pass, and test for the end."""
        self.state, steps = state, self.adaptation.steps
        steps.has_solved = True
        if self.interim:
            self.solve_best()
            self.interim(self.state.result(ending_so_far("Interim result", self.state)))
        if self.checkpoint:
            record = state.last.record
            with steps("checkpoint", f"checkpoint of pass {record.number}", record.number):
                self.checkpoint.write(record, self.adaptation.movable)
        self.terminate()

    def terminate(self) -> None:
        self.adaptation.steps.next_pass(len(self.state.passes))
        stalled = self.adaptation.method.stalls(self.state.passes)
        self.state = self.stop(self.state, self.growing, stalled)

    @property
    def growing(self) -> bool:
        return self.adaptation.settings.growth.grows_after(len(self.state.passes) - 1)

    def resume(self) -> bool:
        """Read the passes of the checkpoint, and solve again on the last mesh."""
        movable, begun = self.adaptation.movable, False
        for record in self.checkpoint.passes(movable) if self.checkpoint else ():
            begun, solved = True, Solved(record, UNSOLVED, None, movable.copy())
            self.state = self.state.with_pass(solved) if record.number else State.first(solved)
            self.terminate()
            if self.state.ending:
                return True
        if not begun:
            return False
        self.solve_again(self.state.last)
        return True

    def solve_again(self, known: Solved) -> None:
        """Solve on the mesh of a pass of an earlier process, which is the current mesh."""
        with self.adaptation.steps("solve again", number=known.record.number):
            solved = self.adaptation.assess_again(known.record)
        self.adaptation.steps.has_solved = True
        self.state = self.state.with_solution(known, solved)

    def solve_best(self) -> None:
        state, steps = self.state, self.adaptation.steps
        best = state.best
        if best.solution is not UNSOLVED:
            return
        self.state = state.with_solution(best, state.last)  # the result if the solver fails
        with steps("solve again", number=best.record.number):
            solution = solve_again(self.adaptation.problem, best.record.mesh, best.record.indicators)
        steps.has_solved = True
        self.state = state.with_solution(best, replace(best, solution=solution))

    def result(self) -> AdaptResult:
        with self.catching_failures():
            self.solve_best()
        with self.catching_failures():
            self.state = with_errors(self.adaptation, self.state)
            self.state = with_worse_outputs(self.adaptation, self.state)
        return self.state.result(outcome(self.adaptation, self.state))

    @contextmanager
    def catching_failures(self) -> Iterator[None]:
        """Convert Ctrl-C and a failed step into an ending after the first solve."""
        try:
            yield
        except KeyboardInterrupt:
            if not self.adaptation.steps.has_solved:
                raise
            self.state = self.state.ended(ending_so_far("Stopped by Ctrl-C", self.state))
        except StepFailed as failure:
            self.state = self.state.ended(failed_ending(failure, self.state))
