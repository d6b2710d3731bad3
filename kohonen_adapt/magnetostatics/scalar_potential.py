"""State magnets and iron in space by materials and surfaces; solve for a scalar potential, and estimate the error."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from skfem import MeshTet
from skfem.mesh import MeshTet1

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.estimators import goal_error, goal_oriented
from kohonen_adapt.magnetostatics.equations.applied_field import checked_field, drive_on, field_at
from kohonen_adapt.magnetostatics.equations.coenergy import CoenergyFunctional
from kohonen_adapt.magnetostatics.equations.conditions import Conditions, Value
from kohonen_adapt.magnetostatics.equations.mirrors import checked_symmetry, conditions_in_space, mirrors_of
from kohonen_adapt.magnetostatics.equations.newton import Newton, NewtonStep, NotConverged
from kohonen_adapt.magnetostatics.equations.system import IN_SPACE
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients, coercivity_at
from kohonen_adapt.magnetostatics.materials.laws import Inverse
from kohonen_adapt.magnetostatics.materials.material import Material, check_materials
from kohonen_adapt.magnetostatics.quantities.goals import Force, Goal, Torque, check_goal, unit_of_goal
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.solid_estimation import estimated_in_space, primal_and_dual
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.problem.protocol import NotOffered
from kohonen_adapt.problem.ritz import Flux, Ritz

__all__ = ["MagneticScalarPotential"]

ESTIMATORS = ("residual", "recovery")


@dataclass(frozen=True, eq=False)
class MagneticScalarPotential:
    """Magnets and iron in space: ``div B = 0`` with ``B = mu (H + Hc)`` and ``H = Hs - grad phi``, phi of order 1.

    Metres, teslas, amperes; fields are (3, n), results totals of what is meshed. Currents are not meshed: Hs is their
    field as it is without iron. In iron that and ``grad phi`` would cancel but for a thousandth, so there a total
    potential is solved for, ``H = -grad psi``; that exists where closed paths in iron link no current.

    Where nothing is said of the outer boundary the flux stays inside: ``B . n = 0``. A problem of this kind is what
    `kohonen_adapt.adapt` takes.

    Parameters
    ----------
    materials
        Subdomain name to `Material`, with remanences of three components and no current densities. Every element of the
        mesh needs exactly one; further subdomains may exist.
    potential
        Name of a boundary to phi in A: a float or a callable of x (3, n) that returns (n,). 0 on the boundary of much
        air: magnets and iron are not felt there. At a node of two boundaries the later in the mapping counts.
    applied_field
        Hs: a callable of x (3, n) in m that returns (3, n) in A/m, three numbers (a uniform field), an object of
        magpylib with currents or a list of such. Its ``mu0 Hs`` has no divergence. Wires must not meet nodes.
    symmetry
        Name of a plane that the mesh ends at to what the flux is to it: "parallel" (as it is beside magnets that the
        plane mirrors; also said so that forces know of the plane) or "normal" (of magnets whose mirror image is
        magnetised the other way round; phi is 0 there).
    estimator
        "residual", multiplied by 1 / 3.6, by which the bare estimate overrates the error, or "recovery".
    goal
        What the mesh is to be adapted for in place of the energy: `Force`, `Torque`, `StoredEnergy`, or an object of
        one's own that is a `Goal`. Then `indicators` are those of `ka.estimators.goal_oriented`, and there is no
        `energy_norm`. At equal nodes that leaves 0.5 to 1.1 of the error of a force (`benchmarks magnets`).

    Raises
    ------
    ValueError
        For arguments of another kind; by `solve` and `indicators` for names that the mesh lacks, elements without or
        with two materials, planes of symmetry that are none, an applied field that is not finite, or against the
        symmetry, and iron that links a current.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
    >>> mesh = skfem.MeshTet.init_tensor(*[np.linspace(0.0, 1.0, 5)] * 3).with_defaults()
    >>> mesh = mesh.with_subdomains({"magnet": lambda x: x[2] < 0.5, "air": lambda x: x[2] > 0.5})
    >>> materials = {"magnet": Material(remanence=(0.0, 0.0, 1.2)), "air": Material()}
    >>> field = MagneticScalarPotential(materials, potential={"front": 0.0, "back": 0.0}).solve(mesh)
    >>> np.allclose(field.flux_density, [[0.0], [0.0], [0.6]])  # of a magnet between iron, over as much air
    True
    """

    materials: Mapping[str, Material]
    potential: Mapping[str, Value] | None = None
    applied_field: Any = None
    symmetry: Mapping[str, str] | None = None
    estimator: str = "residual"
    goal: Goal | None = None
    norm: ClassVar[str] = "energy"
    order: ClassVar[int] = 1
    method: ClassVar[Newton] = Newton(solver=IN_SPACE)  # a subclass may have another

    def __post_init__(self) -> None:
        if self.estimator not in ESTIMATORS:
            raise ValueError(f"estimator must be 'residual' or 'recovery'; got {self.estimator!r}.")
        check_materials(self.materials, 3)
        for name, material in self.materials.items():
            if material.current_density != 0.0:
                raise ValueError(
                    f"{name!r} has a current density, {material.current_density:g} A/m^2, of which a scalar potential "
                    "knows nothing: give the field of the current as applied_field."
                )
        if not isinstance(self.potential, Mapping | None):
            raise ValueError(f"potential must map names of boundaries to phi in A; got {self.potential!r}.")
        if self.goal is not None:
            check_goal(self.goal, 3, self.estimator)
        checked_field(self.applied_field)
        # Copies: what the caller does to the mappings later must not change a problem that has been solved.
        object.__setattr__(self, "materials", dict(self.materials))
        object.__setattr__(self, "potential", dict(self.potential or {}))
        object.__setattr__(self, "symmetry", checked_symmetry(self.symmetry))

    @property
    def goal_unit(self) -> str:
        """Unit of the goal's values, which are totals; empty without a goal."""
        return unit_of_goal(self.goal, per_metre=False)

    def solve(self, mesh: MeshTet) -> SolidField:
        """Solve on a mesh by a sparse direct method, nonlinear problems by Newton's method around it.

        Beyond 8000 unknowns by algebraic multigrid, to a residual of 1e-10, where pyamg is installed.

        Parameters
        ----------
        mesh
            A `MeshTet` in metres, with the named subdomains and boundaries.

        Returns
        -------
        SolidField
            The potential and what follows from it.

        Raises
        ------
        ValueError
            See the class; for a broken mesh or one of another kind.
        numpy.linalg.LinAlgError
            If the equations have no finite solution (a kind of ValueError).
        NotConverged
            If Newton's method does not converge (a kind of LinAlgError); it has the last iterate.
        """
        energy, field = self.stated(mesh)
        steps, given = tuple[NewtonStep, ...](), energy.conditions.values
        if energy.given.pieces:
            # From a solution of another mesh it would take three times as many steps: what interpolation leaves of the
            # small H in iron is B deep in saturation.
            start = self.method.linear(energy) if np.any(given) else given
            unknown, steps = self.method.descend(energy, start)
        else:
            unknown = self.method.linear(energy)
        found = replace(field, unknown=unknown, newton=steps)
        if steps and not steps[-1].converged:
            raise NotConverged(found)
        return found

    def check(self, mesh: MeshTet) -> None:
        """Refuse what `solve` would refuse, without solving.

        Parameters
        ----------
        mesh
            As for `solve`.

        Raises
        ------
        ValueError
            As `solve`, but for equations that have no finite solution.
        """
        self.stated(mesh)

    def stated(self, mesh: MeshTet) -> tuple[CoenergyFunctional, SolidField]:
        """What is to be minimised on a mesh, and the field of what is given, 0 elsewhere.

        Parameters
        ----------
        mesh
            As for `solve`.

        Returns
        -------
        CoenergyFunctional, SolidField
            Unsolved.

        Raises
        ------
        ValueError
            As `solve`.
        """
        if type(mesh) is not MeshTet1:
            plane = " Plane meshes are for Magnetostatics." if len(getattr(mesh, "p", ())) == 2 else ""
            raise ValueError(f"mesh must be a skfem.MeshTet; got {type(mesh).__name__}.{plane}")
        check_mesh(mesh, space=True)
        given, planes = coefficients(mesh, self.materials), mirrors_of(mesh, self.symmetry or {})
        parallel = [plane.facets for plane in planes.values() if plane.kind == "parallel"]
        closed, function = np.concatenate([np.zeros(0, dtype=np.int64), *parallel]), checked_field(self.applied_field)
        drive = drive_on(mesh, given, function, closed)
        conditions = conditions_in_space(drive, self.potential or {}, planes)
        energy = CoenergyFunctional(drive.elements, given, conditions, drive.inside, drive.load)
        field = SolidField(mesh, conditions.values, given, drive, planes)
        if isinstance(self.goal, Force | Torque):
            self.goal.check_body(field)  # now, and not after the solve
        return energy, field

    def indicators(self, mesh: MeshTet, field: SolidField) -> Floats:
        """Error indicators of a solution in the energy norm, with a goal those of its error.

        For nonlinear material the norm is that of the linearised problem, ``sqrt(int dB/dH |H - H_h|^2)``.

        Parameters
        ----------
        mesh, field
            A mesh, and what `solve` returned for it.

        Returns
        -------
        ndarray (nelements,)
            Unsquared, in sqrt(J). With a goal in the root of its unit.
        """
        if self.goal is None:
            return estimated_in_space(field, self.estimator, self.materials)
        return goal_oriented(mesh, **self._pair(field, self.goal))

    def goal_error(self, field: SolidField) -> float:
        """Estimate of what the goal's value falls short of the exact one, with its sign.

        By `ka.estimators.goal_error`, which says how near that comes.

        Parameters
        ----------
        field
            What `solve` returned.

        Returns
        -------
        float
            In the unit of the goal.

        Raises
        ------
        ValueError
            If there is no goal, or as it does itself.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material, StoredEnergy
        >>> mesh = skfem.MeshTet.init_tensor(*[np.linspace(0.0, 1.0, 9)] * 3).with_defaults()
        >>> mesh = mesh.with_subdomains({"a": lambda x: x[2] < 0.5, "b": lambda x: x[2] > 0.5})
        >>> materials = dict.fromkeys("ab", Material())
        >>> problem = MagneticScalarPotential(materials, {"left": 1.0, "right": 0.0}, goal=StoredEnergy("a"))
        >>> abs(problem.goal_error(problem.solve(mesh))) < 1e-15  # of a uniform field there is none
        True
        """
        if self.goal is None:
            raise ValueError("goal_error needs a goal; give one, for instance goal=Force('armature', (0.0, 0.0, 1.0)).")
        return goal_error(field.mesh, **self._pair(field, self.goal))

    def _conditions(self, field: SolidField) -> Conditions:
        return conditions_in_space(field.drive, self.potential or {}, field.planes)

    def _pair(self, field: SolidField, goal: Goal) -> dict[str, Any]:
        return primal_and_dual(field, goal, self._conditions(field), self.materials, self.method)

    def energy_norm(self, mesh: MeshTet, field: SolidField) -> float:
        """``sqrt(int nu |B|^2)`` over the mesh, what `estimate` is compared with.

        Parameters
        ----------
        mesh, field
            As of `indicators`.

        Returns
        -------
        float
            In sqrt(J).

        Raises
        ------
        NotOffered
            If there is a goal: no share of the energy is its error.
        """
        if self.goal is not None:
            raise NotOffered("its indicators are those of a goal, of which the energy is no measure")
        return float(np.sqrt(field.squared_norm))

    def ritz(self, mesh: MeshTet, field: SolidField) -> Ritz:
        """The functional ``int mu |grad phi|^2 / 2 - (Br + mu Hs) . grad phi``, and the phi that minimises it.

        Nonlinear material has the co-energy ``int_0^H B dH`` of ``H = |grad phi|`` in place of the first term. Of a
        solution it lies above the exact minimum by half the square of the error in `energy_norm`.

        Parameters
        ----------
        mesh, field
            As of `indicators`.

        Returns
        -------
        Ritz
            In J, one number per material; its flux is a function where a magnet turns or a field is applied. With a
            goal it shapes elements only.

        Raises
        ------
        NotOffered
            For nonlinear material with a remanence, or in an applied field.
        """
        given, function = field.coefficients, field.drive.function
        present, first, place = given.present(self.materials)
        if given.pieces and function is not None:
            raise NotOffered("nonlinear material in an applied field has no energy to lower")
        if any(given.coercivity[:, piece.elements].any() for piece in given.pieces):
            raise NotOffered("nonlinear magnets have no energy to lower")
        mu = 1.0 / given.reluctivity[first]
        flux: Flux = mu * given.coercivity[:, first]
        if function is not None or any(material.turns for material in present.values()):

            def flux(x: Floats, number: Ints) -> Floats:
                applied = np.zeros_like(x) if function is None else field_at(function, x)
                return mu[number] * (coercivity_at(present, x, number) + applied)

        laws = tuple(None if material.bh is None else Inverse(material.bh) for material in present.values())
        fixed = self._conditions(field).fixed
        ritz = Ritz(field.potential, fixed, mu, 0.0, flux, place, laws if given.pieces else ())
        return ritz if self.goal is None else replace(ritz, comparable=False, shapes_only=True)
