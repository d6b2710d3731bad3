"""An estimate that misses an error is corrected by smaller elements of another pass, and no other estimate is."""

from dataclasses import dataclass

import numpy as np
import pytest
from helpers.layer import Insulation, Layer
from helpers.meshes import centres
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt.loop.state import UNRESOLVED, error_measure, underrating
from kohonen_adapt.mesh.measures import area


@dataclass
class Estimated:
    """The fields of a `Pass` that an estimate has."""

    mesh: object
    indicators: np.ndarray
    order: int = 1
    comparable: bool = False
    calibrated: bool = True
    share: float | None = None
    functional: float | None = None

    @property
    def estimate(self):
        return float(np.linalg.norm(self.indicators))

    @property
    def worth(self):
        return self.estimate


def evenly(mesh, squared_error, order=1):
    return Estimated(mesh, np.full(mesh.nelements, np.sqrt(squared_error / mesh.nelements)), order)


@pytest.mark.parametrize("mesh", [MeshTri().refined(2), MeshTet().refined(1)])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_halved_elements_with_more_error_show_that_of_their_parents(mesh, order):
    step = evenly(mesh, 1.0, order)
    for squared, shown in ((0.9 * UNRESOLVED, 1.0), (1.1 * UNRESOLVED, 1.1 * UNRESOLVED * 4.0**order)):
        halved = evenly(mesh.refined(), squared, order)
        assert error_measure(step, halved) == pytest.approx(np.sqrt(shown), rel=1e-9)
        assert error_measure(halved, step) == halved.worth


def test_errors_at_one_place_count_alone():
    """A quarter of the elements is contradicted by halved elements with ten times their error."""
    mesh = MeshTri().refined(3)
    corner = np.all(centres(mesh) < 0.5, axis=0)
    fine = mesh.refined()
    inside = np.all(centres(fine) < 0.5, axis=0)
    step = Estimated(mesh, np.full(mesh.nelements, 1.0))
    halved = Estimated(fine, np.where(inside, np.sqrt(10.0 / 4.0), 0.1))
    squared = np.sum(~corner) + 40.0 * np.sum(corner)
    assert error_measure(step, halved) == pytest.approx(np.sqrt(squared), rel=1e-9)


@given(st.integers(1, 3), st.integers(0, 2**16))
def test_estimates_that_fall_with_the_size_are_not_corrected(order, seed):
    rng = np.random.default_rng(seed)
    passes = []
    for _ in range(2):
        lines = [np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, rng.integers(2, 12)))]) for _ in "xy"]
        mesh = MeshTri.init_tensor(*(line / line[-1] for line in lines))
        size = area(mesh)
        passes.append(Estimated(mesh, np.sqrt(size ** (1.0 + order)), order))
    assert underrating(*passes) == underrating(*passes[::-1]) == 1.0


def test_all_estimates_zero():
    none, some = Estimated(MeshTri(), np.zeros(2)), Estimated(MeshTri().refined(), np.ones(8))
    assert underrating(none, some) == underrating(none, none) == 1.0
    assert underrating(some, none) == 1.0


class Own:
    """A `Layer` without its functional."""

    calibrated = True

    def __init__(self, layer):
        self.solve, self.indicators, self.energy_norm = layer.solve, layer.indicators, layer.energy_norm


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
    result = ka.adapt(mesh, Own(problem), passes=passes)
    assert problem.error(result.mesh) < 1.1 * min(problem.error(step.mesh) for step in result.history)
    assert result.best.number > 0
