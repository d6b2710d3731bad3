"""The equilibrated flux is in equilibrium, and its distance bounds the error: on any mesh, with any data."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import comb, generic_square, holed, inset, slit, square
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTriP0, ElementTriP1, LinearForm, MeshQuad, MeshTri, MeshTri2
from skfem.helpers import dot, grad

from kohonen_adapt.estimators import equilibrated, equilibrated_flux
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.mesh.measures import area

# --- problems: a mesh, data per element, and values given on some of the boundary ---------------------------------


class Data:
    """A problem on a mesh and its P1 solution, by scikit-fem's own forms."""

    def __init__(self, mesh, values, fixed, reluctivity, source, flux):
        self.mesh, self.fixed, self.reluctivity, self.source, self.flux = mesh, fixed, reluctivity, source, flux
        self.values = values
        self.potential = self.solved()

    def solved(self):
        basis = Basis(self.mesh, ElementTriP1())
        constant = basis.with_element(ElementTriP0())
        self.matrix = BilinearForm(lambda u, v, w: w.nu * dot(grad(u), grad(v))).assemble(
            basis, nu=constant.interpolate(self.reluctivity)
        )
        fields = {"f": self.source, "gx": self.flux[0], "gy": self.flux[1]}
        load = LinearForm(lambda v, w: w.f * v + w.gx * grad(v)[0] + w.gy * grad(v)[1]).assemble(
            basis, **{name: constant.interpolate(field) for name, field in fields.items()}
        )
        potential, free = np.where(self.fixed, self.values, 0.0), ~self.fixed
        load = (load - self.matrix @ potential)[free]
        potential[free] = spsolve(self.matrix[free][:, free].tocsc(), load)
        return potential

    def refined(self):
        """The same problem, each element cut in four; given values are linear along the old facets."""
        fixed = self.fixed[self.mesh.facets].all(axis=0) & (self.mesh.f2t[1] < 0)
        return Data(
            self.mesh.refined(),
            self.onto_refined(self.values),
            np.concatenate((self.fixed, fixed)),
            np.tile(self.reluctivity, 4),
            np.tile(self.source, 4),
            np.tile(self.flux, 4),
        )

    def onto_refined(self, nodal):
        return np.concatenate((nodal, nodal[self.mesh.facets].mean(axis=0)))

    def error(self, levels=2):
        """Distance to the solution on finer meshes: below the error, and the nearer to it the more levels."""
        potential, finer = self.potential, self
        for _ in range(levels):
            potential, finer = finer.onto_refined(potential), finer.refined()
        difference = finer.potential - potential
        return np.sqrt(difference @ finer.matrix @ difference)

    def arguments(self):
        return {"source": self.source, "flux": self.flux, "fixed": self.fixed}

    def estimate(self):
        return equilibrated(self.mesh, self.potential, self.reluctivity, **self.arguments())

    def sigma(self):
        return equilibrated_flux(self.mesh, self.potential, self.reluctivity, **self.arguments())


def ends_of(mesh, share, rng):
    """Nodes of a share of the boundary facets, chosen at random; at least one facet."""
    facets = np.flatnonzero(mesh.f2t[1] < 0)
    some = rng.random(facets.size) < share
    some[0] = True
    fixed = np.zeros(mesh.p.shape[1], dtype=bool)
    fixed[mesh.facets[:, facets[some]]] = True
    return fixed


def random_data(mesh, seed, share=0.5, contrast=3.0):
    """Reluctivity, source and magnetisation at random in every element, values given on some facets."""
    rng = np.random.default_rng(seed)
    count = mesh.t.shape[1]
    reluctivity = 10 ** rng.uniform(-contrast, 0, count)
    source, flux = rng.normal(size=count), rng.normal(size=(2, count))
    return Data(mesh, rng.normal(size=mesh.p.shape[1]), ends_of(mesh, share, rng), reluctivity, source, flux)


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
    sums, element = np.zeros((2, mesh.facets.shape[1])), np.arange(mesh.t.shape[1])
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


def test_a_flux_in_equilibrium_is_left_alone():
    """Layers of iron, magnet and air with continuous nu du/dx - flux_x, natural conditions above and below."""
    mesh = MeshTri.init_tensor(np.linspace(0, 3, 13), np.linspace(0, 1, 5))
    layer = mesh.p[0, mesh.t].mean(axis=0).astype(int)
    reluctivity, magnet = np.array([1e-3, 0.95, 1.0]), np.array([0.0, 0.8, 0.0])
    slope = (0.3 + magnet) / reluctivity
    potential = np.interp(mesh.p[0], range(4), np.concatenate(([0.0], np.cumsum(slope))))
    flux = np.stack((magnet[layer], np.zeros(layer.size)))
    fixed = (mesh.p[0] == 0) | (mesh.p[0] == 3)
    assert np.max(equilibrated(mesh, potential, reluctivity[layer], flux=flux, fixed=fixed)) < 1e-10
    sigma = equilibrated_flux(mesh, potential, reluctivity[layer], flux=flux, fixed=fixed)
    assert_allclose(sigma, np.broadcast_to([[[0.3]], [[0.0]]], sigma.shape), atol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_numbering_and_orientation_do_not_matter(seed):
    data, rng = random_data(generic_square(7, seed), seed), np.random.default_rng(seed)
    mesh = data.mesh
    node, element = rng.permutation(mesh.p.shape[1]), rng.permutation(mesh.t.shape[1])
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


def test_indicators_scale_as_the_energy_norm_does():
    data = random_data(generic_square(6, 2), 2)
    mesh, once, fixed = data.mesh, data.estimate(), data.fixed
    nu, source, flux = data.reluctivity, data.source, data.flux
    thrice = equilibrated(mesh, 3 * data.potential, nu, source=3 * source, flux=3 * flux, fixed=fixed)
    assert_allclose(thrice, 3 * once, rtol=1e-9)
    stiffer = equilibrated(mesh, data.potential, 5 * nu, source=5 * source, flux=5 * flux, fixed=fixed)
    assert_allclose(stiffer, np.sqrt(5) * once, rtol=1e-9)
    smaller = mesh.scaled(0.1)
    small = equilibrated(smaller, data.potential, nu, source=100 * source, flux=10 * flux, fixed=fixed)
    assert_allclose(small, once, rtol=1e-9)


# --- effectivity -------------------------------------------------------------------------------------------------


def test_effectivity_with_a_source():
    """Each patch has the divergence of its share of the source, which is linear; its mean alone would give 1.067."""
    mesh = square(24)
    fixed, one = np.zeros(mesh.p.shape[1], dtype=bool), np.ones(mesh.t.shape[1])
    fixed[mesh.boundary_nodes()] = True
    data = Data(mesh, np.zeros(fixed.size), fixed, one, one, np.zeros((2, one.size)))
    assert 1.0 < np.linalg.norm(data.estimate()) / data.error(levels=3) < 1.06


@pytest.mark.parametrize("seed", range(2))
def test_effectivity_on_random_meshes(seed):
    """Iron beside air with a source, slivers on both sides, the natural condition on one side and values on three."""
    half = generic_square(10, seed)
    mesh = half + MeshTri(half.p * [[-1.0], [1.0]], half.t)
    iron = mesh.p[0, mesh.t].mean(axis=0) < 0
    reluctivity, source = np.where(iron, 1e-3, 1.0), np.where(iron, 0.0, 1.0)
    fixed = (mesh.p[0] == -1) | (mesh.p[1] == 0) | (mesh.p[1] == 1)
    data = Data(mesh, np.zeros(fixed.size), fixed, reluctivity, source, np.zeros((2, iron.size)))
    assert 1.0 < np.linalg.norm(data.estimate()) / data.error(levels=3) < 1.15


@pytest.mark.parametrize("permeability", [1.0, 1e3])
def test_magnetostatics_bounds_with_natural_boundaries(permeability):
    """Potential given left and right, flux across the other two sides: the refined meshes show the error."""
    mesh = inset(16).with_boundaries({"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 1 - 1e-9})
    magnet = Material(permeability=permeability, remanence=(0.3, 1.0))
    potential = {"left": 0.0, "right": 0.2}
    problem = Magnetostatics({"core": magnet, "air": Material()}, potential=potential, estimator="equilibrated")
    field, fine = problem.solve(mesh), mesh.refined(3)
    finest = problem.solve(fine)
    # Both have the same given values: the functional of each lies above the minimum by half its error squared.
    above = 2 * (functional(problem, mesh, field) - functional(problem, fine, finest))
    assert 1.0 < np.linalg.norm(problem.indicators(mesh, field)) / np.sqrt(above) < 1.3


def functional(problem, mesh, field):
    """What the potential minimises: int nu |B|^2 / 2 - nu B . Br."""
    magnets = np.sum(area(mesh) * field.reluctivity * field.flux_density * field.remanence)
    return 0.5 * problem.energy_norm(mesh, field) ** 2 - magnets


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
    refused(data, rf"potential must have shape \(nnodes,\) = \({nnodes},\); got \(3,\)\.", potential=np.zeros(3))
    refused(data, "reluctivity must be positive; it is not in", reluctivity=np.zeros(nelements))
    refused(data, "source must be finite", source=np.full(nelements, np.nan))
    refused(data, r"flux must have shape \(2, nelements\)", flux=data.flux.T)
    refused(data, rf"fixed must be a mask of bool .*\({nnodes},\).*; got an array of int64", fixed=np.arange(nnodes))
    refused(data, r"fixed must be a mask of bool .* of shape \(3,\)", fixed=np.ones(3, dtype=bool))
    quads = MeshQuad()
    for mesh in (quads, MeshTri2()):
        with pytest.raises(ValueError, match=f"mesh must be a skfem.MeshTri; got {type(mesh).__name__}"):
            equilibrated(mesh, np.zeros(mesh.p.shape[1]), np.ones(mesh.t.shape[1]))


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
    pinned = Data(mesh, data.values, data.fixed | (np.arange(data.fixed.size) == inner), *data_fields(data))
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


def test_arguments_stay_as_they_are():
    data = random_data(generic_square(6, 1), 1)
    arrays = (data.mesh.p, data.mesh.t, data.potential, data.reluctivity, data.source, data.flux, data.fixed)
    before = [array.copy() for array in arrays]
    for array in arrays:
        array.setflags(write=False)
    assert np.array_equal(data.estimate(), data.estimate())
    assert all(np.array_equal(old, new) for old, new in zip(before, arrays, strict=True))


def test_one_triangle_is_exact_where_all_is_given():
    mesh = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]]))
    assert np.max(equilibrated(mesh, np.array([1.0, 2.0, 5.0]), np.ones(1))) < 1e-15
