"""Quadratic elements of magnetostatics against exact fields, and in everything that linear ones do."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.devices import tube, wire_mesh
from helpers.exact_fields import (
    LAYERS,
    RECTANGLE,
    Corner,
    overrating,
    random_mesh,
    rectangle_mesh,
    sheet_field,
    smooth_field,
    smooth_potential,
    true_error,
)
from helpers.meshes import disk, generic_square, square

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material, QuadraticField, Torque

MU0 = 4e-7 * np.pi


@pytest.mark.parametrize("make", [square, generic_square])
def test_a_smooth_field_converges_quadratically(make):
    counts, errors = (8, 16, 32), []
    for n in counts:
        mesh = make(n).with_subdomains({"air": lambda x: x[0] > -1})
        mesh = mesh.with_boundaries({"rim": lambda x: x[0] > -1}, boundaries_only=True)
        problem = Magnetostatics({"air": Material()}, {"rim": smooth_potential}, order=2)
        field = problem.solve(mesh)
        errors.append(true_error(field, smooth_field))
        assert 0.95 < overrating(problem, mesh, field, smooth_field) < 1.06
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.2)
    x = np.random.default_rng(0).uniform(0.0, 1.0, (2, 200))
    np.testing.assert_allclose(field.potential_at(x), smooth_potential(x), atol=1e-4 * smooth_potential([1.0, 0.0]))


def test_quadratic_fields_are_held_without_error():
    """A = x^2 - 3 x y of a uniform current: P2 has it exactly, with means and values at points."""
    mesh = random_mesh()
    current = -2.0 / MU0
    problem = Magnetostatics(
        dict.fromkeys(LAYERS, Material(current_density=current)),
        dict.fromkeys(mesh.boundaries, lambda x: x[0] ** 2 - 3 * x[0] * x[1]),
        order=2,
    )
    field = problem.solve(mesh)
    x = np.random.default_rng(1).uniform(0.0, 3.0, (2, 50))
    np.testing.assert_allclose(field.potential_at(x), x[0] ** 2 - 3 * x[0] * x[1], atol=1e-11)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    np.testing.assert_allclose(field.flux_density, [-3 * middle[0], 3 * middle[1] - 2 * middle[0]], atol=1e-9)
    assert np.linalg.norm(problem.indicators(mesh, field)) < 1e-8 * problem.energy_norm(mesh, field)
    assert np.isnan(field.potential_at([[-1.0], [0.5]])[0])
    # int |B|^2 / 2 mu0 over (0, 3)^2 of 9 x^2 + (3 y - 2 x)^2
    assert field.energy == pytest.approx((13 * 27 + 9 * 27 - 12 * 4.5 * 4.5) / 2 / MU0, rel=1e-9)
    assert problem.energy_norm(mesh, field) ** 2 == pytest.approx(2 * field.energy, rel=1e-9)


def test_layers_share_one_field_strength_as_with_linear_elements():
    mesh = random_mesh()
    one, two = (Magnetostatics(LAYERS, {"left": 0.0, "right": -2.5}, order=order).solve(mesh) for order in (1, 2))
    np.testing.assert_allclose(two.field_strength, one.field_strength, atol=1e-9 * np.abs(one.field_strength).max())
    assert two.energy == pytest.approx(one.energy, rel=1e-9)
    assert two.coenergy == pytest.approx(one.coenergy, rel=1e-9)
    assert isinstance(two, QuadraticField) and two.potential.shape == one.potential.shape


def test_estimates_are_near_the_error_of_singular_fields():
    mesh = rectangle_mesh(2)
    problem = Magnetostatics(RECTANGLE.materials, RECTANGLE.potential, order=2)
    assert 0.95 < overrating(problem, mesh, problem.solve(mesh), sheet_field) < 1.05


def test_adapting_with_the_right_exponent_grades_towards_a_corner():
    """The density of order 2 is steeper; at the same nodes the error falls far below the uniform mesh's."""
    corner = Corner(1000.0)
    problem = Magnetostatics(corner.materials, {"rim": corner.potential}, order=2)
    mesh = corner.mesh(8)
    result = ka.adapt(mesh, problem, passes=4)
    assert result.mesh.p.shape == mesh.p.shape
    assert result.estimate < 0.25 * result.history[0].estimate
    assert all(step.functional is not None for step in result.history)


def test_a_wire_in_an_iron_tube():
    """The circles are polygons, so the energies are of second order in them, as with linear elements."""
    energies, numbers = [], (10, 20)
    for rings in numbers:
        field = tube(order=2).solve(wire_mesh(rings))
        assert field.newton[-1].converged and len(field.newton) < 15
        energies.append([field.energy, field.coenergy, field.potential[0]])
    richardson = (4 * np.array(energies[1]) - energies[0]) / 3
    assert richardson[0] == pytest.approx(6.7135511580, rel=0.001)
    assert richardson[2] == pytest.approx(0.0393894788, rel=0.0005)


def test_a_warm_start_saves_steps():
    coarse, fine = wire_mesh(10), wire_mesh(20)
    old = tube(order=2).solve(coarse)
    cold, warm = tube(order=2).solve(fine), tube(order=2).solve_from(fine, coarse, old)
    assert len(warm.newton) < len(cold.newton)
    np.testing.assert_allclose(warm.potential, cold.potential, atol=1e-9 * cold.potential.max())
    assert len(tube(order=2).solve_from(coarse, coarse, old).newton) == 1


def test_an_open_boundary():
    mesh = disk(16, 0.04).with_boundaries({"outer": lambda x: np.hypot(*x) > 0.039})
    inside = np.hypot(*mesh.p[:, mesh.t].mean(axis=1)) < 0.01
    mesh = mesh.with_subdomains({"magnet": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})
    materials = {"magnet": Material(remanence=(1.0, 0.0)), "air": Material()}
    field = Magnetostatics(materials, open_boundary="outer", order=2).solve(mesh)
    # A dipole by the polygon's area in place of the circle's
    moment = 0.5 * field.volume[inside].sum() / np.pi
    rim = np.flatnonzero(np.hypot(*mesh.p) > 0.0399)
    wanted = moment * mesh.p[1, rim] / 0.04**2
    np.testing.assert_allclose(field.potential[rim], wanted, atol=0.005 * wanted.max())


def test_antiperiodic_sides():
    """Half of a mesh stands for the whole, middles of sides included, and so do its indicators."""
    whole = square(8, 0.0, 2.0).with_subdomains({"west": lambda x: x[0] < 1, "east": lambda x: x[0] > 1})
    sides = {"left": lambda x: x[0] == x[0].min(), "right": lambda x: x[0] == x[0].max()}
    sides |= {"bottom": lambda x: x[1] == 0.0, "top": lambda x: x[1] == 2.0}
    half = whole.restrict(whole.subdomains["west"]).with_boundaries(sides)
    half = half.with_subdomains({"west": lambda x: x[0] < 2})
    whole = whole.with_boundaries(sides)
    drive, walls = Material(current_density=1e6), {"bottom": 0.0, "top": 0.0}
    of_half = Magnetostatics({"west": drive}, walls, antiperiodic=[("left", "right")], order=2)
    materials = {"west": drive, "east": Material(current_density=-1e6)}
    of_whole = Magnetostatics(materials, walls, periodic=[("left", "right")], order=2)
    field, double = of_half.solve(half), of_whole.solve(whole)
    x = np.random.default_rng(2).uniform(0.01, 0.99, (2, 40))
    largest = np.abs(field.potential).max()
    for shift, sign in ((0.0, 1.0), (1.0, -1.0)):
        there = double.potential_at(x + np.array([[shift], [0.0]]))
        np.testing.assert_allclose(there, sign * field.potential_at(x), atol=1e-9 * largest)
    ours, theirs = of_half.indicators(half, field), of_whole.indicators(whole, double)
    np.testing.assert_allclose(np.sort(np.tile(ours, 2)), np.sort(theirs), rtol=1e-6, atol=1e-9 * theirs.max())


def test_elements_are_quadratic_where_nothing_else_is_asked_for():
    field = Magnetostatics(RECTANGLE.materials, RECTANGLE.potential).solve(rectangle_mesh(1))
    assert type(field) is QuadraticField
    around = Magnetostatics({"air": Material()}, {"outer": 0.0}, axisymmetric=True)
    assert around.order == Magnetostatics({"air": Material()}, open_boundary="rim").order == 2


@pytest.mark.parametrize(
    "arguments",
    [
        {"estimator": "recovery"},
        {"estimator": "equilibrated"},
    ],
)
def test_what_order_1_alone_has_is_asked_of_order_1(arguments):
    """Also of a problem that was another one, unless it said its order itself."""
    given = {"materials": {"air": Material()}, "potential": {"rim": 0.0}}
    assert Magnetostatics(**(given | arguments)).order == 1
    plain = Magnetostatics(**given)
    changed = replace(plain, **arguments)
    assert (plain.order, changed.order) == (2, 1)
    assert replace(changed, estimator="residual").order == 2
    assert replace(Magnetostatics(**given, order=1), depth=0.1).order == 1
    with pytest.raises(ValueError, match=r"order 2"):
        replace(Magnetostatics(**given, order=2), **arguments)


def test_a_goal_has_order_2_unless_it_is_told_another():
    """Less error than order 1 at equal unknowns, in less time: see test_goals.py."""
    given = {"materials": {"air": Material()}, "potential": {"rim": 0.0}, "goal": Torque("air")}
    assert [Magnetostatics(**given, **more).order for more in ({}, {"order": 1}, {"order": 3})] == [2, 1, 3]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"order": 9}, r"order of the elements must be a whole number from 1 to 8, or 'auto'; got 9\."),
        ({"order": 0}, r"order of the elements must be a whole number from 1 to 8, or 'auto'; got 0\."),
        ({"order": 2.5}, r"order of the elements must be a whole number from 1 to 8, or 'auto'; got 2\.5\."),
        ({"order": "4"}, r"order of the elements must be a whole number from 1 to 8, or 'auto'; got '4'\."),
        ({"order": True}, r"order of the elements must be a whole number from 1 to 8, or 'auto'; got True\."),
        (
            {"order": 2, "estimator": "recovery"},
            r"elements of order 2 have the estimator 'residual' only; got 'recovery'",
        ),
    ],
)
def test_wrong_orders_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Magnetostatics(LAYERS, potential={"left": 0.0}, **arguments)
