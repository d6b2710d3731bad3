"""A solution carried onto the moved mesh of tetrahedra: interpolated, and what is given stays so."""

import numpy as np
import pytest
from helpers.solids import ball, box, cut, l_shape, two_regions
from helpers.tetrahedra import fichera
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt import Ritz, Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.polishing.space.transfer_in_space import transferred_in_space
from kohonen_adapt.som.relocate import move_in_space

TOPOLOGIES = ("recycle", "flip", "fixed")


def moved_and_carried(mesh, values, fixed, topology="recycle", nodes=0):
    """A mesh that has moved towards a point, and what became of values (nnodes,) of which some are given."""
    solid = MovableSolid.of(mesh, Rules(topology, min_quality=0.1))
    functional = SolidFunctional.of(Ritz(values, fixed, 1.0), solid, mesh)
    x = solid.tetrahedralization.centroids() - solid.tetrahedralization.position.mean(axis=0) - 0.2
    moved = move_in_space(solid, 1.0 / (0.01 + (x**2).sum(axis=1)), None, topology, np.random.default_rng(0), nodes)
    return solid, moved, transferred_in_space(functional, moved.before, solid, moved.recycled.start_element)


def rim(mesh, name=None):
    """Nodes on the boundary, or on one named so, (nnodes,) bool."""
    facets = mesh.boundary_facets() if name is None else np.asarray(mesh.boundaries[name])
    return np.isin(np.arange(mesh.nvertices), mesh.facets[:, facets])


@pytest.mark.parametrize("topology", TOPOLOGIES)
@pytest.mark.parametrize("build", [box, l_shape, two_regions, cut])
def test_a_linear_function_is_carried_as_it_is(build, topology):
    """Given all around, or on one side: linear along every patch, so that nodes there have it still, to rounding."""
    mesh = build(4)
    values = 2.0 + mesh.p[0] - 3.0 * mesh.p[1] + 0.5 * mesh.p[2]
    for given in (rim, lambda of: of.p[0] == 0.0):
        solid, _, trial = moved_and_carried(mesh, values, given(mesh), topology)
        x, y, z = solid.tetrahedralization.position.T
        assert_allclose(trial.values, 2.0 + x - 3.0 * y + 0.5 * z, rtol=0.0, atol=2e-13)
        assert_array_equal(trial.fixed, given(solid.mesh()))


@pytest.mark.parametrize("given", [lambda x: np.ones(x.shape[1], dtype=bool), lambda x: x[2] == x[2].min()])
@pytest.mark.parametrize("build", [lambda: box(1), lambda: fichera(1)])
def test_new_nodes_on_faces_without_inner_nodes_are_given_between_given_nodes(build, given):
    mesh = build()
    values = 2.0 + mesh.p[0] - 3.0 * mesh.p[1] + 0.5 * mesh.p[2]
    solid, moved, trial = moved_and_carried(mesh, values, rim(mesh) & given(mesh.p), nodes=120)
    x, y, z = solid.tetrahedralization.position.T
    new = rim(solid.mesh()) & (moved.recycled.old < 0)
    assert np.count_nonzero(new) > 10
    assert_array_equal(trial.fixed[new & (z == mesh.p[2].min())], True)
    wanted = (2.0 + x - 3.0 * y + 0.5 * z)[trial.fixed]
    assert_allclose(trial.values[trial.fixed], wanted, rtol=0.0, atol=2e-13)


@pytest.mark.parametrize("topology", TOPOLOGIES)
def test_values_are_those_of_the_old_function_and_held_nodes_keep_their_own(topology):
    mesh = two_regions(4)
    values = np.random.default_rng(1).uniform(-1.0, 1.0, mesh.nvertices) * ~rim(mesh, "left")
    solid, moved, trial = moved_and_carried(mesh, values, rim(mesh, "left"), topology)
    x, number = solid.tetrahedralization.position, solid.freedom.number
    assert_allclose(trial.values, ka.interpolate(mesh, values, x.T), rtol=0.0, atol=1e-9)
    old = moved.recycled.old
    assert np.all(old[number == HELD] >= 0)
    assert_array_equal(trial.values[number == HELD], values[old[number == HELD]])
    assert np.all(trial.values[trial.fixed] == 0.0)  # to the last bit
    assert_array_equal(trial.fixed, x[:, 0] == 0.0)
    assert np.any(x[number == INSIDE] != moved.before.tetrahedralization.position[old[number == INSIDE]])


@pytest.mark.parametrize("topology", ["recycle", "flip"])
def test_on_curved_surfaces_given_constants_stay(topology):
    """Nodes there lie outside the old elements, or deep in them: values inside have no say."""
    mesh = ball(4)
    values = np.where(rim(mesh), 7.0, np.random.default_rng(0).uniform(size=mesh.nvertices))
    solid, _, trial = moved_and_carried(mesh, values, rim(mesh), topology)
    now = rim(solid.mesh())
    assert_array_equal(trial.fixed, now)
    assert_allclose(trial.values[now], 7.0, rtol=1e-14)
    assert trial.values[~now].max() < 7.0


def test_values_that_are_not_linear_stay_near_what_was_given():
    mesh = box(4)
    values = mesh.p[0] ** 2 + mesh.p[1]
    solid, _, trial = moved_and_carried(mesh, values, rim(mesh))
    x, number = solid.tetrahedralization.position, solid.freedom.number
    assert_array_equal(trial.fixed, number != INSIDE)
    assert_allclose(trial.values, x[:, 0] ** 2 + x[:, 1], atol=0.25**2 / 4 + 1e-12)  # of the chords


def test_what_is_given_inside_is_given_around_it_only():
    mesh = box(4)
    fixed = np.all(np.abs(mesh.p - 0.5) < 0.3, axis=0)
    solid, _, trial = moved_and_carried(mesh, mesh.p[0], fixed)
    assert 0 < trial.fixed.sum() < 27
    assert np.all(np.abs(solid.tetrahedralization.position[trial.fixed] - 0.5) <= 0.25 + 1e-12)


def test_bodies_that_touch_without_common_nodes_have_their_own_values():
    one = box(4)
    mesh = MeshTet(np.hstack([one.p, one.p + [[1.0], [0.0], [0.0]]]), np.hstack([one.t, one.t + one.nvertices]))
    second = np.repeat([False, True], one.nvertices)
    mesh = mesh.with_subdomains({"left": np.arange(one.nelements), "right": one.nelements + np.arange(one.nelements)})
    solid, _, trial = moved_and_carried(mesh, second.astype(float), np.zeros(len(second), dtype=bool))
    elements = solid.tetrahedralization.elements
    for region in (0, 1):
        of_part = np.unique(elements.node[elements.region == region])
        assert len(set(trial.values[of_part])) == 1
    assert set(trial.values) == {0.0, 1.0}
