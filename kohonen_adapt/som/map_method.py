"""Parts of the Kohonen map that depend on the dimension of the mesh."""

from abc import ABC, abstractmethod
from dataclasses import replace
from math import floor, log2
from typing import Any, ClassVar

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


class MapMethod(ABC):
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
    """

    cell: ClassVar[Cell]
    kernel_groups: ClassVar[tuple[str, ...]]
    find_winners: ClassVar[Any]
    learn: ClassVar[Any]
    mark_valid: ClassVar[Any]
    updates: ClassVar[int]

    @abstractmethod
    def barycentric(self, count: int, rng: Generator) -> Floats:
        """Return uniform random barycentric coordinates 1 to dim, (dim, count)."""

    @abstractmethod
    def ring(self, rings: Ints) -> Ints:
        """Return the number of nodes in each ring around a node of a regular mesh."""

    @abstractmethod
    def schedule(self, nnodes: int, topology: str) -> Schedule:
        """Return the default schedule, without sweeps."""


class PlaneMap(MapMethod):
    cell = TRIANGLE
    kernel_groups = "ground", "map", "transport", "locating"
    find_winners = staticmethod(locate.find_winners)
    learn = staticmethod(train.learn)
    mark_valid = staticmethod(geometry.mark_valid)
    updates = 5_000_000

    def barycentric(self, count: int, rng: Generator) -> Floats:
        u, v = rng.random((2, count))
        outside = u + v > 1.0
        return np.stack([np.where(outside, 1.0 - u, u), np.where(outside, 1.0 - v, v)])

    def ring(self, rings: Ints) -> Ints:
        return np.maximum(1, 6 * rings)

    def schedule(self, nnodes: int, topology: str) -> Schedule:
        return replace(Schedule.default(nnodes, topology=topology), sweeps=0)


class SpaceMap(MapMethod):
    cell = TETRAHEDRON
    kernel_groups = "space ground", "space map", "space moves", "space locating"
    find_winners = staticmethod(locate_in_space.find_winners)
    learn = staticmethod(train_in_space.learn)
    mark_valid = staticmethod(guard_in_space.mark_valid)
    updates = 500_000

    def barycentric(self, count: int, rng: Generator) -> Floats:
        return np.diff(np.sort(rng.random((3, count)), axis=0), axis=0, prepend=0.0)

    def ring(self, rings: Ints) -> Ints:
        return np.where(rings == 0, 1, 12 * rings**2 + 2)  # of cubes cut into six tetrahedra

    def schedule(self, nnodes: int, topology: str) -> Schedule:
        doublings = max(0, floor(log2(max(1.0, 0.3 * nnodes ** (1 / 3)))))
        radii = [2**k for k in range(doublings, 0, -1)]
        stages = [Stage(r, 2, min(0.3, 1 / r), points_per_neuron=4 / r**2) for r in radii]
        return Schedule((*stages, Stage(1, 5, (0.3, 0.1))))


def map_method_of(dim: int) -> MapMethod:
    return SpaceMap() if dim == TETRAHEDRON.dim else PlaneMap()
