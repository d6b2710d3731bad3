"""The estimators against slow twins, exact solutions and the alternatives that they are better than."""

import numpy as np
import pytest
from helpers.linear_problems import KINDS, assembled
from helpers.linear_problems import solved as solution_of
from helpers.solids import box
from helpers.tetrahedra import cut_open, generic_cube, thrown
from numpy.testing import assert_allclose
from skfem import (
    Basis,
    MeshTet,
    MeshTet2,
    MeshTri,
    MeshTri2,
)

from kohonen_adapt import estimators
from kohonen_adapt.mesh.measures import area

BOTH = pytest.mark.parametrize("estimator", [estimators.residual, estimators.recovery])
DIMENSIONS = pytest.mark.parametrize("dim", [2, 3])


def grid(*ticks):
    return (MeshTri if len(ticks) == 2 else MeshTet).init_tensor(*ticks)


def shaken(mesh, amount, seed=0, keep=None):
    """The mesh with its inner nodes moved at random, except those where `keep` holds."""
    shift = np.random.default_rng(seed).uniform(-amount, amount, mesh.p.shape)
    shift[:, mesh.boundary_nodes()] = 0.0
    if keep is not None:
        shift[:, keep(mesh.p)] = 0.0
    return MeshTri(mesh.p + shift, mesh.t)


def random_problem(dim, seed=0):
    """A small mesh with two materials, one of them magnetised, and a potential that solves nothing."""
    rng = np.random.default_rng(seed)
    plane = shaken(grid(np.linspace(0, 1, 6), np.linspace(0, 1, 5)), 0.04, seed)
    mesh = plane if dim == 2 else thrown(box(4, 3, 2), seed)
    left = mesh.p[0, mesh.t].mean(axis=0) < 0.5
    flux = np.where(left, np.array([[0.7], [-0.3], [0.4]])[:dim], 0.0)
    given = {"source": rng.normal(size=left.size), "flux": flux}
    potential, reluctivity = rng.normal(size=mesh.nvertices), np.where(left, 0.02, 1.0)
    for array in (mesh.p, mesh.t, potential, reluctivity, *given.values()):
        array.setflags(write=False)  # arguments stay as they are
    return mesh, potential, reluctivity, given


def slow_flux(mesh, potential, reluctivity, flux):
    """The slope of the function through the corners, times the reluctivity, less the flux, element by element."""
    ones = np.ones(len(mesh.t))
    slopes = [np.linalg.solve(np.column_stack((mesh.p[:, n].T, ones)), potential[n])[:-1] for n in mesh.t.T]
    return reluctivity[:, None] * np.array(slopes) - flux.T


def normal_of(corners):
    """Normal of an edge or a triangle, as long as its size."""
    along = corners[1:] - corners[0]
    return np.array([along[0, 1], -along[0, 0]]) if len(along) == 1 else np.cross(*along) / 2


def slow_residual(mesh, potential, reluctivity, source, flux):
    """The formula of the contract read aloud: the larger nu divides the jumps."""
    values, dim = slow_flux(mesh, potential, reluctivity, flux), len(mesh.p)
    squared = area(mesh) ** (1 + 2 / dim) * source**2 / reluctivity
    for facet in np.flatnonzero(mesh.f2t[1] >= 0):
        one, other = mesh.f2t[:, facet]
        normal = normal_of(mesh.p[:, mesh.facets[:, facet]].T)
        size = np.linalg.norm(normal)
        jump = (values[one] - values[other]) @ normal / size
        around = 0.5 * size ** (1 / (dim - 1)) * size * jump**2
        squared[[one, other]] += around / max(reluctivity[one], reluctivity[other])
    return np.sqrt(squared)


def slow_recovery(mesh, potential, reluctivity, flux, region):
    """Averages node by node over the elements of a region; the norm of linear functions by their mass matrix."""
    values, size = slow_flux(mesh, potential, reluctivity, flux), area(mesh)
    squared, corners = np.zeros(size.size), len(mesh.t)
    for k, nodes in enumerate(mesh.t.T):
        stars = [[e for e in np.flatnonzero(np.any(mesh.t == n, axis=0)) if region[e] == region[k]] for n in nodes]
        difference = np.array([np.average(values[star], axis=0, weights=size[star]) for star in stars]) - values[k]
        total = np.sum(difference**2) + np.sum(difference.sum(axis=0) ** 2)
        squared[k] = size[k] * total / (corners * (corners + 1)) / reluctivity[k]
    return np.sqrt(squared)


@DIMENSIONS
@pytest.mark.parametrize("seed", range(3))
def test_indicators_agree_with_their_slow_twins(dim, seed):
    mesh, potential, reluctivity, given = random_problem(dim, seed)
    fast = estimators.residual(mesh, potential, reluctivity, **given)
    assert_allclose(fast, slow_residual(mesh, potential, reluctivity, **given), rtol=1e-9)
    fast = estimators.recovery(mesh, potential, reluctivity, **given)
    wanted = slow_recovery(mesh, potential, reluctivity, given["flux"], reluctivity)
    assert_allclose(fast, wanted, rtol=1e-8)


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
        assert_allclose(estimators.recovery(mesh, u, coefficient), with_region)


def test_recovery_keeps_separate_bodies_of_one_material_apart():
    """Two iron bodies that touch in a single node: the averages there must not mix them."""
    mesh = grid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5))
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    reluctivity = np.where(x * y > 0, 0.01, 1.0)
    potential = np.random.default_rng(0).normal(size=mesh.nvertices)
    quadrant = 2 * (x > 0) + (y > 0)
    wanted = slow_recovery(mesh, potential, reluctivity, np.zeros((2, x.size)), quadrant)
    assert_allclose(estimators.recovery(mesh, potential, reluctivity), wanted, rtol=1e-10)


@BOTH
@DIMENSIONS
def test_a_flux_that_varies_and_is_met_by_the_slope_has_no_error(estimator, dim):
    """u = x . g and a flux that is linear in space: nothing jumps, but were it taken by its means it would."""
    mesh, *_ = random_problem(dim, 1)
    slope = np.random.default_rng(0).normal(size=(dim, dim))
    flux = np.einsum("cd,dik->cik", slope - np.eye(dim) * np.trace(slope) / dim, mesh.p[:, mesh.t])
    region = np.zeros(mesh.nelements, dtype=int)
    options = {"region": region} if estimator is estimators.recovery else {}
    ones, linear = np.ones(mesh.nelements), mesh.p[1] - 2 * mesh.p[-1]
    assert np.max(estimator(mesh, linear, ones, flux=flux, **options)) < 1e-12
    assert np.max(estimator(mesh, linear, ones, flux=flux.mean(axis=1), **options)) > 1e-3


@BOTH
@DIMENSIONS
def test_indicators_do_not_depend_on_numbering_or_orientation(estimator, dim):
    mesh, potential, reluctivity, given = random_problem(dim)
    rng = np.random.default_rng(5)
    node, element = rng.permutation(potential.size), rng.permutation(reluctivity.size)
    shuffled = rng.permuted(np.argsort(node)[mesh.t[:, element]], axis=0)
    other = type(mesh)(mesh.p[:, node], shuffled, sort_t=False)
    once = estimator(mesh, potential, reluctivity, **given)
    moved = {name: values[..., element] for name, values in given.items()}
    again = estimator(other, potential[node], reluctivity[element], **moved)
    assert_allclose(again, once[element], rtol=1e-10)


def test_joined_faces_jump_as_if_they_were_one():
    """The banks of a cut through a cube, joined, with the sign of antiperiodic boundaries, too."""
    mesh, parted, rng = box(4), cut_open(box(4), True), np.random.default_rng(0)
    upper = parted.p[1, parted.t].mean(axis=0) > 0.5
    potential, nu = rng.normal(size=mesh.nvertices), np.where(upper, 1.0, 0.01)
    banks = parted.facets_satisfying(lambda x: np.abs(x[1] - 0.5) < 1e-9, boundaries_only=True)
    above = upper[parted.f2t[0, banks]]
    one, other = (f[np.lexsort(parted.p[:, parted.facets[:, f]].mean(axis=1))] for f in (banks[above], banks[~above]))
    whole = estimators.residual(mesh, potential, nu)
    for sign in (1.0, -1.0):
        values = np.append(potential, potential[mesh.p[1] == 0.5])
        values[np.unique(parted.t[:, upper])] *= sign
        joined = (one, other, np.full(len(one), sign))
        assert_allclose(estimators.residual(parted, values, nu, joined=joined), whole, rtol=1e-10)


# --- effectivity -------------------------------------------------------------------------------------------------


class Interface:
    """u = sin(k y) (cosh k x + c sinh k x) with nu c continuous between iron (x < 0) and air: harmonic in both."""

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
        slope = np.zeros_like(x)
        slope[:2] = np.sin(self.wave * x[1]) * change, self.wave * np.cos(self.wave * x[1]) * along
        return slope

    def reluctivity(self, mesh):
        return np.where(mesh.p[0, mesh.t].mean(axis=0) < 0, 1.0 / self.ratio, 1.0)

    def source(self, mesh):
        return np.zeros(mesh.nelements)


class Sines:
    """u = sin(pi x) sin(pi y) ... in one material: a smooth solution with a source."""

    def exact(self, x):
        return np.prod(np.sin(np.pi * x), axis=0)

    def gradient(self, x):
        own = np.eye(len(x), dtype=bool).reshape(len(x), len(x), *[1] * (x.ndim - 1))
        return np.pi * np.prod(np.where(own, np.cos(np.pi * x), np.sin(np.pi * x)), axis=1)

    def reluctivity(self, mesh):
        return np.ones(mesh.nelements)

    def source(self, mesh):
        return len(mesh.p) * np.pi**2 * self.exact(mesh.p[:, mesh.t].mean(axis=1))


def solved(mesh, case):
    """The P1 solution with exact boundary values, by scikit-fem's own forms, and what the estimators take."""
    nu, source = case.reluctivity(mesh), case.source(mesh)
    matrix, load = assembled(mesh, nu, source, np.zeros((len(mesh.p), nu.size)))
    potential = solution_of(matrix, load, case.exact(mesh.p), mesh.boundary_nodes())
    return potential, nu, source


def true_errors(mesh, case, potential, reluctivity):
    """Energy norm of the error in every element."""
    basis = Basis(mesh, KINDS[len(mesh.p), 1](), intorder=6)
    points = np.asarray(basis.global_coordinates())
    difference = basis.interpolate(potential).grad - case.gradient(points)
    return np.sqrt(reluctivity * np.sum(np.sum(difference**2, axis=0) * basis.dx, axis=1))


def estimated(mesh, case):
    """The error, and what residual and recovery say it is, per element."""
    potential, nu, source = solved(mesh, case)
    found = (estimator(mesh, potential, nu, source=source) for estimator in (estimators.residual, estimators.recovery))
    return true_errors(mesh, case, potential, nu), *found


def interface_mesh(n=24, amount=0.2):
    mesh = grid(np.linspace(-0.5, 0.5, n + 1), np.linspace(0, 1, n + 1))
    return shaken(mesh, amount / n, keep=lambda p: np.abs(p[0]) < 1e-9)


def beside(mesh):
    """The cube with the interface in its middle."""
    return mesh.translated((-0.5, 0.0, 0.0))


NEAR = (2.7, 3.9, 0.94, 1.06)  # residual and recovery over the error, at least and at most
CASES = {
    "plane, sines, shaken": (interface_mesh(), Sines(), (3.4, 4.5, 0.95, 1.03)),
    "sines": (box(14), Sines(), NEAR),
    "harmonic": (beside(box(14)), Interface(1.0, 1.0), NEAR),
    "harmonic, bad elements": (beside(thrown(box(7), 1, worst=0.3)), Interface(1.0, 1.0), (2.7, 3.9, 0.85, 1.05)),
    "harmonic, generic": (beside(generic_cube(6, 1)), Interface(1.0, 1.0), (2.7, 5.2, 0.85, 1.05)),
    "iron": (beside(box(8)), Interface(1e4, 1e-4), (2.7, 3.9, 0.88, 1.12)),
    "error in iron": (beside(box(8)), Interface(1e4, 1.0), (2.7, 3.9, 0.88, 1.12)),
}


@pytest.mark.parametrize("name", CASES)
def test_estimates_are_near_the_error(name):
    mesh, case, (low, high, least, most) = CASES[name]
    error, residual, recovery = (np.linalg.norm(each) for each in estimated(mesh, case))
    assert low < residual / error < high
    assert least < recovery / error < most


def share_at_interface(mesh, indicators):
    touching = np.any(np.abs(mesh.p[0, mesh.t]) < 1e-9, axis=0)
    return np.sum(indicators[touching] ** 2) / np.sum(indicators**2)


@pytest.mark.parametrize("error", ["in iron", "in air"])
def test_effectivity_does_not_depend_on_the_permeability(error):
    by_residual, by_recovery = [], []
    for permeability in (1.0, 10.0, 1e2, 1e3, 1e4):
        slope = 1.0 if error == "in iron" else 1.0 / permeability
        mesh = interface_mesh()
        true, residual, recovery = estimated(mesh, Interface(permeability, slope))
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


# --- arguments --------------------------------------------------------------------------------------------------


def spoilt(array, place, value):
    array = array.copy()
    array[place] = value
    return array


@BOTH
@pytest.mark.parametrize(
    ("dim", "change", "message"),
    [
        (2, {"potential": np.zeros(40)}, r"potential must have shape \(nnodes,\) = \(30,\); got \(40,\)\."),
        (2, {"potential": 1j * np.ones(30)}, "potential must be real numbers; got complex128"),
        (2, {"reluctivity": 1.0}, r"reluctivity must have shape \(nelements,\) = \(40,\); got \(\)\."),
        (
            2,
            {"reluctivity": spoilt(np.ones(40), 3, 0.0)},
            r"reluctivity must be positive; it is not in 1 of 40 elements, .* 3",
        ),
        (2, {"flux": np.zeros((40, 2))}, r"flux must have shape \(2, nelements\) = \(2, 40\); got \(40, 2\)\."),
        (2, {"flux": spoilt(np.zeros((2, 40)), (1, 9), np.nan)}, "flux must be finite; it is not at 1 of 40 elements"),
        (3, {"flux": np.zeros((3, 3, 144))}, r"flux must have shape \(3, 4, nelements\)"),
    ],
)
def test_wrong_arguments_are_named(estimator, dim, change, message):
    mesh, potential, reluctivity, given = random_problem(dim)
    given = {"potential": potential, "reluctivity": reluctivity, **given, **change}
    with pytest.raises(ValueError, match=message):
        estimator(mesh, **given)


@BOTH
@pytest.mark.parametrize("mesh", [MeshTri2(), MeshTet2()])
def test_meshes_of_second_order_are_refused(estimator, mesh):
    with pytest.raises(ValueError, match=f"mesh must be a skfem.MeshTri or MeshTet; got {type(mesh).__name__}"):
        estimator(mesh, np.zeros(mesh.p.shape[1]), np.ones(mesh.nelements))


@BOTH
def test_one_triangle_has_nothing_to_compare(estimator):
    mesh = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]]))
    assert np.array_equal(estimator(mesh, np.array([1.0, 2.0, 5.0]), np.ones(1)), [0.0])


def test_what_needs_an_equilibrated_flux_says_what_to_take():
    mesh, potential, reluctivity, given = random_problem(3)
    calls = [
        lambda: estimators.equilibrated(mesh, potential, reluctivity, source=given["source"]),
        lambda: estimators.equilibrated_flux(mesh, potential, reluctivity, source=given["source"]),
        lambda: estimators.duality_gap(mesh, potential, np.zeros((3, 4, 144)), np.square, np.square),
    ]
    message = (
        r"^mesh must be a skfem\.MeshTri: fluxes are not equilibrated in space; got MeshTet1\. "
        r"Take estimators\.residual or estimators\.recovery\.$"
    )
    for call in calls:
        with pytest.raises(ValueError, match=message):
            call()


def test_a_goal_that_is_the_load_is_weighted_by_its_own_recovery():
    """Then both problems are one, and what elements add to the goal's error are the squares of its indicators."""
    mesh, potential, reluctivity, given = random_problem(3)
    for region in (None, np.arange(mesh.nelements) % 2):
        one = {**given, "region": region}
        both = one | {"dual_source": given["source"], "dual_flux": given["flux"]}
        wanted = estimators.recovery(mesh, potential, reluctivity, **one)
        found = estimators.goal_oriented(mesh, potential, potential, reluctivity, **both)
        assert_allclose(found, wanted, rtol=1e-9)
        error = estimators.goal_error(mesh, potential, potential, reluctivity, **both)
        assert error == pytest.approx(np.sum(wanted**2))
        back = {**both, "dual_source": -given["source"], "dual_flux": -given["flux"]}
        assert estimators.goal_error(mesh, potential, -potential, reluctivity, **back) == pytest.approx(-error)
