"""Evaluate a solved field of order 2 or 3: its elements, and the values that it has."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.elements import Higher
from kohonen_adapt.magnetostatics.quantities.field import Field

__all__ = ["CubicField", "QuadraticField"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class QuadraticField(Field):
    """A planar field of a P2 potential: B is linear in every element, and what is given per element is the mean there.

    Parameters
    ----------
    mesh, potential, coefficients, symmetry, depth, newton
        As of a `Field`; the potential at the nodes is the first part of `values`.
    values : (nunknowns,)
        A in Wb/m at the unknowns of scikit-fem's elements of that order: at the nodes, on the facets and, of a
        `CubicField`, inside the elements.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
    >>> mesh = skfem.MeshTri().refined(2).with_defaults().with_subdomains({"air": lambda x: x[0] > 0.0})
    >>> rim = dict.fromkeys(["left", "right", "bottom", "top"], lambda x: x[0] * x[1])
    >>> field = Magnetostatics({"air": Material()}, potential=rim, order=2).solve(mesh)  # A = x y, B = (x, -y)
    >>> np.allclose(field.flux_density_at([[0.3], [0.2]]), [[0.3], [-0.2]])
    True
    """

    values: Floats
    order: ClassVar[int] = 2

    @cached_property
    def elements(self) -> Higher:
        """The elements whose functions the potential is one of."""
        return Higher(self.mesh, self.order)

    @property
    def _values(self) -> Floats:
        return self.values

    def _interpolated(self, x: Floats) -> Floats:
        element, share = self._located(x)
        return np.where(element >= 0, self.elements.at(self.values, element, share), np.nan)


class CubicField(QuadraticField):
    """A planar field of a P3 potential: B is quadratic in every element.

    Parameters
    ----------
    mesh, potential, coefficients, symmetry, depth, newton, values
        As of a `QuadraticField`.
    """

    order = 3
