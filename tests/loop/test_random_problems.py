"""What holds for every result of `adapt`, on random devices of every order, in the plane, in space and drawn."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from helpers.examples import examples
from helpers.mesh_files import needs_gmsh
from helpers.random_problems import drawn_problem, plane_problem, space_problem
from helpers.results import assert_same
from helpers.stand_ins import killed_at
from hypothesis import given
from hypothesis import strategies as st
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt.mesh.curved import check_midsides, corners_of, is_second_order
from kohonen_adapt.mesh.measures import area

SEEDS = st.integers(0, 2**32 - 1)
RESUMED = 3  # one of so many cases is killed and resumed


@pytest.mark.parametrize("draw", [plane_problem, space_problem])
def test_of_a_device(draw):
    mesh, problem, options, radii = draw(1)
    assert options["seed"] % RESUMED == 0
    checked(mesh, problem, options, radii)


@pytest.mark.slow
@examples(50)
@given(SEEDS)
def test_in_the_plane(seed):
    checked(*plane_problem(seed))


@pytest.mark.slow
@examples(50)
@given(SEEDS)
def test_in_space(seed):
    checked(*space_problem(seed))


@pytest.mark.slow
@needs_gmsh
@examples(4)
@given(SEEDS)
def test_on_drawings(seed):
    with TemporaryDirectory() as folder:
        checked(*drawn_problem(seed, Path(folder)))


def killed_and_resumed(mesh, problem, options):
    """The result after an end of the process in the solve that follows the first relocation."""
    with TemporaryDirectory() as folder:
        killed_at((1, "solve"), mesh, problem, **options, checkpoint=Path(folder))
        return ka.adapt(mesh, problem, **options, checkpoint=Path(folder))


def checked(mesh, problem, options, radii):
    given_arrays = mesh.p.tobytes(), mesh.t.tobytes()
    result = ka.adapt(mesh, problem, **options)
    assert (mesh.p.tobytes(), mesh.t.tobytes()) == given_arrays
    assert result.status is not ka.Status.FAILED, result.message
    names_are_kept(mesh, result.mesh)
    sizes_are_kept(mesh, result.mesh, 0.2 if radii else 1e-12)
    if problem.curved:
        nodes_are_on_circles(result.mesh, radii)
    errors_are_told(result, options)
    if options["seed"] % RESUMED == 0:
        again = killed_and_resumed(mesh, problem, options)
        if any(material.bh is not None for material in problem.materials.values()):  # as exact as its solver
            assert again.history[0].estimate == result.history[0].estimate
            assert again.estimate == pytest.approx(result.estimate, rel=0.3)
        else:
            assert_same(again, result)


def names_are_kept(mesh, result):
    assert list(result.subdomains) == list(mesh.subdomains) and set(result.boundaries) == set(mesh.boundaries)
    assert np.array_equal(np.sort(result.boundaries["outer"]), np.sort(result.boundary_facets()))
    if "skin" in mesh.boundaries:
        skin, around = result.boundaries["skin"], result.facets_around("core")
        assert isinstance(skin, OrientedBoundary) and np.array_equal(np.sort(skin), np.sort(around))
        outward = np.isin(result.f2t[skin.ori, np.asarray(skin)], result.subdomains["core"])
        assert outward.all()


def sizes_are_kept(mesh, result, rtol):
    """To rounding on straight sides. The sizes are absolute values, so that no element is inverted."""
    before, after = area(mesh), area(result)
    for name, rows in mesh.subdomains.items():
        assert abs(after[result.subdomains[name]].sum() - before[rows].sum()) <= rtol * before.sum()
    if is_second_order(result):
        check_midsides(result)


def nodes_are_on_circles(result, radii):
    flat = corners_of(result)
    for name, radius in radii.items():
        facets = flat.boundary_facets() if name == "outer" else np.asarray(flat.facets_around(name))
        distance = np.linalg.norm(flat.p[:, np.unique(flat.facets[:, facets])], axis=0)
        assert np.abs(distance - radius)[distance > 0.99 * radius].max() < 1e-9 * radius


def errors_are_told(result, options):
    assert np.isfinite(result.estimate) and result.indicators.min() >= 0.0
    assert all(np.isfinite(output.value) for output in result.outputs.values())
    assert all(output.error is None or np.isfinite(output.error) for output in result.outputs.values())
    if result.status is ka.Status.CONVERGED and "rtol" in options:
        assert result.estimate <= options["rtol"] * result.best.energy_norm
    if result.status is ka.Status.CONVERGED and "goal_rtol" in options:
        goal = result.outputs["goal"]
        assert abs(goal.error) <= options["goal_rtol"] * abs(goal.value)
