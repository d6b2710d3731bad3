"""Goals of magnetic problems: their derivatives, their dual problems, and meshes on which their errors fall faster."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.devices import (
    AIR,
    CIRCUIT,
    MM,
    STEEL,
    TURNS,
    actuator,
    machine,
    shielded,
    two_magnets,
)
from helpers.devices import plunger as plunger_of_step
from helpers.examples import examples
from helpers.tensor_meshes import box
from hypothesis import given
from hypothesis import strategies as st

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import (
    FluxDensityAt,
    FluxLinkage,
    Force,
    Goal,
    Magnetostatics,
    Material,
    StoredEnergy,
    Torque,
)
from kohonen_adapt.magnetostatics.solution import at_points, dual_of
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.problem.functional_value import functional_value


def plunger():
    return plunger_of_step(2 * MM)


CASES = {
    "force": (actuator, Force("bar", (3.0, 4.0))),
    "torque": (actuator, Torque(["bar"], (0.01, 0.02))),
    "linkage": (actuator, FluxLinkage(CIRCUIT)),
    "energy": (actuator, StoredEnergy(("bar", "go"))),
    "B in saturated steel": (actuator, FluxDensityAt((0.001, -0.004), (1.0, 2.0))),
    "B on an axis": (plunger, FluxDensityAt((0.0, -0.004), (1.0, 2.0))),
    "B around an axis": (plunger, FluxDensityAt((0.01, -0.001), (2.0, 1.0), 0.002)),
    "B with an open boundary": (shielded, FluxDensityAt((0.001, 0.0), (0.0, 1.0))),
    "force along an axis": (plunger, Force("plunger", (0, 1))),
    "linkage around an axis": (plunger, FluxLinkage({"coil": 100})),
    "energy around an axis": (plunger, StoredEnergy("plunger")),
    "torque on a pole": (machine, Torque(("coil", "hub"))),
    "force with an open boundary": (shielded, Force("go", (1, 0))),
    "energy with an open boundary": (shielded, StoredEnergy("tube")),
}
FIELDS = {make: make()[1].solve(make()[0]) for make in (actuator, plunger, machine, shielded)}


@cache
def solved(make, order):
    mesh, problem = make()
    return FIELDS[make] if order == 1 else replace(problem, order=order).solve(mesh)


# --- theorems ----------------------------------------------------------------------------------------------------


def test_goals_have_the_values_of_the_field():
    field, around = FIELDS[actuator], FIELDS[plunger]
    assert Force("bar", (3.0, 4.0))(field) == pytest.approx(field.force("bar") @ (0.6, 0.8), rel=1e-9)
    assert Torque("bar", (0.01, 0.02))(field) == pytest.approx(field.torque("bar", (0.01, 0.02)), rel=1e-9)
    linked = field.flux_linkage("go", turns=50) + field.flux_linkage("back", turns=-50)
    assert FluxLinkage(CIRCUIT)(field) == pytest.approx(linked, rel=1e-12)
    assert StoredEnergy(("go", "back", "bar", "air"))(field) == pytest.approx(field.energy, rel=1e-12)
    assert Force("plunger", (0, 2))(around) == pytest.approx(around.force("plunger")[1], rel=1e-9)
    assert StoredEnergy(["coil", "plunger", "air"])(around) == pytest.approx(around.energy, rel=1e-12)


def shifted(field, change):
    """The field with another potential; `change` (nunknowns,) is of u."""
    values = field.symmetry.potential(field.elements.doflocs, field.unknown + change)
    return replace(field, potential=values[: field.potential.size], **({"values": values} if field.order > 1 else {}))


OF_ORDER_2 = [(case, 2) for case in ("force", "torque", "linkage", "energy", "energy around an axis", "B on an axis")]


@pytest.mark.parametrize(("case", "order"), [*((case, 1) for case in CASES), *OF_ORDER_2])
@given(seed=st.integers(0, 10**6))
@examples(5)
def test_derivatives_are_those_of_the_values(case, order, seed):
    make, goal = CASES[case]
    field = solved(make, order)
    change = 1e-6 * np.random.default_rng(seed).normal(size=field.unknown.size) * np.abs(field.unknown).max()
    change[field.symmetry.on_axis(field.elements.doflocs)] = 0.0
    wanted = 0.5 * (goal(shifted(field, change)) - goal(shifted(field, -change)))
    parts = change * field.elements.loads(*at_points(field, goal.derivative(field)))
    assert parts.sum() == pytest.approx(wanted, abs=1e-5 * np.abs(parts).sum())


@pytest.mark.parametrize(("case", "order"), [*((case, 1) for case in CASES), ("force", 2)])
def test_the_dual_tells_what_a_current_does_to_the_goal(case, order):
    """dJ = int dJ_current z: of nonlinear material, around an axis and with antiperiodic sides."""
    make, goal = CASES[case]
    (mesh, problem), field = make(), solved(make, order)
    problem, dual = (
        replace(problem, order=order),
        dual_of(problem, field, goal.derivative(field)).values,
    )
    name = next(name for name in ("go", "coil") if name in mesh.subdomains)
    density = np.where(np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains[name]), 1e4, 0.0)
    load = field.elements.loads(field.symmetry.source(density), np.zeros_like(field.elements.points))

    def value(sign):
        materials, size = dict(problem.materials), float(np.sum(area(mesh)[density > 0]))
        now = problem.ampere_turns.get(name, size * materials[name].current_density)
        materials[name] = replace(materials[name], current_density=(now / size) + sign * 1e4)
        turns = {other: total for other, total in problem.ampere_turns.items() if other != name}
        return goal(replace(problem, materials=materials, ampere_turns=turns).solve(mesh))

    assert load @ dual == pytest.approx(0.5 * (value(1.0) - value(-1.0)), rel=1e-4)


@pytest.mark.parametrize("order", [2, 3])
def test_where_the_goal_is_the_load_the_products_of_residuals_are_those_of_the_energy(order):
    mesh, problem = linear_actuator(depth=None, order=order)
    field, plain = problem.solve(mesh), replace(problem, goal=None)
    wanted = plain.indicators(mesh, field)
    np.testing.assert_allclose(np.sqrt(TURNS / 50) * problem.indicators(mesh, field), wanted, rtol=1e-6)


@pytest.mark.parametrize("make", [actuator, plunger, machine])
def test_a_goal_of_ones_own(make):
    """The square of a goal has twice its value for a factor of the derivative."""

    class Squared:
        def __init__(self, goal):
            self.goal = goal

        def __call__(self, field):
            return self.goal(field) ** 2

        def derivative(self, field):
            return tuple(2.0 * self.goal(field) * part for part in self.goal.derivative(field))

    (mesh, problem), field = make(), FIELDS[make]
    goal = next(goal for other, goal in CASES.values() if other is make)
    assert isinstance(Squared(goal), Goal)
    plain, square = (replace(problem, goal=each) for each in (goal, Squared(goal)))
    factor = 2.0 * goal(field)
    better = goal(field) + plain.goal_error(field)
    rel = 1e-2 if make is machine else 1e-9  # what rounder arcs change is told to first order
    assert square.goal_error(field) == pytest.approx(better**2 - goal(field) ** 2, rel=rel)
    wanted = np.sqrt(abs(factor)) * plain.indicators(mesh, field)
    np.testing.assert_allclose(square.indicators(mesh, field), wanted, rtol=1e-5, atol=1e-7 * wanted.max())


# --- adapted meshes: the error of a goal falls faster than with the energy's indicators ---------------------------


def lifted(cells=50):
    """A magnet over a bar of saturated steel."""
    sides = {"magnet": (-0.005, 0.005, 0.001, 0.006), "bar": (-0.01, 0.01, -0.004, -0.001)}
    mesh = box(np.linspace(-0.025, 0.025, cells + 1), np.linspace(-0.02, 0.02, cells * 4 // 5 + 1), sides)
    parts = {"magnet": Material(remanence=(0.0, 1.2)), "bar": STEEL, "air": AIR}
    return mesh, Magnetostatics(parts, {"outer": 0.0}, order=1)


def test_the_error_of_a_force_is_told_where_the_field_is_singular_at_corners():
    """0.95 to 0.98 times the error; elements of one order more alone tell 0.77 to 0.92 of it."""
    mesh, problem = lifted()
    problem = replace(problem, goal=Force("magnet", (0, 1)))
    layered = ka.refined_at(mesh, problem.singular_nodes(mesh, problem.solve(mesh)), layers=3)
    exact = problem.goal(problem.solve(layered, order=5))
    for order in (1, 2, 3):
        field = problem.solve(mesh, order=order)
        assert 0.9 < problem.goal_error(field) / (exact - problem.goal(field)) < 1.02


PULL = Force("b", (1, 0))


@pytest.mark.parametrize(
    ("order", "made"), [(1, ((plunger, ()), (machine, [("right", "left")]))), (2, ((shielded, ()),))]
)
def test_goals_around_an_axis_with_pairs_and_with_an_open_boundary_are_adapted(order, made):
    for make, pairs in made:
        mesh, problem = make()
        problem = replace(problem, order=order, goal=next(goal for other, goal in CASES.values() if other is make))
        result = ka.adapt(mesh, problem, periodic=pairs, passes=1)
        assert result.history[-1].estimate < 0.8 * result.history[0].estimate


def test_the_loop_with_a_goal_says_what_it_leaves_out():
    mesh, problem = two_magnets(1)
    problem = replace(problem, goal=PULL)
    result = ka.adapt(mesh, problem, outputs={"pull": PULL}, passes=1)
    why = (
        "a goal whose derivative varies within regions (a force, a torque, B over a spot, the energy of a part) has no "
        "functional to minimise"
    )
    assert f"No polish: {why}" in result.message
    assert "Energy" not in str(result) and "pull" in str(result)
    assert result.history[0].energy_norm is None
    message = (
        "rtol requires the energy norm of the problem, but the error of a goal is no fraction of the "
        "energy. Use atol instead."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        ka.adapt(mesh, problem, rtol=0.01)


# --- the polish for a goal -------------------------------------------------------------------------------------


def linear_actuator(**more):
    mesh, problem = actuator(**more)
    return mesh, replace(problem, materials=problem.materials | {"bar": Material(500.0)}, goal=FluxLinkage(CIRCUIT))


@pytest.mark.parametrize("order", [1, 2, 3])
def test_where_the_goal_is_the_load_the_dual_is_the_field(order):
    mesh, problem = linear_actuator(depth=None, order=order)
    field = problem.solve(mesh)
    ritz, plain = problem.ritz(mesh, field), replace(problem, goal=None).ritz(mesh, field)
    np.testing.assert_allclose(TURNS / 50 * ritz.dual.values, field.unknown, atol=1e-9 * np.ptp(field.unknown))
    assert ritz.share == pytest.approx(50 / TURNS, rel=1e-9) and ritz.comparable
    total = functional_value(mesh, ritz)
    assert total == pytest.approx(2 * ritz.share * functional_value(mesh, plain), rel=1e-9)
    assert total == pytest.approx(-problem.goal(field), rel=1e-9)


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        (
            lambda: (*actuator(), FluxLinkage(CIRCUIT)),
            "with nonlinear material a goal has no functional to minimise",
        ),
        (lambda: (*two_magnets(1), StoredEnergy("a")), r"the energy of a part\) has no functional to minimise"),
    ],
)
def test_goals_that_are_not_polished_say_why(case, reason):
    mesh, problem, goal = case()
    problem = replace(problem, goal=goal)
    with pytest.raises(ka.NotOffered, match=reason):
        problem.ritz(mesh, problem.solve(mesh))


# --- refused -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Force("bar", (0.0, 0.0)), "direction of Force must not be zero; got (0.0, 0.0)."),
        (lambda: Force("bar", 1.0), "direction of Force must be a vector (x, y), in space (x, y, z); got 1.0."),
        (
            lambda: Torque("bar", (np.nan, 0.0)),
            "centre of Torque must be a point (x, y), in space (x, y, z), in m; got (nan, 0.0).",
        ),
        (
            lambda: Torque("bar", (0.0, 0.0, 0.0)),
            "Torque takes a centre (x, y) in the plane, and in space a centre (x, y, z) and an axis (x, y, z); got the "
            "centre (0.0, 0.0, 0.0) and the axis None.",
        ),
        (
            lambda: actuator(goal=Force("bar", (1.0, 0.0, 0.0))),
            "a Force must have vectors (x, y) in the plane as a goal; got Force(body='bar', direction=(1.0, 0.0, "
            "0.0)).",
        ),
        (lambda: FluxLinkage("go"), "circuit must map subdomains to turns, for instance {'coil': 100}; got 'go'."),
        (lambda: FluxLinkage({"go": 0}), "turns of 'go' must be a finite number other than 0; got 0."),
        (
            lambda: actuator(goal="force"),
            "goal must be a Force, Torque, FluxLinkage, StoredEnergy, FluxDensityAt or another object with goal(field) "
            "and goal.derivative(field), or None; got 'force'.",
        ),
        (
            lambda: actuator(goal=Torque("bar"), estimator="recovery"),
            "a goal has its own indicators; omit the estimator, got 'recovery'.",
        ),
        (
            lambda: actuator()[1].goal_error(FIELDS[actuator]),
            "goal_error needs a goal; give one to Magnetostatics, for instance goal=Torque('rotor').",
        ),
        (
            lambda: Force("plunger", (1, 0))(FIELDS[plunger]),
            "the force on 'plunger' has no component along (1.0, 0.0): an axisymmetric force is along z, "
            "and the force on a body cut by a mirror plane is along the plane. Give another direction.",
        ),
        (
            lambda: Torque("plunger")(FIELDS[plunger]),
            "an axisymmetric field has no torque: it is the same at every angle.",
        ),
        (
            lambda: StoredEnergy(["go", "back", "bar", "air"]).derivative(FIELDS[actuator]),
            "StoredEnergy needs a part of the mesh; ['go', 'back', 'bar', 'air'] is all of it. For the whole "
            "energy omit the goal: the indicators then estimate its error.",
        ),
        (
            lambda: StoredEnergy("rotor")(FIELDS[actuator]),
            "subdomain 'rotor' is not in the mesh; it has 'air', 'back', 'bar', 'go'.",
        ),
    ],
)
def test_wrong_goals_are_named(make, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        make()


class SquaredLinkage:
    def __call__(self, field):
        return FluxLinkage(CIRCUIT)(field) ** 2

    def derivative(self, field):
        source, flux = FluxLinkage(CIRCUIT).derivative(field)
        return 2.0 * FluxLinkage(CIRCUIT)(field) * source, flux


def test_a_goal_that_is_not_linear_is_polished_and_compared_by_the_estimate():
    mesh, problem = linear_actuator()
    assert not replace(problem, goal=SquaredLinkage()).ritz(mesh, problem.solve(mesh)).comparable
