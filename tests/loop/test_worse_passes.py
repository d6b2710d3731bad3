"""After a pass that is worse than the best one, the next starts from the best mesh and descends by energy alone."""

from functools import cache

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import centres, square
from helpers.poisson_solids import Minimised, fichera
from helpers.results import assert_same
from helpers.scalar_problems import Gaussians, magnet, magnet_mesh
from helpers.stand_ins import Without, killed_at
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt.problem.functional_value import functional_value

SEEDS = st.integers(0, 2**32 - 1)


def functional(problem, mesh):
    return functional_value(mesh, problem.ritz(mesh, problem.solve(mesh)))


def line(rng, n):
    """From 0 to 1 in so many steps, the longest up to nine times the shortest."""
    ends = np.cumsum(np.append(0.0, 9.0 ** rng.uniform(0.0, rng.uniform(), n)))
    return ends / ends[-1]


def peaks(rng, order):
    count = rng.integers(1, 4)
    return Gaussians(rng.uniform(0.0, 1.0, (count, 2)), rng.uniform(0.08, 0.4, count), order)


def polished(mesh, problem, times):
    for _ in range(times):
        mesh = ka.polish(mesh, problem)
    return mesh


def assert_no_worse_than_the_polish(mesh, problem, **options):
    result = ka.adapt(mesh, problem, **options)
    before, alone = functional(problem, mesh), functional(problem, ka.polish(mesh, problem))
    assert result.error is None
    assert result.best.functional <= before + 1e-12 * abs(before)
    if alone < before - 1e-9 * abs(before):
        assert result.best.number > 0


@pytest.mark.parametrize("order", [1, 3])
@examples(4)
@given(seed=SEEDS, times=st.integers(0, 3), passes=st.integers(1, 3))
def test_the_input_is_never_the_best_if_the_polish_alone_improves_it(order, seed, times, passes):
    rng = np.random.default_rng(seed)
    problem, mesh = peaks(rng, order), MeshTri.init_tensor(line(rng, 7), line(rng, 7))
    assert_no_worse_than_the_polish(polished(mesh, problem, times), problem, passes=passes, seed=seed % 5)


@pytest.mark.parametrize("order", [1, 2])
@examples(2)
@given(seed=SEEDS, times=st.integers(0, 2), passes=st.integers(1, 3))
def test_nor_in_space(order, seed, times, passes):
    rng, problem = np.random.default_rng(seed), Minimised(order=order)
    mesh = MeshTet.init_tensor(*[line(rng, 3) for _ in range(3)])
    assert_no_worse_than_the_polish(polished(mesh, problem, times), problem, passes=passes)


class Misled(Without):
    """A problem with indicators that fade away from a corner without much error, where the map moves the nodes."""

    def indicators(self, mesh, solution):
        to_corner = centres(mesh) - 0.8
        return self.problem.indicators(mesh, solution) * np.exp(-3.0 * np.sum(to_corner**2, axis=0))


@cache
def adapted_magnet():
    problem = magnet(1, False)
    return ka.adapt(magnet_mesh(20, False), problem, passes=6).mesh, Misled(problem)


@pytest.fixture(scope="module", params=["plane", "space"])
def adapted(request):
    """A mesh on which the polish has little left to do, the problem, and the run from it."""
    if request.param == "plane":
        mesh, problem = adapted_magnet()
    else:
        problem = Minimised()
        mesh = ka.adapt(fichera(2), problem, passes=6).mesh
    return mesh, problem, ka.adapt(mesh, problem)


def test_a_pass_by_energy_follows_a_worse_one_and_is_better(adapted):
    first, worse, better, *_ = adapted[2].history
    assert better.functional < first.functional < worse.functional
    assert better.functional <= first.functional - better.polish_gain * (1.0 - 1e-6)
    assert not better.quantization_errors


def test_resumed_after_a_worse_pass(adapted, tmp_path):
    mesh, problem, straight = adapted
    killed_at((2, "polish"), mesh, problem, checkpoint=tmp_path)
    assert_same(ka.adapt(mesh, problem, checkpoint=tmp_path), straight)


def test_the_only_pass_is_followed_by_one_if_the_input_is_better(adapted):
    mesh, problem, _ = adapted
    result = ka.adapt(mesh, problem, passes=1)
    assert [step.number for step in result.history] == [0, 1, 2] and result.best.number == 2


def test_a_mesh_that_grows_keeps_the_nodes_of_the_best_and_splits_edges():
    start, problem = adapted_magnet()
    history = ka.adapt(start, problem, passes=3, target_nodes=447).history
    assert [step.mesh.nvertices for step in history] == [441, 444, 447, 447]
    assert history[1].functional > history[0].functional > history[2].functional


def test_a_sweep_that_is_undone_leaves_every_coefficient_as_it_was():
    """At order 3 some sweeps raise this functional; with coefficients of theirs the polish would gain without end."""
    problem, mesh = (
        Gaussians(np.array([[0.3, 0.4], [0.8, 0.7]]), np.array([0.15, 0.3]), 3),
        square(13),
    )
    history = ka.adapt(mesh, problem, passes=3).history
    excess = history[0].functional + 0.5 * problem.energy(mesh.refined(2), 3)
    assert all(0.0 < step.polish_gain < 10.0 * excess for step in history[1:])
    assert history[1].functional < history[0].functional
