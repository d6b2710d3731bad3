"""Elements of every order in the plane against exact fields: what they hold, how errors fall, what is estimated."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.exact_fields import (
    LAYERS,
    RECTANGLE,
    overrating,
    random_mesh,
    rectangle_mesh,
    sheet_field,
    smooth_field,
    smooth_potential,
    true_error,
)
from helpers.meshes import generic_square, square
from helpers.sheets import MU0
from skfem import Basis, ElementTriP0

from kohonen_adapt.magnetostatics import CubicField, Magnetostatics, Material, QuadraticField, Torque
from kohonen_adapt.mesh.measures import area

GIVEN = {"materials": {"air": Material()}, "potential": {"rim": 0.0}}


@pytest.mark.parametrize(
    ("order", "current"), [*((order, 0.0) for order in range(1, 9)), *((order, -2.0 / MU0) for order in range(2, 9))]
)
def test_polynomials_of_the_order_are_exact(order, current):
    """Harmonic ones without a current, and with one x^2 more: at points, in means, in energies."""
    mesh, square_of_x = random_mesh(), -0.5 * MU0 * current

    def exact(x):
        return ((x[0] - 1.0 + 1j * x[1]) ** order).real / 2.0**order + square_of_x * x[0] ** 2

    def density(x):
        slope = order * (x[0] - 1.0 + 1j * x[1]) ** (order - 1) / 2.0**order
        return np.stack([-slope.imag, -slope.real - 2.0 * square_of_x * x[0]])

    driven = dict.fromkeys(LAYERS, Material(current_density=current))
    problem = Magnetostatics(driven, dict.fromkeys(mesh.boundaries, exact), order=order)
    field = problem.solve(mesh)
    x = np.random.default_rng(1).uniform(0.0, 3.0, (2, 50))
    size = np.abs(exact(field.elements.doflocs)).max()
    near = 1e-10 * order * size
    np.testing.assert_allclose(field.potential_at(x), exact(x), atol=1e-11 * size)
    np.testing.assert_allclose(field.flux_density_at(x), density(x), atol=near)
    np.testing.assert_allclose(field.field_strength_at(x), density(x) / MU0, atol=near / MU0)
    assert np.isnan(field.potential_at([[-1.0], [0.5]])[0])
    basis = Basis(mesh, ElementTriP0(), intorder=2 * order)
    x, dx = np.asarray(basis.global_coordinates()), basis.dx
    np.testing.assert_allclose(field.flux_density, np.sum(density(x) * dx, axis=2) / dx.sum(axis=1), atol=near)
    assert field.elements.mean_function(field.unknown) @ area(mesh) == pytest.approx(np.sum(exact(x) * dx), rel=1e-9)
    assert field.energy == pytest.approx(0.5 / MU0 * np.sum(density(x) ** 2 * dx), rel=1e-9)
    assert problem.energy_norm(mesh, field) ** 2 == pytest.approx(2.0 * field.energy, rel=1e-9)
    if order < 6:  # from order 6 on lower orders make the estimate
        assert np.linalg.norm(problem.indicators(mesh, field)) < 1e-8 * problem.energy_norm(mesh, field)


AT_REST = Material(remanence=smooth_field)  # a magnet that turns inside its region, with H = 0 in all of it
BANDS = {2: (0.95, 1.06), 3: (0.87, 1.12)}  # of the estimate over the error


@pytest.mark.parametrize("order", BANDS)
@pytest.mark.parametrize("material", [Material(), AT_REST], ids=["air", "magnet at rest"])
@pytest.mark.parametrize("make", [square, generic_square])
def test_the_error_of_a_smooth_field_falls_by_the_order(order, material, make):
    errors, (low, high) = [], BANDS[order]
    for n in (16, 32):
        mesh = make(n).with_subdomains({"air": lambda x: x[0] > -1})
        mesh = mesh.with_boundaries({"rim": lambda x: x[0] > -1}, boundaries_only=True)
        problem = Magnetostatics({"air": material}, {"rim": smooth_potential}, order=order)
        field = problem.solve(mesh)
        errors.append(true_error(field, smooth_field))
        assert low < overrating(problem, mesh, field, smooth_field) < high
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1 * order)


@pytest.mark.parametrize(("order", "low", "high"), [(2, 0.95, 1.05), (3, 0.88, 1.12)])
def test_estimates_are_near_the_error_of_singular_fields_without_layers(order, low, high):
    mesh = rectangle_mesh(2)
    problem = Magnetostatics(RECTANGLE.materials, RECTANGLE.potential, order=order)
    assert low < overrating(problem, mesh, problem.solve(mesh), sheet_field) < high


@pytest.mark.parametrize("order", [2, 3, 5])
def test_antiperiodic_sides_of_any_direction(order):
    """Half of a mesh stands for the whole, and so do its indicators: unknowns on sides meet those at the same place."""
    whole = square(6, 0.0, 2.0).with_subdomains({"west": lambda x: x[0] < 1, "east": lambda x: x[0] > 1})
    sides = {"left": lambda x: x[0] == x[0].min(), "right": lambda x: x[0] == x[0].max()}
    sides |= {"bottom": lambda x: x[1] == 0.0, "top": lambda x: x[1] == 2.0}
    half = whole.restrict(whole.subdomains["west"])
    shuffled = np.random.default_rng(3).permutation(half.p.shape[1])  # facets on both sides run both ways
    half = type(half)(half.p[:, shuffled], np.argsort(shuffled)[half.t]).with_boundaries(sides)
    half, whole = half.with_subdomains({"west": lambda x: x[0] < 2}), whole.with_boundaries(sides)
    drive, walls = Material(current_density=1e6), {"bottom": 0.0, "top": 0.0}
    of_half = Magnetostatics({"west": drive}, walls, antiperiodic=[("left", "right")], order=order)
    materials = {"west": drive, "east": Material(current_density=-1e6)}
    of_whole = Magnetostatics(materials, walls, periodic=[("left", "right")], order=order)
    field, double = of_half.solve(half), of_whole.solve(whole)
    x = np.random.default_rng(2).uniform(0.01, 0.99, (2, 40))
    largest = np.abs(field.potential).max()
    for shift, sign in ((0.0, 1.0), (1.0, -1.0)):
        there = double.potential_at(x + np.array([[shift], [0.0]]))
        np.testing.assert_allclose(there, sign * field.potential_at(x), atol=1e-9 * largest)
    ours, theirs = of_half.indicators(half, field), of_whole.indicators(whole, double)
    assert 2.0 * np.sum(ours**2) == pytest.approx(np.sum(theirs**2), rel=1e-8)


def test_elements_are_quadratic_unless_another_order_is_given():
    fields = [Magnetostatics(RECTANGLE.materials, RECTANGLE.potential).solve(rectangle_mesh(1))]
    fields.append(Magnetostatics(RECTANGLE.materials, RECTANGLE.potential, order=3).solve(rectangle_mesh(1)))
    assert [type(field) for field in fields] == [QuadraticField, CubicField]
    around = Magnetostatics({"air": Material()}, {"outer": 0.0}, axisymmetric=True)
    assert around.order == Magnetostatics({"air": Material()}, open_boundary="rim").order == 2
    of_goal = {"goal": Torque("air")}  # less error than order 1 at equal unknowns, in less time: see test_goals.py
    assert [Magnetostatics(**GIVEN, **of_goal, **more).order for more in ({}, {"order": 1}, {"order": 3})] == [2, 1, 3]


@pytest.mark.parametrize("estimator", ["recovery", "equilibrated"])
def test_what_order_1_alone_has_is_asked_of_order_1(estimator):
    """Also of a problem that was another one, unless it said its order itself."""
    assert Magnetostatics(**GIVEN, estimator=estimator).order == 1
    plain = Magnetostatics(**GIVEN)
    changed = replace(plain, estimator=estimator)
    assert (plain.order, changed.order) == (2, 1)
    assert replace(changed, estimator="residual").order == 2
    assert replace(Magnetostatics(**GIVEN, order=1), depth=0.1).order == 1
    for order in (2, 3):
        message = f"elements of order {order} have the estimator 'residual' only; got '{estimator}'"
        with pytest.raises(ValueError, match=message):
            replace(Magnetostatics(**GIVEN, order=order), estimator=estimator)


@pytest.mark.parametrize("order", [9, 0, 2.5, "4", True])
def test_wrong_orders_are_named(order):
    message = rf"order of the elements must be a whole number from 1 to 8, or 'auto'; got {order!r}\."
    with pytest.raises(ValueError, match=message):
        Magnetostatics(**GIVEN, order=order)
