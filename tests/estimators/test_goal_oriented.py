"""Goal-oriented indicators and errors of elements of order 1 to 3: theorems, rates and effectivity."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.linear_problems import Linear, assembled, basis_of, rim_of, solved
from helpers.meshes import generic_square
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from skfem import MeshTri, MeshTri2

from kohonen_adapt.estimators import goal_error, goal_oriented
from kohonen_adapt.mesh.curved import refined
from kohonen_adapt.mesh.measures import area, gradient


def bent_square(n, seed):
    """A square of random triangles whose sides inside are parabolas."""
    mesh, rng = generic_square(n, seed), np.random.default_rng(seed)
    middles = mesh.p[:, mesh.facets].mean(axis=1)
    off = rng.uniform(-0.01, 0.01, middles.shape) * np.hypot(*np.diff(mesh.p[:, mesh.facets], axis=1)[:, 0])
    return MeshTri2(np.hstack([mesh.p, middles + np.where(mesh.f2t[1] >= 0, off, 0.0)]), mesh.t)


class Pair:
    """A problem and a dual on one mesh, with values given on the whole rim."""

    def __init__(self, primal, dual):
        self.mesh, self.primal, self.dual = primal.mesh, primal, dual

    @classmethod
    def random(cls, mesh, seed, flux=()):
        """Data of every element, the flux constant or with values of this shape, and values on the rim of the first."""
        rng, count = np.random.default_rng(seed), mesh.nelements
        reluctivity = 10 ** rng.uniform(-2, 0, count)
        data = [(reluctivity, rng.normal(size=count), rng.normal(size=(2, *flux, count))) for _ in range(2)]
        values = rng.normal(size=mesh.nvertices), np.zeros(mesh.nvertices)
        return cls(*(Linear(mesh, v, rim_of(mesh), *each) for v, each in zip(values, data, strict=True)))

    def at(self, order):
        return Pair(self.primal.at(order), self.dual.at(order))

    def refined(self):
        return Pair(self.primal.refined(), self.dual.refined())

    def goal(self):
        return self.dual.load @ self.primal.potential

    def arguments(self, factor=1.0):
        names = {"source": self.primal.source, "flux": self.primal.flux}
        names |= {"dual_source": factor * self.dual.source, "dual_flux": factor * self.dual.flux}
        return (self.mesh, self.primal.potential, factor * self.dual.potential, self.primal.reluctivity), names

    def estimates(self):
        """Equilibrated estimates of the primal and of the dual problem."""
        return [np.linalg.norm(each.estimate()) for each in (self.primal, self.dual)]

    def products(self):
        """What each element adds to the product of both corrections ``sigma* - sigma_h``, by their corners."""
        one, other = (
            each.sigma() - (each.reluctivity * gradient(self.mesh, each.potential) - each.flux)[:, None]
            for each in (self.primal, self.dual)
        )
        product = np.sum(one * other, axis=(0, 1)) + np.sum(one.sum(axis=1) * other.sum(axis=1), axis=0)
        return area(self.mesh) / 12.0 * product / self.primal.reluctivity

    def error(self):
        values, names = self.arguments()
        return goal_error(*values, **names)

    def indicators(self, factor=1.0):
        values, names = self.arguments(factor)
        return goal_oriented(*values, **names)


# --- theorems of order 1 -----------------------------------------------------------------------------------------


@examples(40)
@given(n=st.integers(3, 8), seed=st.integers(0, 10**6))
def test_the_goal_lies_between_two_bounds(n, seed):
    """|J(u) - J(u_h) - sum / 2| <= product of the equilibrated estimates / 2, on finer and finer meshes."""
    pair = Pair.random(generic_square(n, seed), seed)
    middle, radius = 0.5 * np.sum(pair.products()), 0.5 * np.prod(pair.estimates())
    for finer in (pair.refined(), pair.refined().refined()):
        assert abs(finer.goal() - pair.goal() - middle) <= radius * (1 + 1e-9)
    assert abs(pair.error() - middle) <= radius * (1 + 1e-9)


def test_indicators_are_the_sizes_of_what_the_estimate_adds_up():
    pair = Pair.random(generic_square(6, 1), 1)
    indicators, (primal, dual) = pair.indicators(), pair.estimates()
    assert_allclose(indicators**2, np.abs(pair.products()), rtol=1e-9)
    assert abs(pair.error()) < np.sum(indicators**2) < primal * dual


def test_where_the_goal_is_the_load_the_indicators_are_those_of_the_energy():
    """J(u) = load of u: the dual is the primal, and J(u) - J(u_h) the square of the error's energy norm."""
    load = Pair.random(generic_square(6, 2), 2).primal.at(1)
    pair = Pair(load, load)
    assert_allclose(pair.indicators(), load.estimate(), rtol=1e-10)
    finest = pair.refined().refined().refined()
    assert np.sum(pair.products()) >= finest.goal() - pair.goal() > pair.error() > 0.8 * (finest.goal() - pair.goal())


# --- of every order ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "order"),
    [(generic_square, 1), (generic_square, 2), (generic_square, 3), (bent_square, 2), (bent_square, 3)],
)
@given(seed=st.integers(0, 10**6))
@examples(3)
def test_the_estimate_is_the_change_of_the_goal_to_elements_of_one_order_more(make, order, seed):
    pair = Pair.random(make(4, seed), seed, (3,)).at(order)
    change = pair.at(order + 1).goal() - pair.goal()
    # on curved elements, whose integrands are no polynomials, by fewer points than here
    assert pair.error() == pytest.approx(change, rel=1e-6 if make is generic_square else 0.02)


@pytest.mark.parametrize(("make", "order"), [(generic_square, 1), (bent_square, 2), (bent_square, 3)])
def test_primal_and_dual_may_change_places_and_indicators_have_the_root_of_the_goal_for_a_unit(make, order):
    pair = Pair.random(make(4, 3), 3, (3,)).at(order)
    assert_allclose(pair.indicators(9.0), 3.0 * pair.indicators(), rtol=1e-9)
    assert_allclose(Pair(pair.dual, pair.primal).indicators(), pair.indicators(), rtol=1e-9)


# --- a smooth case with exact values ------------------------------------------------------------------------------


def quarter_ring(n):
    """Of radii 1 and 2 in n by n parts, with parabolas for arcs."""
    mesh = MeshTri.init_tensor(np.linspace(1.0, 2.0, n + 1), np.linspace(0.0, np.pi / 2, n + 1))
    r, angle = np.hstack([mesh.p, mesh.p[:, mesh.facets].mean(axis=1)])
    return MeshTri2(r * np.stack([np.cos(angle), np.sin(angle)]), mesh.t)


def value(mesh, order):
    """-div grad u = 1 with u = 0 on both arcs, and J(u) = int u: J(u_h), its estimated error, and the bound of that."""
    outer = mesh.boundary_facets()
    arcs = outer[np.all(mesh.p[:, mesh.nvertices + outer] > 1e-9, axis=0)]
    one = np.ones(mesh.nelements)
    matrix, load = assembled(mesh, one, one, np.zeros((2, one.size)), order)
    u = solved(matrix, load, np.zeros(load.size), basis_of(mesh, order).get_dofs(arcs).flatten())
    values, data = (mesh, u, u, one), {"source": one, "dual_source": one}
    error = goal_error(*values, **data, fixed=np.isin(np.arange(mesh.nvertices), mesh.facets[:, arcs]))
    return load @ u, error, np.sum(goal_oriented(*values, **data) ** 2)


@pytest.mark.parametrize("order", [2, 3])
def test_on_uniform_meshes_the_error_of_a_smooth_goal_falls_by_its_order_and_is_told(order):
    """By N^-2 of order 2. The dual is the field there, and errors do not cancel: the indicators tell them, too.

    What is taken for exact is the value between the same parabolas, of elements cut in sixteen.
    """
    elements, found = [], []
    for n in (2, 4, 8):
        mesh = quarter_ring(n)
        first, told, bound = value(mesh, order)
        elements.append(mesh.nelements)
        found.append((value(refined(refined(mesh)), order)[0] - first, told, bound))
    error, told, bound = np.array(found).T
    rates = np.diff(np.log(error)) / np.diff(np.log(elements))
    assert rates[-1] < 0.1 - order
    assert_allclose(told[1:], error[1:], rtol=0.05)
    assert np.all((0.5 * error < bound) & (bound < 1.2 * error))


# --- arguments ---------------------------------------------------------------------------------------------------


PAIRS = {1: Pair.random(generic_square(5, 1), 1), 2: Pair.random(bent_square(3, 1), 1, (3,)).at(2)}
VALUES, NAMES = PAIRS[1].arguments()
OF_DUAL = "of the dual problem, "


@pytest.mark.parametrize("function", [goal_oriented, goal_error])
@pytest.mark.parametrize(
    ("order", "change", "message"),
    [
        (1, {2: np.zeros(3)}, rf"{OF_DUAL}potential must have shape \(nnodes,\)"),
        (1, {"dual_source": NAMES["dual_source"] + 1.0}, f"{OF_DUAL}potential must satisfy the P1 equations"),
        (1, {"fixed": np.arange(VALUES[1].size)}, "fixed must be a mask of bool"),
        (2, {2: np.zeros(3)}, f"{OF_DUAL}potential must have shape"),
        (2, {"dual_source": np.full(PAIRS[2].primal.reluctivity.size, np.nan)}, f"{OF_DUAL}source must be finite"),
        (2, {1: np.zeros(PAIRS[2].mesh.nvertices)}, "mesh must be a skfem.MeshTri or MeshTet; got MeshTri2"),
    ],
)
def test_wrong_arguments_are_named(function, order, change, message):
    values, names = PAIRS[order].arguments()
    values = [change.get(place, value) for place, value in enumerate(values)]
    with pytest.raises(ValueError, match=f"^{message}"):
        function(*values, **names | {name: value for name, value in change.items() if isinstance(name, str)})
