"""Polish: move nodes to where the energy of the mesh's own solution is lower, which is where its error is lower."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.checks import check_count
from kohonen_adapt.kernels.arrays import Constraints, Trial
from kohonen_adapt.kernels.compilation import expect
from kohonen_adapt.kernels.ordering import along_curve, mark_deep
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.kernels.triangle.descend import descend_flips, descend_nodes, mark_gainful
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.rules import Pinned, Rules, holding
from kohonen_adapt.outline.surgery import Recycled
from kohonen_adapt.polishing.energy_recycling import recycle_by_energy
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.problem.protocol import NotOffered, Problem, nodes_held, offered, offers, order_of, ritz_of

__all__ = ["PLAN", "SWEEPS", "descend", "descend_and_recycle", "polish"]

FEW = 5_000  # elements that are not worth another thread
PART = 5_000  # nodes: those at the cuts between parts are few

# Four passes of map and polish, medians of five seeds (`python -m benchmarks sweeps`), after so many sweeps each:
#                                    0       4       8      12      16      32
#     L: E sqrt(N), N = 3201     0.794   0.735   0.730   0.728   0.728   0.726
#     M: error %, N = 1681       7.059   6.480   6.434   6.423   6.417   6.419
#     the same with iron         5.128   4.707   4.657   4.642   4.639   4.630
#     F: E sqrt(N), N = 3201     0.966   0.707   0.678   0.669   0.664   0.657
# A sweep takes 0.6 microseconds per node; with eight, polish and recycling together cost no more than the map.
SWEEPS = 8

# As many with recycling by energy between them. The more calls the lower the error, by 1 % on F from two to three.
PLAN = (2, 2, 2, 2)
KNOWN = 2  # sweeps after which elements are asked again for a flux that varies
SETTLED = 0.01  # share of the nodes: a call that makes fewer is the last of its pass


def polish(
    mesh: MeshTri,
    problem: Problem,
    *,
    sweeps: int = SWEEPS,
    topology: str = "flip",
    min_quality: float = 0.3,
    pinned: Pinned = (),
    seed: int = 0,
    curves: Mapping[str, Curve] | None = None,
    periodic: Sequence[Pair] = (),
    layers: Mapping[str, int] | None = None,
) -> MeshTri:
    """Move nodes to where the Ritz functional of the mesh's own solution is lower; the error follows.

    For ``Pi(u) = int coefficient / 2 |grad u|^2 - source u - flux . grad u``, or with the energies of nonlinear laws,
    the discrete solution lies above the exact minimum by half the square of its error in the energy norm. A sweep moves
    every node in turn, by Newton's method with its own value eliminated, to where the functional of the elements around
    it is lower, and flips every edge whose flip lowers it. What a sweep leaves is a function on the new mesh with a
    lower functional, so the solution on that mesh has a lower one still: the error has not grown.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`; it is not modified. It is solved on once.
    problem
        Anything with ``solve(mesh) -> solution`` and ``ritz(mesh, solution) -> kohonen_adapt.Ritz``, with P1 elements.
    sweeps
        How often every node may move.
    topology
        ``"flip"``: edges flip where that lowers the functional, and the result need not be Delaunay; ``"fixed"`` keeps
        ``mesh.t``.
    min_quality, pinned, curves, periodic, layers
        What nodes may do: see `Rules`. Nodes on arcs and splines, and on periodic boundaries, stay where they are.
    seed
        An integer >= 0, as everywhere; nothing here is random.

    Returns
    -------
    MeshTri
        With the same number of nodes and the same names: nodes never leave their region, outlines keep their shape.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri`, an argument is out of range, the problem has no ``ritz`` or elements
        of a degree other than 1, or its constants change inside a region of the mesh.

    Notes
    -----
    Nodes on curves, and those whose given values are not linear along their piece of outline, stay where they are:
    elsewhere the mesh would have another set of admissible functions, and a lower functional would say nothing about
    the error. Energies of nonlinear material are looked up in tables, which makes that true to 1e-10 of the functional.

    The descent of nodal positions by the energy is that of P. Thoutireddy and M. Ortiz, "A variational r-adaption and
    shape-optimization method for finite-deformation elasticity", Int. J. Numer. Meth. Engng 61 (2004).

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
    >>> mesh = skfem.MeshTri().refined(4).with_subdomains({"coil": lambda x: x[0] < 0.5, "air": lambda x: x[0] > 0.5})
    >>> mesh = mesh.with_boundaries({"outer": lambda x: x[0] < 2.0})
    >>> coil = Material(current_density=1e6)
    >>> problem = Magnetostatics({"coil": coil, "air": Material()}, potential={"outer": 0.0})
    >>> better = ka.polish(mesh, problem)
    >>> problem.solve(better).energy > problem.solve(mesh).energy  # nearer to the exact field's, from below
    True
    """
    check_polish(problem, sweeps, topology, seed)
    rules = Rules(topology, min_quality, pinned, curves, periodic, layers).guarded()
    movable = MovableMesh.of(mesh, holding(rules, nodes_held(problem, mesh)))
    expect("polish")
    try:
        ritz = ritz_of(problem, mesh, problem.solve(mesh))
    except NotOffered as reason:
        raise without_functional(reason) from None
    functional = Functional.of(ritz, movable)
    descend(movable, functional, functional.values.copy(), functional.fixed.copy(), sweeps)
    return movable.mesh()


def check_polish(problem: Problem, sweeps: object, topology: object, seed: object) -> None:
    """Refuse a problem that has no functional to descend, sweeps that cannot be counted, and what polish cannot do."""
    if topology not in ("fixed", "flip"):
        raise ValueError(f"topology must be 'fixed' or 'flip', for polish keeps every node; got {topology!r}.")
    check_count("seed", seed)
    check_count("sweeps", sweeps)
    if not offers(problem, "solve"):
        raise ValueError(f"polish needs a problem with the method solve(mesh); {type(problem).__name__} has none.")
    try:
        offered(problem, "ritz")
    except NotOffered as reason:
        raise without_functional(reason) from None
    if order_of(problem) != 1:
        raise ValueError(f"polish needs elements of degree 1; the problem says order = {order_of(problem)!r}.")


def without_functional(reason: NotOffered) -> ValueError:
    """The error of a problem that has nothing to lower, for this reason."""
    return ValueError(f"polish needs the functional of the problem, which offers none: {reason}.")


def descend_and_recycle(
    movable: MovableMesh,
    functional: Functional,
    values: Floats,
    fixed: Mask,
    recycled: Recycled,
    plan: Sequence[int] = PLAN,
) -> tuple[Recycled, float]:
    """Sweep as often as the plan says, and between two of its numbers recycle nodes by energy.

    Returns what was recycled in all, that of before included, and what moves, flips and recycling took off the
    functional. A plan of one number keeps all nodes.
    """
    eager = goes_on = len(plan) > 1
    gain = descend(movable, functional, values, fixed, plan[0], eager)
    for sweeps in plan[1:]:
        if goes_on:
            done = recycled.splits
            values, fixed, recycled, lowered = recycle_downhill(movable, functional, values, fixed, recycled)
            gain, goes_on = gain + lowered, recycled.splits - done > SETTLED * movable.nnodes
        gain += descend(movable, functional, values, fixed, sweeps, eager)
    return recycled, gain


def descend(
    movable: MovableMesh, functional: Functional, values: Floats, fixed: Mask, sweeps: int = SWEEPS, eager: bool = False
) -> float:
    """Sweep nodes and edges of a mesh downhill from the nodal values (n,), which change with them.

    Edges come after nodes in every sweep; an `eager` one begins with them, so that nodes of no use are seen sooner.
    Returns what moves and flips took off the functional; what better values alone gained is not in it. Where the flux
    varies, what elements know of it holds near where they were: it is worked out again after a few sweeps, which are
    undone if they have not lowered the functional, as where the flux jumps inside a region.
    """
    if not functional.varies:
        return sweep(movable, functional, values, fixed, sweeps, eager)
    total = 0.0
    for done in range(0, sweeps, KNOWN):
        state, old = {name: array.copy() for name, array in movable.state().items()}, values.copy()
        before = functional.value(movable.triangulation, values)
        gain = sweep(movable, functional, values, fixed, min(KNOWN, sweeps - done), eager)
        fallen = before - functional.value(movable.triangulation, values)
        if not fallen > 0.0:
            movable.restore(state)
            values[:] = old
            break
        total += min(gain, fallen)
    return total


def recycle_downhill(
    movable: MovableMesh, functional: Functional, values: Floats, fixed: Mask, recycled: Recycled
) -> tuple[Floats, Mask, Recycled, float]:
    """Recycle by energy as `recycle_by_energy` says; where the flux varies undone as in `descend`."""
    if not functional.varies:
        return recycle_by_energy(movable, functional, values, fixed, recycled)
    state, before = movable.state(), functional.value(movable.triangulation, values)
    found = recycle_by_energy(movable, functional, values, fixed, recycled)
    fallen = before - functional.value(movable.triangulation, found[0])
    if fallen > 0.0:
        return (*found[:3], min(found[3], fallen))
    movable.restore(state)
    return values, fixed, recycled, 0.0


def sweep(movable: MovableMesh, functional: Functional, values: Floats, fixed: Mask, sweeps: int, eager: bool) -> float:
    """The sweeps of `descend`, by what elements know of the functional where they are now."""
    triangulation, outline = movable.triangulation, movable.outline
    constraints = outline.constraints._replace(kind=functional.kinds(outline, fixed))
    twins = constraints.twins.partner >= 0  # one value on two sides, which a star on one side cannot judge
    trial = functional.trial(triangulation, values, fixed | twins)
    order, gain = along_curve(triangulation.position).astype(np.int32), 0.0
    part = parts_along(order)
    if eager:
        gain += flip_downhill(movable, trial)
    for _ in range(sweeps):
        gain += descend_in_parts(triangulation, constraints, trial, order, part, movable.floor)
        gain += flip_downhill(movable, trial)
    return gain


def parts_along(order: NDArray[np.int32]) -> NDArray[np.int32]:
    """The part of the mesh that each node belongs to, (n,): stretches of the order, numbered along it."""
    part, parts = np.empty_like(order), max(1, len(order) // PART)
    part[order] = np.arange(len(order), dtype=np.int64) * parts // len(order)
    return part


def descend_in_parts(
    triangulation: Triangulation,
    constraints: Constraints,
    trial: Trial,
    order: NDArray[np.int32],
    part: NDArray[np.int32],
    floor: float,
) -> float:
    """One sweep over the nodes: threads take parts of the mesh side by side, and what lies at their cuts comes last.

    A move depends on the neighbours alone; where these are all of a node's own part, no other thread has a say. So what
    comes out does not depend on the number of threads.
    """
    position, star, parts = triangulation.position, triangulation.star, int(part[order[-1]]) + 1
    deep = np.empty(len(order), dtype=np.bool_)
    mark_deep(star, part, 1, deep, np.empty_like(order))
    alone = deep[order]
    inside, across = order[alone], order[~alone]
    cuts = np.searchsorted(part[inside], np.arange(parts + 1))
    gains = np.zeros(parts + 1)

    def task(thread: int, first: int, last: int) -> None:
        for i in range(first, last):
            nodes = inside[cuts[i] : cuts[i + 1]]
            gains[i] = descend_nodes(position, star, constraints, trial, nodes, floor)

    shared(task, even_cuts(parts, 1))
    gains[parts] = descend_nodes(position, star, constraints, trial, across, floor)
    return float(gains.sum())


def flip_downhill(movable: MovableMesh, trial: Trial) -> float:
    """One sweep over the edges, where they may flip; returns what that took off the functional.

    Threads find the edges whose flip would gain; the flips, which are few, come one after the other.
    """
    if not movable.flips:
        return 0.0
    triangulation, floor = movable.triangulation, movable.floor
    position, elements = triangulation.position, triangulation.elements
    gainful = np.empty(len(elements.node), dtype=np.bool_)
    cuts = even_cuts(len(gainful), FEW)
    shared(lambda thread, first, last: mark_gainful(position, elements, trial, first, last, gainful), cuts)
    gain, flips = descend_flips(position, elements, trial, floor, gainful)
    if flips:
        triangulation.refill_star()
    return gain
