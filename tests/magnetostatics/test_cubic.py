"""Cubic elements of magnetostatics against exact fields, across pairs, in iron, and polished."""

import numpy as np
import pytest
from helpers.devices import tube, wire_mesh
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

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Brauer, CubicField, Magnetostatics, Material
from kohonen_adapt.mesh.measures import area


@pytest.mark.parametrize("make", [square, generic_square])
def test_a_smooth_field_converges_with_the_third_power(make):
    counts, errors = (8, 16, 32), []
    for n in counts:
        mesh = make(n).with_subdomains({"air": lambda x: x[0] > -1})
        mesh = mesh.with_boundaries({"rim": lambda x: x[0] > -1}, boundaries_only=True)
        problem = Magnetostatics({"air": Material()}, {"rim": smooth_potential}, order=3)
        field = problem.solve(mesh)
        errors.append(true_error(field, smooth_field))
        assert 0.87 < overrating(problem, mesh, field, smooth_field) < 1.12
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(3.0, abs=0.2)
    assert isinstance(field, CubicField)


def test_cubic_fields_are_held_without_error():
    """A = x^3 - 3 x y^2 + x y is harmonic: P3 has it exactly, at points, in means and in the energy."""
    mesh = random_mesh()

    def exact(x):
        return x[0] ** 3 - 3 * x[0] * x[1] ** 2 + x[0] * x[1]

    problem = Magnetostatics(dict.fromkeys(LAYERS, Material()), dict.fromkeys(mesh.boundaries, exact), order=3)
    field = problem.solve(mesh)
    x = np.random.default_rng(1).uniform(0.0, 3.0, (2, 50))
    np.testing.assert_allclose(field.potential_at(x), exact(x), atol=1e-10)
    wanted = [-6 * x[0] * x[1] + x[0], -3 * x[0] ** 2 + 3 * x[1] ** 2 - x[1]]
    np.testing.assert_allclose(field.flux_density_at(x), wanted, atol=1e-9)
    assert np.linalg.norm(problem.indicators(mesh, field)) < 1e-8 * problem.energy_norm(mesh, field)
    mean = field.elements.mean_function(field.unknown) @ area(mesh) / 9.0
    assert mean == pytest.approx((3 * 20.25 - 3 * 4.5 * 9 + 4.5 * 4.5) / 9, rel=1e-10)


def test_estimates_are_near_the_error_of_singular_fields():
    mesh = rectangle_mesh(2)
    problem = Magnetostatics(RECTANGLE.materials, RECTANGLE.potential, order=3)
    assert 0.88 < overrating(problem, mesh, problem.solve(mesh), sheet_field) < 1.12


def test_antiperiodic_sides_of_any_direction():
    """Half of a mesh stands for the whole, and so do its indicators: unknowns on sides meet those at the same place."""
    whole = square(6, 0.0, 2.0).with_subdomains({"west": lambda x: x[0] < 1, "east": lambda x: x[0] > 1})
    sides = {"left": lambda x: x[0] == x[0].min(), "right": lambda x: x[0] == x[0].max()}
    sides |= {"bottom": lambda x: x[1] == 0.0, "top": lambda x: x[1] == 2.0}
    half = whole.restrict(whole.subdomains["west"])
    order = np.random.default_rng(3).permutation(half.p.shape[1])  # facets on both sides run both ways
    number = np.argsort(order)
    half = type(half)(half.p[:, order], number[half.t]).with_boundaries(sides)
    half, whole = half.with_subdomains({"west": lambda x: x[0] < 2}), whole.with_boundaries(sides)
    drive, walls = Material(current_density=1e6), {"bottom": 0.0, "top": 0.0}
    of_half = Magnetostatics({"west": drive}, walls, antiperiodic=[("left", "right")], order=3)
    materials = {"west": drive, "east": Material(current_density=-1e6)}
    of_whole = Magnetostatics(materials, walls, periodic=[("left", "right")], order=3)
    field, double = of_half.solve(half), of_whole.solve(whole)
    x = np.random.default_rng(2).uniform(0.01, 0.99, (2, 40))
    largest = np.abs(field.potential).max()
    for shift, sign in ((0.0, 1.0), (1.0, -1.0)):
        there = double.potential_at(x + np.array([[shift], [0.0]]))
        np.testing.assert_allclose(there, sign * field.potential_at(x), atol=1e-9 * largest)
    ours, theirs = of_half.indicators(half, field), of_whole.indicators(whole, double)
    assert 2.0 * np.sum(ours**2) == pytest.approx(np.sum(theirs**2), rel=1e-8)


def test_a_wire_in_an_iron_tube():
    """The circles are polygons, so the energies are of second order in them, as with linear elements."""
    energies = [tube(order=3).solve(wire_mesh(rings)).energy for rings in (10, 20)]
    assert (4 * energies[1] - energies[0]) / 3 == pytest.approx(6.7135511580, rel=0.001)


def test_saturated_iron_is_polished():
    """Every pass has a lower functional than the input, and the result has the lowest."""
    parts = {"coil": lambda x: (x[0] < 0.05) & (x[1] < 0.05), "steel": lambda x: (x[0] > 0.05) & (x[1] < 0.05)}
    parts["air"] = lambda x: x[1] > 0.05
    mesh = square(10, 0.0, 0.1).with_subdomains(parts).with_boundaries({"rim": lambda x: x[0] < 1.0})
    materials = {"coil": Material(current_density=2e7), "steel": Material(bh=Brauer(100.0, 10.0, 1.8))}
    problem = Magnetostatics(materials | {"air": Material()}, potential={"rim": 0.0}, order=3)
    result = ka.adapt(mesh, problem, passes=3)
    values = [step.functional for step in result.history]
    assert all(step.polish_gain > 0.0 for step in result.history[1:])
    assert max(values[1:]) < values[0] and result.best.functional == min(values)
    assert result.estimate < 0.2 * result.history[0].estimate


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"estimator": "recovery"}, "elements of order 3 have the estimator 'residual' only; got 'recovery'"),
    ],
)
def test_what_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Magnetostatics({"air": Material()}, {"rim": 0.0}, order=3, **arguments)
