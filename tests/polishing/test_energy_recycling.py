"""Recycling by energy: a functional that falls as told, arrays of the mesh that is made, and what is kept."""

import numpy as np
import pytest
from helpers.descents import Start
from helpers.meshes import generic_square, inset, junction, named, perturbed, slit, square
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import SLIDING
from kohonen_adapt.magnetostatics import Brauer, Froehlich
from kohonen_adapt.mesh.triangulation import Triangulation

LAWS = {"none": None, "Brauer": Brauer(100.0, 10.0, 1.8), "Froehlich": Froehlich(4000.0, 2.1)}
MESHES = {
    "squares": square(6),
    "generic": generic_square(6, 3),
    "regions": perturbed(inset(8), 3),
    "junction": perturbed(junction(6), 3),
    "slit": perturbed(slit(6), 3),
    "named": perturbed(named(8), 3),
}


def bumps_on(mesh, law=None, seed=3):
    """A bump whose functional changes from region to region, given at the left and the right end."""
    rng, (x, y), region = np.random.default_rng(seed), mesh.p, Triangulation.of(mesh).elements.region
    count, ends, scale = region.max() + 1, (x == x.min()) | (x == x.max()), 1e3 if law else 1.0
    values = np.exp(-30.0 * ((x - rng.random()) ** 2 + (y - rng.random()) ** 2)) + 0.01 * rng.normal(size=len(x))
    constants = 10.0 ** rng.uniform(-1, 1, count), rng.normal(size=count), rng.normal(size=(2, count))
    laws = [law if number % 2 == 0 else None for number in range(count)] if law else ()
    return ka.Ritz(np.where(ends, x, values), ends, *(scale * each for each in constants), region, laws)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", MESHES)
def test_the_functional_falls_by_what_is_told_and_the_arrays_are_those_of_the_mesh(name, law):
    mesh = MESHES[name]
    at = Start.of(mesh, bumps_on(mesh, LAWS[law]))
    for _ in range(2):
        before = at.value()
        told = at.recycle()
        assert told >= 0.0
        # tables of laws leave out 1e-10 of an energy
        near = (1e-9 if LAWS[law] else 1e-11) * abs(before)
        assert before - at.value() == pytest.approx(told, rel=1e-8, abs=near)
    after, ours, recycled = at.movable.mesh(), at.movable, at.recycled
    assert recycled.splits == recycled.collapses > 3 and after.p.shape == mesh.p.shape
    kept = recycled.old >= 0
    assert np.array_equal(after.p[:, kept], mesh.p[:, recycled.old[kept]])
    assert np.count_nonzero(~kept) <= recycled.splits
    assert np.array_equal(at.trial.values[at.trial.fixed], after.p[0, at.trial.fixed])
    again = MovableMesh.of(after, Rules("recycle"))
    for e, k in np.argwhere(ours.triangulation.elements.neighbour >= 0):
        assert e in ours.triangulation.elements.neighbour[ours.triangulation.elements.neighbour[e, k]]
    assert np.array_equal(ours.constraints.kind, again.constraints.kind)
    assert np.array_equal(ours.constraints.inner, again.constraints.inner)
    sliding = ours.constraints.kind == SLIDING
    chain, table = ours.constraints.own_chain[sliding], ours.constraints.chains
    looked_up = table.origin[chain] + ours.constraints.parameter[sliding, None] * table.direction[chain]
    assert_allclose(looked_up, ours.triangulation.position[sliding], atol=1e-15)
