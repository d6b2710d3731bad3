"""Parts of the Kohonen map that depend on the dimension of the mesh."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import floor, log2
from typing import Any

import numpy as np
from numpy.random import Generator

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.tetrahedron import guard as guard_in_space
from kohonen_adapt.kernels.tetrahedron import locate as locate_in_space
from kohonen_adapt.kernels.tetrahedron import train as train_in_space
from kohonen_adapt.kernels.triangle import geometry, locate, train
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE, Cell
from kohonen_adapt.som.schedule import Schedule, Stage

__all__ = ["MapMethod", "map_method_of"]


@dataclass(frozen=True)
class MapMethod:
    """Kernels and settings of the Kohonen map for one kind of element.

    Attributes
    ----------
    cell
        Kind of element.
    kernel_groups
        Groups of `kernels/entries.py`.
    find_winners, learn, mark_valid
        Kernels, which take the same arguments for both kinds of element.
    updates
        Updates of nodes per batch, so that Ctrl-C takes effect within half a second.
    barycentric
        Uniform random barycentric coordinates 1 to dim of points, (dim, count).
    ring
        Number of nodes in each ring around a node of a regular mesh.
    schedule
        Default schedule, without sweeps, by the number of nodes and the topology.
    """

    cell: Cell
    kernel_groups: tuple[str, ...]
    find_winners: Any
    learn: Any
    mark_valid: Any
    updates: int
    barycentric: Callable[[int, Generator], Floats]
    ring: Callable[[Ints], Ints]
    schedule: Callable[[int, str], Schedule]

    def __reduce__(self) -> tuple[Any, ...]:
        return map_method_of, (self.cell.dim,)  # for copies in other processes


def points_of_triangle(count: int, rng: Generator) -> Floats:
    points = rng.random((2, count))
    return np.where(points.sum(axis=0) > 1.0, 1.0 - points, points)


def points_of_tetrahedron(count: int, rng: Generator) -> Floats:
    return np.diff(np.sort(rng.random((3, count)), axis=0), axis=0, prepend=0.0)


def schedule_in_space(nnodes: int, topology: str) -> Schedule:
    doublings = max(0, floor(log2(max(1.0, 0.3 * nnodes ** (1 / 3)))))
    radii = [2**k for k in range(doublings, 0, -1)]
    stages = [Stage(r, 2, min(0.3, 1 / r), points_per_neuron=4 / r**2) for r in radii]
    return Schedule((*stages, Stage(1, 5, (0.3, 0.1))))


PLANE = MapMethod(
    TRIANGLE,
    ("ground", "map", "transport", "locating"),
    locate.find_winners,
    train.learn,
    geometry.mark_valid,
    5_000_000,
    points_of_triangle,
    lambda rings: np.maximum(1, 6 * rings),
    lambda nnodes, topology: replace(Schedule.default(nnodes, topology=topology), sweeps=0),
)
SPACE = MapMethod(
    TETRAHEDRON,
    ("space ground", "space map", "space moves", "space locating"),
    locate_in_space.find_winners,
    train_in_space.learn,
    guard_in_space.mark_valid,
    500_000,
    points_of_tetrahedron,
    lambda rings: np.where(rings == 0, 1, 12 * rings**2 + 2),  # of cubes cut into six tetrahedra
    schedule_in_space,
)


def map_method_of(dim: int) -> MapMethod:
    return SPACE if dim == TETRAHEDRON.dim else PLANE
