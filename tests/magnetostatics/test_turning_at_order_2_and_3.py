"""Magnets that turn inside their region, in elements of order 2 and 3 and around an axis: their remanence at points."""

import numpy as np
import pytest
from helpers.exact_fields import halbach_field
from helpers.meshes import generic_square
from helpers.tensor_meshes import disk

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material, halbach
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY


def at_rest(order, n, potential, field, **material):
    """A square of magnet whose remanence is a field without sources: H is 0 in all of it, and B is that field."""
    mesh = generic_square(n).with_subdomains({"magnet": lambda x: x[0] > -1.0})
    mesh = mesh.with_boundaries({"rim": lambda x: x[0] > -1.0}, boundaries_only=True)
    problem = Magnetostatics({"magnet": Material(remanence=field, **material)}, {"rim": potential}, order=order)
    return mesh, problem, problem.solve(mesh)


@pytest.mark.parametrize("material", [{"permeability": 1.05}, {"bh": Froehlich(8000.0, 2.1)}], ids=["linear", "steel"])
@pytest.mark.parametrize("order", [2, 3])
def test_a_potential_that_the_elements_have_is_found_exactly(order, material):
    def potential(x):
        return 0.1 * (x[0] ** order - 2.0 * x[1] ** order + x[0] * x[1])

    def field(x):
        return 0.1 * np.stack([x[0] - 2.0 * order * x[1] ** (order - 1), -(order * x[0] ** (order - 1)) - x[1]])

    mesh, problem, found = at_rest(order, 4, potential, field, **material)
    x = np.random.default_rng(0).uniform(0.0, 1.0, (2, 50))
    np.testing.assert_allclose(found.potential_at(x), potential(x), atol=1e-9)
    np.testing.assert_allclose(found.flux_density_at(x), field(x), atol=1e-8)
    strength = np.abs(found.coefficients.coercivity).max()
    assert np.abs(found.at_quadrature.field_strength).max() < 1e-7 * strength
    assert np.abs(found.field_strength_at(x)).max() < 1e-7 * strength
    assert found.energy < 1e-12 * strength and problem.indicators(mesh, found).max() < 1e-6 * strength**0.5


def test_a_halbach_cylinder_gains_from_order_2():
    """Its field is exact in closed form; at order 1 chords alone leave more than a percent."""
    mesh = disk(np.linspace(0.0, 0.06, 13)[1:], {"bore": 4, "ring": 8, "air": 12})
    materials = {"bore": Material(), "ring": Material(remanence=halbach(1.0, 1)), "air": Material()}
    shares = []
    for order in (1, 2):
        problem = Magnetostatics(materials, {"outer": 0.0}, order=order)
        result = ka.adapt(mesh, problem, passes=2)
        at, found = result.solution.at_quadrature, result.solution
        off = np.sum((at.flux_density - halbach_field(at.x)) ** 2, axis=0) @ found.elements.weights
        error = np.sqrt(off / VACUUM_PERMEABILITY)
        shares.append(error / np.sqrt(found.squared_norm))
    assert shares[1] < 0.1 * shares[0]
    assert 0.8 < result.estimate / error < 1.2
