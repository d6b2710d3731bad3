"""Relocate: one mesh and a density in, one mesh with its nodes where the density wants them out."""

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTet, MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.kernels.arrays import Elements
from kohonen_adapt.kernels.compilation import expect
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of, check_kind
from kohonen_adapt.mesh.locate import find_elements
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.outline.more_layers import with_layers
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.movable_solid import MovableSolid
from kohonen_adapt.outline.numbering import numbered_along_curve
from kohonen_adapt.outline.rules import LeastQuality, Pinned, Rules
from kohonen_adapt.outline.surfaces import Surface
from kohonen_adapt.outline.surgery import Recycled, unchanged
from kohonen_adapt.som.moved import Moved, why_still
from kohonen_adapt.som.recycling import recycle_nodes, starts_of
from kohonen_adapt.som.schedule import Schedule, check_training, most_doublings
from kohonen_adapt.som.space import loops_in_space, move_in_space, report_surfaces
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import Density, density_of

logger = logging.getLogger("kohonen_adapt")

__all__ = ["loops_in_plane", "move", "relocate", "report_curves"]

# Logarithm of the mean load of a patch of nodes beyond which mass must still travel as far as it is wide.
MISMATCH = 0.6


def relocate(
    mesh: Mesh,
    density: ArrayLike | Callable[[Floats], ArrayLike],
    *,
    schedule: Schedule | None = None,
    topology: str = "flip",
    min_quality: LeastQuality = "auto",
    pinned: Pinned = (),
    seed: int = 0,
    curves: Mapping[str, Curve] | None = None,
    periodic: Sequence[Pair] = (),
    layers: Mapping[str, int] | None = None,
    surfaces: Mapping[str, Surface] | None = None,
) -> Mesh:
    """Move the nodes of a mesh to where a density wants them; every node is kept, and its number.

    A Kohonen map does it, of tetrahedra sweeps of smoothing with swaps of elements between them. `adapt` goes on from
    here: by default it recycles nodes, too.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`, a `skfem.MeshTri2` of which the corners are moved, or a `skfem.MeshTet`; it is not modified.
    density
        Wanted nodes per area or volume, up to a factor, >= 0 and not zero everywhere: (nelements,), or a callable of
        points x (2, n), in space (3, n), that returns (n,). Zeros are raised to 1e-6 of the largest value.
    schedule
        None takes `Schedule.default` with a start radius from how far the mesh is from the density, so that calling
        again and again, each time on a fresh estimate, goes on improving. ``Schedule(())`` moves nothing; with
        ``topology="flip"`` it makes each region constrained Delaunay. Of tetrahedra there are by default 8
        sweeps with "flip", 6 with "fixed" and 3 with "recycle"; stages are presented before them only where a schedule
        has some, rounds are refused. Without either they are only swapped, for the best least quality, and recycled.
    topology, min_quality, pinned, curves, periodic, layers, surfaces
        What nodes may do: see `Rules`. With ``topology="recycle"`` nodes do not keep their numbers.
    seed
        The same seed gives the same mesh, bit for bit, on one type of CPU.

    Returns
    -------
    MeshTri or MeshTet
        With the same number of nodes and the same names: nodes never leave their region, outlines keep their shape. Of
        a `skfem.MeshTri2` one again where an outline is curved: its bent outlines are curves that nodes slide on (arcs
        where corners and mid-side nodes lie on a circle, otherwise splines through both), and mid-side nodes are put
        back on them, or towards the chord where an element would be folded over. Sides inside that were bent become
        straight.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri`, `skfem.MeshTri2` or `skfem.MeshTet`, an argument is out of range, or
        there are fewer layers than are to be kept; nothing is changed then.

    Notes
    -----
    The density is what its own mesh says throughout; a training point moves only nodes of the region it lies in.
    Equation 1, the neighbourhood and the treatment of outlines are those of Lowther and Mai, "On Automatic Mesh
    Generation using Kohonen Maps". Tetrahedra are swapped as `kernels/tetrahedron/swap.py` says, and smoothed as
    `kernels/tetrahedron/smooth.py` does: what counts is the mass of the density in every element, and its shape.
    Where no node moves, the logger ``kohonen_adapt`` says why; it also says how far facets are from the curves that
    their nodes slide on (INFO) and which arcs were recognised (DEBUG).

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(4)
    >>> finer_below = ka.relocate(mesh, lambda x: 1 / (0.1 + x[1]))
    >>> finer_below.p.shape == mesh.p.shape
    True
    """
    check_training(schedule, seed)
    rules = Rules(topology, min_quality, pinned, curves, periodic, layers, surfaces).guarded()
    check_kind(mesh, bent=True, space=True)
    if cell_of(mesh) is TETRAHEDRON:
        return relocated_in_space(mesh, density, schedule, rules, np.random.default_rng(seed))
    return relocated_in_plane(mesh, density, schedule, rules, seed)


def relocated_in_space(
    mesh: MeshTet,
    density: ArrayLike | Callable[[Floats], ArrayLike],
    schedule: Schedule | None,
    rules: Rules,
    rng: np.random.Generator,
) -> MeshTet:
    """What `relocate` does with tetrahedra."""
    movable = MovableSolid.of(mesh, rules)
    expect(*loops_in_space(rules.topology, schedule))
    moved = move_in_space(movable, density, schedule, rules.topology, rng)
    report_surfaces(moved.before, movable)
    if not moved.work(movable).moved and schedule != Schedule(()):
        logger.warning("relocate moved no node: %s.", moved.why_still)
    return movable.mesh()


def relocated_in_plane(
    mesh: MeshTri,
    density: ArrayLike | Callable[[Floats], ArrayLike],
    schedule: Schedule | None,
    rules: Rules,
    seed: int,
) -> MeshTri:
    """What `relocate` does with triangles."""
    layered = with_layers(mesh, rules)
    movable = MovableMesh.of(layered, rules)
    if layered is not mesh and not callable(density) and np.shape(density) == mesh.t.shape[1:]:
        density = np.asarray(density)[find_elements(mesh, layered.p[:, layered.t].mean(axis=1))]
    expect(*loops_in_plane(rules.topology))
    moved = move(movable, density, schedule, rules.topology, np.random.default_rng(seed), int(mesh.nvertices))
    work = moved.work(movable)
    report_curves(moved.before, movable)
    if not work.moved and schedule != Schedule(()):  # that one is asked for its flips
        logger.warning("relocate moved no node: %s.", work.why_still)
    return movable.mesh()


def loops_in_plane(topology: str) -> tuple[str, ...]:
    """The chapters of compiled loops that `move` needs."""
    return "ground", "map", "recycling" if topology == "recycle" else "transport"


def move(
    movable: MovableMesh,
    density: ArrayLike | Callable[[Floats], ArrayLike],
    schedule: Schedule | None,
    topology: str,
    rng: np.random.Generator,
    nodes: int = 0,
    recycles: bool = True,
    longest: Floats | None = None,
) -> Moved[MovableMesh]:
    """Recycle the nodes of a movable mesh, let the map learn the density, and smooth; to so many `nodes`, but that
    without recycling there are never fewer than now.

    `density` is of the mesh as it is now. With the topology "recycle" the map counts on recycling that was done before
    where it `recycles` nothing here. `longest` facets on arcs are those of `recycle_nodes`.
    """
    before, pairs = movable.copy(), recycles and topology == "recycle"
    target = nodes if nodes and pairs else max(nodes, movable.nnodes)
    recycled, starts, exchanges = unchanged(before.triangulation), None, pairs or target > movable.nnodes
    with nullcontext() if exchanges else numbered_along_curve(movable) as row:
        wanted = density_of(movable.triangulation, density, row)
        if exchanges:
            recycled = recycle_nodes(movable, wanted.at_nodes(), target, pairs, longest)
            starts = starts_of(before.triangulation, recycled)
        trainer = Trainer.of(movable)
        if schedule is None:
            radius = radius_for(trainer, wanted, topology, recycled)
            schedule = Schedule.default(target, radius=radius, topology=topology)
        errors = trainer.learn(wanted.draw, schedule, rng, starts)
        if schedule.sweeps:
            if recycled.splits:
                wanted.refit(movable.triangulation, before.triangulation, recycled.hint)
            trainer.smooth(wanted, schedule.sweeps)
    return Moved(before, recycled, errors, why_still(movable, schedule))


def radius_for(trainer: Trainer, wanted: Density, topology: str, recycled: Recycled) -> int | None:
    """How far nodes are to be exchanged, in edges: where nodes are put where they are wanted, none need travel."""
    if topology == "recycle":
        return None
    return 2 if recycled.splits else 2 ** doublings_for(trainer, wanted)


def doublings_for(trainer: Trainer, wanted: Density) -> int:
    """How often an edge must be doubled to reach as far as mass must travel: some patch has far too much or too little.

    Patches are stretches of a space-filling curve through each region, with a quarter of the nodes that are within
    2^doublings edges of an inner one: around a corner of the outline, where the mismatch often is greatest, there are
    no more.
    """
    n = len(trainer.neurons.position)
    doublings = most_doublings(n)
    masses = node_masses(trainer.neurons.elements, wanted.masses)[trainer.order_by_region()]
    total = np.append(0.0, np.cumsum(masses))
    while doublings > 1:
        size = min(n, 3 * 4**doublings // 4)
        if np.any(np.abs(np.log((total[size:] - total[:-size]) / size)) > MISMATCH):
            break
        doublings -= 1
    return doublings


def node_masses(elements: Elements, masses: Floats) -> Floats:
    """The mass that each node carries, a third of its elements', 1 on average in every region, (n,).

    Nodes cannot leave their region, so what one region has too much of is none of another's business.
    """
    node, region = elements.node, elements.region
    degree = np.bincount(node.ravel())
    nodes_of_region = np.bincount(region, weights=np.sum(1.0 / degree[node], axis=1))
    share = masses * (nodes_of_region / np.bincount(region, weights=masses))[region] / 3.0
    return np.bincount(node.ravel(), weights=np.repeat(share, 3)).astype(np.float64)


def report_curves(before: MovableMesh, now: MovableMesh) -> None:
    """Say how much of curves their facets leave out, before and now; of those that are bent to them it is nothing."""
    if now.curved:
        return
    then, left_out = before.sagitta(), now.sagitta()
    if max(then, left_out) > 0.0:
        which = now.outline.farthest_curve(now.triangulation)
        text = "curves are up to %.3g away from their facets, that of %s, and were up to %.3g, in units of the mesh"
        logger.info(text, left_out, which, then)
