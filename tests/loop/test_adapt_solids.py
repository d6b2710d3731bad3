"""The loop on tetrahedra: what holds for every result, and what is refused."""

import re
from functools import cache

import numpy as np
import pytest
from helpers.poisson_solids import FICHERA, Poisson, cube, fichera
from helpers.solids import box, two_regions
from numpy.testing import assert_array_equal
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt.loop.dimension import plane, space


@cache
def adapted(topology="recycle"):
    return ka.adapt(fichera(), Poisson(FICHERA), passes=3, topology=topology)


def test_both_dimensions_have_the_same_names():
    assert plane.__all__ == space.__all__


def test_a_pass_is_relocate_with_the_density_of_its_indicators():
    mesh, problem = fichera(), Poisson()
    solution = problem.solve(mesh)
    indicators = problem.indicators(mesh, solution)
    wanted = {False: ka.density_from_indicators(mesh, indicators)}
    wanted["auto"] = ka.metric_from_hessian(mesh, solution, indicators)
    for anisotropic, density in wanted.items():
        found = ka.relocate(mesh, density, topology="recycle")
        again = ka.adapt(mesh, problem, passes=1, anisotropic=anisotropic).history[1].mesh
        assert_array_equal(again.p, found.p)
        assert_array_equal(again.t, found.t)


def test_directions_lower_the_error_but_not_with_a_tolerance():
    """Residuals overrate long elements, so a tolerance leads to the meshes without directions."""
    found = [adapted().best, ka.adapt(fichera(), Poisson(FICHERA), passes=3, anisotropic=False).best]
    assert Poisson(FICHERA).error(found[0]) < 0.8 * Poisson(FICHERA).error(found[1])
    arguments = {"rtol": 0.3, "passes": 3}
    by_tolerance = [ka.adapt(fichera(2), Poisson(FICHERA), anisotropic=a, **arguments) for a in ("auto", False)]
    assert_array_equal(by_tolerance[0].mesh.p, by_tolerance[1].mesh.p)


def test_elements_of_second_order_have_their_own_density_and_no_polish():
    problem = Poisson(order=2)
    result = ka.adapt(cube(3), problem, passes=2, anisotropic=False)
    mesh = result.best.mesh
    assert result.best.unknowns == mesh.nvertices + mesh.edges.shape[1] == len(result.solution)
    assert "unknowns" in str(result) and "No polish" in result.message
    assert problem.error(result.best) < problem.error(result.history[0])
    eta = result.history[0].indicators
    wanted = [ka.density_from_indicators(cube(3), eta, order=order) for order in (1, 2)]
    assert_array_equal(result.history[1].mesh.p, ka.relocate(cube(3), wanted[1], topology="recycle").p)
    assert not np.array_equal(*wanted)


def test_a_problem_may_name_points_that_stay():
    problem = Poisson()
    problem.points = {"probe": np.array([[0.25], [0.5], [0.75]])}
    result = ka.adapt(two_regions(4), problem, passes=2)
    assert np.any(np.all(result.mesh.p == problem.points["probe"], axis=0))


@pytest.mark.parametrize(
    ("options", "pairs", "said"),
    [
        ({}, (("left", "top"),), "periodic must be left out for tetrahedra; it is for triangles only."),
        (
            {"schedule": ka.Schedule((), rounds=2)},
            (),
            "rounds of transport are for triangles only; got a schedule with 2.",
        ),
    ],
)
def test_what_is_for_the_plane_is_refused_before_anything_is_solved(options, pairs, said):
    problem = Poisson()
    problem.pairs = pairs
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        ka.adapt(two_regions(2), problem, **options)
    assert problem.solves == 0


def test_no_edge_is_curved_where_no_surface_is():
    problem = Poisson(order=2)
    problem.curved = True
    assert type(ka.adapt(box(2), problem, passes=1).mesh) is MeshTet
