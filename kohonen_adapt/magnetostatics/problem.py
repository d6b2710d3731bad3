"""State a magnetostatic problem by materials and conditions; solve it, and estimate the error."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.arguments import Arguments, check_plane_mesh
from kohonen_adapt.magnetostatics.equations.around_axis import elements_on
from kohonen_adapt.magnetostatics.equations.conditions import conditions_of
from kohonen_adapt.magnetostatics.equations.newton import EnergyFunctional, Newton
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR
from kohonen_adapt.magnetostatics.estimation import better_values, error_of_goal, estimated, goal_indicators
from kohonen_adapt.magnetostatics.goal_functional import functional_for
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.solution import linkage_slope, solution_of
from kohonen_adapt.problem.outputs import Output
from kohonen_adapt.problem.protocol import NotOffered
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["Magnetostatics"]


@dataclass(frozen=True, eq=False)
class Magnetostatics(Arguments):
    """Plane magnetostatics, ``curl H = J`` with ``H = nu(|B|) B - Hc``, for a P1, P2 or P3 potential.

    Metres, teslas, amperes. Planar: ``B = (dA/dy, -dA/dx)``, A and J point out of the page, and results are per metre
    of depth unless there is a `depth`. Axisymmetric: x = r >= 0 and y = z, A and J point along phi (with r to the right
    and z up into the page), ``B = (-dA/dz, d(r A)/dr / r)``, and results are totals.

    Where no potential is given the natural condition ``n x H = 0`` holds (flux crosses the boundary at a right angle);
    a constant potential keeps the flux inside. A problem of this kind is what `kohonen_adapt.adapt` takes.

    Parameters
    ----------
    materials
        Subdomain name to `Material`. Every element of the mesh needs exactly one; further subdomains may exist.
    potential
        Name of a boundary or of one of the `points` to A in Wb/m: a float or a callable of x (2, n) that returns (n,).
        At a node of two boundaries the later in the mapping counts. At least one, unless something else fixes A: an
        open boundary, antiperiodic sides, or the axis.
    estimator
        "residual", multiplied by `RESIDUAL_SCALE` = 1 / 3.6, by which the bare estimate overrates the error, give or
        take 25 % (order 2: 1 / 6.1, 5 %; order 3: 1 / 9.7, 12 %; around an axis 1 / 4.2, 20 %, of order 2 and 3 45 %);
        "recovery", within 15 % by itself (order 1); or "equilibrated", a guaranteed upper bound of the error on the
        meshed polygon (of nonlinear material by the duality gap), 1.04 to 1.3 times the error, for planar problems of
        order 1 with potentials and natural conditions only. Deep in saturation the first two come within 30 %; where a
        current fills the mesh, the residual is up to 1.8 times the error.
    ampere_turns
        Subdomain name to the total current through it in A, positive like J, whatever the area of its elements is:
        current times turns of a coil side. In place of the current density of its material.
    depth
        In m: then the energies of a `Field` are totals. Planar problems only.
    axisymmetric
        Whether the mesh is the half-plane of an axis, where u = r A falls like r^2: see `kohonen_adapt.Ritz`.
    open_boundary
        Name of a boundary on a circle beyond which there is nothing but air, around an axis on a half circle about a
        point of it: there ``nu dA/dn + nu A / R0 = 0``, axisymmetric the same for u = r A, which is exact for the field
        of a dipole at its centre, with the radius R0 from the mesh. Planar currents must add up to none; the energy
        beyond is not in that of the `Field`.
    applied_field
        (H_x, H_y) in A/m, around an axis (0, H_z): the uniform field of sources beyond the open boundary.
    points
        Name to a place (x, y) in metres, or to several (2, n), where the mesh has nodes; `adapt` and `polish` keep
        these. Of a Gmsh file ``ka.read_groups(path, scale=scale).places``. Where no boundary fixes A, a value at a
        point takes away the constant that A is free by; elsewhere it stands for a current in that point.
    periodic, antiperiodic
        Pairs of names of boundaries that a translation or rotation carries onto one another, node by node: A is the
        same on both, or the other's negative. Where several motions fit, as between circles, the third entry of a pair
        names the one that is meant. ``("rotor", "bore", ka.Rotation(angle))`` turns a rotor as it is drawn, remanence
        and all, in its stator; B in it and forces on it are those of its drawing. ``("rim", "kelvin",
        ka.Reflection(point, normal))`` joins a disc to a Kelvin disc: one of air, as large, for all that is outside.
    order
        Of the elements, 1, 2 (a `QuadraticField`) or 3 (a `CubicField`). By default 2, a fifth to a third of the time
        of 1 to an error of 1 % (`python -m benchmarks time`); but 1 with another estimator than "residual".
    curved
        Whether `adapt` is to bend the sides of elements of order 2 and 3 to the arcs and splines that they are on, and
        to solve on a `MeshTri2`: on chords they lose their rate (`python -m benchmarks curves`). `solve` bends none.
    goal
        What the mesh is to be adapted for in place of the energy: `Force`, `Torque`, `FluxLinkage`, `StoredEnergy`, or
        an object of one's own that is a `Goal`. Then `indicators` are those of `ka.estimators.goal_oriented`, so the
        square of an `estimate` is what the elements add to the goal's error at most, in its unit (and `atol` the root
        of what is allowed). There is no `energy_norm`, and `ritz` for a `FluxLinkage` and others whose derivative is
        constant in regions of linear material. `goal_error` estimates the error.

    Raises
    ------
    ValueError
        For arguments of another kind; by `solve` and `indicators` for names that the mesh lacks, elements without or
        with two materials, conditions that do not fit the mesh or one another, and parts without a fixed potential.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
    >>> mesh = skfem.MeshTri().refined(3).with_defaults().with_subdomains({"air": lambda x: x[0] > 0.0})
    >>> problem = Magnetostatics({"air": Material()}, potential={"left": 0.0, "right": 1.0})
    >>> field = problem.solve(mesh)
    >>> np.allclose(field.flux_density, [[0.0], [-1.0]])  # A = x, so B = -1 T along y
    True
    """

    norm: ClassVar[str] = "energy"
    method: ClassVar[Newton] = Newton()  # a subclass may have another

    def solve(self, mesh: MeshTri) -> Field:
        """Solve on a mesh by a sparse direct method, nonlinear problems by Newton's method around it.

        Beyond 300 000 unknowns by algebraic multigrid, to a residual of 1e-10, where pyamg is installed.

        Parameters
        ----------
        mesh
            A plain `MeshTri` in metres, with the named subdomains and boundaries, above order 1 also a `MeshTri2`.

        Returns
        -------
        Field
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
        return solution_of(self._energy_on(mesh), self.depth, None, self.method)

    def solve_from(self, mesh: MeshTri, old_mesh: MeshTri, old_field: Field) -> Field:
        """Solve like `solve`; nonlinear problems start from a solution on another mesh, which saves steps.

        Parameters
        ----------
        mesh, old_mesh, old_field
            As for `solve`; the other mesh, and what `solve` returned for it.

        Returns
        -------
        Field
            As of `solve`, which says what it raises.
        """
        return solution_of(self._energy_on(mesh), self.depth, old_field, self.method)

    def check(self, mesh: MeshTri) -> None:
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
        self._energy_on(mesh)

    def _energy_on(self, mesh: MeshTri) -> EnergyFunctional:
        check_plane_mesh(mesh, bent=self.order > 1)
        symmetry = AXISYMMETRIC if self.axisymmetric else PLANAR
        given = coefficients(mesh, self.materials, self.ampere_turns)
        elements = elements_on(mesh, self.order, symmetry, given.lawful)
        return EnergyFunctional(elements, symmetry, given, conditions_of(elements, self.boundaries, symmetry))

    def indicators(self, mesh: MeshTri, field: Field) -> Floats:
        """Error indicators of a solution, near the true error in the energy norm.

        For nonlinear material the norm is that of the linearised problem, ``sqrt(int dH/dB |B - B_h|^2)``. With a goal
        those of its error: the sum of squares is more than that, because in it what the elements add cancels. Of order
        2 and 3 they are the roots of what the residual estimates of field and dual have for a product.

        Parameters
        ----------
        mesh, field
            A mesh, and what `solve` returned for it.

        Returns
        -------
        ndarray (nelements,)
            Unsquared, in sqrt(J/m) whatever the depth; axisymmetric in sqrt(J). With a goal in the root of its unit.
        """
        if self.goal is not None:
            return goal_indicators(field, self.goal, self.boundaries, self.method)
        return estimated(mesh, field, self.estimator, self.boundaries, self.materials)

    def incremental_inductance(self, field: Field, circuit: Mapping[str, float]) -> float:
        """``d linkage / d current`` of a circuit at a solution: what it has for small changes of its current.

        By the linearised problem, with the differential reluctivity along B and the secant one across it; magnets,
        given potentials and other currents stay as they are. Of linear material without these it is
        `apparent_inductance`. Hysteresis and eddy currents have no part in it.

        Parameters
        ----------
        field, circuit
            What `solve` returned, and a circuit as of `circuit_current`; its sides need not carry a current.

        Returns
        -------
        float
            As of `apparent_inductance`.

        Raises
        ------
        ValueError
            If the circuit is no such mapping, or the mesh lacks its names.
        """
        return linkage_slope(field, self.boundaries, circuit, self.method)

    def goal_error(self, field: Field) -> float:
        """Estimate of what the goal's value falls short of the exact one, ``J(A) - J(A_h)``, with its sign.

        By elements of one order more and rounder arcs: where its mesh is adapted for the goal, 0.76 to 1.1 times it.

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
            raise ValueError("goal_error needs a goal; give one to Magnetostatics, for instance goal=Torque('rotor').")
        return error_of_goal(field, self.goal, self.boundaries, self.method, self.solve_from)

    def improved(self, mesh: MeshTri, field: Field, outputs: Mapping[str, Output]) -> dict[str, float]:
        """Better values of outputs than the field's: by quadratic elements, and where arcs are cut off without that.

        Parameters
        ----------
        mesh, field, outputs
            As of `indicators`; and name to a function of a field, a `QuadraticField` among them.

        Returns
        -------
        dict
            Name to value.

        Raises
        ------
        NotOffered
            If there is a goal, or the elements are quadratic.
        """
        if self.goal is not None or self.order > 1:
            raise NotOffered("it has a goal, or quadratic elements")
        return better_values(field, outputs, self.boundaries, self.method, self.solve_from)

    def energy_norm(self, mesh: MeshTri, field: Field) -> float:
        """``sqrt(int nu |B|^2)`` over the mesh, what `estimate` is compared with.

        Parameters
        ----------
        mesh, field
            As of `indicators`.

        Returns
        -------
        float
            In sqrt(J/m) whatever the depth; axisymmetric in sqrt(J).

        Raises
        ------
        NotOffered
            If there is a goal: no share of the energy is its error.
        """
        if self.goal is not None:
            raise NotOffered("its indicators are those of a goal, of which the energy is no measure")
        return float(np.sqrt(field.squared_norm))

    def ritz(self, mesh: MeshTri, field: Field) -> Ritz:
        """The functional ``int nu |grad A|^2 / 2 - J A - nu (-Br_y, Br_x) . grad A``, and the A that minimises it.

        Nonlinear material has ``int_0^B (H + Hc) dB`` in place of ``nu |grad A|^2 / 2``; an open boundary adds
        ``int nu0 / (2 R0) A^2``. Of a solution it lies above the exact minimum by half the square of the error in
        `energy_norm`; for nonlinear material nearly by that of the norm in which `indicators` are.

        Parameters
        ----------
        mesh, field
            As of `indicators`.

        Returns
        -------
        Ritz
            In J/m, around an axis of u = r A and in J, one number per material; its flux is a function where a magnet
            turns; its signs say which sides are periodic and which antiperiodic. With a goal it has the dual one.

        Raises
        ------
        NotOffered
            For goals of which there is no functional.
        """
        return functional_for(field, self.goal, self.boundaries, self.materials, self.method)
