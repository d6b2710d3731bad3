"""The equilibrated flux is in equilibrium, and its distance bounds the error: on any mesh, with any data."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.linear_problems import Linear
from helpers.meshes import comb, generic_square, holed, slit, square
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from skfem import Basis, ElementTriP1, MeshQuad, MeshTri, MeshTri2

from kohonen_adapt.estimators import equilibrated, equilibrated_flux
from kohonen_adapt.mesh.measures import area

# --- problems: a mesh, data per element, and values given on some of the boundary ---------------------------------


def ends_of(mesh, share, rng):
    """Nodes of a share of the boundary facets, chosen at random; at least one facet."""
    facets = np.flatnonzero(mesh.f2t[1] < 0)
    some = rng.random(facets.size) < share
    some[0] = True
    fixed = np.zeros(mesh.nvertices, dtype=bool)
    fixed[mesh.facets[:, facets[some]]] = True
    return fixed


def random_data(mesh, seed, share=0.5, contrast=3.0):
    """Reluctivity, source and magnetisation at random in every element, values given on some facets."""
    rng = np.random.default_rng(seed)
    count = mesh.nelements
    reluctivity = 10 ** rng.uniform(-contrast, 0, count)
    source, flux = rng.normal(size=count), rng.normal(size=(2, count))
    return Linear(mesh, rng.normal(size=mesh.nvertices), ends_of(mesh, share, rng), reluctivity, source, flux)


MESHES = {
    "generic": generic_square,
    "stretched": lambda n, seed: MeshTri(generic_square(n, seed).p * [[1.0], [0.05]], generic_square(n, seed).t),
    "holed": lambda n, seed: holed(3 * max(1, n // 3)),
    "comb": lambda n, seed: comb(5),
    "slit": lambda n, seed: slit(2 * max(2, n // 2)),
}

hostile = given(
    shape=st.sampled_from(sorted(MESHES)),
    n=st.integers(3, 8),
    seed=st.integers(0, 10**6),
    share=st.sampled_from([0.0, 0.3, 1.0]),
    contrast=st.sampled_from([0.0, 1.0, 4.0]),
)


# --- theorems about the flux -------------------------------------------------------------------------------------


def outward(mesh):
    """Outward normals times lengths of the three facets of each element in scikit-fem's order, (2, 3, nelements)."""
    start, end, third = mesh.p[:, mesh.t], mesh.p[:, mesh.t[[1, 2, 0]]], mesh.p[:, mesh.t[[2, 0, 1]]]
    normal = np.stack((end[1] - start[1], start[0] - end[0]))
    return np.where(np.sum(normal * (third - start), axis=0) < 0, normal, -normal)


def sums_at_facets(mesh, sigma):
    """Outward flux density times length, summed over the elements of every facet: at its first and its second node."""
    sums, element = np.zeros((2, mesh.facets.shape[1])), np.arange(mesh.nelements)
    for k, normal in enumerate(outward(mesh).transpose(1, 0, 2)):
        for corner in (k, (k + 1) % 3):
            second = mesh.t[corner] == mesh.facets[1, mesh.t2f[k]]
            np.add.at(sums, (second.astype(int), mesh.t2f[k]), np.sum(sigma[:, corner, element] * normal, axis=0))
    return sums


def net_outflow(mesh, sigma):
    """Integral of the divergence over every element."""
    means = (sigma + sigma[:, [1, 2, 0]]) / 2
    return np.sum(means * outward(mesh), axis=(0, 1))


@examples(60)
@hostile
def test_the_flux_is_in_equilibrium(shape, n, seed, share, contrast):
    data = random_data(MESHES[shape](n, seed), seed, share, contrast)
    mesh, sigma = data.mesh, data.sigma()
    size = np.max(np.abs(sigma[:, [0, 1, 2]] * outward(mesh)))
    assert np.max(np.abs(net_outflow(mesh, sigma) + data.source * area(mesh))) < 1e-11 * size
    sums = sums_at_facets(mesh, sigma)
    given_values = data.fixed[mesh.facets].all(axis=0) & (mesh.f2t[1] < 0)
    assert np.max(np.abs(sums[:, ~given_values])) < 1e-11 * size


@examples(60)
@hostile
def test_the_estimate_bounds_the_error(shape, n, seed, share, contrast):
    data = random_data(MESHES[shape](n, seed), seed, share, contrast)
    assert data.error(levels=1) <= np.linalg.norm(data.estimate())


def test_the_estimate_is_the_distance_of_the_flux():
    data = random_data(generic_square(6, 1), 3)
    gradients = Basis(data.mesh, ElementTriP1()).interpolate(data.potential).grad[:, :, 0]
    difference = data.sigma() - (data.reluctivity * gradients - data.flux)[:, None]
    middles = (difference + difference[:, [1, 2, 0]]) / 2
    squared = area(data.mesh) / 3 * np.sum(middles**2, axis=(0, 1)) / data.reluctivity
    assert_allclose(data.estimate() ** 2, squared, rtol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_numbering_and_orientation_do_not_matter(seed):
    data, rng = random_data(generic_square(7, seed), seed), np.random.default_rng(seed)
    mesh = data.mesh
    node, element = rng.permutation(mesh.nvertices), rng.permutation(mesh.nelements)
    turn = np.argsort(rng.random((3, element.size)), axis=0)
    turned = np.take_along_axis(np.argsort(node)[mesh.t[:, element]], turn, axis=0)
    other = MeshTri(mesh.p[:, node], turned, sort_t=False)
    again = equilibrated_flux(
        other,
        data.potential[node],
        data.reluctivity[element],
        source=data.source[element],
        flux=data.flux[:, element],
        fixed=data.fixed[node],
    )
    once = np.take_along_axis(data.sigma()[:, :, element], turn[None], axis=1)
    assert_allclose(again, once, rtol=1e-7, atol=1e-10 * np.max(np.abs(once)))


# --- effectivity -------------------------------------------------------------------------------------------------


def test_effectivity_with_a_source():
    """Each patch has the divergence of its share of the source, which is linear; its mean alone would give 1.067."""
    mesh = square(24)
    fixed, one = np.zeros(mesh.nvertices, dtype=bool), np.ones(mesh.nelements)
    fixed[mesh.boundary_nodes()] = True
    data = Linear(mesh, np.zeros(fixed.size), fixed, one, one, np.zeros((2, one.size)))
    assert 1.0 < np.linalg.norm(data.estimate()) / data.error(levels=3) < 1.06


# --- arguments ---------------------------------------------------------------------------------------------------


def refused(data, message, **change):
    given_data = {"potential": data.potential, "reluctivity": data.reluctivity, **data.arguments()} | change
    potential, reluctivity = given_data.pop("potential"), given_data.pop("reluctivity")
    for function in (equilibrated, equilibrated_flux):
        with pytest.raises(ValueError, match=message):
            function(data.mesh, potential, reluctivity, **given_data)


def test_wrong_arguments_are_named():
    data = random_data(generic_square(6, 1), 1)
    nnodes, nelements = data.fixed.size, data.source.size
    refused(data, "source must be finite", source=np.full(nelements, np.nan))
    refused(data, rf"fixed must be a mask of bool .*\({nnodes},\).*; got an array of int64", fixed=np.arange(nnodes))
    quads = MeshQuad()
    for mesh in (quads, MeshTri2()):
        with pytest.raises(ValueError, match=f"mesh must be a skfem.MeshTri; got {type(mesh).__name__}"):
            equilibrated(mesh, np.zeros(mesh.p.shape[1]), np.ones(mesh.nelements))


def test_a_potential_that_solves_nothing_is_refused():
    """The bound is a theorem about solutions: of anything else it would say nothing."""
    data = random_data(generic_square(6, 1), 1, share=1.0)
    inner = data.mesh.interior_nodes()[3]
    moved = data.potential.copy()
    moved[inner] += 0.1
    message = "must satisfy the P1 equations where no boundary value is given; it does not at .* nodes, first"
    refused(data, message, potential=moved)
    refused(data, message, source=data.source + 1.0)
    refused(data, rf"{message}.*not fixed.*Give `fixed` all nodes", fixed=np.zeros(data.fixed.size, dtype=bool))


def test_values_given_inside_are_refused():
    mesh = generic_square(6, 1)
    data = random_data(mesh, 1, share=1.0)
    inner = mesh.interior_nodes()[3]
    pinned = Linear(mesh, data.values, data.fixed | (np.arange(data.fixed.size) == inner), *data_fields(data))
    with pytest.raises(ValueError, match=f"first {inner} .fixed, but without a boundary facet of given values"):
        pinned.estimate()


def test_parts_that_hang_together_by_one_node_are_refused():
    """A crack through all of the square but its last node: P1 ties the parts there, the equation does not."""
    data = random_data(slit(2), 0, share=0.0, contrast=0.0)
    with pytest.raises(ValueError, match=r"1 of 11 nodes, first 7 .not fixed; .* hang together by a single node"):
        data.estimate()


def data_fields(data):
    return data.reluctivity, data.source, data.flux


def test_none_fixed_stands_for_the_whole_boundary():
    data = random_data(generic_square(6, 1), 1, share=1.0)
    implied = equilibrated(data.mesh, data.potential, data.reluctivity, source=data.source, flux=data.flux)
    assert np.array_equal(implied, data.estimate())


def test_one_triangle_is_exact_where_all_is_given():
    mesh = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]]))
    assert np.max(equilibrated(mesh, np.array([1.0, 2.0, 5.0]), np.ones(1))) < 1e-15
