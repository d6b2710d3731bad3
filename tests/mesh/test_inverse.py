"""Points between bent sides and their chords are found in the element that the sides are of, and values there."""

import numpy as np
import pytest
from helpers.meshes import disk, square
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.curved import corners_of, midside_offsets, with_midside_offsets
from kohonen_adapt.mesh.validity import check_mesh


def wavy(n, size, seed=0):
    """A square with every side bent, those of the rim too."""
    mesh = square(n)
    off = size / n * np.random.default_rng(seed).uniform(-1.0, 1.0, (2, mesh.facets.shape[1]))
    return with_midside_offsets(mesh, off)


def hexagon():
    mesh = disk(1, 2.0)
    return mesh.with_boundaries({"rim": mesh.boundary_facets()})


MESHES = {
    "disk": lambda: MovableMesh.of(disk(3, 1.0), Rules(), curved=True).mesh(),
    "six sides": lambda: MovableMesh.of(hexagon(), Rules(curves={"rim": ka.Arc((0.0, 0.0), 2.0)}), curved=True).mesh(),
    "wavy": lambda: wavy(6, 0.08),
}


def at_shares(mesh, element, shares):
    """Where the shares (k, 3) of elements (k,) are, (2, k)."""
    i, j = [1, 2, 0], [2, 0, 1]
    bows = 4.0 * np.einsum("ki,dik->dk", shares[:, i] * shares[:, j], midside_offsets(mesh)[:, :, element])
    return np.einsum("ki,dik->dk", shares, mesh.p[:, mesh.t[:, element]]) + bows


def drawn(mesh, count=4000, seed=0):
    rng = np.random.default_rng(seed)
    return rng.integers(0, mesh.nelements, count), rng.dirichlet(np.full(3, 0.6), count)


@pytest.mark.parametrize("name", MESHES)
def test_every_point_is_found_where_it_was_mapped_to(name):
    mesh = MESHES[name]()
    check_mesh(mesh, curved=True)
    element, shares = drawn(mesh)
    inside = shares.min(axis=1) > 1e-7
    x = at_shares(mesh, element, shares)
    found = ka.find_elements(mesh, x)
    assert found.dtype == np.int32
    assert_array_equal(found[inside], element[inside])
    assert np.any(ka.find_elements(corners_of(mesh), x) != found)
    values = np.random.default_rng(1).random(mesh.nvertices)
    expected = np.sum(shares * values[mesh.t[:, element]].T, axis=1)
    assert_allclose(ka.interpolate(mesh, values, x)[inside], expected[inside], atol=1e-9)


def test_what_lies_beyond_a_bent_rim_is_outside():
    """Between chord and arc is inside where the rim bulges, outside where it is bent inwards."""
    mesh = MESHES["disk"]()
    angle = np.linspace(0.0, 2.0 * np.pi, 500)
    for radius, inside in ((1.0 - 1e-3, True), (1.0 + 1e-3, False), (1.2, False)):
        x = radius * np.stack([np.cos(angle), np.sin(angle)])
        assert np.all((ka.find_elements(mesh, x) >= 0) == inside)
        assert np.all(np.isfinite(ka.interpolate(mesh, np.ones(mesh.nvertices), x)) == inside)
