"""Draw training points from a density of nodes, and look the density up where nodes have gone."""

from collections.abc import Callable
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.kernels.triangle.search import STRETCH
from kohonen_adapt.kernels.triangle.smooth import (
    Sites,
    average_at_sites,
    count_sites,
    fill_sites,
    multiply_factors,
    update_factors,
)
from kohonen_adapt.mesh.locate import holding
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.density import per_element, values_at, without_zeros
from kohonen_adapt.som.draw import Draw
from kohonen_adapt.som.rooms import ROOMS

__all__ = [
    "CallableDensity",
    "Density",
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

FEW = 5_000  # nodes that are not worth another thread
CANDIDATES = 2**17  # points at which a callable density is looked at per draw, and 4 to 64 per element
AT_ONCE = 2**17  # and how many of them, or of its elements' quadrature points, are held in memory


class OfElements:
    """The mesh of a density as it is now, for the map goes on to change its own; and the mass of every element."""

    masses: Floats

    def __init__(self, mesh: Triangulation | Tetrahedralization) -> None:
        self.position, self.elements = mesh.position.copy(), mesh.elements
        own = {name: getattr(self.elements, name).copy() for name in ("node", "neighbour", "region")}
        self.elements = self.elements._replace(**own)
        self.room = ROOMS[self.position.shape[1]]
        corners = self.position[self.elements.node].transpose(2, 1, 0)
        self.sizes = self.room.cell.determinant(corners) / factorial(self.room.cell.dim)
        self._order = along_curve(mesh.centroids()).astype(np.int32)

    def at_nodes(self) -> Floats:
        """The mean over the elements around every node, (n,); each counts the same, as small ones know better."""
        node, values = self.elements.node, self.masses / self.sizes
        return np.bincount(node.ravel(), weights=np.repeat(values, node.shape[1])) / np.bincount(node.ravel())


class ElementSource(OfElements):
    """Training points of a density that is constant on every element of the mesh it was estimated on."""

    def __init__(self, mesh: Triangulation | Tetrahedralization, values: Floats) -> None:
        super().__init__(mesh)
        self.values = without_zeros(values, values.max())
        self.masses = self.sizes * self.values
        self._cumulated = np.cumsum(self.masses[self._order])

    def draw(self, number: int, rng: np.random.Generator) -> Draw:
        """Points stratified along a space-filling curve: every stretch of the summed-up mass gets its share."""
        dim, node = self.room.cell.dim, self.elements.node
        points, element = np.empty((number, dim)), np.empty(number, dtype=np.int32)
        random = rng.random((number, dim + 1))
        self.room.draw_points(self.position, node, self._order, self._cumulated, random, points, element)
        return Draw(points, element, self.elements.region[element], np.ones(number))


class ElementDensity(ElementSource):
    """A density of triangles that is constant on every element of the mesh it was estimated on."""

    lasting = 4  # sweeps for which its squares are good: it changes little over the way that a node goes in them

    def __init__(self, triangulation: Triangulation, values: Floats) -> None:
        super().__init__(triangulation, values)
        self._log_at_corners = np.empty(self.elements.node.shape)
        cuts = even_cuts(triangulation.nnodes, FEW)
        arrays = self.sizes, self.values, self.elements, triangulation.star
        shared(lambda thread, first, last: average_at_sites(*arrays, first, last, self._log_at_corners), cuts)
        self._sites = sites_of(triangulation)

    def squares(self, triangulation: Triangulation) -> Floats:
        """Square of the share of the largest density, at every element of the triangulation as it is now, (m,)."""
        squares = np.empty(len(triangulation.elements.node))

        def look_up(thread: int, first: int, last: int) -> None:
            update_factors(
                triangulation.position, first, last, self._sites, self.position, self.elements, self._log_at_corners
            )

        shared(look_up, even_cuts(triangulation.nnodes, FEW, STRETCH))
        multiply_factors(triangulation.elements, self._sites, squares)
        return squares

    def refit(self, triangulation: Triangulation, before: Triangulation, hint: Ints) -> None:
        """Find the nodes of a recycled triangulation in the density's own mesh `before`, from elements near them."""
        self._sites = sites_of(triangulation)
        middle = triangulation.centroids()[self._sites.element]
        start = hint[np.repeat(np.arange(triangulation.nnodes), np.diff(self._sites.start))]
        self._sites.element[:] = holding(before, middle, start, across_outlines=True)


class FunctionSource(OfElements):
    """Training points of a density given as a function of position, sampled wherever it is needed."""

    def __init__(self, mesh: Triangulation | Tetrahedralization, function: Callable[[Floats], ArrayLike]) -> None:
        super().__init__(mesh)
        self.function = function
        self.share = int(np.clip(CANDIDATES // len(self.sizes), 4, 64))
        rng = np.random.default_rng(0)
        values = np.concatenate([self._candidates(stretch, rng)[1] for stretch in self._stretches()])
        self.largest = values.max()
        if not self.largest > 0:
            raise ValueError(
                f"density must not be zero everywhere; the callable is at all {len(values)} points looked at. "
                "Give it a small positive value where few nodes are wanted."
            )
        means = without_zeros(values, self.largest).reshape(len(self.sizes), self.share).mean(axis=1)
        self.masses = np.empty_like(self.sizes)
        self.masses[self._order] = self.sizes[self._order] * means

    def _stretches(self) -> list[Ints]:
        """The elements along the curve, cut where there are candidates enough to be held in memory."""
        most = AT_ONCE // self.share
        return [self._order[first : first + most] for first in range(0, len(self._order), most)]

    def _candidates(self, stretch: Ints, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """As many random points in every element of a stretch, along the curve, and the density there."""
        points = self._points_in(np.repeat(stretch, self.share), rng)
        return points, values_at(self.function, points)

    def draw(self, number: int, rng: np.random.Generator) -> Draw:
        """About `number` of many candidates, chosen by the density at each and stratified along the curve.

        Every stretch gets as many as its share of the mass says.
        """
        stretches = self._stretches()
        mass = np.cumsum([0.0, *(self.masses[stretch].sum() for stretch in stretches)])
        ends = np.round(number * (mass / mass[-1])).astype(np.int64)
        shares = zip(stretches, np.diff(ends).tolist(), strict=True)
        drawn = [self._draw_from(stretch, share, rng) for stretch, share in shares]
        points, element = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
        return Draw(points, element, self.elements.region[element], np.ones(number))

    def _draw_from(self, stretch: Ints, number: int, rng: np.random.Generator) -> tuple[Floats, Ints]:
        """So many candidates in a stretch of the curve, and their elements."""
        points, values = self._candidates(stretch, rng)
        cumulated = np.cumsum(np.repeat(self.sizes[stretch], self.share) * without_zeros(values, self.largest))
        levels = (np.arange(number) + rng.random(number)) * (cumulated[-1] / max(1, number))
        chosen = np.minimum(np.searchsorted(cumulated, levels), len(cumulated) - 1)
        return points[chosen], stretch[chosen // self.share]

    def _points_in(self, element: NDArray[np.int32], rng: np.random.Generator) -> Floats:
        """A random point in each of the given elements, (k, d)."""
        corners = [self.position[self.elements.node[element, k]] for k in range(self.room.cell.dim + 1)]
        points = corners[0]
        for share, corner in zip(self.room.shares(len(element), rng), corners[1:], strict=True):
            points = points + share[:, None] * (corner - corners[0])
        return points


class CallableDensity(FunctionSource):
    """A density of triangles given as a function of position."""

    lasting = 1  # sweeps for which its squares are good: it may change from any place to the next

    def refit(self, triangulation: Triangulation, before: Triangulation, hint: Ints) -> None:
        """Nothing: the function is asked anew wherever nodes are."""

    def squares(self, triangulation: Triangulation) -> Floats:
        """Square of the mean share of the largest density, in every element of the triangulation as it is now, (m,)."""
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
    """A user's density, checked, for the mesh of a triangulation; `row` has where each element is in `density`, (m,).

    Raises
    ------
    ValueError
        If it has another shape than (nelements,), is negative, not finite, or zero everywhere.
    """
    if callable(density):
        return CallableDensity(triangulation, density)
    values = per_element(len(triangulation.elements.node), density, "density")
    if not values.any():
        raise ValueError("density must not be zero everywhere; give it a positive value where nodes are wanted.")
    return ElementDensity(triangulation, values if row is None else values[row])


def source_of(
    mesh: Triangulation | Tetrahedralization, density: ArrayLike | Callable[[Floats], ArrayLike]
) -> ElementSource | FunctionSource:
    """Where training points of a user's density come from, which was checked before."""
    if callable(density):
        return FunctionSource(mesh, density)
    return ElementSource(mesh, per_element(len(mesh.elements.node), density, "density"))


def sites_of(triangulation: Triangulation) -> Sites:
    """The regions of every node, with the elements around it to start searches from."""
    elements, star = triangulation.elements, triangulation.star
    start = np.empty_like(star.start)
    count_sites(elements, star, start)
    region, element = (np.empty(start[-1], dtype=np.int32) for _ in range(2))
    sites = Sites(start, region, element, np.empty(start[-1]))
    fill_sites(elements, star, sites)
    return sites
