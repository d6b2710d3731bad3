"""A solution carried onto the moved mesh of tetrahedra: interpolated, and what is given stays so."""

import numpy as np
import pytest
from helpers.solids import box, cut, l_shape, two_regions
from numpy.testing import assert_allclose, assert_array_equal

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
