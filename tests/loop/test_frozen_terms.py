"""A functional with a term frozen at the solution is another one in every pass, and compares no passes."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.layer import Layer
from helpers.scalar_problems import Gaussians
from skfem import MeshTri

import kohonen_adapt as ka


class Frozen(Layer):
    """-lap u + 50 u = f, with the second term frozen in the functional."""

    def __init__(self, **options):
        super().__init__(20.0, reaction=50.0)
        self.options = options

    def ritz(self, mesh, solution):
        def source(x, region):
            return self.source(x) - self.reaction * np.asarray(ka.interpolate(mesh, solution, x))

        return replace(super().ritz(mesh, solution), source=source, **self.options)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({}, "the functional is another one in every pass, as with a term frozen at the solution."),
        ({"comparable": False}, "its functional depends on the solution (`comparable=False` of `Ritz`)."),
    ],
)
def test_passes_with_a_frozen_term_compare_by_the_estimate(options, reason):
    result = ka.adapt(MeshTri().refined(4), Frozen(**options), passes=2)
    assert result.estimate == min(step.estimate for step in result.history) < result.history[0].estimate
    assert result.message.endswith(f" Passes were compared by the estimate, because {reason}")


def test_a_source_that_is_a_new_function_in_every_pass_is_the_same_functional():
    class Load(Gaussians):
        def ritz(self, mesh, solution):
            return replace(super().ritz(mesh, solution), source=lambda x, region: self.source(x))

    result = ka.adapt(MeshTri.init_lshaped().refined(3), Load(np.zeros((1, 2)), [0.5]), passes=2)
    assert all(step.comparable for step in result.history)
