"""An estimate that misses an error is corrected by smaller elements of another pass, and no other estimate is."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers.layer import Insulation, Layer
from helpers.meshes import centres
from helpers.stand_ins import Without
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.loop.state import error_measure


def estimated(mesh, indicators):
    """A pass with this estimate of order 1, without a functional."""
    estimate = float(np.linalg.norm(indicators))
    told = {"order": 1, "comparable": False, "calibrated": True, "share": None, "functional": None}
    return SimpleNamespace(mesh=mesh, indicators=indicators, estimate=estimate, worth=estimate, **told)


def test_errors_at_one_place_count_alone():
    """A quarter of the elements is contradicted by halved elements with ten times their error."""
    mesh = MeshTri().refined(3)
    fine = mesh.refined()
    corner, inside = (np.all(centres(each) < 0.5, axis=0) for each in (mesh, fine))
    step = estimated(mesh, np.ones(mesh.nelements))
    halved = estimated(fine, np.where(inside, np.sqrt(10.0 / 4.0), 0.1))
    squared = np.sum(~corner) + 40.0 * np.sum(corner)
    assert error_measure(step, halved) == pytest.approx(np.sqrt(squared), rel=1e-9)
    assert error_measure(halved, step) == halved.worth


@pytest.mark.parametrize(
    ("problem", "passes"),
    [
        (Layer(200.0, (0.43, 0.37)), 1),  # the input has 85 % error and the least estimate
        # the first meshes have the largest energies, by quadrature errors
        pytest.param(Layer(400.0, (0.43, 0.37), rule=3), 4, marks=pytest.mark.slow),
        pytest.param(Layer(600.0, (0.43, 0.37), rule=2, by_flux=True), 4, marks=pytest.mark.slow),
        pytest.param(Layer(1500.0, (0.43, 0.37), rule=5, by_flux=True), 4, marks=pytest.mark.slow),
        pytest.param(Insulation(400.0, rule=2), 4, marks=pytest.mark.slow),
        (Insulation(1200.0, rule=2), 1),  # the input has 63 % error and the least estimate, 6.6 %
        pytest.param(Insulation(1200.0), 4, marks=pytest.mark.slow),
    ],
)
def test_the_pass_that_resolves_the_data_is_the_best_one(problem, passes):
    mesh = MeshTri().refined(5)
    result = ka.adapt(mesh, Without(problem, "ritz"), passes=passes)
    assert problem.error(result.mesh) < 1.1 * min(problem.error(step.mesh) for step in result.history)
    assert result.best.number > 0
