"""The loop: solve, estimate, relocate, and stop when it is enough."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from .chains import Curve
from .growth import Growth
from .improvement import Improvement, Settings
from .journal import Ending, Journal, StepFailed
from .limits import Limits
from .outputs import Output, check_outputs, output_value
from .problem import Problem, check_problem, energy_norm, estimate, norm_of, solve
from .relocation import guarded_map
from .result import AdaptResult, Pass, Status
from .schedule import Schedule, check_training, is_count
from .stopping import StopTest, failed, interrupted, not_moved, remarked

__all__ = ["adapt"]

# The measured best of the topologies.
_TOPOLOGY = "recycle"

# How a loop ends that nothing has cut short.
_AT_ITS_END = (Status.MAX_PASSES, Status.STALLED, Status.NOT_MOVED)

_NUMBERS = (int, float, np.integer, np.floating)


def adapt(
    mesh: MeshTri,
    problem: Problem,
    *,
    passes: int = 4,
    rtol: float | None = None,
    atol: float | None = None,
    schedule: Schedule | None = None,
    topology: str | None = None,
    min_quality: float = 0.3,
    pinned: Sequence[int | str] | NDArray[np.integer] | str = (),
    seed: int = 0,
    callback: Callable[[Pass], Any] | None = None,
    polish: bool = True,
    target_nodes: int | None = None,
    curves: Mapping[str, Curve] | None = None,
    periodic: Sequence[tuple[str, str]] = (),
    layers: Mapping[str, int] | None = None,
    outputs: Mapping[str, Output] | None = None,
    output_rtol: float | None = None,
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
        indicators of the input mesh have the wrong shape or are not finite numbers >= 0, or an output of it is not one
        finite number.
    Exception
        Whatever the problem or an output raises on the input mesh, Ctrl-C included. Later that ends the loop, with the
        status ``FAILED`` and the exception in ``AdaptResult.error``, or ``STOPPED`` for Ctrl-C.

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
    _check_loop(passes, rtol, atol, callback, polish)
    outputs = check_outputs(outputs, output_rtol)
    check_training(schedule, seed)
    limits = Limits(topology, min_quality, pinned, curves, periodic, layers)
    guarded_map(mesh, limits)  # refuses what it would refuse later, before the first solve
    check_problem(problem, rtol)
    growth = Growth.of(mesh, target_nodes, passes)
    improvement = Improvement(problem, Settings(schedule, limits, seed, polish))
    journal = Journal(norm_of(problem))
    stop = StopTest(passes, rtol, atol, output_rtol, callback)
    try:
        ending = _loop(mesh, problem, outputs, improvement, growth, stop, journal)
    except KeyboardInterrupt:
        if not journal.history:
            raise
        ending = interrupted(journal)
    except StepFailed as failure:
        ending = failed(journal, failure)
    ending = remarked(ending, improvement.remark)
    if ending.status in _AT_ITS_END:
        ending = remarked(ending, growth.shortfall(journal.history[-1].mesh.p.shape[1]))
    return journal.result(ending)


def _loop(
    mesh: MeshTri,
    problem: Problem,
    outputs: Mapping[str, Output],
    improvement: Improvement,
    growth: Growth,
    stop: StopTest,
    journal: Journal,
) -> Ending:
    """Solve, estimate, stop or relocate and polish, and again."""
    move = None
    while True:
        with journal.timed("solve"):
            solution = solve(problem, mesh, *journal.last)
        with journal.timed("estimate"):
            indicators = estimate(problem, mesh, solution)
            energy = energy_norm(problem, mesh, solution)
            functional = improvement.functional(mesh, solution)
        values = {}
        for name, function in outputs.items():
            with journal.timed("estimate", f"output {name!r}"):
                values[name] = output_value(name, function, solution)
        journal.record(mesh, solution, indicators, energy, functional, values, improvement.comparable, move)
        growing = growth.goes_on(journal.number - 1)
        if ending := stop(journal, move, growing):
            return ending
        with journal.timed("relocate"):
            trained = improvement.train(mesh, indicators, journal.number, growth.nodes(journal.number))
        with journal.timed("polish"):
            gain = improvement.polish(trained)
        with journal.timed("relocate"):
            move = trained.relocation(gain)
        if _same(mesh, move.mesh) and not growth.goes_on(journal.number):
            return not_moved(journal, move)
        mesh = move.mesh


def _same(before: MeshTri, after: MeshTri) -> bool:
    """Whether nothing moved and nothing flipped: then there is nothing to solve again."""
    return np.array_equal(before.p, after.p) and np.array_equal(_triples(before), _triples(after))


def _triples(mesh: MeshTri) -> NDArray[np.integer]:
    return np.unique(np.sort(mesh.t, axis=0), axis=1)


def _check_loop(passes: Any, rtol: Any, atol: Any, callback: Any, polish: Any) -> None:
    if not is_count(passes):
        raise ValueError(f"passes must be an integer >= 0; got {passes!r}.")
    for name, value in (("rtol", rtol), ("atol", atol)):
        if value is not None and not (isinstance(value, _NUMBERS) and 0.0 <= value < np.inf):
            raise ValueError(f"{name} must be a finite number >= 0, or None; got {value!r}.")
    if callback is not None and not callable(callback):
        raise ValueError(f"callback must be a function of the pass, or None; got {callback!r}.")
    if not isinstance(polish, bool | np.bool_):
        raise ValueError(f"polish must be True or False; got {polish!r}. Polish alone: kohonen_adapt.polish.")
