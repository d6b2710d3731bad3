"""The other methods of the benchmarks: bisection, remeshing by Gmsh and Mmg, and the tables that compare them."""

from itertools import takewhile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import area_of, length_of, named

from benchmarks.bisection import Bisection, bisected_meshes, mark_bulk
from benchmarks.l_shape import LShape, l_shaped_mesh


@settings(max_examples=20, deadline=None)
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
