"""The estimators against slow twins, exact solutions and the alternatives that they are better than."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTriP0, ElementTriP1, LinearForm, MeshQuad, MeshTri, MeshTri2
from skfem.helpers import dot, grad

from kohonen_adapt import estimators
from kohonen_adapt.mesh.measures import area

BOTH = [estimators.residual, estimators.recovery]


def shaken(mesh, amount, seed=0, keep=None):
    """The mesh with its inner nodes moved at random, except those where `keep` holds."""
    shift = np.random.default_rng(seed).uniform(-amount, amount, mesh.p.shape)
    shift[:, mesh.boundary_nodes()] = 0.0
    if keep is not None:
        shift[:, keep(mesh.p)] = 0.0
    return MeshTri(mesh.p + shift, mesh.t)


def random_problem(seed=0):
    """A small mesh with two materials, one of them magnetised, and a potential that solves nothing."""
    rng = np.random.default_rng(seed)
    mesh = shaken(MeshTri.init_tensor(np.linspace(0, 1, 6), np.linspace(0, 1, 5)), 0.04, seed)
    left = mesh.p[0, mesh.t].mean(axis=0) < 0.5
    flux = np.where(left, np.array([[0.7], [-0.3]]), 0.0)
    return mesh, rng.normal(size=mesh.p.shape[1]), np.where(left, 0.02, 1.0), rng.normal(size=left.size), flux


def slow_gradient(corners, values):
    """Gradient of the plane through three points."""
    return np.linalg.solve(np.column_stack((corners, np.ones(3))), values)[:2]


def slow_flux(mesh, potential, reluctivity, flux):
    return [
        reluctivity[k] * slow_gradient(mesh.p[:, nodes].T, potential[nodes]) - flux[:, k]
        for k, nodes in enumerate(mesh.t.T)
    ]


def slow_residual(mesh, potential, reluctivity, source, flux, weight=max):
    """The formula of the contract read aloud; `weight` of (own nu, other nu) divides the jumps."""
    values = slow_flux(mesh, potential, reluctivity, flux)
    squared = area(mesh) * area(mesh) * source**2 / reluctivity
    for facet in np.flatnonzero(mesh.f2t[1] >= 0):
        one, other = mesh.f2t[:, facet]
        edge = mesh.p[:, mesh.facets[1, facet]] - mesh.p[:, mesh.facets[0, facet]]
        length = np.linalg.norm(edge)
        jump = (values[one] - values[other]) @ np.array([edge[1], -edge[0]]) / length
        for mine, its in ((one, other), (other, one)):
            squared[mine] += 0.5 * length * (length * jump**2) / weight(reluctivity[mine], reluctivity[its])
    return np.sqrt(squared)


def slow_recovery(mesh, potential, reluctivity, flux, region):
    """Averages node by node over the elements of a region; the norm by the edge midpoint rule, exact for squares."""
    values, size = slow_flux(mesh, potential, reluctivity, flux), area(mesh)
    squared = np.zeros(size.size)
    for k, nodes in enumerate(mesh.t.T):
        difference = []
        for node in nodes:
            star = [e for e in np.flatnonzero(np.any(mesh.t == node, axis=0)) if region[e] == region[k]]
            average = sum(size[e] * values[e] for e in star) / sum(size[e] for e in star)
            difference.append(average - values[k])
        middles = [(difference[i] + difference[i - 1]) / 2 for i in range(3)]
        squared[k] = size[k] / 3 * sum(middle @ middle for middle in middles) / reluctivity[k]
    return np.sqrt(squared)


@pytest.mark.parametrize("seed", range(3))
def test_residual_agrees_with_its_slow_twin(seed):
    mesh, potential, reluctivity, source, flux = random_problem(seed)
    fast = estimators.residual(mesh, potential, reluctivity, source=source, flux=flux)
    np.testing.assert_allclose(fast, slow_residual(mesh, potential, reluctivity, source, flux), rtol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_recovery_agrees_with_its_slow_twin(seed):
    mesh, potential, reluctivity, source, flux = random_problem(seed)
    fast = estimators.recovery(mesh, potential, reluctivity, source=source, flux=flux)
    np.testing.assert_allclose(fast, slow_recovery(mesh, potential, reluctivity, flux, reluctivity), rtol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_recovery_with_a_coefficient_of_every_element_averages_over_them(seed):
    """Each element alone would have the indicator 0, for instance with the secant coefficient of a law."""
    rng = np.random.default_rng(seed)
    mesh = MeshTri().refined(3)
    u, varying = rng.normal(size=mesh.nvertices), 1.0 + 1e-3 * rng.random(mesh.nelements)
    inside = mesh.p[0, mesh.t].mean(axis=0) < 0.5
    beside = np.where(inside, varying, 100.0)  # a law beside air
    for coefficient, region in ((varying, np.zeros(mesh.nelements, dtype=int)), (beside, inside.astype(int))):
        with_region = estimators.recovery(mesh, u, coefficient, region=region)
        np.testing.assert_allclose(estimators.recovery(mesh, u, coefficient), with_region)


def test_recovery_keeps_separate_bodies_of_one_material_apart():
    """Two iron bodies that touch in a single node: the averages there must not mix them."""
    mesh = MeshTri.init_tensor(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5))
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    reluctivity = np.where(x * y > 0, 0.01, 1.0)
    potential = np.random.default_rng(0).normal(size=mesh.p.shape[1])
    quadrant = 2 * (x > 0) + (y > 0)
    wanted = slow_recovery(mesh, potential, reluctivity, np.zeros((2, x.size)), quadrant)
    np.testing.assert_allclose(estimators.recovery(mesh, potential, reluctivity), wanted, rtol=1e-10)


@pytest.mark.parametrize("estimator", BOTH)
def test_a_flux_without_jumps_has_no_error(estimator):
    """Layers of iron, magnet and air in x: u piecewise linear with continuous nu du/dx - flux_x is the solution."""
    mesh = MeshTri.init_tensor(np.linspace(0, 3, 13), np.linspace(0, 1, 5))
    layer = mesh.p[0, mesh.t].mean(axis=0).astype(int)
    reluctivity, magnet = np.array([1e-3, 0.95, 1.0]), np.array([0.0, 0.8, 0.0])
    slope = (0.3 + magnet) / reluctivity
    potential = np.interp(mesh.p[0], range(4), np.concatenate(([0.0], np.cumsum(slope))))
    flux = np.stack((magnet[layer], np.zeros(layer.size)))
    assert np.max(estimator(mesh, potential, reluctivity[layer], flux=flux)) < 1e-11
    assert np.max(estimator(mesh, potential, np.ones(layer.size))) > 0.1


@pytest.mark.parametrize("estimator", BOTH)
def test_indicators_scale_as_the_energy_norm_does(estimator):
    mesh, potential, reluctivity, source, flux = random_problem()
    once = estimator(mesh, potential, reluctivity, source=source, flux=flux)
    thrice = estimator(mesh, 3 * potential, reluctivity, source=3 * source, flux=3 * flux)
    np.testing.assert_allclose(thrice, 3 * once, rtol=1e-12)
    stiffer = estimator(mesh, potential, 5 * reluctivity, source=5 * source, flux=5 * flux)
    np.testing.assert_allclose(stiffer, np.sqrt(5) * once, rtol=1e-12)
    smaller = estimator(mesh.scaled(0.1), potential, reluctivity, source=100 * source, flux=10 * flux)
    np.testing.assert_allclose(smaller, once, rtol=1e-12)


@pytest.mark.parametrize("estimator", BOTH)
def test_indicators_do_not_depend_on_numbering_or_orientation(estimator):
    mesh, potential, reluctivity, source, flux = random_problem()
    rng = np.random.default_rng(5)
    node, element = rng.permutation(potential.size), rng.permutation(source.size)
    turned = rng.permuted(np.argsort(node)[mesh.t[:, element]], axis=0)
    other = MeshTri(mesh.p[:, node], turned, sort_t=False)
    once = estimator(mesh, potential, reluctivity, source=source, flux=flux)
    again = estimator(other, potential[node], reluctivity[element], source=source[element], flux=flux[:, element])
    np.testing.assert_allclose(again, once[element], rtol=1e-10)


# --- effectivity: an interface between iron (x < 0) and air with a smooth exact solution in each -----------------


class Interface:
    """u = sin(k y) (cosh k x + c sinh k x) with nu c continuous: harmonic, and no source at the interface."""

    wave = np.pi

    def __init__(self, permeability, slope_in_air):
        self.ratio, self.slope = permeability, slope_in_air

    def parts(self, x):
        slope = self.slope * np.where(x[0] < 0, self.ratio, 1.0)
        cosh, sinh = np.cosh(self.wave * x[0]), np.sinh(self.wave * x[0])
        return cosh + slope * sinh, self.wave * (sinh + slope * cosh)

    def exact(self, x):
        return np.sin(self.wave * x[1]) * self.parts(x)[0]

    def gradient(self, x):
        along, change = self.parts(x)
        return np.stack((np.sin(self.wave * x[1]) * change, self.wave * np.cos(self.wave * x[1]) * along))

    def reluctivity(self, mesh):
        return np.where(mesh.p[0, mesh.t].mean(axis=0) < 0, 1.0 / self.ratio, 1.0)


class Waves:
    """u = sin(pi x) sin(pi y) in one material: a smooth solution with a source."""

    def exact(self, x):
        return np.sin(np.pi * x[0]) * np.sin(np.pi * x[1])

    def gradient(self, x):
        sine, cosine = np.sin(np.pi * x), np.cos(np.pi * x)
        return np.pi * np.stack((cosine[0] * sine[1], sine[0] * cosine[1]))

    def reluctivity(self, mesh):
        return np.ones(mesh.t.shape[1])

    def source(self, mesh):
        return 2 * np.pi**2 * self.exact(mesh.p[:, mesh.t].mean(axis=1))


def solved(mesh, case):
    """The P1 solution with exact boundary values, by scikit-fem's own forms."""
    basis, reluctivity = Basis(mesh, ElementTriP1()), case.reluctivity(mesh)
    constant = basis.with_element(ElementTriP0())
    matrix = BilinearForm(lambda u, v, w: w.nu * dot(grad(u), grad(v))).assemble(
        basis, nu=constant.interpolate(reluctivity)
    )
    source = case.source(mesh) if hasattr(case, "source") else np.zeros(reluctivity.size)
    load = LinearForm(lambda v, w: w.f * v).assemble(basis, f=constant.interpolate(source))
    potential, free = case.exact(mesh.p), mesh.interior_nodes()
    fixed = mesh.boundary_nodes()
    load = load[free] - matrix[free][:, fixed] @ potential[fixed]
    potential[free] = spsolve(matrix[free][:, free].tocsc(), load)
    return potential, reluctivity, source


def true_errors(mesh, case, potential, reluctivity):
    """Energy norm of the error in every element."""
    basis = Basis(mesh, ElementTriP1(), intorder=6)
    points = np.asarray(basis.global_coordinates())
    difference = basis.interpolate(potential).grad - case.gradient(points)
    return np.sqrt(reluctivity * np.sum(np.sum(difference**2, axis=0) * basis.dx, axis=1))


def interface_mesh(n=24, amount=0.2):
    mesh = MeshTri.init_tensor(np.linspace(-0.5, 0.5, n + 1), np.linspace(0, 1, n + 1))
    return shaken(mesh, amount / n, keep=lambda p: np.abs(p[0]) < 1e-9)


def share_at_interface(mesh, indicators):
    touching = np.any(np.abs(mesh.p[0, mesh.t]) < 1e-9, axis=0)
    return np.sum(indicators[touching] ** 2) / np.sum(indicators**2)


def interface_errors(permeability, slope):
    """True errors, residual and recovery indicators."""
    mesh, case = interface_mesh(), Interface(permeability, slope)
    potential, reluctivity, _ = solved(mesh, case)
    true = true_errors(mesh, case, potential, reluctivity)
    return mesh, true, *(estimator(mesh, potential, reluctivity) for estimator in BOTH)


@pytest.mark.parametrize("error", ["in iron", "in air"])
def test_effectivity_does_not_depend_on_the_permeability(error):
    by_residual, by_recovery = [], []
    for permeability in (1.0, 10.0, 1e2, 1e3, 1e4):
        slope = 1.0 if error == "in iron" else 1.0 / permeability
        mesh, true, residual, recovery = interface_errors(permeability, slope)
        by_residual.append(np.linalg.norm(residual) / np.linalg.norm(true))
        by_recovery.append(np.linalg.norm(recovery) / np.linalg.norm(true))
        share = share_at_interface(mesh, true)
        assert share < 0.035
        assert 0.7 * share < share_at_interface(mesh, residual) < 1.1 * share
        assert 0.9 * share < share_at_interface(mesh, recovery) < 1.1 * share
    assert 3.7 < min(by_residual) < max(by_residual) < 4.1
    assert max(by_residual) < 1.04 * min(by_residual)
    assert 0.96 < min(by_recovery) < max(by_recovery) < 1.01
    assert max(by_recovery) < 1.01 * min(by_recovery)


def test_the_naive_estimators_fail_at_high_permeability():
    """Jumps weighted with each element's own nu, and averages across materials, put the error at the interface."""
    mesh, case = interface_mesh(), Interface(1e4, 1e-4)
    potential, reluctivity, source = solved(mesh, case)
    true = true_errors(mesh, case, potential, reluctivity)
    empty = np.zeros((2, source.size))
    own = slow_residual(mesh, potential, reluctivity, source, empty, weight=lambda mine, its: mine)
    across = slow_recovery(mesh, potential, reluctivity, empty, np.zeros(source.size))
    for naive in (own, across):
        assert np.linalg.norm(naive) > 10 * np.linalg.norm(true)
        assert share_at_interface(mesh, naive) > 0.7
    assert share_at_interface(mesh, true) < 0.05


@pytest.mark.parametrize("amount", [0.0, 0.2])
def test_effectivity_with_a_source(amount):
    mesh, case = interface_mesh(amount=amount), Waves()
    potential, reluctivity, source = solved(mesh, case)
    true = np.linalg.norm(true_errors(mesh, case, potential, reluctivity))
    by_residual = estimators.residual(mesh, potential, reluctivity, source=source)
    assert 3.4 < np.linalg.norm(by_residual) / true < 4.5
    by_recovery = estimators.recovery(mesh, potential, reluctivity, source=source)
    assert 0.95 < np.linalg.norm(by_recovery) / true < 1.03


# --- arguments --------------------------------------------------------------------------------------------------


def spoilt(array, place, value):
    array = array.copy()
    array[place] = value
    return array


@pytest.mark.parametrize("estimator", BOTH)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"potential": np.zeros(40)}, r"potential must have shape \(nnodes,\) = \(30,\); got \(40,\)\."),
        (
            {"potential": spoilt(np.zeros(30), 7, np.nan)},
            "potential must be finite; it is not at 1 of 30 nodes, first 7",
        ),
        ({"potential": 1j * np.ones(30)}, "potential must be real numbers; got complex128"),
        ({"reluctivity": 1.0}, r"reluctivity must have shape \(nelements,\) = \(40,\); got \(\)\."),
        (
            {"reluctivity": spoilt(np.ones(40), 3, 0.0)},
            r"reluctivity must be positive; it is not in 1 of 40 elements, .* 3",
        ),
        ({"reluctivity": spoilt(np.ones(40), 3, np.inf)}, "reluctivity must be finite; it is not at 1 of 40 elements"),
        ({"source": np.zeros(30)}, r"source must have shape \(nelements,\) = \(40,\); got \(30,\)\."),
        ({"source": spoilt(np.ones(40), 3, np.nan)}, "source must be finite"),
        ({"flux": np.zeros((40, 2))}, r"flux must have shape \(2, nelements\) = \(2, 40\); got \(40, 2\)\."),
        (
            {"flux": spoilt(np.zeros((2, 40)), (1, 9), np.nan)},
            "flux must be finite; it is not at 1 of 40 elements, first 9",
        ),
    ],
)
def test_wrong_arguments_are_named(estimator, change, message):
    mesh, potential, reluctivity, source, flux = random_problem()
    given = {"potential": potential, "reluctivity": reluctivity, "source": source, "flux": flux} | change
    with pytest.raises(ValueError, match=message):
        estimator(mesh, given["potential"], given["reluctivity"], source=given["source"], flux=given["flux"])


@pytest.mark.parametrize("estimator", BOTH)
def test_other_meshes_are_refused(estimator):
    for mesh in (MeshQuad(), MeshTri2()):
        with pytest.raises(ValueError, match=f"mesh must be a skfem.MeshTri or MeshTet; got {type(mesh).__name__}"):
            estimator(mesh, np.zeros(mesh.p.shape[1]), np.ones(mesh.t.shape[1]))
    flat = MeshTri(np.array([[0.0, 1.0, 2.0, 0.0], [0.0, 0.0, 0.0, 1.0]]), np.array([[0, 0], [1, 1], [2, 3]]))
    with pytest.raises(ValueError, match="every element must have an area above zero; 1 have none"):
        estimator(flat, np.zeros(4), np.ones(2))


@pytest.mark.parametrize("estimator", BOTH)
def test_arguments_stay_as_they_are(estimator):
    mesh, potential, reluctivity, source, flux = random_problem()
    arrays = (mesh.p, mesh.t, potential, reluctivity, source, flux)
    before = [array.copy() for array in arrays]
    for array in arrays:
        array.setflags(write=False)
    first = estimator(mesh, potential, reluctivity, source=source, flux=flux)
    second = estimator(mesh, potential, reluctivity, source=source, flux=flux)
    assert np.array_equal(first, second)
    assert all(np.array_equal(old, new) for old, new in zip(before, arrays, strict=True))


@pytest.mark.parametrize("estimator", BOTH)
def test_one_triangle_has_nothing_to_compare(estimator):
    mesh = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]]))
    assert np.array_equal(estimator(mesh, np.array([1.0, 2.0, 5.0]), np.ones(1)), [0.0])
