"""Flux density recovered at the corners of elements: nearer to the truth, and never across materials."""

import numpy as np
from helpers.exact_fields import RECTANGLE, rectangle_mesh
from helpers.sheets import MU0
from helpers.tensor_meshes import box
from skfem import MeshTet

from kohonen_adapt.magnetostatics import MagneticVectorPotential, Magnetostatics, Material


def test_layers_keep_their_jump():
    """Flux along y in iron beside air: two values of B, recovered exactly on both sides of the interface."""
    mesh = box(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9), {"iron": (0.0, 0.5, 0.0, 1.0)})
    problem = Magnetostatics(
        {"iron": Material(9.0), "air": Material()},
        potential={"outer": lambda x: np.minimum(9 * x[0], x[0] + 4)},
        order=1,
    )
    field = problem.solve(mesh)
    each = np.ones((1, 3, 1))
    np.testing.assert_allclose(field.corner_flux_density, field.flux_density[:, None] * each, atol=1e-12)
    np.testing.assert_allclose(field.corner_field_strength, field.field_strength[:, None] * each, atol=1e-12 / MU0)
    jump = field.flux_density_at(np.array([[0.4999, 0.5001], [0.3, 0.3]]), recovered=True)
    np.testing.assert_allclose(jump, [[0.0, 0.0], [-9.0, -1.0]], atol=1e-12)


def test_corner_values_are_those_at_the_corners_and_linear_between():
    mesh = rectangle_mesh(2)
    field = RECTANGLE.solve(mesh)
    rng = np.random.default_rng(1)
    share = rng.dirichlet((1.0, 1.0, 1.0), mesh.t.shape[1]).T
    x = np.einsum("ik,dik->dk", share, mesh.p[:, mesh.t])
    wanted = np.einsum("ik,dik->dk", share, field.corner_flux_density)
    np.testing.assert_allclose(field.flux_density_at(x, recovered=True), wanted, atol=1e-12)
    assert np.all(np.isnan(field.flux_density_at([[1.0], [0.0]], recovered=True)))


def test_a_vector_potential_has_its_own_recovered_values():
    """B of a magnet between iron plates, over as much air, is constant."""
    mesh = MeshTet.init_tensor(*[np.linspace(0.0, 1.0, 4)] * 3).with_defaults()
    mesh = mesh.with_subdomains({"magnet": lambda x: x[2] < 0.4, "air": lambda x: x[2] > 0.4})
    materials = {"magnet": Material(remanence=(0.0, 0.0, 1.2)), "air": Material()}
    field = MagneticVectorPotential(materials, potential={"front": 0.0, "back": 0.0}).solve(mesh)
    np.testing.assert_allclose(field.corner_flux_density, np.tile([[[0.0]], [[0.0]], [[0.4]]], mesh.t.shape), atol=1e-6)
    x = np.array([[0.5], [0.4], [0.8]])
    np.testing.assert_allclose(field.flux_density_at(x, recovered=True), [[0.0], [0.0], [0.4]], atol=1e-6)
    np.testing.assert_allclose(
        field.field_strength_at(x, recovered=True), [[0.0], [0.0], [0.4 / MU0]], rtol=1e-5, atol=1.0
    )
