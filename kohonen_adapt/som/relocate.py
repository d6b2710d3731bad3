"""Relocation of triangles and tetrahedra by recycling, the map and smoothing."""

from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import DataFunction, Floats, Ints
from kohonen_adapt.geometry.movable import Movable, Recycled, unchanged
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import numbered_along_curve
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.geometry.space.thread_parts import Parts
from kohonen_adapt.kernels.arrays import KernelMesh
from kohonen_adapt.kernels.heap import Heap
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, Constraints
from kohonen_adapt.kernels.tetrahedron.recycle import fill_heaps, recycle
from kohonen_adapt.kernels.tetrahedron.smooth import smooth_nodes
from kohonen_adapt.kernels.threads import Nodes, number_of_threads
from kohonen_adapt.kernels.triangle.arrays import Elements
from kohonen_adapt.log import logger
from kohonen_adapt.som.recycling import RATIO, recycle_nodes, starts_of
from kohonen_adapt.som.relocation_record import Moved, why_still
from kohonen_adapt.som.schedule import IN_METRIC, Schedule, most_doublings
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import Density, density_of

__all__ = [
    "loops_in_plane",
    "loops_in_space",
    "move",
    "move_in_space",
    "report_sagitta",
    "split_edges",
]

# Logarithm of the mean mass per node of a patch, above which mass must travel the width of the patch.
MISMATCH = 0.6
SWEEPS = {"flip": 8, "fixed": 6, "recycle": 3}  # sweeps of smoothing: more would concentrate nodes too much
ROUNDS = 6  # number of rounds: a forbidden collapse may be allowed after swaps nearby
SETTLED = 0.005  # fraction of nodes: a round with fewer splits is the last
TURNS = 4  # further recyclings in a metric, because collapses on a mesh without its directions need sweeps before
MIXED = 0.1  # fraction of nodes: after a round with more splits rows are ordered again
POWER = 5.0 / 3.0  # exponent of the density as weight of smoothing, which equalises the mass of elements
PAIRS, NODES = 10_000, 50_000  # per compiled call, so that Ctrl-C takes effect within half a second


def loops_in_plane(topology: str, schedule: Schedule | None) -> tuple[str, ...]:
    return "ground", "map", "carrying", "locating", "recycling" if topology == "recycle" else "transport"


def move(
    movable: MovableMesh,
    density: ArrayLike | DataFunction,
    schedule: Schedule | None,
    topology: str,
    rng: Generator,
    nodes: int = 0,
    recycles: bool = True,
    longest: Floats | None = None,
) -> Moved[MovableMesh]:
    """Recycle the nodes of a movable mesh, train the map with a density, and smooth.

    `density` belongs to the present mesh. `nodes` is the final number of nodes, 0 for the present number; without
    recycling the number does not decrease. If `recycles` is False, "recycle" as `topology` means that recycling was
    done before. `longest` is the argument of `recycle_nodes`.
    """
    before = movable.copy()
    pairs = recycles and topology == "recycle"
    target = nodes if nodes and pairs else max(nodes, movable.nnodes)
    recycled = unchanged(before.triangulation)
    starts = None
    exchanges = pairs or target > movable.nnodes
    with nullcontext() if exchanges else numbered_along_curve(movable) as row:
        wanted = density_of(movable.triangulation, density, row)
        movable.measure_by(wanted.shapes_now(movable.triangulation, unchanged(movable.triangulation).start_element))
        if exchanges:
            recycled = recycle_nodes(movable, wanted.at_nodes(), target, pairs, longest)
            starts = starts_of(before.triangulation, recycled)
            movable.measure_by(wanted.shapes_now(movable.triangulation, recycled.start_element))
        trainer = Trainer.of(movable)
        if schedule is None and movable.in_metric and topology == "recycle":
            schedule = IN_METRIC
        elif schedule is None:
            radius = radius_for(trainer, wanted, topology, recycled)
            schedule = Schedule.default(target, radius=radius, topology=topology)
        errors = trainer.learn(wanted.draw, schedule, rng, starts)
        if schedule.sweeps:
            movable.measure_by(wanted.shapes_now(movable.triangulation))
            trainer.smooth(wanted, schedule.sweeps)
    return Moved(before, recycled, errors, why_still(movable, schedule), trainer.refused)


def split_edges(movable: MovableMesh | MovableSolid, density: ArrayLike | DataFunction, nodes: int) -> Moved[Any]:
    before = movable.copy()
    recycled = unchanged(before.tessellation)
    if nodes > movable.nnodes:
        wanted = density_of(before.tessellation, density)
        movable.measure_by(wanted.nodal_shapes())
        if isinstance(movable, MovableMesh):
            recycled = recycle_nodes(movable, wanted.at_nodes(), nodes, pairs=False)
        else:
            recycled = rearrange(movable, wanted, "fixed", 0, nodes, swaps=False)  # swaps would raise the energy
    return Moved(before, recycled, (), why_still(movable, None))


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
    nodes_of_region = np.bincount(region, np.sum(1.0 / degree[node], axis=1))
    fraction = masses * (nodes_of_region / np.bincount(region, masses))[region] / 3.0
    return np.bincount(node.ravel(), np.repeat(fraction, 3)).astype(np.float64)


def loops_in_space(topology: str, schedule: Schedule | None) -> tuple[str, ...]:
    if schedule is not None and schedule.rounds:
        raise ValueError(f"rounds of transport are for triangles only; got a schedule with {schedule.rounds}.")
    others = [
        *["space recycling"] * (topology == "recycle"),
        *["space map"] * (schedule is not None and schedule.trains),
    ]
    return "space ground", "space moves", *others, "space locating"


def move_in_space(
    movable: MovableSolid,
    density: ArrayLike | DataFunction,
    schedule: Schedule | None,
    topology: str,
    rng: Generator,
    nodes: int = 0,
) -> Moved[MovableSolid]:
    before = movable.copy()
    sweeps = None if schedule is None else schedule.sweeps
    refused = np.zeros(2, np.int64)
    wanted = density_of(before.tetrahedralization, density)
    movable.measure_by(wanted.nodal_shapes())
    if schedule is None or not schedule.trains:
        recycled, errors = rearrange(movable, wanted, topology, sweeps, nodes, refused), tuple[float, ...]()
    else:
        recycled = rearrange(movable, wanted, topology, 0, nodes)
        trainer = Trainer.of(movable)
        errors = trainer.learn(wanted.draw, schedule, rng, starts_in_space(before, movable))
        refused += trainer.refused
        rearrange(movable, wanted, "flip" if movable.flips else "fixed", sweeps, refused=refused)
    return Moved(before, recycled, errors, why_still(movable, schedule), refused)


def starts_in_space(before: MovableSolid, now: MovableSolid) -> Ints:
    middle = before.tetrahedralization.centroids()
    old = before.tetrahedralization.elements.region
    node, region = now.tetrahedralization.elements.node, now.tetrahedralization.elements.region
    starts = np.empty(len(middle), np.int32)
    for number in range(int(old.max()) + 1):
        nodes = np.unique(node[region == number])
        nearest = cKDTree(now.tetrahedralization.position[nodes]).query(middle[old == number])[1]
        starts[old == number] = nodes[nearest]
    return starts


def rearrange(
    movable: MovableSolid,
    density: Density,
    topology: str,
    sweeps: int | None = None,
    nodes: int = 0,
    refused: Ints | None = None,
    swaps: bool = True,
) -> Recycled:
    """Recycle nodes, swap elements and smooth, in place, as `topology` allows.

    `nodes` is the final number of nodes, 0 for the present number; without recycling the number does not decrease. The
    moves that the quality and the reach refuse are added to `refused`, shape (2,).
    """
    pairs = topology == "recycle"
    target = nodes or movable.nnodes
    target = target if pairs else max(target, movable.nnodes)
    movable.project_nodes()
    opened = OpenSolid.of(movable, density.at_nodes(), target)
    swaps = swaps and movable.flips
    if swaps:
        opened.swap()
    splits = collapses = 0
    if pairs or target > movable.nnodes:
        splits, collapses = exchange(opened, movable.floor, swaps, target, RATIO if pairs else np.inf)
    for _ in range(TURNS if pairs and movable.in_metric else 0):
        smooth(opened, density, SWEEPS[topology], movable)
        more, fewer = exchange(opened, movable.floor, swaps, target, RATIO)
        splits, collapses = splits + more, collapses + fewer
        if more <= MIXED * len(opened.mesh.position):
            break
    counts = smooth(opened, density, SWEEPS[topology] if sweeps is None else sweeps, movable)
    if refused is not None:
        refused += counts
    rows = opened.write_back(movable, renumbered=bool(pairs and splits + collapses))
    movable.project_nodes()
    return Recycled(opened.mesh.origins.old[rows], opened.mesh.origins.start_element[rows], splits, collapses)


def exchange(opened: OpenSolid, floor: float, swaps: bool, target: int, ratio: float) -> tuple[int, int]:
    mesh = opened.mesh
    rows = 2 * len(opened.mesh.elements.node)
    heaps = Heap.of(rows), Heap.of(rows)
    splits = collapses = 0
    for _ in range(ROUNDS):
        fill(opened, heaps)
        at_first, finished = splits, False
        while not finished:
            missing = target - len(opened.nodes())
            more, fewer, finished = recycle(mesh, opened.queue, *heaps, missing, ratio, floor**3, PAIRS)
            splits, collapses = splits + more, collapses + fewer
        if ratio < np.inf and splits - at_first > MIXED * len(mesh.position):  # without this nodes keep their numbers
            opened.renumber()
        if swaps:
            opened.swap()
        if splits - at_first <= SETTLED * len(mesh.position):
            break
    return splits, collapses


def fill(opened: OpenSolid, heaps: tuple[Heap, Heap]) -> None:
    for heap in heaps:
        heap.size[0] = 0
    for first in range(0, len(opened.mesh.position), NODES):
        fill_heaps(opened.mesh, *heaps, first, min(first + NODES, len(opened.mesh.position)))


def smooth(opened: OpenSolid, density: Density, sweeps: int, movable: MovableSolid) -> Ints:
    parts, refused = opened.parts(), np.zeros(2, np.int64)
    for _ in range(sweeps):
        refused += sweep(opened, parts, weights(opened, density), movable.floor**3)
        if movable.flips:
            opened.queue_worse()
            opened.swap()
    return refused


def weights(opened: OpenSolid, density: Density) -> Floats:
    node = opened.mesh.elements.node
    weight = np.zeros(len(opened.mesh.elements.node))
    used = np.flatnonzero(node[:, 0] >= 0)
    weight[used] = density.means(opened.mesh.position[node[used]]) ** POWER
    return weight


def sweep(opened: OpenSolid, parts: Parts, weight: Floats, floor: float) -> Ints:
    mesh = opened.mesh
    star = opened.star()
    constraints = Constraints(mesh.freedom, mesh.surfaces, mesh.freedom.number == INSIDE, mesh.metric)
    neurons = KernelMesh(mesh.position, mesh.elements, star, constraints)
    refused = np.zeros((number_of_threads(), 2), np.int64)

    def task(thread: int, nodes: Nodes) -> float:
        refused[thread] += smooth_nodes(neurons, weight, floor, nodes)
        return 0.0

    parts.sweep(star, task)
    return refused.sum(axis=0)


def report_sagitta(before: Movable, now: Movable) -> None:
    then, left_out = before.sagitta(), now.sagitta()
    if max(then, left_out) > 0.0:
        text = "largest distance of %s from %s: %.3g (name: %s), before %.3g, in units of the mesh"
        logger.info(text, *now.curved_parts, left_out, now.farthest_part(), then)
