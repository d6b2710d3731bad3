"""Flux density recovered at the corners of elements: nearer to the truth, and never across materials."""

import numpy as np
from helpers.sheets import MU0
from helpers.tensor_meshes import box

from kohonen_adapt.magnetostatics import Magnetostatics, Material


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
