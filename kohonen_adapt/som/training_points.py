"""Densities of nodes, and training points drawn from them."""

from dataclasses import replace
from functools import cached_property
from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import DataFunction, Floats, FloatsPair, Int32s, Ints, ranks
from kohonen_adapt.kernels.draw import draw_points
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.mesh.locate import Locator, barycentric_coordinates, walk_to_elements
from kohonen_adapt.mesh.shapes import logarithms, mean_shapes, shapes_at_nodes
from kohonen_adapt.mesh.tessellation import AnyTessellation
from kohonen_adapt.som.density import parts_of, per_element, values_at, without_zeros
from kohonen_adapt.som.map_method import map_method_of

__all__ = ["Density", "Draw", "density_of", "values_at", "without_zeros"]

# barycentric coordinates of the corners, the midpoints of the edges, and the barycentre
QUADRATURE = np.array([*np.eye(3), *(0.5 - 0.5 * np.eye(3)), np.full(3, 1 / 3)])

CANDIDATES = 2**17  # number of evaluations of a callable density per draw, limited to 4 to 64 per element


class Draw(NamedTuple):
    """Training points with their elements, regions and weights.

    `points` has shape (k, d), `shape` (k, 3) or (k, 6), None for round shapes, and the other arrays (k,). Elements are
    numbered in the mesh of the density. The order is along a space-filling curve, so that neighbours in the arrays are
    near in the mesh.
    """

    points: Floats
    element: Int32s
    region: Int32s
    weights: Floats
    shape: Floats | None = None

    def reordered(self, order: Ints) -> "Draw":
        shape = None if self.shape is None else self.shape[order]
        return Draw(self.points[order], self.element[order], self.region[order], self.weights[order], shape)


class Density:
    """Density on a mesh, with mass and shape of every element.

    The mesh is a copy, because the map changes the mesh that it trains.
    """

    masses: Floats
    shape: Floats | None = None
    at_once = 2**17  # number of evaluations, or quadrature points of elements, that are held in memory at once
    _near: Ints

    def __init__(self, mesh: AnyTessellation) -> None:
        own = {name: getattr(mesh.elements, name).copy() for name in ("node", "neighbour", "region")}
        self.base = replace(mesh, position=mesh.position.copy(), elements=mesh.elements._replace(**own))
        self.position, self.elements = self.base.position, self.base.elements
        self.method = map_method_of(self.position.shape[1])
        corners = self.position[self.elements.node].transpose(2, 1, 0)
        self.sizes = self.method.cell.determinant(corners) / factorial(self.method.cell.dim)
        self.shares = np.full((1, len(corners[0])), 1.0 / len(corners[0]))
        self._order = along_curve(mesh.centroids()).astype(np.int32)

    @property
    def lasting(self) -> int:
        """Number of sweeps with the same weights."""
        return 1

    def at(self, points: Floats) -> Floats:
        """Return the density at points (k, d) as fractions of the largest value."""
        raise NotImplementedError

    def means(self, corners: Floats) -> Floats:
        """Return mean densities of elements as fractions of the largest value.

        `corners` has shape (m, d + 1, d).
        """
        means = np.empty(len(corners))
        most = self.at_once // len(self.shares)
        for first in range(0, len(corners), most):
            points = np.einsum("qk,mkd->qmd", self.shares, corners[first : first + most])
            values = self.at(points.reshape(-1, points.shape[-1]))
            means[first : first + most] = values.reshape(len(self.shares), -1).mean(axis=0)
        return means

    def nodal_shapes(self) -> Floats | None:
        if self.shape is None:
            return None
        return shapes_at_nodes(self.elements.node, self.shape, self.sizes, len(self.position))

    def shapes_now(self, mesh: AnyTessellation, near: Ints | None = None) -> Floats | None:
        # at the nodes of a mesh, each `near` an element of the mesh of the density, or near the element found before
        nodal = self.nodal_shapes()
        if nodal is None:
            return None
        start = self._near if near is None else near
        self._near = walk_to_elements(self.base, mesh.position, start, across_regions=True)
        share = barycentric_coordinates(self.position, self.elements.node, mesh.position, self._near)
        share = np.maximum(share, 0.0)
        mean = np.einsum("nk,nki->ni", share, logarithms(nodal)[self.elements.node[self._near]])
        return mean_shapes(mean / share.sum(axis=1, keepdims=True))

    def at_nodes(self) -> Floats:
        node = self.elements.node
        values = self.masses / self.sizes
        return np.bincount(node.ravel(), np.repeat(values, node.shape[1])) / np.bincount(node.ravel())

    def draw(self, number: int, rng: Generator) -> Draw:
        points, element = self._drawn(number, rng)
        shape = None if self.shape is None else self.shape[element]
        return Draw(points, element, self.elements.region[element], np.ones(number), shape)

    def _drawn(self, number: int, rng: Generator) -> tuple[Floats, Int32s]:
        raise NotImplementedError


class ElementDensity(Density):
    def __init__(self, mesh: AnyTessellation, values: Floats) -> None:
        super().__init__(mesh)
        self.values = without_zeros(values, values.max())
        self.masses = self.sizes * self.values
        self._cumulated = np.cumsum(self.masses[self._order])

    @property
    def lasting(self) -> int:
        # in so few sweeps the density at a node changes little, except across a thin layer
        return 4 if self.shape is None else 1

    def at(self, points: Floats) -> Floats:
        # The logarithm is linear in every element. Points outside have the value of the nearest element.
        found = self._locator.find(points)
        logs = np.sum(self._locator.barycentric_coordinates(points, found) * self._logs[found], axis=1)
        lost = np.flatnonzero(found < 0)
        if len(lost):
            nearest = cKDTree(self.base.centroids()).query(points[lost])[1]
            logs[lost] = np.log(self.values[nearest])
        return np.exp(logs)

    @cached_property
    def _locator(self) -> Locator:
        return Locator(self.base)

    @cached_property
    def _logs(self) -> Floats:
        # of the mean densities around corners, each within its region, (m, d + 1)
        node = self.elements.node
        count = int(self.elements.region.max()) + 1
        site, of_corner = np.unique(node.astype(np.int64) * count + self.elements.region[:, None], return_inverse=True)
        of_corner = of_corner.ravel()
        mass, size = (
            np.bincount(of_corner, np.repeat(array, node.shape[1]), len(site)) for array in (self.masses, self.sizes)
        )
        return np.log(mass / size)[of_corner].reshape(node.shape)

    def _drawn(self, number: int, rng: Generator) -> tuple[Floats, Int32s]:
        dim = self.method.cell.dim
        points, element = np.empty((number, dim)), np.empty(number, np.int32)
        arrays = self.position, self.elements.node, self._order, self._cumulated, rng.random((number, dim + 1))
        draw_points(*arrays, points, element)
        return points, element


class FunctionDensity(Density):
    def __init__(self, mesh: AnyTessellation, function: DataFunction) -> None:
        super().__init__(mesh)
        self.function = function
        if self.method.cell.dim == 2:
            self.shares = QUADRATURE
        self.points_per_element = int(np.clip(CANDIDATES // len(self.sizes), 4, 64))
        rng = np.random.default_rng(0)
        values = np.concatenate([self._candidates(stretch, rng)[1] for stretch in self._stretches()])
        self.largest = values.max()
        if not self.largest > 0:
            raise ValueError(
                f"density must not be zero everywhere; the callable is at all {len(values)} points looked at. "
                "Give it a small positive value where few nodes are wanted."
            )
        means = without_zeros(values, self.largest).reshape(len(self.sizes), self.points_per_element).mean(axis=1)
        self.masses = np.empty_like(self.sizes)
        self.masses[self._order] = self.sizes[self._order] * means

    def _stretches(self) -> list[Ints]:
        most = self.at_once // self.points_per_element
        return [self._order[first : first + most] for first in range(0, len(self._order), most)]

    def _candidates(self, stretch: Ints, rng: Generator) -> FloatsPair:
        points = self._points_in(np.repeat(stretch, self.points_per_element), rng)
        return points, values_at(self.function, points)

    def at(self, points: Floats) -> Floats:
        return without_zeros(values_at(self.function, points), self.largest)

    def _drawn(self, number: int, rng: Generator) -> tuple[Floats, Int32s]:
        """Draw about `number` of many candidates with probability according to density.

        The points are stratified along the order of the elements; every interval has as many as its mass requires.
        """
        stretches = self._stretches()
        mass = np.cumsum([0.0, *(self.masses[stretch].sum() for stretch in stretches)])
        ends = np.round(number * (mass / mass[-1])).astype(np.int64)
        random_points = zip(stretches, np.diff(ends).tolist(), strict=True)
        drawn = [self._draw_from(stretch, points_per_element, rng) for stretch, points_per_element in random_points]
        points, element = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
        return points, element

    def _draw_from(self, stretch: Ints, number: int, rng: Generator) -> tuple[Floats, Ints]:
        points, values = self._candidates(stretch, rng)
        cumulated = np.cumsum(
            np.repeat(self.sizes[stretch], self.points_per_element) * without_zeros(values, self.largest)
        )
        levels = (np.arange(number) + rng.random(number)) * (cumulated[-1] / max(1, number))
        chosen = np.minimum(np.searchsorted(cumulated, levels), len(cumulated) - 1)
        return points[chosen], stretch[chosen // self.points_per_element]

    def _points_in(self, element: Int32s, rng: Generator) -> Floats:
        corners = [self.position[self.elements.node[element, k]] for k in range(self.method.cell.dim + 1)]
        points = corners[0]
        for barycentric, corner in zip(self.method.barycentric(len(element), rng), corners[1:], strict=True):
            points = points + barycentric[:, None] * (corner - corners[0])
        return points


def density_of(mesh: AnyTessellation, density: ArrayLike | DataFunction, row: Ints | None = None) -> Density:
    # `row` is the previous index of every element of a mesh that was renumbered
    values, shape = parts_of(density, mesh.centroids()[slice(None) if row is None else ranks(row, len(row))])
    if callable(values):
        found: Density = FunctionDensity(mesh, values)
    else:
        checked = per_element(len(mesh.elements.node), values, "density")
        if not checked.any():
            raise ValueError("density must not be zero everywhere; give it a positive value where nodes are wanted.")
        found = ElementDensity(mesh, checked if row is None else checked[row])
    found.shape = shape if shape is None or row is None else shape[row]
    return found
