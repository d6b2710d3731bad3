"""State the energy that the solution minimises: its value, gradient and Hessian, for elements of any order."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy.sparse import csc_array

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, Conditions, conditions_of
from kohonen_adapt.magnetostatics.equations.elements import Elements
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients

__all__ = ["EnergyFunctional", "Scalar", "scalar_problem"]


@dataclass(frozen=True)
class Scalar:
    """``-div(reluctivity grad u - flux) = source`` in the plane of the mesh."""

    reluctivity: Floats  # (nelements,)
    flux: Floats  # (2, nelements)
    source: Floats  # (nelements,)


def scalar_problem(elements: Elements, symmetry: Symmetry, given: Coefficients) -> Scalar:
    """The scalar problem of linear material, and of nonlinear material that at B = 0; at the quadrature points."""
    return Scalar(
        symmetry.reluctivity(elements.points, given.reluctivity),
        -symmetry.flux(-given.coercivity),
        symmetry.source(given.current_density),
    )


@dataclass(frozen=True)
class EnergyFunctional:
    """``Pi(u) = int (int H . dB) - J A`` of the functions on a mesh that keep the boundary conditions.

    ``Pi`` is convex as H rises with B, so its minimum under the conditions is the solution.
    """

    elements: Elements
    symmetry: Symmetry
    given: Coefficients
    conditions: Conditions

    @classmethod
    def of(cls, elements: Elements, symmetry: Symmetry, given: Coefficients, boundaries: Boundaries) -> Self:
        """That of the conditions of these names."""
        return cls(elements, symmetry, given, conditions_of(elements, boundaries, symmetry))

    @cached_property
    def _at_points(self) -> Coefficients:
        return self.given.repeated(self.elements.weights.size // self.given.number.size)

    def at_rest(self) -> Self:
        """The same with the reluctivity at B = 0 everywhere: quadratic in u."""
        return replace(self, given=replace(self.given, pieces=()))

    @property
    def _source(self) -> Floats:
        return self.symmetry.source(self.given.current_density)

    def flux_density(self, u: Floats) -> Floats:
        """B at the quadrature points, (2, npoints)."""
        return self.symmetry.flux_density(self.elements.points, self.elements.gradient(u))

    def value(self, u: Floats) -> tuple[float, float]:
        """The functional, and the size of its rounding error."""
        volume = self.symmetry.volume(self.elements.points, self.elements.weights)
        stored = volume * self._at_points.energy_density(self.flux_density(u))
        spent = self.elements.against_function(self._source, u)
        robin = 0.0 if self.conditions.robin is None else 0.5 * float(u @ (self.conditions.robin @ u))
        rounding = np.finfo(float).eps * (float(np.sum(stored)) + float(np.sum(np.abs(spent))) + robin)
        return float(np.sum(stored) - np.sum(spent)) + robin, rounding

    def residual(self, u: Floats) -> tuple[Floats, float]:
        """Gradient at the free unknowns, (nfree,), and the norm of the sums of the sizes of its terms."""
        density, load = self.flux_density(u), self.elements.against_functions(self._source)
        flux = self.symmetry.flux(self._at_points.field_strength(density))
        largest = self._at_points.largest_terms(density)
        sizes = np.hypot(*self.symmetry.flux(np.stack((largest, np.zeros_like(largest)))))
        total = self.elements.added(self.elements.against_gradients(flux) - load)
        size = self.elements.added(self.elements.against_slopes(sizes) + np.abs(load))
        return self._at_free(total, u), float(np.linalg.norm(size))

    def linear_residual(self, u: Floats) -> Floats:
        """Gradient at the free unknowns of linear material, in half the time."""
        scalar = scalar_problem(self.elements, self.symmetry, self._at_points)
        with np.errstate(over="ignore", invalid="ignore"):
            flux = scalar.flux - scalar.reluctivity * self.elements.gradient(u)
            return self._at_free(-self.elements.loads(self._source, flux), u)

    def hessian(self, u: Floats) -> csc_array:
        """Second derivatives at the free unknowns: ``nu_d`` along grad u and ``nu`` across it."""
        points, free = self.elements.points, self.conditions.free
        if not self.given.pieces:
            return self.elements.stiffness(self.symmetry.reluctivity(points, self._at_points.reluctivity), free)
        slope = self.elements.gradient(u)
        pair = self._at_points.reluctivities(self.symmetry.flux_density(points, slope))
        across, along = (self.symmetry.reluctivity(points, each) for each in pair)
        size = np.hypot(*slope)
        return self.elements.stiffness(across, free, (along, slope / np.where(size > 0.0, size, 1.0)))

    def _at_free(self, total: Floats, u: Floats) -> Floats:
        if self.conditions.robin is not None:
            total = total + self.conditions.robin @ u
        return total[self.conditions.free]
