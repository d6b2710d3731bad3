"""Adapt a mesh to a problem: solve, estimate, relocate and polish, until it is enough."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any

from skfem import Mesh

from kohonen_adapt.checks import with_nearest_names
from kohonen_adapt.kernels.compilation import expect
from kohonen_adapt.loop.checkpoint import Checkpoint
from kohonen_adapt.loop.growth import Growth
from kohonen_adapt.loop.history import History
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.rooms import ROOMS
from kohonen_adapt.loop.settings import PASSES, Settings
from kohonen_adapt.loop.step import Adaptation
from kohonen_adapt.loop.steps import Steps
from kohonen_adapt.loop.stopping import StopTest
from kohonen_adapt.mesh.cells import cell_of
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.outline.more_layers import with_layers
from kohonen_adapt.outline.rules import LeastQuality, Pinned, Rules, check_for, holding
from kohonen_adapt.outline.surfaces import Surface
from kohonen_adapt.problem.outputs import Output, check_outputs
from kohonen_adapt.problem.protocol import Problem, check_problem, curves_of, is_curved, nodes_held, order_of, pairs_of
from kohonen_adapt.som.schedule import Schedule

__all__ = ["adapt"]

TOPOLOGY = "recycle"  # the measured best
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
    passes: int = PASSES,
    rtol: float | None = None,
    atol: float | None = None,
    schedule: Schedule | None = None,
    topology: str | None = None,
    min_quality: LeastQuality = "auto",
    pinned: Pinned = (),
    seed: int = 0,
    callback: Callable[[Pass], Any] | None = None,
    polish: bool = True,
    target_nodes: int | None = None,
    curves: Mapping[str, Curve] | None = None,
    periodic: Sequence[Pair] | None = None,
    layers: Mapping[str, int] | None = None,
    surfaces: Mapping[str, Surface] | None = None,
    outputs: Mapping[str, Output] | None = None,
    output_rtol: float | None = None,
    interim: Callable[[AdaptResult], Any] | None = None,
    progress: Callable[[int, str], Any] | None = None,
    checkpoint: str | PathLike[str] | None = None,
) -> AdaptResult:
    """Adapt a mesh to a problem: nodes are moved and recycled to where the error is; how many there are is yours.

    Recycling renumbers nodes (`AdaptResult.nodes` tells how); `relocate`, and ``topology="flip"`` here, keep every one.
    A pass solves, estimates the error per element, and lets the Kohonen map learn the density that would make the
    error equal everywhere; then the polish moves nodes to where the energy of the solution, carried over, is lower, and
    recycles more of them by what their loss would cost and a new one gain.
    The mesh after the last pass is solved and estimated too, so `passes` relocations cost ``passes + 1`` solves. The
    result is the best mesh seen, the input included.

    Parameters
    ----------
    mesh
        Of triangles or of tetrahedra; it is not modified. The corners of a `skfem.MeshTri2` are moved, as `relocate`
        says.
    problem
        Anything with ``solve(mesh) -> solution`` and ``indicators(mesh, solution) -> (nelements,)``, error indicators
        of the energy norm, unsquared. Used where present: ``order`` (degree of the elements, 1), ``norm`` ("energy" or
        "L2": the norm in which the error is to be small), ``solve_from(mesh, old_mesh, old_solution)`` (in place of
        ``solve`` on every mesh but the first), ``energy_norm(mesh, solution) -> float``,
        ``calibrated`` (False: whether the indicators are near the error itself, so that the table may say so), and
        ``ritz(mesh, solution) -> kohonen_adapt.Ritz`` (the functional that the solution minimises; the polish needs
        it), ``pairs`` (its periodic and antiperiodic boundaries), ``points`` (names to places of nodes that stay), and
        ``curves(mesh)`` (what it knows to be round). ``curved`` (None): True asks for a `skfem.MeshTri2` where an
        outline is curved, from order 2 on, the input included, False for straight elements; None takes what `mesh` is.
    passes
        Number of relocations, at most; 0 solves and estimates the input.
    rtol, atol
        Stop when the estimate is at most ``atol + rtol * energy norm``; `rtol` needs the problem's ``energy_norm``.
    schedule
        How the map learns; None for the default, which fits itself to every pass. Of tetrahedra there are by default
        no stages, as in `relocate`: presenting points to them after recycling costs error. With a polish their third
        pass, and all after it, are left to the energy but while the mesh grows.
    topology, min_quality, pinned, curves, layers, surfaces
        What nodes may do: see `Rules`. ``topology=None`` takes the measured best, ``"recycle"``.
    periodic
        Pairs of boundaries that are one another's image: see `Rules`. None takes those of the problem, its ``pairs``;
        ``()`` means none.
    seed
        An integer >= 0. Every pass draws its training points from a seed of its own, made from this one.
    callback
        Called with every `Pass`, the input's first; returning True stops the loop. What it raises is not caught.
    polish
        Whether to descend the energy after the map. Where the problem has no ``ritz``, ``norm = "L2"``, coefficients
        that vary inside a region, or on tetrahedra elements of another degree than 1, there is no polish, and the
        message says so.
    target_nodes
        Grow to that many nodes by splitting edges, a share in every pass (edges around are flipped, with "fixed" too);
        names are kept. None keeps their number. The last of several passes adds none, so that the estimate that places
        its nodes knows as many; with a polish of order 1 in the plane, which puts right what fewer misplace, it adds
        two thirds of them at most, and none up to 500. Where the quality rule allows no further split there are fewer,
        and the message says so. Of tetrahedra nothing is swapped for it with "fixed".
    outputs
        Name to a function of the solution that returns a finite float. Every `Pass` carries the values, and the table
        shows them with their changes. Where a run stalls and the problem has better values to compare with
        (``improved``), the message says what is worse than on the input.
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
        mesh again, and the best one if that is another; if this one fails, the last pass is the result. A linear
        problem then has the same history and the same result, bit for bit, as without a break; a nonlinear one to the
        accuracy of its solver.

    Returns
    -------
    AdaptResult
        The best pass, never worse than the input: the one of the lowest Ritz functional where the polish can compare
        passes, else by estimate (with ``norm = "L2"`` by the square root of the sum of ``|K|`` times the squared
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
    stop, steps = StopTest(passes, rtol, atol, output_rtol, callback), Steps(progress)
    check_problem(problem, rtol)
    check_mesh(mesh, bent=True, folded=True, space=True)
    room = ROOMS[cell_of(mesh).dim]
    round_, pairs = curves_of(problem, mesh, curves), pairs_of(problem) if periodic is None else periodic
    rules = Rules(TOPOLOGY if topology is None else topology, min_quality, pinned, round_, pairs, layers, surfaces)
    check_for(rules, room.dim)
    rules = holding(rules.guarded(), nodes_held(problem, mesh))
    growth = Growth.of(int(mesh.nvertices), target_nodes, passes, polish and room.corrects(problem))
    settings = Settings(rules, schedule, seed, polish, growth, check_outputs(outputs, output_rtol), rtol)
    mesh = with_layers(mesh, rules, grows=growth.target > growth.start)
    movable = room.taken_apart(mesh, rules, is_curved(problem))
    kept = Checkpoint.at(checkpoint, mesh, problem, settings)
    expect(*room.loops(problem, settings))
    adaptation = Adaptation(problem, room, movable, settings, steps, order_of(problem))
    return adapted(adaptation, History(adaptation, stop, kept, interim))


def adapted(adaptation: Adaptation, history: History) -> AdaptResult:
    """Solve and estimate; until it is enough relocate, polish, and solve and estimate again."""
    movable = adaptation.movable
    with history.ending_kept():
        solved = history.resumed() or history.add(adaptation.assess())
        while history.goes_on:
            moved = adaptation.relocate(solved)
            moved, gain = adaptation.polish(solved, moved)
            if moved.changed(movable) or history.growing:
                solved = history.add(adaptation.assess(solved, moved, gain))
            else:
                history.end_unmoved(moved.work(movable, gain))
    return history.result()
