"""Solved field in space with values at points, fluxes, forces and torques."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import finite_triple
from kohonen_adapt.magnetostatics.equations.applied_field import Drive
from kohonen_adapt.magnetostatics.equations.given_field import Sources
from kohonen_adapt.magnetostatics.equations.newton import Steps
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.coil_quantities import OfCoil, ampere_turns
from kohonen_adapt.magnetostatics.quantities.forces import force_along
from kohonen_adapt.magnetostatics.quantities.linkage import checked_turns
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.magnetostatics.quantities.point_values import Points, Strength
from kohonen_adapt.magnetostatics.quantities.surfaces import oriented_surface
from kohonen_adapt.mesh.curved import is_second_order
from kohonen_adapt.mesh.elements.rules import triangle_rule
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.names import Names

__all__ = ["SolidField"]

DEGREE, CURVED_DEGREE = 2, 5  # of the quadrature of a flux


@dataclass(frozen=True, eq=False, repr=False)
class SolidField(MagneticField):
    """Solved field in space, as returned by `MagneticScalarPotential.solve`.

    ``H = Hs - grad phi`` with the applied field Hs, and ``B = mu (|H + Hc|) (H + Hc)``. Without an applied field both
    are constant in every element at order 1, and H is linear at order 2. Arrays of shape (nelements,) hold means over
    elements. Results refer to the meshed part: half a model has half the energy.

    Parameters
    ----------
    mesh
        The mesh of the solution, in metres.
    unknown : (nunknowns,)
        Solution in A: the reduced potential, in iron with an applied field the total potential.
    coefficients
        Material coefficients of every element.
    drive
        The applied field, with its replacement in iron.
    planes
        The planes of symmetry by name.
    newton
        Steps of Newton's method; empty for linear problems.
    far
        True if the reduced potential is 0 on all of the outer boundary except planes of symmetry.
    """

    mesh: MeshTet
    unknown: Floats
    coefficients: Coefficients
    drive: Drive
    planes: Mapping[str, Mirror]
    newton: Steps = ()
    far: bool = False
    kind: ClassVar[Any] = Strength  # of a scalar potential

    def __repr__(self) -> str:
        return self._text(f" on {self.mesh.nvertices} nodes", self.flux_density)

    @property
    def potential(self) -> Floats:
        """Reduced potential phi at the unknowns, shape (nunknowns,) in A.

        The unknowns are those of `skfem.ElementTetP1`, the nodes, or of `skfem.ElementTetP2`, the nodes and then the
        edges in the order of ``mesh.edges``. Without an applied field this is the total potential.
        """
        return self.unknown - self.drive.potential

    @property
    def elements(self) -> Space:
        return self.drive.elements

    @property
    def mirrors(self) -> tuple[Mirror, ...]:
        return tuple(self.planes.values())

    @property
    def sources(self) -> Sources:
        return self.drive.sources

    def _vectors(self, at: Points, unknown: Floats) -> Floats:
        given = getattr(self.drive, at.given) if at.given else self.drive.at(at.x, at.element)
        return given - at.slope(unknown)

    @cached_property
    def _in_laws(self) -> Strength:
        # The field of coils takes time, and no linear material needs H.
        return self._at_quadrature("inside_at_points")

    def _potential_in(self, at: Points) -> Floats:
        return self.elements.at(self.potential, at.element, at.share)

    def _reaction(self, x: Floats, element: Ints) -> Floats:
        barycentric = self.elements.barycentric(x, element)
        return -VACUUM_PERMEABILITY * self.elements.gradient_at(self.potential, element, barycentric)

    def _against(self, at: Strength, weight: Floats) -> Floats:
        return -at.change_of_flux_density(weight)

    @property
    def current_density(self) -> Floats:
        """Magnitude of the curl of the applied field, shape (nelements,) in A/m^2."""
        return self.drive.current_density

    @property
    def current_in_shells(self) -> Floats:
        return self.drive.current_density_without_coils

    def flux(self, surface: str) -> float:
        """Return the magnetic flux through a named surface, ``int B . n``.

        On the outer boundary n points out of the mesh. For an oriented surface inside the mesh n points out of the
        elements on its side, as in `skfem.OrientedBoundary`; for other surfaces inside n points towards larger values
        of the coordinate x, y or z to which the surface is most nearly normal.

        B inside the mesh is the mean of the elements on both sides, and has a divergence: fluxes through iron can be
        10 % off, and fluxes out of a closed surface do not sum to zero. `MagneticVectorPotential` has exact sums.

        Parameters
        ----------
        surface
            Name of a boundary of the mesh.

        Returns
        -------
        float
            In Wb.

        Raises
        ------
        ValueError
            If the mesh has no surface of this name, or if the surface is inside the mesh, has no orientation, and has
            facets nearly parallel to n.

        Examples
        --------
        >>> import skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> mesh = skfem.MeshTet().refined(2).with_defaults().with_subdomains({"iron": lambda x: x[0] > 0.0})
        >>> field = MagneticScalarPotential({"iron": Material(1e4)}, {"left": 1.0, "right": 0.0}).solve(mesh)
        >>> round(field.flux("right"), 6), round(field.flux("left"), 6)  # mu0 1e4 times 1 A/m times 1 m^2
        (0.012566, -0.012566)
        """
        mesh, total = self.mesh, 0.0
        facets, straight, sign = oriented_surface(mesh, surface)
        first, second = mesh.f2t[:, facets]
        rule = triangle_rule(CURVED_DEGREE if is_second_order(mesh) else DEGREE)
        for barycentric, weight in zip(*rule, strict=True):
            x, normal = self.elements.facet_points(facets, barycentric)
            normal *= 0.25 * weight * sign * np.sign(np.sum(normal * straight, axis=0))
            for element in (first, np.where(second < 0, first, second)):
                total += float(np.sum(self.at(x, element).flux_density * normal))
        return total

    def force(self, body: Names) -> Floats:
        """Return the magnetic force on a body or a coil.

        ``F = -int T grad w`` over the air around the body, with Maxwell's stress tensor ``T = (B B - |B|^2 / 2) / mu0``
        and a weight w that falls from 1 on the body to 0 on everything else (the eggshell method: Henrotte, Deliege and
        Hameyer, COMPEL 23, 2004). If the air contains parts of coils, ``int w J x B`` is subtracted.

        The force on a coil is ``int J x B`` over the winding, ``I d lambda`` of `flux_linkage` by a displacement of the
        coil.

        Parameters
        ----------
        body
            Name of a subdomain or of a coil, or a sequence of names that form one body. A name of both is the coil.

        Returns
        -------
        ndarray (3,)
            In N. For a body that planes of symmetry cut: the force along the planes on the modelled part. The image
            adds the same force along the planes, and cancels the force across.

        Raises
        ------
        ValueError
            If the body touches anything but air (permeability 1, no current of an applied field, no remanence), lies on
            the outer boundary elsewhere than on planes of symmetry, or if names are unknown. For coils as in
            `flux_linkage`.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.26, axis=0)
        >>> mesh = skfem.MeshTet().refined(3).with_defaults()
        >>> mesh = mesh.with_subdomains({"iron": inside, "air": lambda x: ~inside(x)})
        >>> field = MagneticScalarPotential({"iron": Material(100.0), "air": Material()}, {"left": 0.0}).solve(mesh)
        >>> field.force("iron").tolist()  # nothing drives this field
        [0.0, 0.0, 0.0]
        """
        return np.array([force_along(self, body, along) for along in np.eye(3)])

    def torque(self, body: Names, centre: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
        """Return the magnetic torque on a body or a coil about a centre.

        The torque is computed as in `force`, with ``(x - centre) x T grad w``.

        Parameters
        ----------
        body
            As in `force`.
        centre : (3,)
            In m.

        Returns
        -------
        ndarray (3,)
            In N m. For a body that a plane of symmetry cuts: the component normal to the plane of the torque on the
            modelled part. The image adds the same component, and cancels the components along the plane. The centre
            should lie in the plane.

        Raises
        ------
        ValueError
            As in `force`, and for a centre that is not three finite numbers.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.26, axis=0)
        >>> mesh = skfem.MeshTet().refined(3).with_defaults()
        >>> mesh = mesh.with_subdomains({"iron": inside, "air": lambda x: ~inside(x)})
        >>> field = MagneticScalarPotential({"iron": Material(100.0), "air": Material()}, {"left": 0.0}).solve(mesh)
        >>> field.torque("iron", centre=(0.5, 0.5, 0.5)).tolist()  # nothing drives this field
        [0.0, 0.0, 0.0]
        """
        about = np.array(finite_triple(centre, "centre"))
        return np.array([force_along(self, body, axis, about) for axis in np.eye(3)])

    def flux_linkage(self, coil: Names, turns: float = 1) -> float:
        """Return the flux linkage of a coil, or of coils in series.

        ``lambda = lambda_0 + int mu0 M . h`` over iron and magnets, by reciprocity: lambda_0 is the linkage in free
        space, ``mu0 M = B - mu0 H``, and h is the field of the coil per ampere of its turns. The linkage is that
        of a boundary at infinity, beyond which the fields of all coils go on. In linear material without magnets and
        applied fields, current times linkage, summed over coils, is twice `energy` with the energy of the coils'
        fields beyond the mesh.

        Parameters
        ----------
        coil
            Name of a coil of the problem, or a sequence of names whose linkages are added.
        turns
            Number of turns of every coil; negative for the other direction.

        Returns
        -------
        float
            In Wb, positive for the flux of a positive current. Of a coil that planes of symmetry cut: the linkage of
            the part in the mesh, half the whole for one plane.

        Raises
        ------
        ValueError
            For names that are no coils, coils beyond a plane of symmetry, turns that are zero or not finite, and if
            the outer boundary, except planes of symmetry, has not the potential 0 everywhere.

        Examples
        --------
        >>> import skfem
        >>> from kohonen_adapt.magnetostatics import Coil, MagneticScalarPotential, Material
        >>> mesh = skfem.MeshTet().refined(2).with_subdomains({"air": lambda x: x[0] > 0.0}).with_defaults()
        >>> mesh = mesh.with_boundaries({"outer": lambda x: x[0] > -1.0})
        >>> coil = Coil.circular((0.5, 0.5, 0.5), (0.0, 0.0, 1.0), 0.3, (0.2, 0.2), 1000.0)
        >>> problem = MagneticScalarPotential({"air": Material()}, {"outer": 0.0}, coils={"winding": coil})
        >>> field = problem.solve(mesh)
        >>> print(f"{1e3 * field.flux_linkage('winding', turns=100):.2f} mWb")  # 5.098 mH times 10 A
        50.98 mWb
        """
        names = [coil] if isinstance(coil, str) else list(coil)
        return checked_turns(coil, turns) * float(sum(OfCoil(self, name).value() for name in names))

    def inductance(self, coil: str, turns: float = 1) -> float:
        """Return the flux linkage of a coil divided by its current.

        For linear material without magnets and other currents this is the inductance. Magnets and other currents add
        flux to the linkage, and the result is then no inductance.

        Parameters
        ----------
        coil
            Name of a coil of the problem.
        turns
            Number of turns.

        Returns
        -------
        float
            In H. Of a coil that planes of symmetry cut: of the part in the mesh.

        Raises
        ------
        ValueError
            As in `flux_linkage`, and for a coil without current.

        Examples
        --------
        See `flux_linkage`, ``field.inductance("winding", turns=100)``.
        """
        return turns * self.flux_linkage(coil, turns) / ampere_turns(self, coil)
