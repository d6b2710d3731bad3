"""The loop with the polish for an error in the L2 norm."""

import numpy as np
import pytest
from helpers.meshes import square
from helpers.scalar_problems import Scalar
from skfem import Basis, ElementTriP1, Functional

import kohonen_adapt as ka


class Wave(Scalar):
    """-div grad u = f for u = cos(a x) cos(b y), with u given on the whole boundary."""

    norm = "L2"
    calibrated = True

    def __init__(self, a, b):
        super().__init__(source=self.source)
        self.a, self.b = a * np.pi, b * np.pi

    def given(self, x):
        return np.cos(self.a * x[0]) * np.cos(self.b * x[1])

    def source(self, x, region=None):
        return (self.a**2 + self.b**2) * self.given(x)

    def indicators(self, mesh, solution):
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements))

    def error(self, step):
        basis = Basis(step.mesh, ElementTriP1(), intorder=8)
        solution = basis.interpolate(self.solve(step.mesh))
        return np.sqrt(Functional(lambda w: (w["u"] - self.given(w.x)) ** 2).assemble(basis, u=solution))


@pytest.mark.parametrize(
    ("wave", "topology", "most", "of_plain"),
    [
        (Wave(0, 2), "recycle", 0.15, 2.0),  # varies along an axis only, which the map finds without a polish
        (Wave(0, 2), "flip", 0.45, 0.9),
        (Wave(2, 2), "recycle", 0.55, 0.9),
        (Wave(4, 2), "fixed", 0.65, 0.9),
    ],
)
def test_the_error_in_l2_is_lower_than_without_a_polish(wave, topology, most, of_plain):
    result, plain = (ka.adapt(square(14), wave, topology=topology, polish=polish) for polish in (True, False))
    error = wave.error(result.best)
    assert error < most * wave.error(result.history[0]) and error < of_plain * wave.error(plain.best)


@pytest.mark.parametrize("topology", ["recycle", "flip", "fixed"])
def test_the_best_pass_has_the_least_estimate_in_l2(topology):
    result = ka.adapt(square(10), Wave(2, 2), topology=topology, pinned=square(10).boundary_nodes())
    assert result.best.worth == min(step.worth for step in result.history)
    assert all(step.polish_gain > 0.0 and not step.comparable for step in result.history[1:])
    assert result.message.endswith(
        " The polish lowered the energy, and passes were compared by the estimate in the L2 norm."
    )
