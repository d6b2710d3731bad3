"""Recycling: splits and collapses that keep everything but the number of nodes where they are."""

import numpy as np
import pytest
from helpers.meshes import (
    area_of,
    centres,
    generic_square,
    holed,
    inset,
    junction,
    l_shape,
    named,
    peak,
    slit,
    square,
)
from numpy.testing import assert_allclose
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Rules, Schedule
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import SLIDING
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.som.recycling import recycle_nodes
from kohonen_adapt.som.training_points import density_of

MESHES = {
    "square": square(12),
    "generic": generic_square(12),
    "l_shape": l_shape(6),
    "holed": holed(12),
    "inset": inset(12),
    "junction": junction(12),
    "named": named(12),
}


def recycled(mesh, density, *, pinned=(), target=None, pairs=True, min_quality=0.3):
    """A mesh after recycling, and what that did."""
    movable = MovableMesh.of(mesh, Rules("recycle", min_quality, pinned))
    wanted = density_of(movable.triangulation, density).at_nodes()
    return movable, recycle_nodes(movable, wanted, target or mesh.p.shape[1], pairs)


@pytest.fixture(params=MESHES, ids=str)
def mesh(request):
    return MESHES[request.param]


def test_the_arrays_are_those_of_the_mesh_they_make(mesh):
    """Neighbours, stars, regions, chains and what nodes may do, as if found anew."""
    movable, _ = recycled(mesh, peak(mesh, 0.4, 0.9))
    again = MovableMesh.of(movable.mesh(), Rules("recycle"))
    ours, anew, constraints = movable.triangulation, again.triangulation, movable.constraints
    for e in range(len(ours.elements.node)):
        for k in range(3):
            across = ours.elements.neighbour[e, k]
            assert across < 0 or e in ours.elements.neighbour[across]
    assert edges_on_chains(ours) == edges_on_chains(anew)
    assert np.array_equal(constraints.kind, again.constraints.kind)
    assert np.array_equal(constraints.inner, again.constraints.inner)
    sliding = constraints.kind == SLIDING
    chain, table = constraints.own_chain[sliding], constraints.chains
    looked_up = table.origin[chain] + constraints.parameter[sliding, None] * table.direction[chain]
    assert_allclose(looked_up, ours.position[sliding], atol=1e-15)


def edges_on_chains(triangulation):
    """The edges on outlines, as pairs of nodes."""
    e, k = np.nonzero(triangulation.elements.chain >= 0)
    node = triangulation.elements.node
    return {frozenset(pair) for pair in zip(node[e, (k + 1) % 3].tolist(), node[e, (k + 2) % 3].tolist(), strict=True)}


def fan():
    """Three triangles from the end of a side to short edges at its beginning, too thin for a half of one to do."""
    p = np.array([[0.0, 4.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.75, 1.5, 2.25]])
    return MeshTri(p, np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4]]).T)


@pytest.mark.parametrize("pinned", [[], [3]])
def test_growth_divides_long_sides_between_elements_that_are_too_thin_to_be_halved(pinned):
    mesh = fan()
    movable, done = recycled(mesh, peak(mesh, 0.1, 0.1), target=60, pairs=False, pinned=pinned)
    made = movable.mesh()
    check_mesh(made)
    assert made.nvertices == 60 and done.collapses == 0
    assert area_of(made) == pytest.approx(area_of(mesh), rel=1e-13)
    assert ka.quality(made).min() >= 0.3
    assert np.count_nonzero(made.p[1] == 0.0) > 4
    assert np.array_equal(movable.mesh().p[:, done.old >= 0], mesh.p[:, done.old[done.old >= 0]])


def test_heaps_that_fill_up_are_filled_anew():
    """Far from Delaunay, with two nodes of high degree: one split sets off thousands of flips."""
    n = 8000
    x, i = np.linspace(1, 2, n), 2 + np.arange(n - 1)
    p = np.hstack([[[1.5], [1.0]], [[1.5], [-1.0]], [x, 0.1 * np.sin(np.pi * (x - 1))]])
    mesh = MeshTri(p, np.hstack([[0 * i, i, i + 1], [0 * i + 1, i, i + 1]]))
    density = np.where(centres(mesh)[0] < 1.1, 1.0, 1e-6)
    result = ka.relocate(mesh, density, topology="recycle", min_quality=0.0, schedule=Schedule(()))
    assert result.p.shape == mesh.p.shape
    assert area_of(result) == pytest.approx(area_of(mesh), rel=1e-12)


def test_new_nodes_on_a_slit_are_found_from_their_own_bank():
    mesh = slit(12)
    movable, done = recycled(mesh, peak(mesh, 0.55, 0.5, contrast=1e4))
    middle = centres(mesh)[1]
    chains = np.flatnonzero((done.old < 0) & (movable.mesh().p[1] == 0.5) & (movable.mesh().p[0] < 0.6))
    star = movable.triangulation.star
    above = [centres(movable.mesh())[1, star.element[star.start[v]]] > 0.5 for v in chains]
    assert len(chains) > 5
    assert [middle[done.start_element[v]] > 0.5 for v in chains] == above
