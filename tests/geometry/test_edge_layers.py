"""Geometric layers in space: volumes, names, curved edges, what is refused, and what high orders make of them."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.random_solids import flat_solids
from helpers.solids import box, two_regions
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTet, MeshTet2
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt.geometry.pieces import FoldedLayers
from kohonen_adapt.geometry.singular_layers import with_layers_at
from kohonen_adapt.mesh.adjacency import connected_arrays
from kohonen_adapt.mesh.curved import Isoparametric, corners_of, with_midside_offsets
from kohonen_adapt.mesh.measures import area, directed
from kohonen_adapt.mesh.validity import check_mesh


def normals(mesh, rows):
    """Twice the vector areas of facets, seen from the side of an oriented boundary."""
    which = rows.ori if isinstance(rows, OrientedBoundary) else np.zeros(len(rows), dtype=int)
    a, b, c = mesh.p[:, directed(mesh, np.asarray(rows), which)].transpose(2, 0, 1)
    return np.cross(b - a, c - a, axis=0)


def check_kept(mesh, finer):
    """The layers fill the mesh: elements, outer faces and named parts have the same measures and sides."""
    check_mesh(finer, curved=True, space=True)
    connected_arrays(finer)  # refuses overlaps
    assert_array_equal(finer.p[:, : mesh.nvertices], mesh.p[:, : mesh.nvertices])
    assert area(finer).sum() == pytest.approx(area(mesh).sum(), rel=1e-12)
    assert sorted(finer.subdomains or {}) == sorted(mesh.subdomains or {})
    assert sorted(finer.boundaries or {}) == sorted(mesh.boundaries or {})
    for name, rows in (mesh.subdomains or {}).items():
        assert area(finer)[finer.subdomains[name]].sum() == pytest.approx(area(mesh)[rows].sum(), rel=1e-12)
    own, other = corners_of(mesh), corners_of(finer)
    rims = own.boundary_facets(), other.boundary_facets()
    sides = [(own.boundaries[name], other.boundaries[name]) for name in own.boundaries or {}]
    for before, after in [rims, *sides] if type(mesh) is MeshTet else ():
        ways = [normals(each, rows) for each, rows in ((own, before), (other, after))]
        sizes = [np.linalg.norm(each, axis=0).sum() for each in ways]
        assert sizes[1] == pytest.approx(sizes[0], rel=1e-12)
        if before is rims[0] or isinstance(before, OrientedBoundary):
            assert isinstance(after, OrientedBoundary) == isinstance(before, OrientedBoundary)
            assert_allclose(*[each.sum(axis=1) for each in ways], atol=1e-12 * sizes[0])


@examples(40)
@given(flat_solids(), st.data(), st.integers(1, 3), st.floats(0.05, 0.9), st.integers(0, 2**32 - 1))
def test_volumes_names_and_sides_stay(body, data, layers, factor, seed):
    mesh, rng = body[0], np.random.default_rng(seed)
    nodes = rng.integers(0, mesh.nvertices, data.draw(st.sampled_from([0, 1, 5])))
    some = rng.permutation(mesh.edges.shape[1])[: data.draw(st.sampled_from([0, 1, 3, 30]))]
    before = mesh.p.copy(), mesh.t.copy()
    finer = ka.refined_at(mesh, nodes, edges=rng.permuted(mesh.edges[:, some], axis=0), layers=layers, factor=factor)
    check_kept(mesh, finer)
    assert finer.nelements > mesh.nelements or not nodes.size + some.size
    assert_array_equal(mesh.p, before[0])
    assert_array_equal(mesh.t, before[1])


def bowed(size):
    """A cube of two halves whose edges, those inside and on the faces, have random offsets."""
    mesh = two_regions(2)
    along = np.linalg.norm(np.diff(mesh.p[:, mesh.edges], axis=1)[:, 0], axis=0)
    return with_midside_offsets(mesh, np.random.default_rng(0).uniform(-size, size, (3, along.size)) * along)


@examples(20)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.floats(0.1, 0.6))
def test_curved_edges_are_those_of_the_mesh(seed, layers, factor):
    mesh, rng = bowed(0.02), np.random.default_rng(seed)
    edges = corners_of(mesh).edges
    edges = edges[:, rng.integers(0, edges.shape[1], 3)]
    finer = ka.refined_at(mesh, rng.integers(0, mesh.nvertices, 2), edges=edges, layers=layers, factor=factor)
    assert type(finer) is MeshTet2
    check_kept(mesh, finer)
    shape, own = Isoparametric(finer), Isoparametric(mesh)
    element, at = rng.integers(0, finer.nelements, 40), rng.dirichlet(np.ones(4), 40).T
    x = shape.points(element, at)
    holder, inside = own.locate(x, np.full(40, -1))
    found = holder >= 0
    assert_allclose(own.points(holder, inside)[:, found], x[:, found], atol=1e-12)


def test_layers_that_invert_straight_elements_are_refused():
    mesh = bowed(0.06)
    edges = corners_of(mesh).edges.astype(np.int64)
    with pytest.raises(FoldedLayers, match="layers at the nodes would invert elements at a curve"):
        ka.refined_at(mesh, edges=edges)
    made, nodes = with_layers_at(mesh, np.arange(mesh.nvertices), 2, edges=edges)
    assert nodes.size < mesh.nvertices
    check_mesh(made, curved=True, space=True)


def test_layers_that_coordinates_do_not_resolve_are_left_out():
    mesh = box(2).translated((1e8, 0.0, 0.0))
    edge = mesh.edges[:, :1].astype(np.int64)
    made, nodes = with_layers_at(mesh, np.array([5, 7]), 8, edges=edge)
    assert nodes.size == 0
    assert made.nelements == mesh.nelements
    made, nodes = with_layers_at(mesh, np.array([5, 7]), 1, edges=edge)
    assert_array_equal(made.t, ka.refined_at(mesh, [5, 7], edges=edge, layers=1).t)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"layers": True}, "layers must be an integer >= 1; got True"),
        ({"factor": 0.0}, r"factor must be a number between 0 and 1; got 0\.0"),
        ({"nodes": [27]}, "nodes must be numbers of nodes of this mesh, from 0 to 26; got 27"),
        ({"nodes": 3}, r"nodes must be whole numbers, shape \(k,\); got int64 of shape \(\)\."),
        ({"edges": [[0.0], [1.0]]}, r"edges must be whole numbers, shape \(2, k\); got float64 of shape \(2, 1\)\."),
        ({"edges": [[0], [-1]]}, "edges must be numbers of nodes of this mesh, from 0 to 26; got -1"),
        ({"edges": [[4, 0], [4, 1]]}, "edges must be edges of the mesh; it has none between the nodes 4 and 4"),
        ({"edges": [[1], [25]]}, "edges must be edges of the mesh; it has none between the nodes 1 and 25"),
        ({"periodic": [("a", "b")]}, "periodic and curves are for triangles"),
    ],
)
def test_bad_input_in_space_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        ka.refined_at(**{"mesh": box(2), "nodes": [0]} | arguments)
