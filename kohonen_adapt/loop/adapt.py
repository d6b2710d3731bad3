"""Adaptive loop of solving, estimating, relocating and polishing."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

from skfem import Mesh

from kohonen_adapt.checks import is_count, with_nearest_names
from kohonen_adapt.geometry.plane.curves import Curve
from kohonen_adapt.geometry.plane.surgery import with_layers
from kohonen_adapt.geometry.rules import LeastQuality, Pinned, Rules, check_for, with_pinned
from kohonen_adapt.geometry.space.surfaces import Surface
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.loop.checkpoint import Checkpoint
from kohonen_adapt.loop.dimension import method_of
from kohonen_adapt.loop.final_order import HIGH_ORDERS, GradingTolerance, run_to_order
from kohonen_adapt.loop.growth import MAX_NODES, Growth, GrowthByTolerance, NodeCounts
from kohonen_adapt.loop.history import History, run_loop
from kohonen_adapt.loop.method import Method
from kohonen_adapt.loop.passes import Pass, Steps
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.settings import PASSES, PASSES_TO_TOLERANCE, Settings, Tolerance
from kohonen_adapt.loop.step import Adaptation
from kohonen_adapt.loop.stopping import StopTest
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.problem.evaluation import Output, check_outputs, curves_of
from kohonen_adapt.problem.protocol import CheckedProblem, Problem, checked_problem
from kohonen_adapt.som.schedule import Schedule

__all__ = ["adapt"]

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

logger = logging.getLogger("kohonen_adapt")


@with_nearest_names(SYNONYMS)
def adapt(
    mesh: Mesh,
    problem: Problem,
    *,
    passes: int | None = None,
    rtol: float | None = None,
    target_nodes: int | None = None,
    pinned: Pinned = (),
    curves: Mapping[str, Curve] | None = None,
    outputs: Mapping[str, Output] | None = None,
    atol: float | None = None,
    output_rtol: float | Mapping[str, float] | None = None,
    polish: bool = True,
    surfaces: Mapping[str, Surface] | None = None,
    periodic: Sequence[Pair] | None = None,
    layers: Mapping[str, int] | None = None,
    topology: str | None = None,
    min_quality: LeastQuality = "auto",
    schedule: Schedule | None = None,
    seed: int = 0,
    callback: Callable[[Pass], Any] | None = None,
    progress: Callable[[int, str], Any] | None = None,
    interim: Callable[[AdaptResult], Any] | None = None,
    checkpoint: str | PathLike[str] | None = None,
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
        ``metric`` of the problem. ``"auto"`` does so if the values of the solution are known, and neither with
        a goal nor with ``topology="fixed"``, on tetrahedra not with a tolerance. False gives elements the same length
        in all directions before the polish.
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
    stop = stop_test(mesh, passes, Tolerance(rtol, atol, output_rtol, goal_rtol), target_nodes, callback, max_nodes)
    checked = checked_problem(problem, rtol)
    check_goal(checked, goal_rtol, outputs)
    check_mesh(mesh, curved=True, inverted=True, space=True)
    given = Rules(TOPOLOGY if topology is None else topology, min_quality, pinned, curves, (), layers, surfaces)
    rules = rules_for(checked, mesh, given, periodic)
    functions = check_outputs(outputs, output_rtol)
    if stop.max_nodes is not None:
        checked = aimed(checked, functions, stop.asked)
    method, grading = method_of(mesh), grading_for(checked, stop, mesh.dim())
    in_passes = checked.at_grading_order if grading else checked
    growth = node_counts(in_passes, method, mesh, rules, target_nodes, stop, grading)
    settings = Settings(rules, schedule, seed, polish, growth, functions, anisotropic, stop.asked)
    start = with_layers(mesh, rules, grows=growth.target > growth.start)
    movable = method.open(start, rules, in_passes.is_curved)
    files = Checkpoint.at(checkpoint, start, checked, settings)
    expect_kernels(method, in_passes, settings)
    adaptation = Adaptation(in_passes, method, movable, settings, Steps(progress), in_passes.order)
    history = History(adaptation, replace(stop, grading=grading), files, interim)
    if grading is None:
        return run_loop(adaptation, history)
    return run_to_order(adaptation, history, checked, stop, grading)


def rules_for(problem: CheckedProblem, mesh: Mesh, rules: Rules, periodic: Sequence[Pair] | None) -> Rules:
    pairs = problem.pairs if periodic is None else periodic
    rules = replace(rules, curves=curves_of(problem, mesh, rules.curves), periodic=pairs)
    check_for(rules, mesh.dim())
    return with_pinned(rules.guarded(), problem.nodes_on(mesh))


def grading_for(problem: CheckedProblem, stop: StopTest, dim: int) -> GradingTolerance | None:
    # None if the result has the order of the passes
    orders = problem.final_orders(stop.max_nodes is not None)
    return GradingTolerance(stop, orders, HIGH_ORDERS[dim]) if orders else None


def stop_test(
    mesh: Mesh,
    passes: int | None,
    tolerance: Tolerance,
    target_nodes: int | None,
    callback: Callable[[Pass], Any] | None,
    max_nodes: int | None,
) -> StopTest:
    follows = bool(tolerance) and target_nodes is None
    if follows and not any((tolerance.rtol, tolerance.atol, tolerance.output_rtol, tolerance.goal_rtol)):
        raise ValueError("a tolerance of 0 is never met; give one above 0, for instance rtol=1e-3, or target_nodes.")
    if max_nodes is not None and not follows:
        raise ValueError("max_nodes needs a tolerance (rtol or atol) and no target_nodes, which fixes the number.")
    if max_nodes is not None and (not is_count(max_nodes) or max_nodes < mesh.nvertices):
        raise ValueError(f"max_nodes must be at least the nodes of the mesh, {mesh.nvertices}; got {max_nodes!r}.")
    most_passes = (PASSES_TO_TOLERANCE if follows else PASSES) if passes is None else passes
    return StopTest(most_passes, tolerance, callback, (max_nodes or MAX_NODES) if follows else None)


def node_counts(
    problem: CheckedProblem,
    method: Method,
    mesh: Mesh,
    rules: Rules,
    target_nodes: int | None,
    stop: StopTest,
    grading: GradingTolerance | None,
) -> NodeCounts:
    start, removes = int(mesh.nvertices), rules.topology == "recycle"
    if stop.max_nodes is None:
        return Growth.of(start, target_nodes, stop.passes, method.corrects(problem))
    allowed = grading.aim if grading else stop.tolerance
    return GrowthByTolerance(start, stop.max_nodes, allowed, problem.order, method.dim, removes)


def check_goal(problem: CheckedProblem, goal_rtol: float | None, outputs: Mapping[str, Output] | None) -> None:
    if goal_rtol is not None and not problem.has_goal:
        raise ValueError(
            "goal_rtol requires a problem with a goal and its goal_error; use rtol or output_rtol instead."
        )
    if "goal" in (outputs or {}) and problem.has_goal:
        raise ValueError("outputs must not have the name 'goal' beside a goal of the problem; rename the output.")


def aimed(problem: CheckedProblem, outputs: Mapping[str, Output], tolerance: Tolerance) -> CheckedProblem:
    names = tolerance.only_outputs(outputs)
    if len(names) != 1 or not problem.has("aimed_at"):
        return problem
    found = CheckedProblem(problem.aimed_at(outputs[names[0]]))
    if found.given is not problem.given:
        logger.info("%s is the goal of the passes", names[0])
    return found


def expect_kernels(method: Method, problem: CheckedProblem, settings: Settings) -> None:
    expect(*method.moving_kernels(settings.rules.topology, settings.schedule))
    if settings.polish:
        expect(*method.polish_kernels(problem), *method.transfer_kernels)
