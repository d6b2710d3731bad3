"""Training of a mesh by epochs of training points, shared among threads.

Triangles may have rounds of transport before the epochs and sweeps of smoothing after.

Points are presented in batches, and the winners of a batch are found before its first point is presented. Along a
space-filling curve the mesh is cut into parts. Points with winners in the interior of a part change nothing in other
parts, so threads present the points of different parts in parallel; points near cuts follow in one thread. Neither the
parts nor the result depend on the number of threads.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.random import Generator

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import swap_elements
from kohonen_adapt.kernels.arrays import KernelMesh, Lesson, SearchScratch
from kohonen_adapt.kernels.ordering import along_curve, mark_interior, shuffle, sorted_into_tiles
from kohonen_adapt.kernels.threads import even_cuts, number_of_threads, parts_for, shared
from kohonen_adapt.kernels.triangle.locate import STRETCH
from kohonen_adapt.kernels.triangle.smooth import sweep
from kohonen_adapt.mesh.shapes import round_shapes
from kohonen_adapt.som.map_method import MapMethod, map_method_of
from kohonen_adapt.som.schedule import Schedule, Stage
from kohonen_adapt.som.training_points import Density, Draw
from kohonen_adapt.som.transport import FLOWS, POINTS, Transport

__all__ = ["Trainer"]

PULL = 0.4  # maximum displacement of a node in a batch, as a fraction of the distance to its points
STRIPS = 0.3  # maximum fraction of nodes near cuts, which have to wait
TILE = 250  # number of nodes whose points are presented together, to stay in the cache; more for wide radii
FEW = 1_000  # minimum number of stars or searches per thread

Drawing = Callable[[int, Generator], Draw]


@dataclass
class Trainer:
    """Movable mesh in training, with scratch memory for every thread.

    Attributes
    ----------
    movable
        Mesh in training.
    method
        Kernels and settings for its kind of element.
    order, rank
        Nodes along a space-filling curve, which is cut into parts, and the position of each node on it, shape (n,).
    neurons
        Kernel arrays of the present mesh.
    scratch
        Scratch memory, one record per thread.
    refused
        Number of moves that the quality and the reach refused so far, shape (2,).
    """

    movable: MovableMesh | MovableSolid
    method: MapMethod
    order: Ints
    rank: Ints
    neurons: KernelMesh
    scratch: list[SearchScratch]
    refused: Ints

    @classmethod
    def of(cls, movable: MovableMesh | MovableSolid) -> "Trainer":
        neurons = movable.kernel_mesh()
        order = along_curve(neurons.position).astype(np.int32)
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        method, refused = map_method_of(neurons.position.shape[1]), np.zeros(2, np.int64)
        return cls(movable, method, order, rank, neurons, scratch_for(neurons), refused)

    def learn(self, draw: Drawing, schedule: Schedule, rng: Generator, starts: Ints | None = None) -> tuple[float, ...]:
        """Train with drawn points, and return the quantisation error of every epoch.

        The error is the mean distance of the points to their winners before the update. `draw` returns points with
        their elements in the mesh of the density. `starts`, shape (m,), is a node near every element of this mesh, in
        its region; None if this is the present mesh. `rng` also decides the order of points. Sweeps are left to
        `smooth`.
        """
        winners = (self.neurons.elements.node[:, 0] if starts is None else starts).copy()
        self._flip()
        if not schedule.trains:
            return ()
        self.movable.project_nodes()
        self._carry(draw, schedule.rounds, rng, winners)
        errors = self._present(draw, schedule, rng, winners)
        self.movable.project_nodes()
        return errors

    def _carry(self, draw: Drawing, rounds: int, rng: Generator, winners: Ints) -> None:
        if not rounds:
            return
        transport = Transport.of(self._triangles("rounds of transport"), self.rank)
        for number in range(min(rounds, FLOWS)):
            shown = draw(ceil(POINTS * self.movable.nnodes), rng)
            found = self.search(shown, winners[shown.element])[0]
            winners[shown.element] = found
            transport.carry(shown, found, ceil((rounds - number) / FLOWS))

    def _present(self, draw: Drawing, schedule: Schedule, rng: Generator, winners: Ints) -> tuple[float, ...]:
        count = self.movable.nnodes
        errors = list[float]()
        fixed_draw = None
        if not schedule.fresh:
            fixed_draw = draw(
                ceil(max((stage.points_per_neuron for stage in schedule.stages), default=0.0) * count), rng
            )
            winners = winners[fixed_draw.element]
        for stage, rate in schedule.epochs():
            shown = draw(ceil(stage.points_per_neuron * count), rng) if fixed_draw is None else fixed_draw
            slot = shown.element if fixed_draw is None else np.arange(len(winners))
            errors.append(self.epoch(stage, rate, shown, slot, winners, rng))
            self._flip()
            if schedule.tolerance is not None and errors[-1] < schedule.tolerance:
                break
        return tuple(errors)

    def smooth(self, density: Density, sweeps: int) -> None:
        movable = self._triangles("sweeps")
        for number in range(sweeps):
            tri = movable.triangulation
            if number % density.lasting == 0:
                weight = density.means(tri.position[tri.elements.node]) ** 2
                movable.measure_by(density.shapes_now(movable.triangulation))
            self.sweep(weight, movable.flips)
            self._flip()
        movable.project_nodes()

    def epoch(self, stage: Stage, rate: float, shown: Draw, slot: Ints, winners: Ints, rng: Generator) -> float:
        # The search for a point starts from the entry of `winners` at its `slot`; the winner replaces the entry.
        number = len(slot)
        total = 0.0
        rings = stage.radius + 2  # elements of moved nodes need one ring beyond the radius, a corner jump a second
        parts = parts_for(self.movable.nnodes, rings, self.method.cell.dim, STRIPS)
        is_valid, interior = self._valid_stars(), self._interior_nodes(parts, rings)
        batches = batches_for(stage, rate, number / self.movable.nnodes, number, self.method)
        for first in range(batches):
            rows = np.arange(first, number, batches)
            batch = shown.reordered(rows)
            found, distances = self.search(batch, winners[slot[rows]])
            winners[slot[rows]] = found
            cuts, order = self._by_parts(found, stage.radius, parts, interior, rng)
            self._teach(stage, rate, batch.reordered(order), found[order], is_valid, cuts)
            total += float(distances.sum())
        return total / max(1, number)

    def order_by_region(self) -> Ints:
        region = self.neurons.elements.region[self.neurons.star.element[self.neurons.star.start[:-1]]]
        return self.order[np.argsort(region[self.order], kind="stable")]

    def _valid_stars(self) -> Mask:
        is_valid = np.empty(self.movable.nnodes, bool)
        arrays = self.neurons.position, self.neurons.star, self.movable.floor
        cuts = even_cuts(len(is_valid), FEW)
        shared(lambda thread, first, last: self.method.mark_valid(*arrays, first, last, is_valid), cuts)
        return is_valid

    def sweep(self, weight: Floats, circumcentres: bool) -> None:
        movable = self._triangles("sweeps")
        mesh = movable.kernel_mesh()
        shape, floor = movable.shape, movable.floor
        parts = parts_for(movable.nnodes, 1, self.method.cell.dim, STRIPS)
        interior = self._interior_nodes(parts, 1)

        def task(thread: int, first: int, last: int, which: bool = True) -> tuple[int, int]:
            return sweep(mesh, shape, weight, circumcentres, floor, self.order[first:last], interior, which)

        refused = shared(task, starts_of_threads(-(-np.arange(parts + 1) * movable.nnodes // parts)))
        self.refused += np.sum([*refused, task(0, 0, movable.nnodes, which=False)], axis=0)

    def _interior_nodes(self, parts: int, rings: int) -> Mask:
        """Return the mask (n,) of nodes with all nodes within `rings` in their own part."""
        interior = np.empty(self.movable.nnodes, bool)
        part = (self.rank.astype(np.int64) * parts // len(interior)).astype(np.int32)
        if isinstance(self.movable, MovableMesh):
            paired = np.flatnonzero(self.movable.constraints.periodic.partner >= 0)
            part[paired] = -1 - paired  # points near a pair change two parts of the mesh
        star = self.neurons.star
        mark_interior(star.start, star.link, part, rings, interior, self.scratch[0].queue)
        return interior

    def search(self, batch: Draw, start_nodes: Ints) -> tuple[Ints, Floats]:
        found, distances = np.empty(len(start_nodes), np.int32), np.empty(len(start_nodes))
        shape = round_shapes(*batch.points.shape) if batch.shape is None else batch.shape

        def task(thread: int, first: int, last: int) -> None:
            part = slice(first, last)
            self.method.find_winners(
                self.neurons, batch.points[part], shape[part], batch.region[part], start_nodes[part],
                found[part], distances[part], self.scratch[thread],
            )  # fmt: skip

        shared(task, even_cuts(len(start_nodes), FEW, STRETCH))
        return found, distances

    def _flip(self) -> None:
        if isinstance(self.movable, MovableMesh):
            self.movable.flip()
        else:
            swap_elements(self.movable)
        self.neurons = self.movable.kernel_mesh()
        if len(self.neurons.elements.node) > len(self.scratch[0].element_stamp):
            self.scratch = scratch_for(self.neurons)

    def _triangles(self, what: str) -> MovableMesh:
        if isinstance(self.movable, MovableSolid):
            raise ValueError(f"the schedule has {what}, which are for triangles only; got tetrahedra. Use wider radii.")
        return self.movable

    def _by_parts(self, winners: Ints, radius: int, parts: int, interior: Mask, rng: Generator) -> IntsPair:
        n = len(interior)
        tiles = parts * max(1, round(n / (parts * max(TILE, disc(radius, self.method)))))
        cuts, order = sorted_into_tiles(winners, self.rank, interior, tiles)
        shuffle(cuts, order, rng)
        return np.append(cuts[: tiles + 1 : tiles // parts], cuts[-1]), order

    def _teach(self, stage: Stage, rate: float, batch: Draw, winners: Ints, is_valid: Mask, cuts: Ints) -> None:
        floor = self.movable.floor
        strength = stage.strength()

        def task(thread: int, first: int, last: int) -> tuple[int, int]:
            part = slice(first, last)
            shown = batch.points[part], batch.region[part], batch.weights[part], winners[part]
            lesson = Lesson(*shown, strength)
            return self.method.learn(self.neurons, lesson, rate, floor, is_valid, self.scratch[thread])

        refused = shared(task, starts_of_threads(cuts[:-1]))
        self.refused += np.sum([*refused, task(0, cuts[-2], cuts[-1])], axis=0)


def starts_of_threads(starts: Ints) -> list[int]:
    parts = len(starts) - 1
    threads = min(number_of_threads(), parts)
    return starts[np.linspace(0, parts, threads + 1).round().astype(int)].tolist()


def disc(radius: int, method: MapMethod) -> int:
    return int(method.ring(np.arange(radius + 1)).sum())


def batches_for(stage: Stage, rate: float, per_neuron: float, points: int, method: MapMethod) -> int:
    pull = per_neuron * rate * float(method.ring(np.arange(stage.radius + 1)) @ stage.strength()) / PULL
    return max(1, ceil(pull), ceil(points / method.updates * disc(stage.radius, method)))


def scratch_for(neurons: KernelMesh) -> list[SearchScratch]:
    size = len(neurons.position), len(neurons.elements.node)
    return [SearchScratch.of(*size) for _ in range(number_of_threads())]
