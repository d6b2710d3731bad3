"""The estimators on tetrahedra against slow twins and exact solutions; which of them are for triangles only."""

import numpy as np
import pytest
from helpers.solids import box
from helpers.tetrahedra import REGULAR, fichera, generic_cube, lone, thrown, turned
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTetP1, LinearForm, MeshHex, MeshTet, MeshTet2, condense
from skfem.helpers import dot, grad

from kohonen_adapt import estimators
from kohonen_adapt.mesh.measures import area

BOTH = [estimators.residual, estimators.recovery]


def random_problem(seed=0):
    """A small mesh with two materials, one with a flux of its own, and a potential that solves nothing."""
    rng = np.random.default_rng(seed)
    mesh = thrown(box(4, 3, 2), seed)
    left = mesh.p[0, mesh.t].mean(axis=0) < 0.5
    flux = np.where(left, np.array([[0.7], [-0.3], [0.4]]), 0.0)
    return mesh, rng.normal(size=mesh.p.shape[1]), np.where(left, 0.02, 1.0), rng.normal(size=left.size), flux


def slow_flux(mesh, potential, reluctivity, flux):
    """The slope of the function through four points, times the reluctivity, less the flux, element by element."""
    slopes = [np.linalg.solve(np.column_stack((mesh.p[:, n].T, np.ones(4))), potential[n])[:3] for n in mesh.t.T]
    return reluctivity[:, None] * np.array(slopes) - flux.T


def slow_residual(mesh, potential, reluctivity, source, flux):
    """The formula of the docstring read aloud."""
    values = slow_flux(mesh, potential, reluctivity, flux)
    squared = np.cbrt(area(mesh)) ** 2 * area(mesh) * source**2 / reluctivity
    for facet in np.flatnonzero(mesh.f2t[1] >= 0):
        one, other = mesh.f2t[:, facet]
        a, b, c = mesh.p[:, mesh.facets[:, facet]].T
        normal, size = np.cross(b - a, c - a), np.linalg.norm(np.cross(b - a, c - a)) / 2
        jump = (values[one] - values[other]) @ normal / np.linalg.norm(normal)
        largest = max(reluctivity[one], reluctivity[other])
        for element in (one, other):
            squared[element] += 0.5 * np.sqrt(size) * size * jump**2 / largest
    return np.sqrt(squared)


def slow_recovery(mesh, potential, reluctivity, flux, region):
    """Averages node by node over the elements of a region; the norm by a rule of four points, exact for squares."""
    values, size = slow_flux(mesh, potential, reluctivity, flux), area(mesh)
    squared, far, near = np.zeros(size.size), (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
    for k, nodes in enumerate(mesh.t.T):
        difference = []
        for node in nodes:
            star = [e for e in np.flatnonzero(np.any(mesh.t == node, axis=0)) if region[e] == region[k]]
            difference.append(sum(size[e] * values[e] for e in star) / sum(size[e] for e in star) - values[k])
        share = np.full((4, 4), far) + (near - far) * np.eye(4)
        squared[k] = size[k] / 4 * np.sum((share @ np.array(difference)) ** 2) / reluctivity[k]
    return np.sqrt(squared)


@pytest.mark.parametrize("seed", range(3))
def test_indicators_agree_with_their_slow_twins(seed):
    mesh, potential, reluctivity, source, flux = random_problem(seed)
    fast = estimators.residual(mesh, potential, reluctivity, source=source, flux=flux)
    np.testing.assert_allclose(fast, slow_residual(mesh, potential, reluctivity, source, flux), rtol=1e-9)
    fast = estimators.recovery(mesh, potential, reluctivity, source=source, flux=flux)
    np.testing.assert_allclose(fast, slow_recovery(mesh, potential, reluctivity, flux, reluctivity), rtol=1e-8)


@pytest.mark.parametrize("estimator", BOTH)
def test_a_flux_without_jumps_has_no_error(estimator):
    """Layers of iron, magnet and air in x: u piecewise linear with continuous nu du/dx - flux_x is the solution."""
    mesh = MeshTet.init_tensor(np.linspace(0, 3, 7), np.linspace(0, 1, 3), np.linspace(0, 1, 3))
    layer = mesh.p[0, mesh.t].mean(axis=0).astype(int)
    reluctivity, magnet = np.array([1e-3, 0.95, 1.0]), np.array([0.0, 0.8, 0.0])
    potential = np.interp(mesh.p[0], range(4), np.concatenate(([0.0], np.cumsum((0.3 + magnet) / reluctivity))))
    flux = np.stack((magnet[layer], np.zeros(layer.size), np.zeros(layer.size)))
    assert np.max(estimator(mesh, potential, reluctivity[layer], flux=flux)) < 1e-10
    assert np.max(estimator(mesh, potential, np.ones(layer.size))) > 0.1


@pytest.mark.parametrize("estimator", BOTH)
def test_a_flux_that_varies_and_is_met_by_the_slope_has_no_error(estimator):
    """u = x . g and a flux that is linear in space: nothing jumps, but were it taken by its means it would."""
    mesh = thrown(box(3), 1)
    slope = np.random.default_rng(0).normal(size=(3, 3))
    flux = np.einsum("cd,dik->cik", slope, mesh.p[:, mesh.t])
    region = np.zeros(mesh.nelements, dtype=int)
    options = {"region": region} if estimator is estimators.recovery else {}
    ones, linear = np.ones(mesh.nelements), mesh.p[1] - 2 * mesh.p[2]
    assert np.max(estimator(mesh, linear, ones, flux=flux, **options)) < 1e-12
    assert np.max(estimator(mesh, linear, ones, flux=flux.mean(axis=1), **options)) > 1e-3


@pytest.mark.parametrize("estimator", BOTH)
def test_indicators_scale_as_the_energy_norm_does(estimator):
    mesh, potential, reluctivity, source, flux = random_problem()
    once = estimator(mesh, potential, reluctivity, source=source, flux=flux)
    thrice = estimator(mesh, 3 * potential, reluctivity, source=3 * source, flux=3 * flux)
    np.testing.assert_allclose(thrice, 3 * once, rtol=1e-12)
    stiffer = estimator(mesh, potential, 5 * reluctivity, source=5 * source, flux=5 * flux)
    np.testing.assert_allclose(stiffer, np.sqrt(5) * once, rtol=1e-12)
    smaller = estimator(mesh.scaled(0.1), potential, reluctivity, source=100 * source, flux=10 * flux)
    np.testing.assert_allclose(smaller, np.sqrt(0.1) * once, rtol=1e-11)


@pytest.mark.parametrize("estimator", BOTH)
def test_indicators_do_not_depend_on_numbering_or_orientation(estimator):
    mesh, potential, reluctivity, source, flux = random_problem()
    rng = np.random.default_rng(1)
    element = rng.permutation(mesh.nelements)
    t = rng.permuted(mesh.t[:, element], axis=0)
    other = estimator(
        MeshTet(mesh.p, t, sort_t=False), potential, reluctivity[element], source=source[element], flux=flux[:, element]
    )
    once = estimator(mesh, potential, reluctivity, source=source, flux=flux)
    np.testing.assert_allclose(other, once[element], rtol=1e-11)


def test_joined_faces_jump_as_if_they_were_one():
    """The banks of a cut through a cube, joined, with the sign of antiperiodic boundaries, too."""
    mesh, rng = box(4), np.random.default_rng(0)
    wall = np.flatnonzero(mesh.p[0] == 0.5)
    twin = np.arange(mesh.p.shape[1])
    twin[wall] = mesh.p.shape[1] + np.arange(len(wall))
    right = mesh.p[0, mesh.t].mean(axis=0) > 0.5
    parted = MeshTet(np.hstack([mesh.p, mesh.p[:, wall]]), np.where(right, twin[mesh.t], mesh.t), sort_t=False)
    potential, nu = rng.normal(size=mesh.p.shape[1]), np.where(right, 1.0, 0.01)
    banks = parted.facets_satisfying(lambda x: np.abs(x[0] - 0.5) < 1e-9, boundaries_only=True)
    on_right = parted.p[0, parted.t[:, parted.f2t[0, banks]]].mean(axis=0) > 0.5
    one, other = banks[on_right], banks[~on_right]
    one, other = (f[np.lexsort(parted.p[:, parted.facets[:, f]].mean(axis=1))] for f in (one, other))
    whole = estimators.residual(mesh, potential, nu)
    for sign in (1.0, -1.0):
        values = np.append(potential, potential[wall])
        values[np.unique(parted.t[:, right])] *= sign
        joined = (one, other, np.full(len(one), sign))
        np.testing.assert_allclose(estimators.residual(parted, values, nu, joined=joined), whole, rtol=1e-10)


def solved(mesh, value, source, nu):
    """The P1 solution of ``-div nu grad u = source`` with these values on the boundary."""
    basis = Basis(mesh, ElementTetP1(), intorder=4)
    stiffness = BilinearForm(lambda u, v, w: w["nu"] * dot(grad(u), grad(v))).assemble(basis, nu=nu[:, None])
    load = LinearForm(lambda v, w: source(w.x) * v).assemble(basis)
    matrix, right, found, free = condense(stiffness, load, x=value(mesh.p), D=mesh.boundary_nodes())
    found[free] = spsolve(matrix.tocsc(), right)
    return basis, found


def energy_error(basis, found, slope, nu):
    """The energy norm of the error per element."""
    difference = basis.interpolate(found).grad - slope(basis.global_coordinates())
    return np.sqrt(nu * np.sum(np.sum(difference**2, axis=0) * basis.dx, axis=1))


def sine(x):
    return np.sin(np.pi * x)


def cosine(x):
    return np.cos(np.pi * x)


SINES = (
    lambda x: sine(x[0]) * sine(x[1]) * sine(x[2]),
    lambda x: np.pi * np.stack([np.prod([(cosine if i == j else sine)(x[j]) for j in range(3)], 0) for i in range(3)]),
    lambda x: 3 * np.pi**2 * sine(x[0]) * sine(x[1]) * sine(x[2]),
)
WAVE = (  # harmonic, and steep where x is large
    lambda x: np.exp(3 * x[0]) * np.sin(3 * x[1]) + x[2] ** 2 - x[1] ** 2,
    lambda x: np.stack(
        [3 * np.exp(3 * x[0]) * np.sin(3 * x[1]), 3 * np.exp(3 * x[0]) * np.cos(3 * x[1]) - 2 * x[1], 2 * x[2]]
    ),
    lambda x: 0.0 * x[0],
)


def estimates(mesh, problem):
    """Error in the energy norm, and what the residual and the recovery say it is."""
    value, slope, source = problem
    ones = np.ones(mesh.nelements)
    basis, found = solved(mesh, value, source, ones)
    load = source(mesh.p[:, mesh.t].mean(axis=1))
    return [
        np.linalg.norm(each)
        for each in (
            energy_error(basis, found, slope, ones),
            estimators.residual(mesh, found, ones, source=load),
            estimators.recovery(mesh, found, ones, source=load),
        )
    ]


@pytest.mark.parametrize("problem", [SINES, WAVE], ids=["sines", "wave"])
def test_estimates_fall_as_the_error_does_and_stay_near_it(problem):
    """Of order 1 in the width of the mesh; the residual within 2.7 to 3.9 of the error, the recovery within 6 %."""
    total = np.array([estimates(box(n), problem) for n in (7, 14)])
    rate = np.log2(total[0] / total[1])
    assert np.all((rate > 0.9) & (rate < 1.1))
    assert 2.7 < total[1, 1] / total[1, 0] < 3.9
    assert total[1, 2] / total[1, 0] == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize(("mesh", "most"), [(thrown(box(7), 1, worst=0.3), 3.9), (generic_cube(6, 1), 5.2)])
def test_bad_elements_change_the_effectivity_little(mesh, most):
    error, residual, recovery = estimates(mesh, WAVE)
    assert 2.7 < residual / error < most
    assert 0.85 < recovery / error < 1.05


@pytest.mark.parametrize("ratio", [1e-4, 1.0, 1e4])
def test_the_effectivity_does_not_depend_on_the_ratio_of_materials(ratio):
    """u = r(x) w(y, z) with nu r' continuous in the middle plane, where the reluctivity changes by the ratio."""
    mesh = box(8)
    left = mesh.p[0, mesh.t].mean(axis=0) < 0.5
    nu = np.where(left, ratio, 1.0)
    value = lambda x: np.sin(2 * np.pi * x[0]) * sine(x[1]) * sine(x[2]) / np.where(x[0] < 0.5, ratio, 1.0)  # noqa: E731
    scale = lambda x: 1.0 / np.where(x[0] < 0.5, ratio, 1.0)  # noqa: E731
    slope = lambda x: np.pi * scale(x) * np.stack(  # noqa: E731
        [
            2 * np.cos(2 * np.pi * x[0]) * sine(x[1]) * sine(x[2]),
            np.sin(2 * np.pi * x[0]) * cosine(x[1]) * sine(x[2]),
            np.sin(2 * np.pi * x[0]) * sine(x[1]) * cosine(x[2]),
        ]
    )  # fmt: skip
    source = lambda x: 6 * np.pi**2 * np.sin(2 * np.pi * x[0]) * sine(x[1]) * sine(x[2])  # noqa: E731
    basis, found = solved(mesh, value, source, nu)
    error = np.linalg.norm(energy_error(basis, found, slope, nu))
    load = source(mesh.p[:, mesh.t].mean(axis=1))
    assert 2.7 < np.linalg.norm(estimators.residual(mesh, found, nu, source=load)) / error < 3.9
    assert np.linalg.norm(estimators.recovery(mesh, found, nu, source=load)) / error == pytest.approx(1.0, abs=0.12)


def test_the_largest_indicators_are_where_the_solution_is_not_smooth():
    """At the edges that run into the corner of Fichera's cube."""
    mesh = turned(fichera(4), 0)
    ones = np.ones(mesh.nelements)
    _, found = solved(mesh, lambda x: 0.0 * x[0], lambda x: 1.0 + 0.0 * x[0], ones)
    for indicators in (estimators.residual(mesh, found, ones, source=ones), estimators.recovery(mesh, found, ones)):
        middle = mesh.p[:, mesh.t[:, np.argsort(indicators)[-12:]]].mean(axis=1)
        assert np.all(np.sort(np.abs(middle), axis=0)[1] < 0.25)


@pytest.mark.parametrize("estimator", BOTH)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"potential": np.ones(3)}, r"potential must have shape \(nnodes,\)"),
        ({"flux": np.zeros((2, 144))}, r"flux must have shape \(3, nelements\)"),
        ({"flux": np.zeros((3, 3, 144))}, r"flux must have shape \(3, 4, nelements\)"),
        ({"source": np.full(144, np.nan)}, "source must be finite"),
        ({"reluctivity": np.zeros(144)}, "reluctivity must be positive"),
    ],
)
def test_wrong_arguments_are_named(estimator, change, message):
    mesh, potential, reluctivity, source, flux = random_problem()
    given = {"potential": potential, "reluctivity": reluctivity, "source": source, "flux": flux} | change
    with pytest.raises(ValueError, match=message):
        estimator(mesh, given["potential"], given["reluctivity"], source=given["source"], flux=given["flux"])


@pytest.mark.parametrize("estimator", BOTH)
def test_other_meshes_are_refused(estimator):
    for mesh in (MeshHex(), MeshTet2()):
        with pytest.raises(ValueError, match=f"mesh must be a skfem.MeshTri or MeshTet; got {type(mesh).__name__}"):
            estimator(mesh, np.zeros(mesh.p.shape[1]), np.ones(mesh.t.shape[1]))
    flat = lone(REGULAR * [[1.0], [1.0], [0.0]])
    with pytest.raises(ValueError, match="every element must have a volume above zero; 1 have none"):
        estimator(flat, np.zeros(4), np.ones(1))


def test_what_needs_an_equilibrated_flux_says_what_to_take():
    mesh, potential, reluctivity, source, _ = random_problem()
    given = (mesh, potential, reluctivity)
    calls = [
        lambda: estimators.equilibrated(*given, source=source),
        lambda: estimators.equilibrated_flux(*given, source=source),
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
    mesh, potential, reluctivity, source, flux = random_problem()
    number = np.arange(mesh.nelements) % 2
    for region in (None, number):
        one = {"source": source, "flux": flux, "region": region}
        both = one | {"dual_source": source, "dual_flux": flux}
        wanted = estimators.recovery(mesh, potential, reluctivity, **one)
        found = estimators.goal_oriented(mesh, potential, potential, reluctivity, **both)
        np.testing.assert_allclose(found, wanted, rtol=1e-9)
        error = estimators.goal_error(mesh, potential, potential, reluctivity, **both)
        assert error == pytest.approx(np.sum(wanted**2))
        back = {**both, "dual_source": -source, "dual_flux": -flux}
        assert estimators.goal_error(mesh, potential, -potential, reluctivity, **back) == pytest.approx(-error)
