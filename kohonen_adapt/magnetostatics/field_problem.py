"""Methods that magnetostatic problems in the plane and in space have in common."""

from abc import ABC, abstractmethod
from typing import ClassVar, Generic, TypeVar

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.goals import FluxLinkage, Force, Goal, StoredEnergy, Torque
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.problem.protocol import CheckedProblem, NotOffered
from kohonen_adapt.problem.uncertain import error_of

__all__ = ["FieldProblem"]

ROUNDING = 1e-12  # sum of the indicators of a goal, relative to its value, that rounding errors make


MeshKind = TypeVar("MeshKind", bound=Mesh)
FieldKind = TypeVar("FieldKind", bound=Field | SolidField)


class FieldProblem(ABC, Generic[MeshKind, FieldKind]):
    norm: ClassVar[str] = "energy"
    goal: Goal | None
    no_goal: ClassVar[str]  # how to get a goal, the end of a message

    @property
    def per_metre(self) -> bool:
        """True if values of goals are per metre of depth."""
        return False

    @property
    def calibrated(self) -> bool:
        """True if an estimate approximates the error in the energy norm.

        False with a goal. Its indicators overestimate the error, because contributions of opposite sign do not cancel.
        """
        return self.goal is None

    @property
    def goal_unit(self) -> str:
        """Unit of the values of the goal, an empty string without a goal.

        Per metre of depth in the plane, unless the problem has a `depth` or an axis.
        """
        unit, per_metre = str(getattr(self.goal, "unit", "")), self.per_metre
        return f"{unit}/m" if per_metre and isinstance(self.goal, Force | Torque | FluxLinkage | StoredEnergy) else unit

    @abstractmethod
    def solve(self, mesh: MeshKind) -> FieldKind:
        """Solve on a mesh by a sparse direct method, with Newton's method if nonlinear.

        Above 300 000 unknowns, in space 8000, by algebraic multigrid, to a residual of 1e-10, if pyamg is installed. A
        vector potential in space is solved by conjugate gradients, to a residual of 1e-7.

        Parameters
        ----------
        mesh
            In metres, with the named subdomains and boundaries. In the plane a plain `MeshTri`, above order 1 also a
            `MeshTri2`; in space a `MeshTet`.

        Returns
        -------
        Field or SolidField
            The potential and derived quantities.

        Raises
        ------
        ValueError
            If the mesh is invalid or does not match the problem, see the class.
        numpy.linalg.LinAlgError
            If the equations have no finite solution (a kind of ValueError).
        NotConverged
            If Newton's method does not converge (a kind of LinAlgError); its `field` is the last iterate.
        """

    @abstractmethod
    def check(self, mesh: MeshKind) -> None:
        """Raise the errors of `solve` for the mesh, without solving.

        Parameters
        ----------
        mesh
            As in `solve`.

        Raises
        ------
        ValueError
            As in `solve`, except for equations that have no finite solution.
        """

    def indicators(self, mesh: MeshKind, field: FieldKind) -> Floats:
        """Return error indicators in the energy norm, or of the error of the goal.

        For nonlinear material the norm is that of the linearised problem, ``sqrt(int dH/dB |B - B_h|^2)``, in space
        ``sqrt(int dB/dH |H - H_h|^2)``. With a goal the sum of squares exceeds the error, because contributions of
        opposite sign do not cancel. A goal that does not depend on the potential, such as the force between a coil and
        a magnet of permeability 1, has indicators of the energy, scaled to `goal_error`. Of order 2 and 3 the
        indicators of a goal are the roots of the products of the residual estimates of field and dual.

        Parameters
        ----------
        mesh, field
            A mesh, and the field that `solve` returned for it.

        Returns
        -------
        ndarray (nelements,)
            Unsquared, in sqrt(J/m) whatever the depth; axisymmetric and in space in sqrt(J). With a goal in the root of
            its unit.

        Raises
        ------
        ValueError
            If the field belongs to another mesh, or if the goal raises it.
        """
        wanted, got = ((each.nvertices, each.nelements) for each in (mesh, field.mesh))
        if wanted != got:
            raise ValueError(
                f"field must belong to the mesh, with {wanted[0]} nodes and {wanted[1]} elements; its own has {got[0]} "
                f"and {got[1]}. Solve on the mesh first."
            )
        if self.goal is None:
            return self._of_energy(field)
        found = self._of_goal(field, self.goal)
        if float(np.sum(found**2)) > ROUNDING * abs(self.goal(field)):
            return found
        of_energy = self._of_energy(field)
        size = float(np.linalg.norm(of_energy))
        return of_energy * (np.sqrt(abs(self.goal_error(field))) / size) if size else of_energy

    @abstractmethod
    def _of_energy(self, field: FieldKind) -> Floats:
        """Return the indicators of the energy."""

    def _of_goal(self, field: FieldKind, goal: Goal) -> Floats:
        """Return the indicators of a goal."""
        raise NotImplementedError

    def goal_error(self, field: FieldKind) -> float:
        """Return an estimate of the error of the goal, exact less computed value.

        The estimate is the difference of the value by `improved` from the value of the field, and at least the doubt of
        the former. In the plane it is 0.97 to 1.01 times the error of forces in the median. In space on meshes adapted
        for a force the estimate of order 1 is 0.9 to 1.1 times the error, for a torque half of it.

        Parameters
        ----------
        field
            The solution that `solve` returned.

        Returns
        -------
        float
            In the unit of the goal.

        Raises
        ------
        ValueError
            If there is no goal, or if the goal raises it.

        Examples
        --------
        >>> import skfem
        >>> from kohonen_adapt.magnetostatics import FluxLinkage, Magnetostatics, Material
        >>> mesh = skfem.MeshTri().refined(3).with_defaults().with_subdomains({"all": lambda x: x[0] < 9.0})
        >>> sides, goal = {"left": 0.0, "bottom": 0.0}, FluxLinkage({"all": 1})
        >>> problem = Magnetostatics({"all": Material(current_density=1)}, sides, goal=goal)
        >>> field, finer = problem.solve(mesh), problem.solve(mesh.refined(3))
        >>> 0.9 < problem.goal_error(field) / (problem.goal(finer) - problem.goal(field)) < 1.1
        True
        """
        if self.goal is None:
            raise ValueError(f"goal_error needs a goal{self.no_goal}")
        better = CheckedProblem(self).improved(field.mesh, field, {"goal": self.goal})["goal"]
        return error_of(self.goal(field), better)

    def energy_norm(self, mesh: MeshKind, field: FieldKind) -> float:
        """Return the energy norm ``sqrt(int nu |B|^2)`` of a solution.

        An `estimate` divided by this norm is the relative error.

        Parameters
        ----------
        mesh, field
            As in `indicators`.

        Returns
        -------
        float
            In sqrt(J/m) whatever the depth; axisymmetric and in space in sqrt(J).

        Raises
        ------
        NotOffered
            If there is a goal, because its error is no fraction of the energy.
        """
        if self.goal is not None:
            raise NotOffered("the error of a goal is no fraction of the energy")
        return float(np.sqrt(field.squared_norm))
