"""The other methods of the benchmarks, bisection and remeshing by Gmsh and Mmg, do what they say, and so do tables."""

from functools import partial
from itertools import takewhile

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import area_of, length_of, named
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTri

from benchmarks.peers import methods, peers, remeshing, time_to_error, wheels
from benchmarks.peers.bisection import Bisection, bisected_meshes, mark_bulk
from benchmarks.peers.gmsh_remesh import gmsh_remesh
from benchmarks.peers.lost_names import lost_names
from benchmarks.peers.methods import DEFAULT
from benchmarks.peers.mmg_remesh import mmg_remesh
from benchmarks.peers.time_to_error import Reached
from benchmarks.problems.cases import CASES
from benchmarks.problems.l_shape import LShape, l_shaped_mesh


@examples(20)
@given(seed=st.integers(0, 2**32 - 1), rounds=st.integers(1, 5))
def test_bisection_conforms_and_keeps_areas_and_names(seed, rounds):
    rng = np.random.default_rng(seed)
    start = named(6)
    state = Bisection.of(start)
    for _ in range(rounds):
        before = state.t.shape[1]
        state = state.refined(rng.choice(before, rng.integers(1, before + 1), replace=False))
        assert state.t.shape[1] > before
    mesh = state.mesh()
    assert mesh.is_valid()
    assert np.array_equal(mesh.p[:, : start.p.shape[1]], start.p)
    # a hanging node would leave a facet inside with one element only
    assert length_of(mesh, mesh.boundary_facets()) == pytest.approx(length_of(start, start.boundary_facets()))
    assert area_of(mesh) == pytest.approx(area_of(start))
    for name, elements in start.subdomains.items():
        assert area_of(mesh, mesh.subdomains[name]) == pytest.approx(area_of(start, elements))
    for name, facets in start.boundaries.items():
        assert length_of(mesh, mesh.boundaries[name]) == pytest.approx(length_of(start, facets))


def test_bisection_makes_right_isosceles_triangles_of_them():
    state = Bisection.of(l_shaped_mesh(2))
    for _ in range(6):
        state = state.refined(np.arange(0, state.t.shape[1], 3))
    corners = state.p[:, state.t]
    sides = np.sort(np.hypot(*(corners - np.roll(corners, 1, axis=1))), axis=0)
    np.testing.assert_allclose(sides[2], np.sqrt(2) * sides[0])
    np.testing.assert_allclose(sides[1], sides[0])


def test_bulk_marking_takes_the_fewest_elements_with_the_share():
    indicators = np.array([1.0, 3.0, 2.0, 0.0])
    assert mark_bulk(indicators, 0.6).tolist() == [1]
    assert mark_bulk(indicators, 0.65).tolist() == [1, 2]
    assert set(mark_bulk(indicators, 1.0)) == {0, 1, 2}


def test_bisection_of_the_l_shape():
    problem = LShape()
    loop = takewhile(lambda pair: pair[0].p.shape[1] < 4000, bisected_meshes(problem, l_shaped_mesh(2)))
    found = {mesh.p.shape[1]: round(problem.error(mesh, solution), 5) for mesh, solution in loop}
    published = {289: 0.05210, 1093: 0.02602, 3955: 0.01348}
    assert {nodes: found[nodes] for nodes in published} == published


def remesh_by(name, case):
    why = wheels.missing({"gmsh": "gmsh", "mmg": "mmgpy"}[name])
    if why:
        pytest.skip(why)
    return partial(gmsh_remesh, case.geometry) if name == "gmsh" else mmg_remesh


@pytest.mark.parametrize("name", ["gmsh", "mmg"])
@pytest.mark.parametrize(("letter", "number"), [("L", 0), ("H", 0), ("M", 0), ("M", 2), ("C", 0)])
def test_remeshing_keeps_areas_and_names(name, letter, number):
    case = CASES[letter][number]
    start = peers.with_outside_named(case.start())
    metric = remeshing.equidistributing(case.problem, start, case.problem.solve(start))
    mesh = remesh_by(name, case)(start, metric)
    assert mesh.is_valid()
    assert area_of(mesh) == pytest.approx(area_of(start))
    assert lost_names(start, mesh) == []


def test_lost_names_are_those_of_another_area_or_length():
    start = named(6)
    assert lost_names(start, start) == []
    subdomains, boundaries = dict(start.subdomains), dict(start.boundaries)
    del subdomains["west"]
    boundaries["floor"] = boundaries["floor"][1:]
    mesh = MeshTri(start.p, start.t, boundaries, subdomains)
    assert lost_names(start, mesh) == ["floor", "west"]


@pytest.mark.parametrize(("name", "low", "high"), [("gmsh", 0.785, 0.815), ("mmg", 0.795, 0.835)])
def test_remeshing_loops_of_the_l_shape(name, low, high):
    (case,) = [case for case in CASES["L"] if case.start().p.shape[1] == 833]
    loop = remeshing.remeshed_meshes(
        case.problem, case.start(), [1000] * 5, remeshing.equidistributing, remesh_by(name, case)
    )
    *_, (mesh, solution) = loop
    assert mesh.p.shape[1] == pytest.approx(1000, rel=0.02)
    assert low < case.error(mesh, solution) * mesh.nvertices**0.5 < high


def test_anisotropic_remeshing_of_helmholtz():
    (case,) = CASES["H"]
    loop = remeshing.remeshed_meshes(
        case.problem, case.start(), [441] * 5, remeshing.curvature_metric, remesh_by("mmg", case)
    )
    *_, (mesh, solution) = loop
    assert case.error(mesh, solution) * mesh.p.shape[1] / 441 == pytest.approx(0.00091, rel=0.06)


def test_the_recovered_hessian_of_a_quadratic_function_is_exact_inside():
    mesh = l_shaped_mesh(8)
    x, y = mesh.p
    hessian = remeshing.recovered_hessian(mesh, x**2 + 3 * x * y - y**2)
    inside = np.setdiff1d(np.arange(x.size), mesh.facets[:, mesh.boundary_facets()])
    inner = [node for node in inside if np.isin(mesh.t[:, (mesh.t == node).any(axis=0)], inside).all()]
    np.testing.assert_allclose(hessian[inner], np.tile([[2.0, 3.0], [3.0, -2.0]], (len(inner), 1, 1)), atol=1e-10)


def test_the_expected_number_of_nodes_of_equilateral_triangles():
    mesh = l_shaped_mesh(2)
    sizes = np.full(mesh.p.shape[1], 0.1)
    assert remeshing.expected_nodes(mesh, sizes**-2) == pytest.approx(3 / (np.sqrt(3) / 4 * 0.1**2) / 2)
    tensors = np.stack((4 * sizes**-2, 0 * sizes, sizes**-2))
    assert remeshing.expected_nodes(mesh, tensors) == pytest.approx(2 * remeshing.expected_nodes(mesh, sizes**-2))


def test_the_report_says_where_a_peer_is_better():
    results = {
        name: peers.Result(error, 1.0, 0.5, 0.9, [])
        for name, error in {"uniform": 3.0, "Gmsh": 1.0, DEFAULT.name: 2.0}.items()
    }
    text = peers.tables([peers.Comparison("C, N = 9", "E", results)])
    assert "**1.000**" in text
    assert "* Gmsh has the smaller error on C, N = 9 (2.000)." in text
    assert "* uniform: nowhere." in text


def test_the_fewest_nodes_for_an_error_are_found():
    def run(nodes, seed):
        return Reached(nodes, 2.0 / nodes**0.5, 1.0 + seed)

    reached = time_to_error.with_fewest_nodes(run, 0.05, 400, range(3), least=100, order=1)
    assert reached.seconds == 2.0
    assert 0.045 < reached.error <= 0.05
    worse = Reached(16, 1.0, 1.0)
    assert time_to_error.with_fewest_nodes(lambda nodes, seed: worse, 0.5, 16, range(1), least=16, order=1) is None


def test_time_to_an_error_is_that_of_a_mesh_that_has_it():
    (case,) = [case for case in CASES["L"] if case.start().p.shape[1] == 225]
    loop = methods.measured(case, bisected_meshes(case.problem, case.coarse()))
    bisected = time_to_error.until(loop, 0.1)
    adapting, least = time_to_error.adapting(case, passes=3), case.coarse().p.shape[1]
    ours = time_to_error.with_fewest_nodes(adapting, 0.1, bisected.nodes, range(1), least, order=1)
    assert max(bisected.error, ours.error) <= 0.1
    assert ours.nodes < bisected.nodes


def test_polish_lowers_the_error_of_another_mesh():
    case = CASES["M"][2]
    start = case.start()
    (found,) = methods.measured(case, [(start, case.problem.solve(start))])
    after = methods.polished(case, found)
    assert after.error < 0.95 * found.error
    assert after.nodes == found.nodes
    assert after.seconds > found.seconds


def test_numbers_of_nodes_grow_evenly():
    assert time_to_error.growing(10, 160) == [40, 160]
    assert time_to_error.growing(10, 90) == [30, 90]
    assert time_to_error.growing(100, 100) == [100]
