"""Magnetostatic problems in space by a scalar potential."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar, Self

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, IntsPair
from kohonen_adapt.geometry.space.movable_solid import with_round_edges
from kohonen_adapt.magnetostatics.arguments import ArgumentsInSpace, checked_choices, solved
from kohonen_adapt.magnetostatics.equations.applied_field import Drive, drive_on
from kohonen_adapt.magnetostatics.equations.energy import coenergy
from kohonen_adapt.magnetostatics.error_by_orders import (
    change_by_further_orders,
    goal_indicators_by_orders,
    indicators_beside_edges,
    step_to,
)
from kohonen_adapt.magnetostatics.field_problem import FieldProblem
from kohonen_adapt.magnetostatics.functional import functional_in_space
from kohonen_adapt.magnetostatics.hypercircle import gap_indicators, with_currents_of
from kohonen_adapt.magnetostatics.quantities.coil_quantities import ends_far
from kohonen_adapt.magnetostatics.quantities.goals import Goal, check_goal_on
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.solid_estimation import (
    HIGHEST_WITH_SURPLUS,
    are_parallel,
    better_values,
    dual_in_space,
    energy_indicators_in_space,
    goal_indicators_in_space,
    with_surplus,
)
from kohonen_adapt.magnetostatics.strong_corners import materials_of
from kohonen_adapt.magnetostatics.vector_potential import MagneticVectorPotential
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.singular_edges import singular_edges
from kohonen_adapt.problem.energy import Energy
from kohonen_adapt.problem.evaluation import Output
from kohonen_adapt.problem.protocol import AutoOrder
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["MagneticScalarPotential"]

ESTIMATORS, ORDERS = ("residual", "recovery", "bracket"), range(1, 7)


@dataclass(frozen=True, eq=False)
class MagneticScalarPotential(ArgumentsInSpace, FieldProblem[MeshTet, SolidField]):
    """Magnets and iron in space, by a magnetic scalar potential of order 1 to 6.

    The equations are ``div B = 0`` with ``B = mu (H + Hc)`` and ``H = Hs - grad phi``, in metres, teslas and amperes.
    Fields have shape (3, n), and results are totals of the meshed part. Currents are not meshed: Hs is their field
    without iron. In iron Hs and ``grad phi`` would cancel up to a thousandth, so the unknown there is a total
    potential, ``H = -grad psi``. In a closed ring of iron around a current, psi has a jump across a layer of elements,
    which is found automatically and is no part of the result.

    The natural condition on the outer boundary is ``B . n = 0``, which keeps the flux inside. `kohonen_adapt.adapt`
    takes a problem of this class.

    Parameters
    ----------
    materials
        Subdomain name to `Material`, with remanences of three components and no current densities. Every element of the
        mesh needs exactly one; further subdomains may exist.
    potential
        Name of a boundary to phi in A: a float or a callable of x, shape (3, n), that returns shape (n,). 0 on the
        boundary of a large volume of air. At a node of two boundaries the later entry counts.
    applied_field
        Hs: a callable of x, shape (3, n) in m, that returns shape (3, n) in A/m, three numbers (a uniform field), an
        object of magpylib with currents or a list of such objects. ``mu0 Hs`` must be free of divergence, and wires
        must not meet nodes.
    symmetry
        Name of a plane in which the mesh ends to the direction of the flux there: "parallel" (natural, as beside
        magnets that the plane mirrors; needed for forces on a body that the plane cuts) or "normal" (of magnets whose
        mirror image has the opposite magnetisation; phi is 0 there).
    estimator
        "residual", which equals the error approximately: scaled at order 1, by cubic functions at order 2. At order 1
        also "recovery" or "bracket": the difference to `MagneticVectorPotential`, a guaranteed bound (see `bracket`).
    goal
        Quantity to adapt the mesh for in place of the energy: `Force`, `Torque`, `FluxLinkage`, `StoredEnergy`,
        `FluxDensityAt`, or a user-defined `Goal`. There is no `energy_norm` then.
    order
        From 1 to 6 (at order 2 B is linear in every element, with the unknowns of `skfem.ElementTetP2`) or "auto", the
        default: 2, but 1 with another estimator, and with a tolerance the order that takes the least time. From order 4
        on, `adapt` moves nodes at order 2, refines geometrically at edges and corners (`kohonen_adapt.refined_at`) and
        solves with the order, which takes a fraction of the time for small errors. The estimate is then 0.86 to 1.12
        times the error (`benchmarks hp --three-d`).
    curved
        At order 2 `kohonen_adapt.adapt` puts the nodes inside edges onto curved surfaces and solves on a `MeshTet2`. An
        edge that would fold an element stays straight. At order 1 errors of outputs and goals are those to curved
        edges.
    coils
        Name to `Coil`. Windings lie in air, and need no elements of their own. Planes of symmetry cut whole coils. The
        fields of coils and `applied_field` are added.

    Raises
    ------
    ValueError
        For invalid arguments. `solve` and `indicators` raise it for names that the mesh lacks, elements with no or two
        materials, surfaces that are no planes of symmetry, an applied field that is not finite or contradicts the
        symmetry, a current through iron, and coils that meet iron or a magnet, leave the mesh or do not have the
        symmetry.

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

    estimator: str = "residual"
    goal: Goal | None = None
    order: int = AutoOrder(2)
    curved: bool = True
    no_goal: ClassVar[str] = "; give one, for instance goal=Force('armature', (0.0, 0.0, 1.0))."

    def __post_init__(self) -> None:
        super().__post_init__()
        vars(self)["order"] = checked_choices(self, 3, ORDERS, ESTIMATORS)

    @property
    def orders(self) -> tuple[int, int]:
        """Lowest and highest order."""
        return ORDERS[0], ORDERS[-1]

    @property
    def vector_potential(self) -> MagneticVectorPotential:
        """The same problem for `MagneticVectorPotential`."""
        return MagneticVectorPotential(
            self.materials, self.potential, self.applied_field, self.symmetry, coils=self.coils
        )

    def solve(self, mesh: MeshTet, *, order: int | None = None) -> SolidField:
        """Solve on a mesh, with Newton's method if nonlinear.

        By a sparse direct method, above 8000 unknowns by algebraic multigrid if pyamg is installed, above order 2 by
        conjugate gradients; to a residual of 1e-10.

        Parameters
        ----------
        mesh
            In metres, with the named subdomains and boundaries, a plain `MeshTet`, above order 1 also a `MeshTet2`.
        order
            Order of the elements in place of that of the problem.

        Returns
        -------
        SolidField
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
        if order is not None:
            return replace(self, order=order).solve(mesh)
        energy, start = self.functional_on(mesh)
        if energy.is_quadratic:
            return solved(start, self.method.linear(energy))
        return solved(start, *self.method.descend_coenergy(energy, self._start(mesh, energy, start.drive)))

    def _start(self, mesh: MeshTet, energy: Energy, drive: Drive) -> Floats | None:
        # The solution of order 1 on the same mesh. A start from another mesh takes more steps, because the
        # interpolation error of the small H in iron is a B deep in saturation.
        if self.order == 1:
            return None
        linear, _ = self._functional(corners_of(mesh), drive, 1)
        values = self.method.descend_coenergy(linear)[0]
        return energy.conditions.admissible(energy.space.interpolated(linear.space, values))

    def check(self, mesh: MeshTet) -> None:
        self.functional_on(mesh)
        if self.estimator == "bracket":
            self.vector_potential.check(mesh)

    def functional_on(self, mesh: MeshTet) -> tuple[Energy, SolidField]:
        """Return the functional to minimise on a mesh, and the field before the solve.

        Parameters
        ----------
        mesh
            As in `solve`.

        Returns
        -------
        Energy, SolidField
            The unknown of the field has the prescribed values, and is 0 elsewhere.

        Raises
        ------
        ValueError
            As in `solve`.
        """
        return self._functional(mesh)

    def _functional(
        self, mesh: MeshTet, known: Drive | None = None, order: int | None = None
    ) -> tuple[Energy, SolidField]:
        # `known` is the given field on the same nodes, of another order.
        # Differences of orders need one order more than problems have.
        order = self.order if order is None else order
        material, planes = self.given_on(mesh, order)
        parallel = [plane.facets for plane in planes.values() if plane.kind == "parallel"]
        closed = np.concatenate([np.zeros(0, np.int64), *parallel])
        drive = drive_on(mesh, material, self.free_field, closed, order, known)
        conditions = self.conditions(drive, planes)
        far = ends_far(drive, conditions, planes.values())
        field = SolidField(mesh, conditions.values, material, drive, planes, far=far)
        check_goal_on(self.goal, field)
        return coenergy(drive, material, conditions), field

    def _of_energy(self, field: SolidField) -> Floats:
        if self.estimator == "bracket":
            vector = self.vector_potential.solve(field.mesh)
            return gap_indicators(with_currents_of(vector, field), vector)
        if field.order <= HIGHEST_WITH_SURPLUS:
            return energy_indicators_in_space(self, field, self.estimator)
        return self._by_orders(field).copy()

    def _by_orders(self, field: SolidField) -> Floats:
        if "by orders" not in field.kept:  # for outputs, too
            given = field.order, field.mesh, partial(self._energy_of, field), self.method
            parts = self.singular_edges(field.mesh, field)
            field.kept["by orders"] = indicators_beside_edges(
                field.unknown, *given, parts, lambda: self._better_solution(field).unknown
            )
        return field.kept["by orders"]

    def _of_goal(self, field: SolidField, goal: Goal) -> Floats:
        if field.order <= HIGHEST_WITH_SURPLUS:
            return goal_indicators_in_space(self, field, goal)

        higher, energies = self._better_solution(field), partial(self._energy_of, field)
        return goal_indicators_by_orders(field, higher, lambda each: dual_in_space(self, each, goal)[0], energies)

    def _energy_of(self, field: SolidField, order: int) -> Energy:
        if order == field.order:  # without the field of coils and the checks of the mesh again
            return coenergy(field.drive, field.coefficients, self.conditions_of(field))
        return self._functional(field.mesh, field.drive, order)[0]

    def aimed_at(self, output: object) -> Self:
        """Return the problem for an output, with a goal where that is quicker.

        Passes of order 1 for the force of TEAM problem 20 take two thirds of the time of passes for the energy to 1 %.
        At order 2 passes for the energy are quicker.

        Parameters
        ----------
        output
            A function of a field. Only a `Goal` can be the goal.

        Returns
        -------
        MagneticScalarPotential
            This problem at order 2, or if it has a goal or another estimator than "residual".

        Examples
        --------
        >>> from kohonen_adapt.magnetostatics import Force, MagneticScalarPotential, Material
        >>> problem, force = MagneticScalarPotential({"air": Material()}, {}, order=1), Force("body", (0.0, 0.0, 1.0))
        >>> problem.aimed_at(force).goal is force, problem.aimed_at(lambda field: 0.0).goal is None
        (True, True)
        """
        taken = self.order > 1 or self.goal is not None or self.estimator != "residual"
        return self if taken or not isinstance(output, Goal) else replace(self, goal=output)

    def improved(self, mesh: MeshTet, field: SolidField, outputs: Mapping[str, Output]) -> Mapping[str, float]:
        """Return better values of outputs.

        At order 1 they are those of the quadratic field of the problem that is linearised at the field, on curved edges
        if `curved`. At order 2 the surplus of cubic functions is added, and the doubt of a value is the relative error
        of the energy, times the part of the value that changes with the potential. The integrals of coils over magnets
        and iron have a finer quadrature. Above order 2 the change by one order more is extended by what further orders
        add to the energy, which is the doubt, too.

        Parameters
        ----------
        mesh, field
            As in `indicators`.
        outputs
            Name to a function of a field, which must accept a field of order 2.

        Returns
        -------
        dict
            Name to value, a float with the attribute ``doubt``, the estimated magnitude of its own error.
        """
        return better_values(field, outputs, self._better_solution, self._rest)

    def _rest(self, field: SolidField) -> float:
        if field.order <= HIGHEST_WITH_SURPLUS:
            return 0.0
        higher, energies = self._better_solution(field), partial(self._energy_of, field)
        return change_by_further_orders(field, higher, energies, self._by_orders(field))

    def _better_solution(self, field: SolidField) -> SolidField:
        if field.order == HIGHEST_WITH_SURPLUS:
            return with_surplus(self, field)
        if "higher" in field.kept:  # for indicators, goals and outputs
            return field.kept["higher"]
        cut_off = self.curved and field.order == 1  # faces cut off a part of round bodies
        mesh = with_round_edges(field.mesh) if cut_off else field.mesh
        energy, start = self._functional(mesh, field.drive, field.order + 1)
        # The potential in nonlinear material is total, so that H on straight edges does not change.
        step = step_to(energy, field.elements, field.unknown, self.method.roughly)
        found = replace(start, unknown=np.add(*step))
        if field.order > HIGHEST_WITH_SURPLUS:
            field.kept["higher"] = found
        return found

    def singular_edges(self, mesh: MeshTet, field: SolidField) -> IntsPair:
        """Return the edges along which B is infinite or not smooth, and corners.

        Parameters
        ----------
        mesh, field
            As in `indicators`.

        Returns
        -------
        ndarray (2, k), ndarray (n,)
            Numbers of the nodes of the edges, the lower first, and of the corners. Across an edge with sectors of
            constant permeability phi is a sum of functions ``r^l s(angle)``. Edges with an exponent l below 2 other
            than 1 count, and edges of magnets unless the magnetisation is along them. Nonlinear material has its
            permeability at H = 0. Surfaces that turn by less than 35 degrees count as smooth. At a corner edges meet at
            an angle or end, except in a plane of symmetry across the edge.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
        >>> mesh = skfem.MeshTet.init_tensor(*[np.linspace(0.0, 1.0, 5)] * 3).with_defaults()
        >>> mesh = mesh.with_subdomains({"iron": inside, "air": lambda x: ~inside(x)})
        >>> materials = {"iron": Material(1000.0), "air": Material()}
        >>> problem = MagneticScalarPotential(materials, {"left": 0.0, "right": 1.0})
        >>> edges, corners = problem.singular_edges(mesh, problem.solve(mesh))
        >>> edges.shape[1], corners.size
        (24, 8)
        """
        return singular_edges(mesh, materials_of(self, field))

    def ritz(self, mesh: MeshTet, field: SolidField) -> Ritz:
        """Return the co-energy functional and its minimiser, the potential.

        The functional is ``int mu |grad phi|^2 / 2 - (Br + mu Hs) . grad phi``. Nonlinear material has the co-energy
        ``int_0^|H + Hc| B dh`` in place of the integrand. The value of a solution exceeds the exact minimum by half the
        square of the error in `energy_norm`.

        The applied field appears on surfaces only. In iron the unknown is the total potential ``u = phi + chi`` with
        ``Hs = -grad chi``, and ``int mu Hs . grad phi`` outside iron is an integral of ``mu Hs . n phi`` over faces at
        which mu changes, because ``mu Hs`` has no divergence.

        Parameters
        ----------
        mesh, field
            As in `indicators`.

        Returns
        -------
        Ritz
            In J, with one coefficient per material. Its flux is a function if a magnet varies within its region. With a
            goal it shapes elements only, unless the dual is parallel to the potential.

        Raises
        ------
        NotOffered
            For nonlinear material with a remanence that varies in a region, and for iron that links a current. At order
            2 for all magnets that vary in a region.
        """
        ritz = functional_in_space(self, field, self.functional_on)
        if self.goal is None:
            return ritz
        shapes_only = not are_parallel(field, dual_in_space(self, field, self.goal)[0])
        return replace(ritz, comparable=False, shapes_only=shapes_only)
