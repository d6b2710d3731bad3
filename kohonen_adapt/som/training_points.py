"""Densities of nodes, and training points drawn from them."""

from collections.abc import Callable
from dataclasses import replace
from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kohonen_adapt.arrays import Floats, Ints, ranks
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.kernels.triangle.locate import STRETCH
from kohonen_adapt.kernels.triangle.smooth import (
    Sites,
    average_at_sites,
    count_sites,
    fill_sites,
    multiply_factors,
    update_factors,
)
from kohonen_adapt.mesh.locate import barycentric_coordinates, walk_to_elements
from kohonen_adapt.mesh.shapes import logarithms, mean_shapes, shapes_at_nodes
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.density import parts_of, per_element, values_at, without_zeros
from kohonen_adapt.som.map_method import map_method_of

__all__ = [
    "CallableDensity",
    "Density",
    "Draw",
    "ElementDensity",
    "ElementSource",
    "FunctionSource",
    "density_of",
    "source_of",
    "values_at",
    "without_zeros",
]

# barycentric coordinates of the corners, the midpoints of the edges, and the barycentre
QUADRATURE = np.array([*np.eye(3), *(0.5 - 0.5 * np.eye(3)), np.full(3, 1 / 3)])

FEW = 5_000  # minimum number of nodes per thread
CANDIDATES = 2**17  # number of evaluations of a callable density per draw, limited to 4 to 64 per element
AT_ONCE = 2**17  # number of evaluations, or quadrature points of elements, that are held in memory at once


class Draw(NamedTuple):
    """Training points with their elements, regions and weights.

    `points` has shape (k, d), `shape` (k, 3) or (k, 6), None for round shapes, and the other arrays (k,). Elements are
    numbered in the mesh of the density. The order is along a space-filling curve, so that neighbours in the arrays are
    near in the mesh.
    """

    points: Floats
    element: NDArray[np.int32]
    region: NDArray[np.int32]
    weights: Floats
    shape: Floats | None = None

    def reordered(self, order: Ints) -> "Draw":
        shape = None if self.shape is None else self.shape[order]
        return Draw(self.points[order], self.element[order], self.region[order], self.weights[order], shape)


class OfElements:
    """Mesh of a density, with mass and shape of every element.

    The mesh is a copy, because the map changes the mesh that it trains.
    """

    masses: Floats
    shape: Floats | None = None
    _near: Ints

    def __init__(self, mesh: Triangulation | Tetrahedralization) -> None:
        self.position, self.elements = mesh.position.copy(), mesh.elements
        own = {name: getattr(self.elements, name).copy() for name in ("node", "neighbour", "region")}
        self.elements = self.elements._replace(**own)
        self.method = map_method_of(self.position.shape[1])
        corners = self.position[self.elements.node].transpose(2, 1, 0)
        self.sizes = self.method.cell.determinant(corners) / factorial(self.method.cell.dim)
        self._order = along_curve(mesh.centroids()).astype(np.int32)

    def shapes_now(self, mesh: Triangulation | Tetrahedralization, near: Ints | None = None) -> Floats | None:
        # at the nodes of a mesh, each `near` an element of the mesh of the density, or near the element found before
        if self.shape is None:
            return None
        base = replace(mesh, position=self.position, elements=self.elements)  # type: ignore[arg-type]
        self._near = walk_to_elements(base, mesh.position, self._near if near is None else near, across_regions=True)
        share = barycentric_coordinates(self.position, self.elements.node, mesh.position, self._near)
        share = np.maximum(share, 0.0)
        logs = logarithms(shapes_at_nodes(self.elements.node, self.shape, self.sizes, len(self.position)))
        mean = np.einsum("nk,nki->ni", share, logs[self.elements.node[self._near]])
        return mean_shapes(mean / share.sum(axis=1, keepdims=True))

    def at_nodes(self) -> Floats:
        node, values = self.elements.node, self.masses / self.sizes
        return np.bincount(node.ravel(), weights=np.repeat(values, node.shape[1])) / np.bincount(node.ravel())


class ElementSource(OfElements):
    def __init__(self, mesh: Triangulation | Tetrahedralization, values: Floats) -> None:
        super().__init__(mesh)
        self.values = without_zeros(values, values.max())
        self.masses = self.sizes * self.values
        self._cumulated = np.cumsum(self.masses[self._order])

    def draw(self, number: int, rng: np.random.Generator) -> Draw:
        dim, node = self.method.cell.dim, self.elements.node
        points, element = np.empty((number, dim)), np.empty(number, dtype=np.int32)
        random = rng.random((number, dim + 1))
        self.method.draw_points(self.position, node, self._order, self._cumulated, random, points, element)
        shape = None if self.shape is None else self.shape[element]
        return Draw(points, element, self.elements.region[element], np.ones(number), shape)


class ElementDensity(ElementSource):
    @property
    def lasting(self) -> int:
        # sweeps with the same squares: in so few the density at a node changes little, except across a thin layer
        return 4 if self.shape is None else 1

    def __init__(self, triangulation: Triangulation, values: Floats) -> None:
        super().__init__(triangulation, values)
        self._log_at_corners = np.empty(self.elements.node.shape)
        cuts = even_cuts(triangulation.nnodes, FEW)
        arrays = self.sizes, self.values, self.elements, triangulation.star
        shared(lambda thread, first, last: average_at_sites(*arrays, first, last, self._log_at_corners), cuts)
        self._sites = sites_of(triangulation)

    def squares(self, triangulation: Triangulation) -> Floats:
        squares = np.empty(len(triangulation.elements.node))

        def look_up(thread: int, first: int, last: int) -> None:
            update_factors(
                triangulation.position, first, last, self._sites, self.position, self.elements, self._log_at_corners
            )

        shared(look_up, even_cuts(triangulation.nnodes, FEW, STRETCH))
        multiply_factors(triangulation.elements, self._sites, squares)
        return squares

    def refit(self, triangulation: Triangulation, before: Triangulation, start_element: Ints) -> None:
        self._sites = sites_of(triangulation)
        middle = triangulation.centroids()[self._sites.element]
        start = start_element[np.repeat(np.arange(triangulation.nnodes), np.diff(self._sites.start))]
        self._sites.element[:] = walk_to_elements(before, middle, start, across_regions=True)


class FunctionSource(OfElements):
    def __init__(self, mesh: Triangulation | Tetrahedralization, function: Callable[[Floats], ArrayLike]) -> None:
        super().__init__(mesh)
        self.function = function
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
        most = AT_ONCE // self.points_per_element
        return [self._order[first : first + most] for first in range(0, len(self._order), most)]

    def _candidates(self, stretch: Ints, rng: np.random.Generator) -> tuple[Floats, Floats]:
        points = self._points_in(np.repeat(stretch, self.points_per_element), rng)
        return points, values_at(self.function, points)

    def draw(self, number: int, rng: np.random.Generator) -> Draw:
        """Draw about `number` of many candidates with probability according to density.

        The points are stratified along the order of the elements; every interval has as many as its mass requires.
        """
        stretches = self._stretches()
        mass = np.cumsum([0.0, *(self.masses[stretch].sum() for stretch in stretches)])
        ends = np.round(number * (mass / mass[-1])).astype(np.int64)
        random_points = zip(stretches, np.diff(ends).tolist(), strict=True)
        drawn = [self._draw_from(stretch, points_per_element, rng) for stretch, points_per_element in random_points]
        points, element = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
        shape = None if self.shape is None else self.shape[element]
        return Draw(points, element, self.elements.region[element], np.ones(number), shape)

    def _draw_from(self, stretch: Ints, number: int, rng: np.random.Generator) -> tuple[Floats, Ints]:
        points, values = self._candidates(stretch, rng)
        cumulated = np.cumsum(
            np.repeat(self.sizes[stretch], self.points_per_element) * without_zeros(values, self.largest)
        )
        levels = (np.arange(number) + rng.random(number)) * (cumulated[-1] / max(1, number))
        chosen = np.minimum(np.searchsorted(cumulated, levels), len(cumulated) - 1)
        return points[chosen], stretch[chosen // self.points_per_element]

    def _points_in(self, element: NDArray[np.int32], rng: np.random.Generator) -> Floats:
        corners = [self.position[self.elements.node[element, k]] for k in range(self.method.cell.dim + 1)]
        points = corners[0]
        for barycentric, corner in zip(self.method.barycentric(len(element), rng), corners[1:], strict=True):
            points = points + barycentric[:, None] * (corner - corners[0])
        return points


class CallableDensity(FunctionSource):
    lasting = 1  # sweeps with the same squares: the function may change from point to point

    def refit(self, triangulation: Triangulation, before: Triangulation, start_element: Ints) -> None:
        """Do nothing, because the function is evaluated wherever nodes are."""

    def squares(self, triangulation: Triangulation) -> Floats:
        node = triangulation.elements.node
        squares, most = np.empty(len(node)), AT_ONCE // len(QUADRATURE)
        for first in range(0, len(node), most):
            points = np.einsum("qk,mkd->qmd", QUADRATURE, triangulation.position[node[first : first + most]])
            values = values_at(self.function, points.reshape(-1, points.shape[-1])).reshape(len(QUADRATURE), -1)
            squares[first : first + most] = without_zeros(values, self.largest).mean(axis=0) ** 2
        return squares


Density = ElementDensity | CallableDensity


def density_of(
    triangulation: Triangulation, density: ArrayLike | Callable[[Floats], ArrayLike], row: Ints | None = None
) -> Density:
    # `row` is the previous index of every element of a mesh that was renumbered
    values, shape = parts_of(density, triangulation.centroids()[slice(None) if row is None else ranks(row, len(row))])
    if callable(values):
        found: Density = CallableDensity(triangulation, values)
    else:
        checked = per_element(len(triangulation.elements.node), values, "density")
        if not checked.any():
            raise ValueError("density must not be zero everywhere; give it a positive value where nodes are wanted.")
        found = ElementDensity(triangulation, checked if row is None else checked[row])
    found.shape = shape if shape is None or row is None else shape[row]
    return found


def source_of(
    mesh: Triangulation | Tetrahedralization, density: ArrayLike | Callable[[Floats], ArrayLike]
) -> ElementSource | FunctionSource:
    values, shape = parts_of(density, mesh.centroids())
    if callable(values):
        found: ElementSource | FunctionSource = FunctionSource(mesh, values)
    else:
        found = ElementSource(mesh, per_element(len(mesh.elements.node), values, "density"))
    found.shape = shape
    return found


def sites_of(triangulation: Triangulation) -> Sites:
    elements, star = triangulation.elements, triangulation.star
    start = np.empty_like(star.start)
    count_sites(elements, star, start)
    region, element = (np.empty(start[-1], dtype=np.int32) for _ in range(2))
    sites = Sites(start, region, element, np.empty(start[-1]))
    fill_sites(elements, star, sites)
    return sites
