"""Plane and axisymmetric magnetostatic problems."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.curves import Curves
from kohonen_adapt.magnetostatics.arguments import Arguments
from kohonen_adapt.magnetostatics.better_values import better_values
from kohonen_adapt.magnetostatics.estimation import energy_indicators, goal_indicators
from kohonen_adapt.magnetostatics.field_problem import FieldProblem
from kohonen_adapt.magnetostatics.functional import functional_for
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.linkage import Circuit, checked_circuit, turn_length, turns_density
from kohonen_adapt.magnetostatics.solution import dual_of, field_of, solution_of
from kohonen_adapt.magnetostatics.strong_corners import materials_of, with_strong_corners
from kohonen_adapt.mesh.corners import corner_exponents, singular_nodes
from kohonen_adapt.problem.evaluation import Output
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["Magnetostatics"]


@dataclass(frozen=True, eq=False)
class Magnetostatics(Arguments, FieldProblem[MeshTri, Field]):
    """Plane or axisymmetric magnetostatics with elements of order 1 to 8.

    The equations are ``curl H = J`` with ``H = nu(|B|) B - Hc``, in metres, teslas and amperes.

    Planar: ``B = (dA/dy, -dA/dx)``, A and J point out of the page, and results are per metre of depth unless there is a
    `depth`. Axisymmetric: x = r >= 0 and y = z, A and J point along phi (with r to the right and z up into the page),
    ``B = (-dA/dz, d(r A)/dr / r)``, and results are totals.

    Boundaries without a potential have the natural condition ``n x H = 0`` (flux crosses them at a right angle). A
    constant potential keeps the flux inside. `kohonen_adapt.adapt` takes a problem of this class.

    Parameters
    ----------
    materials
        Subdomain name to `Material`. Every element of the mesh needs exactly one; further subdomains may exist.
    potential
        Name of a boundary, or of an entry of `points`, to A in Wb/m: a float or a callable of x, shape (2, n), that
        returns shape (n,). At a node of two boundaries the later entry counts. At least one entry is required, unless
        an open boundary, antiperiodic sides or the axis fix A.
    estimator
        "residual", "recovery" (order 1) or "equilibrated" (order 1). "residual" is scaled by `RESIDUAL_SCALE` = 1 /
        3.6, which makes it equal to the error within 25 % (order 2: 1 / 6.1, 5 %; order 3: 1 / 9.7, 12 %; around an
        axis 1 / 4.2, 20 %, of order 2 and 3 45 %); where a current fills the mesh, it is up to 1.8 times the error.
        "recovery" is within 15 %. Both include what corners with exponents below 0.45 hide (`corner_exponents`). Deep
        in saturation both are within 30 %. "equilibrated" is a guaranteed upper bound of the error on the meshed
        polygon, 1.04 to 1.3 times the error, for planar problems with potentials and natural conditions only; for
        nonlinear material it is the duality gap.
    ampere_turns
        Subdomain name to the total current through the subdomain in A, positive like J: current times turns of a coil
        side. Replaces the current density of the material.
    depth
        In m. Energies, forces, torques and flux linkages are then totals. Planar problems only.
    axisymmetric
        True if the mesh is the half-plane of an axis. The unknown u = r A falls like r^2 towards the axis, see
        `kohonen_adapt.Ritz`.
    open_boundary
        Name of a boundary on a circle, around an axis on a half circle centred on the axis, with only air outside. The
        condition ``nu dA/dn + nu A / R0 = 0`` (axisymmetric: for u = r A) is exact for the field of a dipole at the
        centre. The radius R0 is measured from the mesh. Planar currents must add up to zero. The energy of the `Field`
        excludes the exterior.
    applied_field
        (H_x, H_y) in A/m, around an axis (0, H_z): the uniform field of sources outside the open boundary.
    points
        Name to a point (x, y) in metres, or to several, shape (2, n). The mesh must have nodes there, and `adapt` and
        `polish` keep them. From a Gmsh file: ``ka.read_groups(path, scale=scale).places``. If no boundary fixes A, a
        value at a point fixes the constant of A; otherwise it stands for a current in that point.
    periodic, antiperiodic
        Pairs of names of boundaries that a translation or rotation maps onto each other, node by node. A is equal on
        both, or of opposite sign. If several motions match, as between circles, a third entry of the pair selects the
        motion. ``("rotor", "bore", ka.Rotation(angle))`` turns a rotor with its remanence in its stator; B in the rotor
        and forces on it refer to the position in the mesh. ``("rim", "kelvin", ka.Reflection(point, normal))`` joins a
        disc to a Kelvin disc, a disc of air of the same size that stands for the exterior.
    order
        Order of the elements: 1 to 8, or "auto", the default. With an estimator other than "residual", "auto" is 1.
        Otherwise "auto" is 2, which takes less time than order 1 (`python -m benchmarks time`), and up to 8 in `adapt`
        with a tolerance. From order 4 on, `adapt` moves nodes at order 2, refines geometrically at corners
        (`kohonen_adapt.refined_at`) and solves with the order. Errors below 0.3 % take less time with high orders,
        unless B-H laws have kinks, or sources jump inside regions.
    curved
        True if `adapt` curves the sides of elements of order 2 and above onto the arcs and splines that they follow,
        and solves on a `MeshTri2`. On chords these orders lose their rate of convergence (`python -m benchmarks
        curves`). `solve` curves no sides. From order 4 on, a side is the arc through its three nodes if the midside
        node lies on the perpendicular bisector, and otherwise a parabola, unless it has a curve in `sides`.
    goal
        Quantity to adapt the mesh for in place of the energy: `Force`, `Torque`, `FluxLinkage`, `StoredEnergy`,
        `FluxDensityAt`, or a user-defined `Goal`. `indicators` are then those of `ka.estimators.goal_oriented`: the
        square of an `estimate` is the sum of the magnitudes of what the elements add to the error of the goal, in its
        unit, and `atol` is the root of the allowed error. There is no `energy_norm`, and `ritz` exists only if the
        derivative of the goal is constant in regions of linear material, as for a `FluxLinkage`. `goal_error` estimates
        the error.

    sides
        Boundary name to a curve with a method ``project``, such as `kohonen_adapt.Spline`, which the curved sides of
        elements of order 4 and above follow. Arcs need none, and `adapt` adds its `curves`.

    Raises
    ------
    ValueError
        For invalid arguments. `solve` and `indicators` raise it for names that the mesh lacks, elements with no or two
        materials, conditions that match neither the mesh nor each other, and parts without a fixed potential.

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

    orders: ClassVar[tuple[int, int]] = (1, 8)
    no_goal: ClassVar[str] = "; give one to Magnetostatics, for instance goal=Torque('rotor')."

    def solve(self, mesh: MeshTri, *, order: int | None = None) -> Field:
        """Solve on a mesh by a sparse direct method, with Newton's method if nonlinear.

        Above 300 000 unknowns by algebraic multigrid, to a residual of 1e-10, if pyamg is installed.

        Parameters
        ----------
        mesh
            In metres, with the named subdomains and boundaries, a plain `MeshTri`, above order 1 also a `MeshTri2`.
        order
            Order of the elements in place of that of the problem.

        Returns
        -------
        Field
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
        return solution_of(self, self.energy_on(mesh, order))

    def solve_from(self, mesh: MeshTri, old_mesh: MeshTri, old_field: Field, *, order: int | None = None) -> Field:
        """Solve like `solve`, starting from a solution on another mesh.

        The start saves steps of Newton's method. Linear problems do not use it.

        Parameters
        ----------
        mesh
            As in `solve`.
        old_mesh, old_field
            Another mesh, and the field that `solve` returned for it.
        order
            Order of the elements in place of that of the problem.

        Returns
        -------
        Field
            As in `solve`, with the same errors raised.
        """
        return solution_of(self, self.energy_on(mesh, order), old_field)

    def check(self, mesh: MeshTri) -> None:
        self.energy_on(mesh)

    def _of_energy(self, field: Field) -> Floats:
        found = energy_indicators(self, field)
        return with_strong_corners(self, field, found) if self.estimator == "residual" else found

    _of_goal = goal_indicators

    def functional(self, mesh: MeshTri, field: Field) -> float:
        """Return the functional that a solution minimises.

        The functional exceeds its minimum by half the squared error.

        Parameters
        ----------
        mesh, field
            As in `indicators`.

        Returns
        -------
        float
            As `NewtonStep.functional`, less the value for B = 0, so that it does not rise with the area of magnets. The
            error is that in `energy_norm`, for nonlinear material as described in `ritz`.

        Examples
        --------
        >>> import skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> mesh = skfem.MeshTri().refined(3).with_subdomains({"coil": lambda x: x[0] > -1.0}).with_defaults()
        >>> sides = dict.fromkeys(("left", "right", "bottom", "top"), 0.0)
        >>> problem = Magnetostatics({"coil": Material(current_density=1e6)}, sides, order=2)
        >>> field = problem.solve(mesh)  # the functional is minus half the squared norm if A is 0 on the boundary
        >>> round(problem.functional(mesh, field) / problem.energy_norm(mesh, field) ** 2, 6)
        -0.5
        """
        energy = self.energy_on(mesh, field.order)
        return energy.value(field.unknown)[0] - energy.value(0.0 * field.unknown)[0]

    def on_curves(self, curves: Curves) -> Self:
        """Return the problem with more curves in `sides`.

        Parameters
        ----------
        curves
            As `sides`, which have priority.

        Returns
        -------
        Magnetostatics
            A copy.
        """
        return replace(self, sides={**curves, **(self.sides or {})})

    def singular_nodes(self, mesh: MeshTri, field: Field) -> Ints:
        """Return the corners at which B is infinite or not smooth.

        Parameters
        ----------
        mesh, field
            As in `indicators`.

        Returns
        -------
        ndarray (n,)
            Numbers of the nodes, for `kohonen_adapt.refined_at`. Around a corner with sectors of constant reluctivity,
            A is a sum of functions ``r^l s(angle)``. Corners with an exponent l below 2 other than 1 count, and corners
            of magnets. Nonlinear material has its reluctivity at B = 0.

        Examples
        --------
        >>> import numpy as np, skfem, kohonen_adapt as ka
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
        >>> mesh = skfem.MeshTri().refined(3).with_defaults()
        >>> mesh = mesh.with_subdomains({"iron": inside, "air": lambda x: ~inside(x)})
        >>> materials = {"iron": Material(1000.0), "air": Material()}
        >>> problem = Magnetostatics(materials, {"left": 0.0, "right": 1.0}, order=5)
        >>> nodes = problem.singular_nodes(mesh, problem.solve(mesh))
        >>> mesh.p[:, nodes].tolist()
        [[0.75, 0.25, 0.25, 0.75], [0.25, 0.75, 0.25, 0.75]]
        """
        return singular_nodes(mesh, materials_of(self, field))

    def corner_exponents(self, mesh: MeshTri) -> dict[int, float]:
        """Return the exponents of corners at which B is infinite, before any solve.

        Parameters
        ----------
        mesh
            As in `solve`.

        Returns
        -------
        dict
            Number of the node to the least exponent l < 1 of the functions ``r^l s(angle)`` of which A consists there.
            B rises like ``r^(l - 1)`` towards the node. Elements of size h there leave an error like ``h^l`` in the
            energy norm, which falls slowly where iron touches iron. Nonlinear material has its reluctivity at B = 0.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> mesh = skfem.MeshTri().refined(2).with_defaults()
        >>> mesh = mesh.with_subdomains({"iron": lambda x: np.prod(x - 0.5, axis=0) > 0.0})
        >>> mesh = mesh.with_subdomains({"air": lambda x: np.prod(x - 0.5, axis=0) < 0.0})
        >>> problem = Magnetostatics({"iron": Material(1000.0), "air": Material()}, {"left": 0.0, "right": 1.0})
        >>> [(mesh.p[:, node].tolist(), round(l, 4)) for node, l in problem.corner_exponents(mesh).items()]
        [([0.5, 0.5], 0.0402)]
        """
        energy = self.energy_on(mesh)
        blank = field_of(energy, self.depth, energy.conditions.values)
        nodes, least = corner_exponents(mesh, materials_of(self, blank))
        return dict(zip(nodes.tolist(), least.tolist(), strict=True))

    def incremental_inductance(self, field: Field, circuit: Circuit) -> float:
        """Return ``d linkage / d current`` of a circuit for small changes of its current.

        The problem is linearised at the solution, with the differential reluctivity along B and the secant one across.
        Magnets, prescribed potentials and other currents stay constant. For linear material without these the result
        is the flux linkage divided by the current. Hysteresis and eddy currents are neglected.

        Parameters
        ----------
        field
            The solution that `solve` returned.
        circuit
            Subdomain to turns for every side of a coil, negative for return sides: ``{"go": 100, "return": -100}``.

        Returns
        -------
        float
            In H per metre of depth; with `depth`, and axisymmetric, in H.

        Raises
        ------
        ValueError
            If the circuit is no such mapping, or the mesh lacks its names.
        """
        density, zero = turns_density(field, checked_circuit(circuit)), np.zeros_like(field.elements.points)
        change = dual_of(self, field, (field.symmetry.source(density), zero)).values
        return turn_length(field) * float(field.elements.loads(density, zero) @ change)

    def improved(self, mesh: MeshTri, field: Field, outputs: Mapping[str, Output]) -> Mapping[str, float]:
        """Return better values of outputs.

        The elements have two orders more, or three if the change of an output by the second is not small, and are
        smaller at corners. Arcs are rounder.

        Parameters
        ----------
        mesh, field
            As in `indicators`.
        outputs
            Name to a function of a field, which must accept fields of up to three orders more.

        Returns
        -------
        dict
            Name to value, a float with the attribute ``doubt``, the estimated magnitude of its own error: half the
            change by the last order.
        """
        return better_values(self, field, outputs)

    def ritz(self, mesh: MeshTri, field: Field) -> Ritz:
        """Return the energy functional and its minimiser, the potential.

        The functional is ``int nu |grad A|^2 / 2 - J A - nu (-Br_y, Br_x) . grad A``. Nonlinear material has ``int_0^B
        (H + Hc) dB`` in place of ``nu |grad A|^2 / 2``; an open boundary adds ``int nu0 / (2 R0) A^2``. The value of a
        solution exceeds the exact minimum by half the square of the error in `energy_norm`, for nonlinear material
        approximately, in the norm of `indicators`.

        Parameters
        ----------
        mesh, field
            As in `indicators`.

        Returns
        -------
        Ritz
            In J/m, around an axis for u = r A and in J, with one coefficient per material. Its flux is a function if a
            magnet varies within its region; its signs distinguish periodic from antiperiodic sides. With a goal it
            includes the dual functional.

        Raises
        ------
        NotOffered
            For goals without a functional.
        """
        return functional_for(self, field, self.goal)
