"""One mesh in, one better mesh out: the nodes move to where the density wants them."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.locate import Locator
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.outline.outline import Outline
from kohonen_adapt.outline.rules import Limits
from kohonen_adapt.som.kohonen_map import KohonenMap
from kohonen_adapt.som.recycling import Recycled, unchanged
from kohonen_adapt.som.schedule import Schedule, check_training, widest_radius
from kohonen_adapt.som.training_points import CallableDensity, ElementDensity, density_of

logger = logging.getLogger(__package__)

__all__ = ["Relocation", "Trained", "guarded_map", "relocate", "trained_map"]

TOPOLOGIES = ("fixed", "flip", "recycle")
MISMATCH = (
    0.6  # logarithm of the mean load of a patch of nodes beyond which mass must still travel as far as it is wide
)


@dataclass(frozen=True)
class Relocation:
    """A relocated mesh and what it took.

    Attributes
    ----------
    mesh
        The new mesh.
    quantization_errors
        Mean distance of the training points to their winners, one per epoch, in mesh units.
    max_displacement
        The longest way that a node went, in mesh units.
    moved
        Number of nodes that moved or are new.
    message
        Why no node moved, or empty.
    old
        (nnodes,): number in the old mesh of every node, -1 for a new one.
    splits, collapses
        How often recycling split and collapsed an edge.
    polish_gain
        What moves and flips of the polish took off the Ritz functional.
    """

    mesh: MeshTri
    quantization_errors: tuple[float, ...]
    max_displacement: float
    moved: int
    message: str
    old: Ints
    splits: int = 0
    collapses: int = 0
    polish_gain: float = 0.0


@dataclass(frozen=True)
class Trained:
    """A map that has learnt a density, with what it was before; it can still be polished.

    Attributes
    ----------
    som
        The map.
    mesh, triangulation, outline
        The old mesh, and the map's arrays when it was that.
    recycled
        Which nodes are old, and an old element near each.
    quantization_errors
        Mean distance of the training points to their winners, one per epoch, in mesh units.
    still
        Why no node moved, if none did.
    """

    som: KohonenMap
    mesh: MeshTri
    triangulation: Triangulation
    outline: Outline
    recycled: Recycled
    quantization_errors: tuple[float, ...]
    still: str

    def relocation(self, polish_gain: float = 0.0) -> Relocation:
        """The map as it is now as a mesh, compared with the old one."""
        self._report_curves()
        mesh, old = self.som.mesh, self.recycled.old
        kept = old >= 0
        way = np.sqrt(np.sum((mesh.p[:, kept] - self.mesh.p[:, old[kept]]) ** 2, axis=0))
        moved = int(np.count_nonzero(way) + np.count_nonzero(~kept))
        return Relocation(
            mesh=mesh,
            quantization_errors=self.quantization_errors,
            max_displacement=float(way.max()),
            moved=moved,
            message="" if moved else self.still,
            old=old,
            splits=self.recycled.splits,
            collapses=self.recycled.collapses,
            polish_gain=polish_gain,
        )

    def _report_curves(self) -> None:
        """Say how much of curves their facets leave out, before and now."""
        before, now = self.outline.sagitta(self.triangulation), self.som.outline.sagitta(self.som.triangulation)
        if max(before, now) > 0.0:
            logger.info("curves are up to %.3g away from their facets; before up to %.3g", now, before)


def relocate(
    mesh: MeshTri,
    density: ArrayLike | Callable[[Floats], ArrayLike],
    *,
    schedule: Schedule | None = None,
    topology: str = "flip",
    min_quality: float = 0.3,
    pinned: Sequence[int | str] | Ints | str = (),
    seed: int = 0,
    curves: Mapping[str, Curve] | None = None,
    periodic: Sequence[tuple[str, str]] = (),
    layers: Mapping[str, int] | None = None,
) -> MeshTri:
    """Move the nodes of a mesh to where a density wants them, with a Kohonen map.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`; it is not modified.
    density
        Wanted nodes per area up to a factor, >= 0 and not zero everywhere: (nelements,), or a callable of points x
        (2, n) that returns (n,). Zeros are raised to 1e-6 of the largest value.
    schedule
        None takes `Schedule.default` with a start radius from how far the mesh is from the density, so that calling
        again and again, each time on a fresh estimate, goes on improving. ``Schedule(())`` moves nothing; with
        ``topology="flip"`` it makes each region constrained Delaunay.
    topology
        ``"flip"`` makes each region constrained Delaunay as far as `min_quality` lets it, ``"fixed"`` keeps ``mesh.t``,
        ``"recycle"`` also takes nodes away where there are too many and puts as many where there are too few: outlines
        gain and lose nodes, corners and pinned nodes stay, and the number of elements may change.
    min_quality
        A move, flip, collapse or split is accepted if the worst quality it leaves in what it touches is at least
        ``min(min_quality, the worst there before)``.
    pinned
        Node numbers, and names of boundaries and subdomains, of what stays where it is.
    seed
        The same seed gives the same mesh, bit for bit, on one type of CPU.
    curves
        The curves that named boundaries are on: `Line`, `Arc`, `Spline`, or any object with a method
        ``project(x (2, n)) -> (2, n)``, by name. Without one, six nodes and more on a circle (within 1e-3 of its
        radius, turning by less than 35 degrees at each) are taken for an arc, and other turns for corners.
    periodic
        Pairs of names of boundaries, as ``[("left", "right")]``, for periodic and antiperiodic conditions: a
        translation or rotation carries the one to the other node by node, and does so afterwards. A training point
        beside one also reaches what lies beside the other.
    layers
        Layers of elements to keep across thin subdomains, by name: every way over edges from one side to the other then
        has so many edges or more. The sides are the pieces of the subdomain's outline that face each other at a short
        distance, with whatever joins pieces of one side; the ends of a gap are none.

    Returns
    -------
    MeshTri
        With the same number of nodes and the same names: nodes never leave their region, outlines keep their shape.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri`, an argument is out of range, or there are fewer layers than are
        to be kept; nothing is changed then.

    Notes
    -----
    The density is what its own mesh says throughout; a training point moves only nodes of the region it lies in.
    Equation 1, the neighbourhood and the treatment of outlines are those of Lowther and Mai, "On Automatic Mesh
    Generation using Kohonen Maps". Where no node moves, the logger ``kohonen_adapt`` says why; it also says how far
    facets are from the curves that their nodes slide on (INFO) and which arcs were recognised (DEBUG).

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(4)
    >>> finer_below = ka.relocate(mesh, lambda x: 1 / (0.1 + x[1]))
    >>> finer_below.p.shape == mesh.p.shape
    True
    """
    done = trained_map(
        mesh,
        density,
        schedule=schedule,
        limits=Limits(topology, min_quality, pinned, curves, periodic, layers),
        seed=seed,
    ).relocation()
    if not done.moved and schedule != Schedule(()):  # that one is asked for its flips
        logger.warning("relocate moved no node: %s.", done.message)
    return done.mesh


def trained_map(
    mesh: MeshTri,
    density: ArrayLike | Callable[[Floats], ArrayLike],
    *,
    schedule: Schedule | None,
    limits: Limits,
    seed: int,
    target: int | None = None,
) -> Trained:
    """What `relocate` does, before it is made a mesh again; with at least `target` nodes."""
    check_training(schedule, seed)
    som, topology = guarded_map(mesh, limits), limits.topology
    wanted, rng = density_of(som.triangulation, density), np.random.default_rng(seed)
    before, outline = som.triangulation.copy(), som.outline.copy()
    recycled = unchanged(before)
    target = max(target or 0, before.nnodes)
    if topology == "recycle" or target > before.nnodes:
        recycled = som.recycle(wanted, target, pairs=topology == "recycle")
    if schedule is None:
        schedule = Schedule.default(target, radius=radius_for(som, wanted, topology, recycled), topology=topology)
    errors = som.learn(wanted.draw, schedule, rng, recycled.starts)
    if schedule.sweeps:
        if recycled.splits:
            wanted.refit(som.triangulation, Locator(before))
        som.smooth(wanted, schedule.sweeps)
    return Trained(som, mesh, before, outline, recycled, errors, why_still(som, schedule))


def radius_for(
    som: KohonenMap, wanted: ElementDensity | CallableDensity, topology: str, recycled: Recycled
) -> int | None:
    """The start radius: where nodes are put where they are wanted, none need travel."""
    if topology == "recycle":
        return None
    return 2 if recycled.splits else start_radius(som, wanted)


def guarded_map(mesh: MeshTri, limits: Limits) -> KohonenMap:
    """A map that keeps the quality rule; whatever is wrong with the mesh or the options is refused here."""
    if limits.min_quality is None:
        raise ValueError("min_quality must be a number here; only KohonenMap works unchecked. Got None.")
    if limits.topology not in TOPOLOGIES:
        raise ValueError(f"topology must be 'fixed', 'flip' or 'recycle'; got {limits.topology!r}.")
    return KohonenMap(
        mesh,
        topology="fixed" if limits.topology == "fixed" else "flip",
        min_quality=limits.min_quality,
        pinned=limits.pinned,
        curves=limits.curves,
        periodic=limits.periodic,
        layers=limits.layers,
    )


def why_still(som: KohonenMap, schedule: Schedule) -> str:
    """The reason that no node moved."""
    if not schedule.rounds and not schedule.sweeps and not any(stage.epochs for stage in schedule.stages):
        return "the schedule has no rounds, no epochs and no sweeps"
    if not som.can_move():
        return "every node is a corner or pinned"
    return "every move would have broken the quality rule"


def start_radius(som: KohonenMap, wanted: ElementDensity | CallableDensity) -> int:
    """The largest power of two such that some patch of that radius has far too much or too little mass per node.

    Patches are stretches of a space-filling curve through each region, with a quarter of the nodes that are within the
    radius of an inner one: around a corner of the outline, where the mismatch often is greatest, there are no more.
    """
    n, radius = som.triangulation.nnodes, widest_radius(som.triangulation.nnodes)
    masses = node_masses(som.triangulation, wanted.masses)[som.along_curve()]
    total = np.append(0.0, np.cumsum(masses))
    while radius > 2:
        size = min(n, 3 * radius**2 // 4)
        if np.any(np.abs(np.log((total[size:] - total[:-size]) / size)) > MISMATCH):
            break
        radius //= 2
    return radius


def node_masses(triangulation: Triangulation, masses: Floats) -> Floats:
    """The mass that each node carries, a third of its elements', 1 on average in every region, (n,).

    Nodes cannot leave their region, so what one region has too much of is none of another's business.
    """
    node, region = triangulation.elements.node, triangulation.elements.region
    degree = np.bincount(node.ravel())
    nodes_of_region = np.bincount(region, weights=np.sum(1.0 / degree[node], axis=1))
    share = masses * (nodes_of_region / np.bincount(region, weights=masses))[region] / 3.0
    return np.bincount(node.ravel(), weights=np.repeat(share, 3)).astype(np.float64)
