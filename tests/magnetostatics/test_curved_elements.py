"""Elements with curved sides against exact fields: equations, estimate, values at points, forces, conditions."""

import numpy as np
import pytest
from helpers.curved_meshes import on_circles, with_midsides
from helpers.exact_fields import overrating, true_error
from helpers.meshes import disk

from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.mesh.measures import area

pytestmark = pytest.mark.filterwarnings("ignore:.*removed in 1.2:DeprecationWarning")

MU0 = 4e-7 * np.pi
INNER, OUTER = 0.4, 1.0  # radii of the magnet, and of the air around it


def round_mesh(rings, curved=True):
    """A magnet in a disk of air: nodes on rings, sides on the circle of the magnet and on the outer one curved."""
    mesh = disk(rings, OUTER).with_boundaries({"outer": lambda x: x[0] > -9.0}, boundaries_only=True)
    mesh = mesh.with_subdomains({"magnet": lambda x: np.hypot(*x) < INNER, "air": lambda x: np.hypot(*x) > INNER})
    return with_midsides(mesh, on_both) if curved else mesh


def on_both(mesh, facets):
    radius = np.hypot(*mesh.p[:, mesh.facets[:, facets]])
    on = np.isclose(radius, INNER).all(axis=0) | np.isclose(radius, OUTER).all(axis=0)
    return np.where(on, on_circles(mesh, facets), mesh.p[:, mesh.facets[:, facets]].mean(axis=1))


MAGNET = {"magnet": Material(remanence=(0.0, 1.0)), "air": Material()}


def disk_field(x):
    """B of that magnet of permeability 1: A = a x inside, (b + c / r^2) x outside."""
    a, b, c = np.linalg.solve([[INNER, -INNER, -1 / INNER], [0, OUTER, 1 / OUTER], [1, -1, 1 / INNER**2]], [0, 0, -1])
    squared = np.sum(x**2, axis=0)
    inside = squared < INNER**2
    along = np.where(inside, a, b + c * (x[1] ** 2 - x[0] ** 2) / squared**2)
    return np.stack((np.where(inside, 0.0, -2 * c * x[0] * x[1] / squared**2), -along))


def solved(order, rings, **options):
    mesh = round_mesh(rings)
    problem = Magnetostatics(MAGNET, {"outer": 0.0}, order=order, **options)
    return problem, mesh, problem.solve(mesh)


@pytest.mark.parametrize(("order", "rate", "band"), [(2, 0.95, (0.95, 1.05)), (3, 1.35, (0.88, 1.12))])
def test_a_round_magnet_converges_at_the_rate_of_its_elements(order, rate, band):
    """On chords the rate of order 2 falls to a half (python -m benchmarks curves)."""
    unknowns, errors = [], []
    for rings in (10, 20):
        problem, mesh, field = solved(order, rings)
        unknowns.append(field.values.size)
        errors.append(true_error(field, disk_field) / problem.energy_norm(mesh, field))
        assert band[0] < overrating(problem, mesh, field, disk_field) < band[1]
    assert np.log(errors[0] / errors[1]) / np.log(unknowns[1] / unknowns[0]) > rate
    assert errors[0] < {2: 0.012, 3: 0.001}[order]


@pytest.mark.parametrize("order", [2, 3])
def test_a_uniform_field_is_held_without_error(order):
    """Linear functions are among the isoparametric ones: everything of B = 1 T is known in closed form."""
    mesh = round_mesh(5)
    problem = Magnetostatics(dict.fromkeys(MAGNET, Material()), {"outer": lambda x: x[0]}, order=order)
    field = problem.solve(mesh)
    size = area(mesh)
    assert size.sum() == pytest.approx(np.pi, rel=2e-5) and area(round_mesh(5, curved=False)).sum() < 0.994 * np.pi
    x = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 500))
    x = x[:, np.hypot(*x) < 0.99]
    np.testing.assert_allclose(field.potential_at(x), x[0], atol=1e-12)
    np.testing.assert_allclose(field.flux_density_at(x).T, np.tile([0.0, -1.0], (x.shape[1], 1)), atol=1e-10)
    assert field.energy == pytest.approx(size.sum() / 2 / MU0, rel=1e-12)
    assert problem.energy_norm(mesh, field) ** 2 == pytest.approx(2 * field.energy, rel=1e-12)
    assert np.linalg.norm(problem.indicators(mesh, field)) < 1e-9 * problem.energy_norm(mesh, field)
    assert field.flux_linkage("magnet") == pytest.approx(0.0, abs=1e-12)
