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
from benchmarks.peers.bisection import Bisection, bisected_meshes
from benchmarks.peers.gmsh_remesh import gmsh_remesh
from benchmarks.peers.lost_names import lost_names
from benchmarks.peers.methods import DEFAULT
from benchmarks.peers.mmg_remesh import mmg_remesh
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


def test_the_report_says_where_a_peer_is_better():
    results = {
        name: peers.Result(error, 1.0, 0.5, 0.9, [])
        for name, error in {"uniform": 3.0, "Gmsh": 1.0, DEFAULT.name: 2.0}.items()
    }
    text = peers.tables([peers.Comparison("C, N = 9", "E", results)])
    assert "**1.000**" in text
    assert "* Gmsh has the smaller error on C, N = 9 (2.000)." in text
    assert "* uniform: nowhere." in text


def test_time_to_an_error_is_that_of_a_mesh_that_has_it():
    (case,) = [case for case in CASES["L"] if case.start().p.shape[1] == 225]
    loop = methods.measured(case, bisected_meshes(case.problem, case.coarse()))
    bisected = time_to_error.until(loop, 0.1)
    adapting, least = time_to_error.adapting(case, passes=3), case.coarse().p.shape[1]
    ours = time_to_error.with_fewest_nodes(adapting, 0.1, bisected.nodes, range(1), least, order=1)
    assert max(bisected.error, ours.error) <= 0.1
    assert ours.nodes < bisected.nodes
