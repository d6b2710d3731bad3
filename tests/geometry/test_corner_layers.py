"""Geometric layers at nodes: areas, names, arcs, pairs and what is refused."""

import numpy as np
import pytest
from helpers.curved_meshes import curved_annulus, on_circles, with_midsides
from helpers.meshes import apart, ring
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.mesh.blended import exact_area
from kohonen_adapt.mesh.curved import inverted_elements
from kohonen_adapt.mesh.measures import area


def named_square():
    mesh = MeshTri().refined(2).with_defaults()
    return mesh.with_subdomains({"low": lambda x: x[0] < 0.5, "high": lambda x: x[0] > 0.5})


def length(mesh, rows):
    start, end = mesh.p[:, mesh.facets[:, np.asarray(rows)]].swapaxes(0, 1)
    return np.hypot(*(end - start)).sum()


@given(st.sets(st.integers(0, 24)), st.integers(1, 3), st.floats(0.05, 0.9))
def test_areas_names_and_nodes_stay(nodes, layers, factor):
    mesh = named_square()
    finer = ka.refined_at(mesh, sorted(nodes), layers=layers, factor=factor)
    assert finer.is_valid()
    assert_array_equal(finer.p[:, : mesh.nvertices], mesh.p)
    for name, rows in mesh.subdomains.items():
        assert area(finer)[finer.subdomains[name]].sum() == pytest.approx(area(mesh)[rows].sum(), rel=1e-12)
    for name, rows in mesh.boundaries.items():
        assert length(finer, finer.boundaries[name]) == pytest.approx(length(mesh, rows), rel=1e-12)


@pytest.mark.parametrize(("count", "layers"), [(8, 1), (9, 3)])
def test_layers_at_every_node_of_coarse_arcs(count, layers):
    mesh = curved_annulus(count)
    for nodes in ([count], [count, count + 1], np.arange(mesh.nvertices)):
        finer = ka.refined_at(mesh, nodes, layers=layers)
        assert np.array_equal(finer.p[:, : mesh.nvertices], mesh.p[:, : mesh.nvertices])
        assert not inverted_elements(finer).size
        for name, rows in mesh.subdomains.items():
            own = exact_area(finer)[finer.subdomains[name]].sum()
            assert own == pytest.approx(exact_area(mesh)[rows].sum(), rel=1e-13)


def test_halves_of_curved_sides_stay_pairs():
    sides = "0 outer", "1 inner"
    mesh = with_midsides(apart(ring(8, 1, 0.5, 1.0), ring(8, 1, 1.0, 1.5)), on_circles)
    rim = np.unique(mesh.facets[:, mesh.boundaries[sides[0]]])
    finer = ka.refined_at(mesh, rim[:2], periodic=[(*sides, ka.Rotation(0.0))])
    one, other = (finer.p[:, np.unique(finer.facets[:, finer.boundaries[name]])] for name in sides)
    assert one.shape[1] > 8 + 4
    assert_allclose(*(np.sort(np.arctan2(*each)) for each in (one, other)), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"layers": 0}, "layers must be an integer >= 1; got 0"),
        ({"factor": 1.0}, r"factor must be a number between 0 and 1; got 1\.0"),
        ({"nodes": [3, 25]}, "nodes must be numbers of nodes of this mesh, from 0 to 24; got 25"),
        ({"nodes": [0.5]}, "nodes must be whole numbers"),
        ({"nodes": np.zeros(25, dtype=bool)}, r"got bool of shape \(25,\). Take np.flatnonzero\(mask\) of a mask"),
        ({"edges": [[0], [1]]}, "edges are for tetrahedra; give the nodes of triangles as nodes"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        ka.refined_at(**{"mesh": named_square(), "nodes": [0]} | arguments)
