"""Flips: every region constrained Delaunay, as far as the quality rule lets it."""

import numpy as np
import pytest
from helpers.alternatives import locally_delaunay, signed_quality
from helpers.meshes import (
    comb,
    doubled_areas,
    generic_square,
    inset,
    junction,
    named,
    perturbed,
    slit,
    square,
)
from numpy.testing import assert_array_equal
from scipy.spatial import Delaunay

import kohonen_adapt as ka
from kohonen_adapt.mesh.triangulation import Triangulation

NO_TRAINING = ka.Schedule(())


def flipped(mesh, min_quality=0.0):
    return ka.relocate(mesh, np.ones(mesh.nelements), schedule=NO_TRAINING, min_quality=min_quality)


def triangles(t):
    return {tuple(sorted(row)) for row in t.T.tolist()}


def edges_of_nodes(mesh, facets):
    return {tuple(sorted(pair)) for pair in mesh.facets[:, np.asarray(facets)].T.tolist()}


def quadrilaterals(mesh):
    """For every inner edge that may flip: its ends p, q, the opposite nodes r, s; (r, p, q) is counter-clockwise."""
    tri = Triangulation.of(mesh)
    node, neighbour, region = tri.elements.node, tri.elements.neighbour, tri.elements.region
    fixed = {pair for rows in (mesh.boundaries or {}).values() for pair in edges_of_nodes(mesh, rows)}
    for e, k in zip(*np.nonzero(neighbour >= 0), strict=True):
        other = neighbour[e, k]
        p, q = node[e, k - 2], node[e, k - 1]
        if e < other and region[e] == region[other] and tuple(sorted((p, q))) not in fixed:
            yield p, q, node[e, k], np.setdiff1d(node[other], [p, q])[0]


@pytest.mark.parametrize("seed", range(3))
def test_a_convex_region_becomes_the_delaunay_triangulation_of_its_nodes(seed):
    mesh = perturbed(generic_square(7, seed), seed)
    result = flipped(mesh)
    hull = Delaunay(mesh.p.T).simplices.T
    solid = np.abs(doubled_areas(mesh.p, hull)) > 1e-12
    assert triangles(mesh.t) != triangles(result.t)
    assert triangles(result.t) == triangles(hull[:, solid])
    assert_array_equal(result.p, mesh.p)


@pytest.mark.parametrize("min_quality", [0.0, 0.1, 0.3, 0.6])
@pytest.mark.parametrize("build", [inset, junction, named, slit, lambda n: comb(10)])
def test_every_edge_left_is_delaunay_or_excused_by_the_quality_rule(build, min_quality):
    excused = 0
    for seed in range(4):
        mesh = perturbed(build(8), seed)
        result = flipped(mesh, min_quality)
        x = result.p.T
        for p, q, r, s in quadrilaterals(result):
            if locally_delaunay(x[r], x[p], x[q], x[s]):
                continue
            before = min(signed_quality(x[r], x[p], x[q]), signed_quality(x[s], x[q], x[p]))
            after = min(signed_quality(x[r], x[p], x[s]), signed_quality(x[s], x[q], x[r]))
            assert after < min(min_quality, before) or after <= 1e-14
            excused += 1
        assert ka.quality(result).min() >= min(min_quality, ka.quality(mesh).min()) - 1e-14
    assert min_quality > 0.3 or excused < 20


def test_subdomains_keep_their_elements_by_number():
    mesh = perturbed(inset(8), 2)
    result = flipped(mesh)
    for name, rows in mesh.subdomains.items():
        assert_array_equal(result.subdomains[name], rows)
        assert set(np.unique(mesh.t[:, rows])) == set(np.unique(result.t[:, rows]))


def test_what_is_delaunay_stays_bit_for_bit():
    for mesh in (square(6), inset(8), named(8)):  # right triangles: both diagonals are as good
        assert_array_equal(flipped(mesh).t, mesh.t)
    once = flipped(perturbed(named(8), 7))
    assert_array_equal(flipped(once).t, once.t)


@pytest.mark.parametrize("seed", range(2))
def test_flips_of_elements_that_overlap_come_to_an_end_and_leave_a_triangulation(seed):
    mesh = square(6)
    som = ka.KohonenMap(mesh, min_quality=None)
    points = np.random.default_rng(seed).random((2, 20)) ** 2
    som.train(points, ka.Schedule((ka.Stage(2, 5, 0.8, neighbourhood="flat"),)), seed=seed)
    result = som.mesh
    assert np.abs(doubled_areas(result.p, result.t)).sum() > 2.0 * (1.0 + 1e-6)  # more than the square: some overlap
    assert result.facets.shape == mesh.facets.shape
    assert np.bincount(result.t2f.ravel()).max() == 2
    assert_array_equal(np.sort(mesh.boundary_nodes()), np.sort(result.boundary_nodes()))
