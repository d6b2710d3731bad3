"""Densities: their formulas, scale and floors, and the training points drawn from them."""

import numpy as np
import pytest
from helpers.meshes import centres, inset, perturbed, square
from helpers.solids import box
from helpers.tetrahedra import thrown
from numpy.testing import assert_allclose
from skfem import MeshTet, MeshTri

from kohonen_adapt import density_from_indicators, density_from_sizes
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.training_points import ElementDensity, FunctionDensity, density_of

POWERS = [(order, norm) for order in (1, 2, 3, 4) for norm in ("energy", "L2")]


def indicators_of(mesh, seed=0):
    return np.random.default_rng(seed).uniform(0.1, 2.0, mesh.t.shape[1])


def drawn(mesh, density, number, seed=0):
    """Training points, in space by the classes that training takes there."""
    if len(mesh.p) == 2:
        made = density_of(Triangulation.of(mesh), density)
    else:
        kind = FunctionDensity if callable(density) else ElementDensity
        made = kind(Tetrahedralization.of(mesh), density)
    return made.draw(number, np.random.default_rng(seed))


@pytest.mark.parametrize("mesh", [perturbed(square(5)), thrown(box(3), 2)], ids=["plane", "space"])
@pytest.mark.parametrize(("order", "norm"), POWERS)
def test_the_formula(order, norm, mesh):
    eta, size = indicators_of(mesh), area(mesh)
    q, d = (2 * order if norm == "energy" else 2 * order + 2), len(mesh.p)
    wanted = (eta**2 / size ** (1 + 2 * order / d)) ** (d / (d + q))
    wanted *= mesh.p.shape[1] / np.sum(size * wanted)
    assert_allclose(density_from_indicators(mesh, eta, order=order, norm=norm), wanted, rtol=1e-12)


def test_sizes_are_edges_of_equilateral_triangles_or_distances_in_a_densest_packing_of_spheres():
    """Half a node per triangle, and 4 nodes in a cube of sides sqrt(2) h."""
    h = 0.1 + 0.05 * np.arange(50)
    assert_allclose(density_from_sizes(square(5), h), 2 / (np.sqrt(3) * h**2))
    assert_allclose(density_from_sizes(box(2), h[:48]), 4 / (np.sqrt(2) * h[:48]) ** 3)


def test_indicators_are_floored_at_a_thousandth_of_their_median():
    mesh = square(5)
    eta = np.ones(50)
    eta[7], eta[8], eta[9] = 0.0, 1e-9, 2e-3
    density = density_from_indicators(mesh, eta)
    assert_allclose(density[7:10] / density[0], [1e-3, 1e-3, 2e-3], rtol=1e-12)


@pytest.mark.parametrize("mesh", [square(5), MeshTet().refined(1)], ids=["plane", "space"])
def test_a_metric_has_the_same_nodes_in_all_coordinates(mesh):
    """Coordinates y = A x have the metric A^-T M A^-1 for the same lengths, and as many nodes in every element."""
    d, rng = len(mesh.p), np.random.default_rng(0)
    factors = rng.normal(size=(mesh.nelements, d, d))
    metric = factors @ factors.transpose(0, 2, 1) + np.eye(d)
    back = np.linalg.inv(rng.normal(size=(d, d)) + 3.0 * np.eye(d))
    density, mapped = density_from_sizes(mesh, metric), density_from_sizes(mesh, back.T @ metric @ back)
    nodes = np.sqrt(np.linalg.det(density)) * np.abs(np.linalg.det(back))
    assert_allclose(np.sqrt(np.linalg.det(mapped)), nodes, rtol=1e-12)
    assert_allclose(mapped, back.T @ density @ back, rtol=1e-12)


@pytest.mark.parametrize("number", [1, 7, 50, 1000])
@pytest.mark.parametrize("contrast", [0, 2, 6])
@pytest.mark.parametrize("mesh", [perturbed(square(5)), thrown(box(3), 2)], ids=["plane", "space"])
def test_points_are_stratified(number, contrast, mesh):
    density = 10.0 ** (contrast * np.random.default_rng(1).random(mesh.nelements))
    order = along_curve(centres(mesh).T)
    mass = np.cumsum((area(mesh) * density)[order])
    for seed in range(5):
        draw = drawn(mesh, density, number, seed)
        assert len(draw.points) == len(draw.element) == len(draw.weights) == number
        counts = np.cumsum(np.bincount(draw.element, minlength=mesh.nelements)[order])
        assert np.abs(counts - number * mass / mass[-1]).max() <= 1 + 1e-9
        assert np.all(draw.weights == 1)


@pytest.mark.parametrize("density", ["array", "callable"])
def test_points_lie_in_their_elements_and_come_along_a_curve(density):
    mesh = perturbed(inset(8))
    function = lambda x: 1 + 100 * x[0] ** 4  # noqa: E731
    draw = drawn(mesh, function if density == "callable" else function(centres(mesh)), 500)
    a, b, c = mesh.p[:, mesh.t[:, draw.element]].transpose(1, 0, 2)
    random_points = np.linalg.solve(np.stack([b - a, c - a]).T, (draw.points.T - a).T[..., None])[..., 0]
    assert random_points.min() >= -1e-12
    assert random_points.sum(axis=1).max() <= 1 + 1e-12
    steps = np.hypot(*np.diff(draw.points, axis=0).T)
    assert steps.mean() < 0.4 * np.hypot(*(draw.points - draw.points.mean(axis=0)).T).mean()
    assert np.all(draw.region == Triangulation.of(mesh).elements.region[draw.element])


def test_a_callable_is_sampled_as_its_values_are():
    function = lambda x: np.where(x[0] < 0.5, 3.0, 1.0)  # noqa: E731
    for mesh in (square(6), box(4)):
        for density in (function, function(centres(mesh))):
            points = drawn(mesh, density, 4000).points
            assert np.mean(points[:, 0] < 0.5) == pytest.approx(0.75, abs=0.01)
            assert points[:, 1:].mean() == pytest.approx(0.5, abs=0.01)


class Piecewise(FunctionDensity):
    at_once = 1000


def test_a_callable_is_asked_for_so_many_points_at_once_and_the_stretches_get_their_shares():
    mesh, asked = square(8), []

    def function(x):
        asked.append(x.shape[1])
        return 1 + 9 * (x[0] > 0.5) + x[1]

    tri = Triangulation.of(mesh)
    made = density_of(tri, function)
    whole, most = squares(made, tri), made.largest
    assert max(asked) > 1000
    asked.clear()
    made = Piecewise(tri, function)
    assert_allclose(squares(made, tri) / whole, made.largest**-2 * most**2, rtol=1e-12)
    draw = made.draw(2001, np.random.default_rng(1))
    assert max(asked) <= 1000
    assert len(draw.points) == len(draw.element) == 2001
    found = np.bincount(draw.element, minlength=len(made.masses))
    order = along_curve(centres(mesh).T)
    ahead = np.cumsum(found[order]) - np.cumsum(2001 * (made.masses / made.masses.sum())[order])
    assert np.abs(ahead).max() < 0.01 * 2001  # at every place of the curve


def test_zeros_are_raised_to_a_millionth_of_the_largest():
    mesh = square(4)
    density = np.full(32, 5.0)
    density[3] = 0.0
    made = density_of(Triangulation.of(mesh), density)
    assert made.masses[3] / made.masses[0] == pytest.approx(1e-6, rel=1e-12)
    assert np.all(squares(made, Triangulation.of(mesh)) > 0)


def test_the_density_is_looked_up_wherever_elements_have_gone():
    mesh = MeshTri.init_tensor(np.linspace(0, 300, 301), np.linspace(0, 1, 2))
    density = np.random.default_rng(0).uniform(1, 10, mesh.t.shape[1])
    tri = Triangulation.of(mesh)
    made = density_of(tri, density)
    nodal = np.array([np.average(density[hit], weights=area(mesh)[hit]) for hit in around_nodes(mesh)])
    tri.position[:] = [300, 1] - tri.position
    there = np.lexsort(mesh.p)[np.argsort(np.lexsort(tri.position.T))]
    wanted = np.prod(nodal[there][mesh.t] / density.max(), axis=0) ** (2 / 3)
    assert_allclose(squares(made, tri), wanted, rtol=1e-9)


def squares(density, tri):
    """Weights of smoothing."""
    return density.means(tri.position[tri.elements.node]) ** 2


def around_nodes(mesh):
    return [np.flatnonzero((mesh.t == v).any(axis=0)) for v in range(mesh.p.shape[1])]
