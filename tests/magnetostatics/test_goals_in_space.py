"""Goals of fields in space: their derivatives and duals, what is told of their errors, and meshes adapted for them."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.magnet_solids import blocks, cuboids, graded

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import (
    FluxDensityAt,
    Force,
    Froehlich,
    MagneticScalarPotential,
    Material,
    StoredEnergy,
    Torque,
)
from kohonen_adapt.magnetostatics.solid_estimation import dual_in_space
from kohonen_adapt.problem.functional_value import functional_value

AIR = Material()
POLES = {"a": Material(remanence=(0.0, 0.0, 1.2)), "b": Material(remanence=(0.0, 0.5, 1.0)), "air": AIR}
PULL = np.array([-10.77767, 8.95397, -33.30058])  # N on the second of the cuboids, by magpylib 5.1
WHOLE = float(np.linalg.norm(PULL))
AXIS = (0.6, 0.0, 0.8)


def under_iron(step=0.005):
    """A magnet under a plate of iron that saturates."""
    parts = {"a": POLES["a"], "b": Material(bh=Froehlich(500.0, 1.6)), "air": AIR}
    return cuboids(step), MagneticScalarPotential(parts, {"outer": 0.0}, order=1)


def applied():
    """A permeable block beside a magnet in a field that is not uniform."""
    parts = {"a": POLES["a"], "b": Material(50.0), "air": AIR}

    def saddle(x):
        return 1e6 * np.stack((x[1], x[0], 0.0 * x[0]))

    return cuboids(0.006), MagneticScalarPotential(parts, {"outer": 0.0}, applied_field=saddle, order=1)


def halved():
    """Two magnets that a plane of symmetry cuts."""
    axes = [graded([-0.02, -0.01, 0.01, 0.02], 0.01, 0.04, 2), graded([-0.01, 0.01], 0.01, 0.04, 2), [0.0, 0.01, 0.03]]
    mesh = blocks(
        axes, {"a": ((-0.02, -0.01, 0.0), (-0.01, 0.01, 0.01)), "b": ((0.01, -0.01, 0.0), (0.02, 0.01, 0.01))}
    )
    parts = {"a": Material(remanence=(1.0, 0.5, 0.0)), "b": Material(remanence=(1.0, 0.0, 0.0)), "air": AIR}
    return mesh, MagneticScalarPotential(parts, {"x-": 0.0, "z+": 0.0}, symmetry={"z-": "parallel"}, order=1)


def magnets():
    return cuboids(0.006), MagneticScalarPotential(POLES, {"outer": 0.0}, order=1)


GOALS = {
    "force": Force("b", (1.0, -2.0, 3.0)),
    "torque": Torque("b", (0.004, 0.001, 0.015), AXIS),
    "energy": StoredEnergy("a"),
    "B at a point": FluxDensityAt((0.001, 0.0, 0.0075), (1.0, -2.0, 3.0)),
}
CASES = {make.__name__: (make, make()[1].solve(make()[0])) for make in (magnets, under_iron, applied, halved)}
every_goal = pytest.mark.parametrize("goal", GOALS.values(), ids=GOALS)


# --- theorems ----------------------------------------------------------------------------------------------------


@cache
def solved(case, order):
    make, field = CASES[case]
    mesh, problem = make()
    return field if order == 1 else replace(problem, order=order).solve(mesh)


@every_goal
@pytest.mark.parametrize(
    ("case", "order"), [*((case, 1) for case in CASES), ("under_iron", 2), ("halved", 3), ("magnets", 3)]
)
def test_derivatives_are_those_of_the_values(case, order, goal):
    field = solved(case, order)
    change = 1e-6 * np.random.default_rng(0).normal(size=field.unknown.size) * np.abs(field.unknown).max()
    one, other = (goal(replace(field, unknown=field.unknown + sign * change)) for sign in (1.0, -1.0))
    source, load = goal.derivative(field)
    assert not source.any()
    parts = np.sum(load * field.elements.gradient_at_points(change), axis=0) * field.point_volumes
    assert parts.sum() == pytest.approx(0.5 * (one - other), abs=1e-5 * np.abs(parts).sum())


@every_goal
@pytest.mark.parametrize("case", ["magnets", "under_iron", "halved"])
def test_the_dual_tells_what_a_magnet_does_to_the_goal(case, goal):
    """A change of the remanence of air far from the bodies: dJ = int dBr . grad z."""
    (make, field), size = CASES[case], 1e-4
    mesh, problem = make()
    far = np.flatnonzero(np.isin(np.arange(mesh.nelements), mesh.subdomains["air"]) & (_reach(mesh) > 0.035))
    parts = {**mesh.subdomains, "far": far, "air": np.setdiff1d(mesh.subdomains["air"], far)}
    mesh, way = mesh.with_subdomains(parts), np.array([0.3, 0.5, 1.0])

    def value(sign):
        materials = {**problem.materials, "far": Material(remanence=tuple(sign * size * way))}
        return goal(replace(problem, materials=materials).solve(mesh))

    dual = dual_in_space(problem, field, goal)[0]
    slope = field.elements.gradient(dual)[:, far] @ field.elements.volumes[far]
    assert size * way @ slope == pytest.approx(0.5 * (value(1.0) - value(-1.0)), rel=2e-4)


def _reach(mesh):
    return np.abs(mesh.p[:, mesh.t]).max(axis=0).min(axis=0)


@pytest.mark.parametrize("order", [1, 2])
def test_adapt_ends_at_a_tolerance_of_an_output_in_space(order):
    mesh, problem = magnets()
    result = ka.adapt(mesh, replace(problem, order=order), outputs={"force": GOALS["force"]}, output_rtol=0.1)
    assert result.status is ka.Status.CONVERGED
    assert result.best.unknowns < 10 * result.history[0].unknowns
    assert abs(result.outputs["force"].error) <= 0.1 * abs(result.outputs["force"].value)


def test_the_only_output_with_a_tolerance_is_the_goal_at_order_1():
    mesh, problem = magnets()
    force, torque = GOALS["force"], GOALS["torque"]

    def goal_of(problem, **more):
        return ka.adapt(mesh, problem, passes=0, **more).best.goal

    assert goal_of(problem, outputs={"f": force}, output_rtol=0.1) == force(problem.solve(mesh))
    assert goal_of(problem, outputs={"f": force, "t": torque}, output_rtol={"f": 0.1}) == force(problem.solve(mesh))
    assert goal_of(problem, outputs={"f": force, "t": torque}, output_rtol=0.1) is None
    assert goal_of(problem, outputs={"f": force}, output_rtol=0.1, rtol=0.1) is None
    assert goal_of(problem, outputs={"f": force}, output_rtol=0.1, target_nodes=mesh.nvertices) is None
    assert goal_of(problem, outputs={"f": lambda field: force(field)}, output_rtol=0.1) is None
    assert goal_of(replace(problem, order=2), outputs={"f": force}, output_rtol=0.1) is None


@pytest.mark.slow
def test_estimates_are_calibrated_without_a_goal():
    """The error of an adapted mesh is known from the functionals of finer meshes, by extrapolation."""
    problem = magnets()[1]
    assert problem.calibrated and not replace(problem, goal=GOALS["force"]).calibrated

    def value(mesh, field):
        return functional_value(mesh, problem.ritz(mesh, field))

    coarse, middle, fine = (value(mesh, problem.solve(mesh)) for mesh in map(cuboids, (0.005, 0.0025, 0.00125)))
    exact = fine - (middle - fine) ** 2 / (coarse - 2.0 * middle + fine)
    result = ka.adapt(cuboids(0.0033), problem, passes=2)
    error = np.sqrt(2.0 * (value(result.mesh, result.solution) - exact))
    assert 0.7 < result.estimate / error < 1.3
    assert "Energy-norm error %" in str(result)


# --- adapted meshes ----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_force_converges_on_meshes_adapted_for_it_and_what_is_missing_is_told():
    """To less than on those for the energy; and with what is told there is less than half of the error."""
    problem, nodes, errors = (
        MagneticScalarPotential(POLES, {"outer": 0.0}, order=1, goal=Force("b", tuple(PULL))),
        [],
        [],
    )
    for step in (0.005, 0.0033):
        mesh = cuboids(step, far=0.15)
        field = ka.adapt(mesh, problem, passes=2).solution
        nodes.append(mesh.nvertices)
        errors.append(WHOLE - problem.goal(field))
    assert np.log(errors[0] / errors[1]) / np.log(nodes[1] / nodes[0]) > 0.6
    assert abs(errors[1] - problem.goal_error(field)) < 0.5 * errors[1] < 0.0125 * WHOLE
    energy = ka.adapt(
        mesh, replace(problem, goal=None), passes=2, anisotropic=False
    ).solution  # with directions as good as for the force
    assert errors[1] < 0.8 * abs(WHOLE - problem.goal(energy))


# --- refused -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        (
            "force",
            "goal must be a Force, Torque, FluxLinkage, StoredEnergy, FluxDensityAt or another object with goal(field) "
            "and goal.derivative(field), or None; got 'force'.",
        ),
        (
            Force("b", (1.0, 0.0)),
            "a Force must have vectors (x, y, z) in space as a goal; got Force(body='b', direction=(1.0, 0.0)).",
        ),
        (
            Torque("b"),
            "a Torque must have vectors (x, y, z) in space as a goal; got Torque(body='b', centre=(0.0, 0.0), "
            "axis=None).",
        ),
    ],
)
def test_wrong_goals_are_named(goal, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        MagneticScalarPotential(POLES, {"outer": 0.0}, order=1, goal=goal)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda field: Force("b", (1.0, 0.0))(field), "a Force must have vectors (x, y, z) in space as a goal; got"),
        (lambda field: Force("b", (0.0, 0.0, 2.0))(field), "the force on 'b' has no component along (0.0,"),
        (
            lambda field: Torque("b", (0.0,) * 3, (1, 0, 0))(field),
            "the torque on 'b' has no component along (1.0,",
        ),
        (lambda field: Torque("b", (0.0,) * 3, (0, 0, 0))(field), "axis of Torque must not be zero; got (0, 0, 0)."),
        (lambda field: halved()[1].goal_error(field), "goal_error needs a goal; give one, for instance goal=Force("),
        (lambda field: StoredEnergy(("a", "b", "air")).derivative(field), "StoredEnergy needs a part of the mesh"),
        (
            lambda field: replace(halved()[1], goal=GOALS["force"], estimator="recovery"),
            "a goal has its own indicators",
        ),
    ],
)
def test_what_a_half_cannot_tell_and_what_is_missing(call, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        call(CASES["halved"][1])


def test_a_functional_that_shapes_only_does_not_compare():
    values = np.zeros(4), np.zeros(4, dtype=bool)
    assert ka.Ritz(*values, 1.0, comparable=False, shapes_only=True).shapes_only
    for wrong in ({"shapes_only": True}, {"shapes_only": 1, "comparable": False}):
        with pytest.raises(ValueError, match=r"^shapes_only of Ritz must be False, or True"):
            ka.Ritz(*values, 1.0, **wrong)
