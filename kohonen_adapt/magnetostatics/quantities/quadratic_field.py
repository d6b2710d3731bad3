"""The field of quadratic elements: means over elements, and the potential between the nodes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.quadratic import Quadratic, repeated
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.mesh.locate import find_elements

__all__ = ["QuadraticField"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class QuadraticField(Field):
    """A planar field that is linear in every element; what is given per element is its mean there.

    Parameters
    ----------
    mesh, potential, coefficients, symmetry, depth, newton
        As of a `Field`; the potential at the nodes is the first part of `values`.
    problem
        The functional that it minimises.
    values : (nnodes + nfacets,)
        A at the nodes and at the middles of the facets, in Wb/m.
    """

    problem: Quadratic
    values: Floats

    @cached_property
    def _points(self) -> tuple[Floats, Floats, Floats]:
        """B, H and the energy density at the quadrature points."""
        density = self.problem.flux_density(self.values)
        given = repeated(self.coefficients, self.problem.weights.shape[1])
        return density, given.field_strength(density), given.energy_density(density)

    @property
    def mean_unknown(self) -> Floats:
        """Mean of A over every element, (nelements,): the values at the middles of its facets have it all."""
        return self.values[self.problem.unknowns[3:]].mean(axis=0)

    @cached_property
    def flux_density(self) -> Floats:
        """Mean of B in every element, (2, nelements) in T."""
        return self.problem.mean(self._points[0])

    @cached_property
    def field_strength(self) -> Floats:
        """Mean of H in every element, (2, nelements) in A/m."""
        return self.problem.mean(self._points[1])

    @cached_property
    def energy_density(self) -> Floats:
        """Mean of ``int H . dB`` since the remanent state in every element, (nelements,) in J/m^3."""
        return self.problem.mean(self._points[2])

    @cached_property
    def coenergy_density(self) -> Floats:
        """Mean of ``H . B`` less the energy density in every element, (nelements,) in J/m^3."""
        density, strength, stored = self._points
        return self.problem.mean(np.sum(strength * density, axis=0) - stored)

    @cached_property
    def squared_norm(self) -> float:
        """``int nu |B|^2`` over the mesh, in J/m."""
        density = self._points[0]
        secant = repeated(self.coefficients, self.problem.weights.shape[1]).reluctivities(density)[0]
        return float(np.sum(self.problem.weights.ravel() * secant * density**2))

    def potential_at(self, x: ArrayLike) -> Floats:
        """Potential at points, quadratic in every element.

        Parameters
        ----------
        x : (2, n)
            Points in metres.

        Returns
        -------
        ndarray (n,)
            In Wb/m; nan outside the mesh.

        Raises
        ------
        ValueError
            If `x` is not of shape (2, n).
        """
        points = np.asarray(x, dtype=float)
        element = find_elements(self.mesh, points)
        corner = self.mesh.p[:, self.mesh.t[:, element]]
        (ax, ay), (bx, by) = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        x0, y0 = points - corner[:, 0]
        second, third = (x0 * by - y0 * bx) / (ax * by - ay * bx), (ax * y0 - ay * x0) / (ax * by - ay * bx)
        share = np.stack((1.0 - second - third, second, third))
        # scikit-fem's sides join the local nodes (0, 1), (1, 2), (0, 2)
        functions = np.vstack((share * (2.0 * share - 1.0), 4.0 * share * share[[1, 2, 0]]))
        found = np.sum(functions * self.values[self.problem.unknowns[:, element]], axis=0)
        return np.where(element >= 0, found, np.nan)
