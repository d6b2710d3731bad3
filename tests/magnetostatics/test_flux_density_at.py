"""`FluxDensityAt`: exact fields, told errors, meshes adapted for B at a point, and refused points and spots."""

import re
from dataclasses import replace

import numpy as np
import pytest
import skfem
from helpers.devices import AIR, MAGNET_HALF, PLACES, plunger, two_magnets
from helpers.sheets import rectangle_field

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import FluxDensityAt, Magnetostatics
from kohonen_adapt.problem.uncertain import corrected, error_of


def square(cells=4):
    mesh = skfem.MeshTri.init_tensor(*[np.linspace(0.0, 1.0, cells + 1)] * 2)
    return mesh.with_boundaries({"rim": lambda x: x[0] > -1.0}).with_subdomains({"air": lambda x: x[0] > -1.0})


def half_plane(cells=5):
    mesh = skfem.MeshTri.init_tensor(np.linspace(0.0, 1.0, cells + 1), np.linspace(-1.0, 1.0, 2 * cells + 1))
    mesh = mesh.with_boundaries({"rim": lambda x: (x[0] > 1.0 - 1e-9) | (np.abs(x[1]) > 1.0 - 1e-9)})
    return mesh.with_subdomains({"air": lambda x: x[0] > -1.0})


def between_magnets(x):
    return sum(rectangle_field(np.reshape(x, (2, 1)), place, MAGNET_HALF) for place in PLACES.values())[:, 0]


# --- theorems ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [None, 0.05, 0.3])
@pytest.mark.parametrize("order", [3, 5])
def test_a_harmonic_field_has_its_value_at_the_point_over_every_spot(order, radius):
    """A = Re (x + i y)^3 is in the space of order 3, and B = (-6 x y, -3 (x^2 - y^2))."""
    potential = {"rim": lambda x: ((x[0] + 1j * x[1]) ** 3).real}
    field = Magnetostatics({"air": AIR}, potential, order=order).solve(square())
    exact = np.array([-6 * 0.45 * 0.52, -3 * (0.45**2 - 0.52**2)])
    assert FluxDensityAt((0.45, 0.52), (3.0, 4.0), radius)(field) == pytest.approx(exact @ (0.6, 0.8), rel=1e-9)


@pytest.mark.parametrize("radius", [None, 0.2, 0.3])
@pytest.mark.parametrize("r", [0.0, 0.1, 0.45])
def test_around_an_axis_spots_are_balls(r, radius):
    """B = (-r / 2, z) is harmonic in space, not in the plane of the mesh."""
    potential = {"rim": lambda x: 0.5 * x[0] * x[1]}
    field = Magnetostatics({"air": AIR}, potential, axisymmetric=True, order=3).solve(half_plane())
    assert FluxDensityAt((r, 0.3), (3.0, 4.0), radius)(field) == pytest.approx(0.6 * -r / 2 + 0.8 * 0.3, rel=1e-9)


@pytest.mark.parametrize(
    ("order", "goal_rtol"),
    [(2, 1e-2), (5, 1e-3), pytest.param("auto", 1e-5, marks=pytest.mark.slow)],
)
def test_b_is_told_right_within_the_tolerance(order, goal_rtol):
    mesh, problem = two_magnets(1)
    goal = FluxDensityAt((0.0, 0.008), (0.3, 1.0), 0.002)
    exact = between_magnets(goal.x) @ goal.direction
    problem = Magnetostatics(problem.materials, problem.potential, order=order, goal=goal)
    result = ka.adapt(mesh, problem, goal_rtol=goal_rtol)
    told = result.outputs["goal"]
    assert result.status is ka.Status.CONVERGED and "T, estimated error" in result.message
    assert abs(told.value - exact) < 1.25 * goal_rtol * abs(exact)
    resolved = 0.01 * goal_rtol * abs(exact)  # of an error of the value that is smaller, half is by chance
    assert abs(told.corrected - exact) < max(0.5 * abs(told.value - exact), resolved)


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_errors_of_b_at_points_are_told_within_a_factor_and_corrections_improve_them(order):
    """Of 24 points each: a change by one order crosses zero, and by chance an error is smaller than told."""
    mesh, problem = two_magnets(1)
    problem = replace(problem, order=order)
    field = ka.adapt(mesh, problem, passes=2).solution
    x = np.random.default_rng(0).uniform(-0.018, 0.018, (2, 24))
    outputs = {str(k): lambda field, k=k: float(field.flux_density_at(x[:, k : k + 1])[1, 0]) for k in range(24)}
    better = problem.improved(field.mesh, field, outputs)
    exact = sum(rectangle_field(x, place, MAGNET_HALF) for place in PLACES.values())[1]
    value = np.array([output(field) for output in outputs.values()])
    errors = [error_of(v, better[name]) for v, name in zip(value, outputs, strict=True)]
    true = np.abs(exact - value)
    ratio, by_chance = np.abs(errors) / true, true < 0.1 * np.median(true)
    left = [corrected(v, error, error.doubt) for v, error in zip(value, errors, strict=True)] - exact
    assert np.sum((ratio > 0.5) & ((ratio < 5.0) | by_chance)) >= 23 and 0.9 < np.median(ratio) < 1.1
    assert np.sum(np.abs(left) > true) <= 1
    assert np.linalg.norm(left) < 0.25 * np.linalg.norm(exact - value)


# --- refused -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FluxDensityAt((0.0, 0.0), (0.0, 0.0)), "direction of FluxDensityAt must not be zero; got (0.0, 0.0)."),
        (
            lambda: FluxDensityAt(0.1, (0.0, 1.0)),
            "x of FluxDensityAt must be a point (x, y), in space (x, y, z), in m; got 0.1.",
        ),
        (
            lambda: FluxDensityAt((0.0, 0.0, 0.0), (0.0, 1.0)),
            "x and direction of FluxDensityAt must have equally many components; got (0.0, 0.0, 0.0) and (0.0, 1.0).",
        ),
        (
            lambda: FluxDensityAt((0.0, 0.0), (0.0, 1.0), 0.0),
            "radius of FluxDensityAt must be a finite number > 0 in m, or None; got 0.0.",
        ),
        (
            lambda: replace(plunger()[1], goal=FluxDensityAt((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
            "a FluxDensityAt must have vectors (x, y) in the plane as a goal; got FluxDensityAt(x=(0.0, 0.0, 0.0), "
            "direction=(0.0, 0.0, 1.0), radius=None).",
        ),
    ],
)
def test_wrong_points_are_named(make, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        make()


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        (
            FluxDensityAt((0.3, 0.0), (0.0, 1.0)),
            "x of FluxDensityAt must be a point of the mesh, which is from (0, -0.2) to (0.2, 0.2) m; (0.3, 0) is "
            "outside.",
        ),
        (
            FluxDensityAt((0.004, 0.0), (0.0, 1.0), 0.003),
            "the spot of FluxDensityAt must not reach the boundary of the mesh or another material, where B jumps; "
            "they are 0.002 m from (0.004, 0), and the radius is 0.003. Give a smaller radius.",
        ),
        (
            FluxDensityAt((0.002, 0.002), (0.0, 1.0)),
            "x of FluxDensityAt must be inside a material; (0.002, 0.002) is on the boundary of the mesh or between "
            "two materials. Move it into one of them.",
        ),
        (
            FluxDensityAt((0.0, -0.01), (1.0, 0.0)),
            "B on an axis is along z; FluxDensityAt there must have a direction with a z component.",
        ),
    ],
)
def test_spots_in_no_material_or_two_are_refused_before_anything_moves(goal, message):
    mesh, problem = plunger()
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        ka.adapt(mesh, replace(problem, goal=goal))
