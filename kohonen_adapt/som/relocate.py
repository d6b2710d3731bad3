"""Relocation of triangles by recycling, the Kohonen map and transport."""

import logging
from collections.abc import Callable
from contextlib import nullcontext

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats
from kohonen_adapt.geometry.movable import Recycled, unchanged
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import numbered_along_curve
from kohonen_adapt.kernels.arrays import Elements
from kohonen_adapt.som.moved import Moved, why_still
from kohonen_adapt.som.recycling import recycle_nodes, starts_of
from kohonen_adapt.som.schedule import Schedule, most_doublings
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import Density, density_of

logger = logging.getLogger("kohonen_adapt")

__all__ = ["loops_in_plane", "move", "report_curves"]

# Logarithm of the mean mass per node of a patch, above which mass must travel the width of the patch.
MISMATCH = 0.6


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
