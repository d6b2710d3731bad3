"""Solved plane field with values at points, forces, torques and flux linkages."""

from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.newton import Steps
from kohonen_adapt.magnetostatics.equations.symmetry import PLANAR, Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.quantities.forces import OUT_OF_PAGE, checked_point, force_along
from kohonen_adapt.magnetostatics.quantities.linkage import checked_turns, turn_length
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.magnetostatics.quantities.point_values import PointField, Points
from kohonen_adapt.mesh.blended import Projections
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.names import Names, elements_in

__all__ = ["CubicField", "Dual", "Field", "HighOrderField", "QuadraticField"]


class Dual(NamedTuple):
    values: Floats  # (nunknowns,)
    source: Floats  # (nelements,)
    load: Floats  # (2, npoints)


@dataclass(frozen=True, eq=False, repr=False)
class Field(MagneticField):
    """Solved field of a plane problem, as returned by `Magnetostatics.solve`.

    B is a polynomial in every element, of one degree less than the potential: constant at order 1, linear at order 2.
    In elements with curved sides A and B are polynomials of the reference coordinates. Arrays of shape (nelements,) are
    means over elements. Energies of a planar field are per metre of depth, in J/m, unless the problem has a `depth`.
    With a depth, and of an axisymmetric field, energies are totals in J.

    `QuadraticField`, `CubicField` and `HighOrderField` are former names of this class.

    Parameters
    ----------
    mesh
        The mesh of the solution, in metres.
    potential : (nnodes,)
        Nodal A_z in Wb/m, or A_phi.
    coefficients
        Material coefficients of every element.
    symmetry
        The planar or the axisymmetric reduction.
    depth
        In m; None for results per metre.
    newton
        Steps of Newton's method; empty for linear problems.
    values : (nunknowns,)
        A in Wb/m at ``elements.doflocs``, with the potential at the nodes as its first part; None at order 1. At orders
        2 and 3 the unknowns are those of scikit-fem's elements: at the nodes, on the facets and inside the elements. At
        higher orders those on facets are at the Gauss-Lobatto points from the lower to the higher node.
    degree
        Order of the elements.
    sides
        Projections onto the curves of boundaries by name for orders of 4 and above, see `Magnetostatics`.

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

    mesh: MeshTri
    potential: Floats
    coefficients: Coefficients
    symmetry: Symmetry = PLANAR
    depth: float | None = None
    newton: Steps = ()
    _: KW_ONLY
    values: Floats | None = None
    degree: int = 1
    sides: Projections | None = None

    def __repr__(self) -> str:
        size, order = f" on {self.potential.size} nodes", f" of order {self.order}" * (self.order > 1)
        unit = "J" if self.axisymmetric or self.depth is not None else "J/m"
        return self._text(order + size, self.at_corners.flux_density, unit)

    @cached_property
    def elements(self) -> Space:
        """Finite elements of the potential."""
        return Space(self.mesh, self.degree, self.coefficients.nonlinear, self.axisymmetric, self.sides)

    @cached_property
    def unknown(self) -> Floats:
        """A, axisymmetric r A, at all degrees of freedom, shape (nunknowns,)."""
        values = self.potential if self.values is None else self.values
        return self.symmetry.unknown(self.elements.doflocs, values)

    def _vectors(self, at: Points, unknown: Floats) -> Floats:
        return self.symmetry.flux_density(at.off_axis, at.slope(unknown))

    def _against(self, at: PointField, weight: Floats) -> Floats:
        return self.symmetry.flux(weight) / self.symmetry.volume(at.x, np.ones(at.x.shape[1]))

    def flux_linkage(self, coil: Names, turns: float = 1) -> float:
        """Return the flux linkage of a coil side per metre of depth, or the total.

        The linkage is `turns` times the mean of A over the side, times the depth; axisymmetric, `turns` times the mean
        of ``2 pi r A``. With `depth`, and axisymmetric, it is the total.

        Parameters
        ----------
        coil
            Name of a subdomain, or a sequence of names that form one side.
        turns
            Number of turns; negative for the return side (current into the page), so that the linkages of the sides add
            up to the linkage of the coil.

        Returns
        -------
        float
            In Wb/m, for totals in Wb; positive for the flux of a current out of the page.

        Raises
        ------
        ValueError
            For unknown names, and turns that are zero or not finite.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
        >>> mesh = skfem.MeshTri().refined(4).with_defaults()
        >>> mesh = mesh.with_subdomains({"coil": inside, "air": lambda x: ~inside(x)})
        >>> materials = {"coil": Material(current_density=1e3), "air": Material()}
        >>> field = Magnetostatics(materials, potential={"left": 0.0, "right": 1.0}).solve(mesh)  # B = -1 T along y
        >>> round(field.flux_linkage("coil", turns=100), 1)  # 100 times the mean of A = x, in Wb/m
        50.0
        """
        inside, count = elements_in(self.mesh, coil), checked_turns(coil, turns)
        size, mean = self.elements.volumes[inside], self.elements.mean_function(self.unknown)[inside]
        # A is constant along a turn, of length 2 pi r or the depth.
        return count * turn_length(self) * float(np.sum(size * mean) / np.sum(size))

    def force(self, body: Names) -> Floats:
        """Return the magnetic force on a body, per metre of depth or in total.

        ``F = -int T grad w`` over the air around the body, with Maxwell's stress tensor ``T = (B B - |B|^2 / 2) / mu0``
        and a weight w that falls from 1 on the body to 0 on everything else (the eggshell method: Henrotte, Deliege and
        Hameyer, COMPEL 23, 2004; the weight solves Laplace's equation as in FEMM). With `depth`, and axisymmetric, the
        force is the total.

        Parameters
        ----------
        body
            Name of a subdomain, or a sequence of names that form one body.

        Returns
        -------
        ndarray (2,)
            (F_x, F_y) in N/m; with `depth` in N, axisymmetric (0, F_z) in N. For a body that the outer boundary cuts
            along a mirror plane: the force along the plane on the modelled part. The mirror image adds the same force
            along the plane, and cancels the force across.

        Raises
        ------
        ValueError
            If the body touches anything but air (permeability 1, no current, no remanence), lies on the outer boundary
            along lines of several directions, or if names are unknown.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
        >>> mesh = skfem.MeshTri().refined(4).with_defaults()
        >>> mesh = mesh.with_subdomains({"coil": inside, "air": lambda x: ~inside(x)})
        >>> materials = {"coil": Material(current_density=1e3), "air": Material()}
        >>> field = Magnetostatics(materials, potential={"left": 0.0, "right": 1.0}).solve(mesh)  # B = -1 T along y
        >>> round(float(field.force("coil")[0]), 1)  # 1000 A/m^2 times 0.25 m^2 times 1 T, in N/m
        250.0
        """
        return np.array([force_along(self, body, along) for along in np.eye(2)])

    def torque(self, body: Names, centre: ArrayLike = (0.0, 0.0)) -> float:
        """Return the magnetic torque on a body about a centre.

        The torque is computed as in `force`, with ``(x - centre) x T grad w``; per metre of depth, with `depth` the
        total.

        Parameters
        ----------
        body
            Name of a subdomain, or a sequence of names that form one body.
        centre : (2,)
            In m.

        Returns
        -------
        float
            In N m/m, with `depth` in N m; counter-clockwise. For a body that the outer boundary cuts along the two
            sides of a periodic sector about the centre: the torque on the sector.

        Raises
        ------
        ValueError
            For an axisymmetric field, and as in `force`. However, the body may lie on the outer boundary on two sides
            of a sector, with nodes at the same radii, and on circles about the centre (a bore), where a constant
            potential makes no torque.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
        >>> mesh = skfem.MeshTri().refined(4).with_defaults()
        >>> mesh = mesh.with_subdomains({"coil": inside, "air": lambda x: ~inside(x)})
        >>> materials = {"coil": Material(current_density=1e3), "air": Material()}
        >>> field = Magnetostatics(materials, potential={"left": 0.0, "right": 1.0}).solve(mesh)  # B = -1 T along y
        >>> abs(field.torque("coil", centre=(0.5, 0.5))) < 0.1  # N m/m
        True
        """
        return force_along(self, body, np.array(OUT_OF_PAGE), checked_point("centre", centre))


QuadraticField = CubicField = HighOrderField = Field
