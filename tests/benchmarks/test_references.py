"""The references of problems in space agree with elements of high order."""

import pytest

from benchmarks.peers.hexahedra import least_energy
from benchmarks.problems.solids import CUBE, FICHERA


@pytest.mark.parametrize(("problem", "layers", "order", "most"), [(CUBE, 1, 4, 1e-5), (FICHERA, 2, 5, 1e-4)])
def test_hexahedra_bound_the_exact_energy_from_above(problem, layers, order, most):
    pytest.importorskip("ngsolve")
    _, energy = least_energy(problem, layers, order)
    assert 0.0 < energy - problem.energy < most * abs(problem.energy)
