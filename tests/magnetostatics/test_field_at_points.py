"""Fields of quadratic elements inside the elements: at points, at corners, and in every integral, against exact ones.

Each fails where the mean of an element stands for its field.
"""

import numpy as np
import pytest
from helpers.devices import MAGNET_HALF, PLACES, two_magnets
from helpers.exact_fields import random_mesh
from helpers.sheets import rectangle_force
from helpers.tensor_meshes import everywhere, sector
from skfem import Basis, ElementTriP0

from kohonen_adapt.magnetostatics import Magnetostatics, Material, arkkio_torque, lorentz_force, lorentz_torque

pytestmark = pytest.mark.filterwarnings("ignore:.*removed in 1.2:DeprecationWarning")

MU0 = 4e-7 * np.pi
POINTS = np.random.default_rng(1).uniform(0.05, 2.95, (2, 200))


def with_current():
    """A = x^2 - 3 x y of a uniform current, which P2 holds exactly."""
    mesh = random_mesh()
    rim = dict.fromkeys(mesh.boundaries, lambda x: x[0] ** 2 - 3 * x[0] * x[1])
    driven = Material(current_density=-2.0 / MU0)
    return Magnetostatics(dict.fromkeys(mesh.subdomains, driven), rim, order=2).solve(mesh)


def density_with_current(x):
    return np.stack((-3 * x[0], 3 * x[1] - 2 * x[0]))


def in_air(mesh):
    """A = x^2 - y^2 + x y + 2 x without any current, and ``B = (x - 2 y, -2 x - y - 2)``."""
    mesh = mesh.with_boundaries({"rim": everywhere}, boundaries_only=True)
    rim = {"rim": lambda x: x[0] ** 2 - x[1] ** 2 + x[0] * x[1] + 2 * x[0]}
    return Magnetostatics({name: Material() for name in mesh.subdomains}, rim, order=2).solve(mesh)


def density_in_air(x):
    return np.stack((x[0] - 2 * x[1], -2 * x[0] - x[1] - 2))


def test_values_at_points_are_those_of_the_field():
    """0.4.0 has (-1.167, -1.667) for a B of (-1.1, -1.8): the mean over an element of 1/3."""
    field, wanted = with_current(), density_with_current(POINTS)
    for recovered in (False, True):
        found = field.flux_density_at(POINTS, recovered=recovered)
        np.testing.assert_allclose(found, wanted, atol=1e-8)
        np.testing.assert_allclose(field.field_strength_at(POINTS, recovered=recovered), wanted / MU0, atol=1e-8 / MU0)
    corners = field.mesh.p[:, field.mesh.t]
    np.testing.assert_allclose(field.corner_flux_density, density_with_current(corners), atol=1e-8)
    np.testing.assert_allclose(field.corner_field_strength, density_with_current(corners) / MU0, atol=1e-8 / MU0)
    assert f"|B| up to {np.hypot(*density_with_current(field.mesh.p)).max():.4g} T" in repr(field)


def test_force_and_torque_on_a_uniform_current():
    """int J x B and int x x (J x B) of a linear B over 1 by 3 m."""
    field = with_current()
    np.testing.assert_allclose(lorentz_force(field, "iron"), -2.0 / MU0 * np.array([-10.5, -4.5]), rtol=1e-9)
    assert lorentz_torque(field, "iron") == pytest.approx(-2.0 / MU0 * 19.5, rel=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_arkkio_is_the_integral_over_the_field_of_the_elements(order):
    """A quarter of a ring of 3 x 8 cells, in a field that P2 holds; by means the torque is 0.24 % off."""
    mesh = sector(np.linspace(1.0, 1.3, 4), np.linspace(0.0, np.pi / 2, 9), {"ring": (1.0, 1.3, 0.0, 2.0)})
    mesh = mesh.with_subdomains({"ring": mesh.subdomains["ring"]})
    field = in_air(mesh)
    if order == 1:
        field = Magnetostatics({"ring": Material()}, {"outer": 0.0, "bore": lambda x: x[0]}, order=1).solve(mesh)
    basis = Basis(mesh, ElementTriP0(), intorder=12)
    x = np.asarray(basis.global_coordinates())
    bx, by = density_in_air(x) if order == 2 else field.flux_density[:, :, None]
    wanted = np.sum((x[0] * bx + x[1] * by) * (x[0] * by - x[1] * bx) / np.hypot(*x) * basis.dx) / (MU0 * 0.3)
    assert arkkio_torque(field, "ring") == pytest.approx(wanted, rel=2e-4 if order == 1 else 1e-6)


def test_force_between_two_magnets():
    """Of fourth order, where means leave the second: at 5265 nodes 0.02 % off in place of 0.35 %."""
    wanted, errors = rectangle_force(PLACES["b"], PLACES["a"], MAGNET_HALF), []
    for k in (2, 4):
        mesh, problem = two_magnets(k)
        field = Magnetostatics(problem.materials, problem.potential, order=2).solve(mesh)
        errors.append(np.hypot(*(field.force("b") - wanted)) / np.hypot(*wanted))
    assert errors[1] < 3e-4 and errors[0] > 8.0 * errors[1]
