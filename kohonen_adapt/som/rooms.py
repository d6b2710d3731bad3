"""Kernels and settings of the Kohonen map for triangles and for tetrahedra."""

from collections.abc import Callable
from dataclasses import replace
from math import floor, log2
from typing import Any, NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels import ordering
from kohonen_adapt.kernels.tetrahedron import search as search_in_space
from kohonen_adapt.kernels.tetrahedron import stars
from kohonen_adapt.kernels.tetrahedron import train as train_in_space
from kohonen_adapt.kernels.triangle import geometry, search, train
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE, Cell
from kohonen_adapt.som.schedule import Schedule, Stage

__all__ = ["METHODS", "Method"]

MAP_IN_PLANE = "ground", "map", "transport", "locating"
MAP_IN_SPACE = "space ground", "space map", "space moves", "space locating"


class Method(NamedTuple):
    """Kernels and settings of the Kohonen map for one kind of element."""

    cell: Cell
    chapters: tuple[str, ...]  # groups of kernels in `kernels/entries.py`
    draw_points: Any
    find_winners: Any
    learn: Any
    mark_valid: Any
    mark_interior: Any
    shares: Callable[[int, np.random.Generator], Floats]  # of random points, as `shares_in_triangles`
    ring: Callable[[Ints], Ints]  # number of nodes in rings around a node of a regular mesh
    schedule: Callable[[int, str], Schedule]  # default schedule for a number of nodes and a topology, without sweeps
    updates: int  # updates of nodes per batch, so that Ctrl-C takes effect within half a second


def shares_in_triangles(count: int, rng: np.random.Generator) -> Floats:
    """Return uniform random points in barycentric coordinates 1 and 2, (2, count)."""
    u, v = rng.random((2, count))
    outside = u + v > 1.0
    return np.stack([np.where(outside, 1.0 - u, u), np.where(outside, 1.0 - v, v)])


def shares_in_tetrahedra(count: int, rng: np.random.Generator) -> Floats:
    """Return uniform random points in barycentric coordinates 1 to 3, (3, count)."""
    return np.diff(np.sort(rng.random((3, count)), axis=0), axis=0, prepend=0.0)


def ring_in_plane(rings: Ints) -> Ints:
    return np.maximum(1, 6 * rings)


def ring_in_space(rings: Ints) -> Ints:
    """Return the number of nodes in rings of cubes cut into six tetrahedra."""
    return np.where(rings == 0, 1, 12 * rings**2 + 2)


def schedule_in_plane(nnodes: int, topology: str) -> Schedule:
    return replace(Schedule.default(nnodes, topology=topology), sweeps=0)


def schedule_in_space(nnodes: int, topology: str) -> Schedule:
    doublings = max(0, floor(log2(max(1.0, 0.3 * nnodes ** (1 / 3)))))
    radii = [2**k for k in range(doublings, 0, -1)]
    stages = [Stage(r, 2, min(0.3, 1 / r), points_per_neuron=4 / r**2) for r in radii]
    return Schedule((*stages, Stage(1, 5, (0.3, 0.1))))


METHODS = {
    TRIANGLE.dim: Method(
        TRIANGLE, MAP_IN_PLANE, train.draw_points, search.find_winners, train.learn, geometry.mark_valid,
        ordering.mark_interior, shares_in_triangles, ring_in_plane, schedule_in_plane, 5_000_000,
    ),
    TETRAHEDRON.dim: Method(
        TETRAHEDRON, MAP_IN_SPACE, train_in_space.draw_points, search_in_space.find_winners,
        train_in_space.learn, stars.mark_valid, stars.mark_interior, shares_in_tetrahedra, ring_in_space,
        schedule_in_space, 500_000,
    ),
}  # fmt: skip
