"""Relocation of the nodes of a mesh to a given density."""

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTet, MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import with_nearest_names
from kohonen_adapt.kernels.arrays import Elements
from kohonen_adapt.kernels.numba.compilation import expect
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

__all__ = ["loops_in_plane", "move", "relocate"]

# Logarithm of the mean mass per node of a patch, above which mass must travel the width of the patch.
MISMATCH = 0.6


@with_nearest_names({"size": "density", "sizes": "density", "indicators": "density", "fixed": "pinned"})
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
    """Move the nodes of a mesh to a given density.

    All nodes and their numbers are kept. Nodes of triangles are moved by a Kohonen map, nodes of tetrahedra by sweeps
    of smoothing with swaps of elements between the sweeps. `adapt`, which repeats relocation for an estimated density,
    recycles nodes by default, too.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`, a `skfem.MeshTri2`, of which the corners are moved, or a `skfem.MeshTet`. The mesh is not
        modified.
    density
        Wanted nodes per area or volume up to a factor, >= 0 and not zero everywhere: an array of shape (nelements,), or
        a callable of points x, shape (2, n), in space (3, n), that returns shape (n,). Zeros are raised to 1e-6 of the
        largest value.
    schedule
        Schedule of the map. None means `Schedule.default` with a first radius that depends on how far the mesh is from
        the density, so that repeated calls, each with a new estimate, continue to improve the mesh. ``Schedule(())``
        moves nothing; with ``topology="flip"`` it makes each region constrained Delaunay. For tetrahedra, None means 8
        sweeps with "flip", 6 with "fixed" and 3 with "recycle". Stages, if any, are presented before the sweeps; rounds
        are refused. Without stages and sweeps elements are swapped, to raise the least quality, and recycled.
    topology, min_quality, pinned, curves, periodic, layers, surfaces
        Constraints on the nodes, see `Rules`. With ``topology="recycle"`` nodes do not keep their numbers.
    seed
        Seed of all random numbers. The same seed gives the same mesh, bit for bit, on one type of CPU.

    Returns
    -------
    MeshTri or MeshTet
        Mesh with the same number of nodes and the same names. Nodes stay in their region, and boundaries and interfaces
        keep their shape. If the input is a `skfem.MeshTri2` and a boundary or interface is curved, so is the result:
        its curved sides lie on arcs, where corners and midside nodes are on a circle, or else on splines through both.
        Midside nodes are put on these curves, or nearer to the chord where an element would be inverted. Curved sides
        on no boundary or interface are straightened.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri`, `skfem.MeshTri2` or `skfem.MeshTet`, if an argument is out of range,
        or if the mesh has fewer layers than `layers` requests.

    Notes
    -----
    The density belongs to the input mesh throughout. A training point moves only nodes of its own region. Equation 1,
    the neighbourhood and the treatment of boundaries are from Lowther and Mai, "On Automatic Mesh Generation using
    Kohonen Maps". See `kernels/tetrahedron/swap.py` for the swaps of tetrahedra, and `kernels/tetrahedron/smooth.py`
    for the smoothing, which balances the mass of the density in every element and the shape of the element.

    The logger ``kohonen_adapt`` reports the reason if no node moves (WARNING), the distance between facets and the
    curves on which their nodes slide (INFO), and the arcs that are recognised (DEBUG).

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
    check_kind(mesh, curved=True, space=True)
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
    movable = MovableSolid.of(mesh, rules)
    expect(*loops_in_space(rules.topology, schedule))
    moved = move_in_space(movable, density, schedule, rules.topology, rng)
    report_surfaces(moved.before, movable)
    work = moved.work(movable)
    if not work.moved and schedule != Schedule(()):
        logger.warning("relocate moved no node: %s.", work.why_still)
    return movable.mesh()


def relocated_in_plane(
    mesh: MeshTri,
    density: ArrayLike | Callable[[Floats], ArrayLike],
    schedule: Schedule | None,
    rules: Rules,
    seed: int,
) -> MeshTri:
    layered = with_layers(mesh, rules)
    movable = MovableMesh.of(layered, rules)
    if layered is not mesh and not callable(density) and np.shape(density) == mesh.t.shape[1:]:
        density = np.asarray(density)[find_elements(mesh, layered.p[:, layered.t].mean(axis=1))]
    expect(*loops_in_plane(rules.topology))
    moved = move(movable, density, schedule, rules.topology, np.random.default_rng(seed), int(mesh.nvertices))
    work = moved.work(movable)
    report_curves(moved.before, movable)
    if not work.moved and schedule != Schedule(()):  # an empty schedule is used for its flips alone
        logger.warning("relocate moved no node: %s.", work.why_still)
    return movable.mesh()


def loops_in_plane(topology: str) -> tuple[str, ...]:
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
    """Recycle the nodes of a movable mesh, train the map with a density, and smooth.

    `density` belongs to the present mesh. `nodes` is the final number of nodes, 0 for the present number; without
    recycling the number does not decrease. If `recycles` is False, "recycle" as `topology` means that recycling was
    done before. `longest` is the argument of `recycle_nodes`.
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
                wanted.refit(movable.triangulation, before.triangulation, recycled.start_element)
            trainer.smooth(wanted, schedule.sweeps)
    return Moved(before, recycled, errors, why_still(movable, schedule))


def radius_for(trainer: Trainer, wanted: Density, topology: str, recycled: Recycled) -> int | None:
    if topology == "recycle":
        return None
    return 2 if recycled.splits else 2 ** doublings_for(trainer, wanted)


def doublings_for(trainer: Trainer, wanted: Density) -> int:
    """Return how often an edge must be doubled to reach as far as mass must travel.

    Mass must travel the width of a patch if some patch has far too much or too little (`MISMATCH`). Patches are
    intervals of a space-filling curve through each region. They have a quarter of the nodes that are within 2^doublings
    edges of an inner node, because no more are around a corner of the boundary, where the mismatch often is largest.
    """
    n = len(trainer.neurons.position)
    doublings = most_doublings(n)
    masses = node_masses(trainer.neurons.elements, wanted.masses)[trainer.order_by_region()]
    total = np.append(0.0, np.cumsum(masses))
    while doublings > 1:
        size = min(n, 3 * 4**doublings // 4)
        with np.errstate(divide="ignore"):  # a patch whose mass is lost beside the sum of all
            loads = np.log((total[size:] - total[:-size]) / size)
        if np.any(np.abs(loads) > MISMATCH):
            break
        doublings -= 1
    return doublings


def node_masses(elements: Elements, masses: Floats) -> Floats:
    """Return the mass of the density at every node, (n,), with mean 1 in a region."""
    node, region = elements.node, elements.region
    degree = np.bincount(node.ravel())
    nodes_of_region = np.bincount(region, weights=np.sum(1.0 / degree[node], axis=1))
    fraction = masses * (nodes_of_region / np.bincount(region, weights=masses))[region] / 3.0
    return np.bincount(node.ravel(), weights=np.repeat(fraction, 3)).astype(np.float64)


def report_curves(before: MovableMesh, now: MovableMesh) -> None:
    then, left_out = before.sagitta(), now.sagitta()
    if max(then, left_out) > 0.0:
        which = now.outline.farthest_curve(now.triangulation)
        text = "curves are up to %.3g away from their facets, that of %s, and were up to %.3g, in units of the mesh"
        logger.info(text, left_out, which, then)
