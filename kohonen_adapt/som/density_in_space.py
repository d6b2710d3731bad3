"""Densities of nodes on tetrahedra, evaluated at any point."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.locate import Locator
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.som.density import per_element, values_at, without_zeros

__all__ = ["DensityInSpace", "density_in_space"]


class ElementDensityInSpace:
    """Density that is constant on every element of the mesh of its estimate."""

    def __init__(self, tet: Tetrahedralization, values: Floats) -> None:
        node, region = tet.elements.node[tet.used], tet.elements.region[tet.used]
        self.values = without_zeros(values, values.max())
        self._node, self._nnodes = node, tet.nnodes
        self._locator, self._centroids = Locator(tet), tet.centroids()
        self._log_at_corners = averages_by_region(node, region, tet.volumes(), np.log(self.values))

    def at_nodes(self) -> Floats:
        node = self._node.ravel()
        return np.bincount(node, weights=np.repeat(self.values, 4), minlength=self._nnodes) / np.bincount(node)

    def at(self, points: Floats) -> Floats:
        """Return the density at points (k, 3) as fractions of the largest value.

        The logarithm is linear in every element. Points outside have the value of the nearest element.
        """
        found = self._locator.find(points)
        logs = np.sum(self._locator.barycentric_coordinates(points, found) * self._log_at_corners[found], axis=1)
        lost = np.flatnonzero(found < 0)
        if len(lost):
            nearest = cKDTree(self._centroids).query(points[lost])[1]
            logs[lost] = np.log(self.values[nearest])
        return np.exp(logs)


class CallableDensityInSpace:
    """User-defined density as a function of position."""

    def __init__(self, tet: Tetrahedralization, function: Callable[[Floats], ArrayLike]) -> None:
        self.function = function
        nodes, centroids = (values_at(function, points) for points in (tet.position, tet.centroids()))
        self.largest = max(nodes.max(), centroids.max())
        if not self.largest > 0:
            raise ValueError(
                f"density must not be zero everywhere; the callable is at all {len(nodes) + len(centroids)} points "
                "looked at. Give it a small positive value where few nodes are wanted."
            )
        self._at_nodes = without_zeros(nodes, self.largest)

    def at_nodes(self) -> Floats:
        return self._at_nodes

    def at(self, points: Floats) -> Floats:
        return without_zeros(values_at(self.function, points), self.largest)


DensityInSpace = ElementDensityInSpace | CallableDensityInSpace


def density_in_space(tet: Tetrahedralization, density: ArrayLike | Callable[[Floats], ArrayLike]) -> DensityInSpace:
    if callable(density):
        return CallableDensityInSpace(tet, density)
    values = per_element(len(tet.used), density, "density")
    if not values.any():
        raise ValueError("density must not be zero everywhere; give it a positive value where nodes are wanted.")
    return ElementDensityInSpace(tet, values)


def averages_by_region(node: Ints, region: Ints, volumes: Floats, values: Floats) -> Floats:
    """Return volume-weighted averages at corners, each within its region, (m, 4)."""
    count = int(region.max()) + 1
    site, of_corner = np.unique(node.astype(np.int64) * count + region[:, None], return_inverse=True)
    of_corner = of_corner.ravel()
    total = np.bincount(of_corner, weights=np.repeat(volumes, 4), minlength=len(site))
    mean = np.bincount(of_corner, weights=np.repeat(volumes * values, 4), minlength=len(site)) / total
    return mean[of_corner].reshape(node.shape)
