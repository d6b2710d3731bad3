"""Goal-oriented indicators and errors of elements of order 1 to 3: theorems, rates and effectivity."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.linear_problems import assembled, basis_of, solved
from helpers.meshes import generic_square
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from skfem import MeshTri, MeshTri2

from kohonen_adapt.estimators import goal_error, goal_oriented
from kohonen_adapt.mesh.curved import refined


def bent_square(n, seed):
    """A square of random triangles whose sides inside are parabolas."""
    mesh, rng = generic_square(n, seed), np.random.default_rng(seed)
    middles = mesh.p[:, mesh.facets].mean(axis=1)
    off = rng.uniform(-0.01, 0.01, middles.shape) * np.hypot(*np.diff(mesh.p[:, mesh.facets], axis=1)[:, 0])
    return MeshTri2(np.hstack([mesh.p, middles + np.where(mesh.f2t[1] >= 0, off, 0.0)]), mesh.t)


class Pair:
    """A problem and a dual with random data per element on one mesh; zeros given on the whole rim."""

    def __init__(self, mesh, order, seed=0, dual=None):
        rng, count = np.random.default_rng(seed), mesh.t.shape[1]
        self.mesh, self.order, self.nu = mesh, order, 10 ** rng.uniform(-1, 0, count)
        self.primal, self.dual = ((rng.normal(size=count), rng.normal(size=(2, 3, count))) for _ in range(2))

    def solved(self, data, order):
        matrix, load = assembled(self.mesh, self.nu, *data, order)
        return solved(matrix, load, np.zeros(load.size), basis_of(self.mesh, order).get_dofs().flatten())

    def goal(self, order):
        return assembled(self.mesh, self.nu, *self.dual, order)[1] @ self.solved(self.primal, order)

    def arguments(self, factor=1.0):
        one, other = self.solved(self.primal, self.order), factor * self.solved(self.dual, self.order)
        names = {"source": self.primal[0], "flux": self.primal[1]}
        names |= {"dual_source": factor * self.dual[0], "dual_flux": factor * self.dual[1]}
        return (self.mesh, one, other, self.nu), names

    def swapped(self):
        self.primal, self.dual = self.dual, self.primal
        return self

    def indicators(self, factor=1.0):
        values, names = self.arguments(factor)
        return goal_oriented(*values, **names)


@pytest.mark.parametrize(
    ("make", "order"),
    [(generic_square, 1), (generic_square, 2), (generic_square, 3), (bent_square, 2), (bent_square, 3)],
)
@given(seed=st.integers(0, 10**6))
@examples(3)
def test_the_estimate_is_the_change_of_the_goal_to_elements_of_one_order_more(make, order, seed):
    pair = Pair(make(4, seed), order, seed)
    values, names = pair.arguments()
    change = pair.goal(order + 1) - pair.goal(order)
    # on curved elements, whose integrands are no polynomials, by fewer points than here
    assert goal_error(*values, **names) == pytest.approx(change, rel=1e-6 if make is generic_square else 0.02)


@pytest.mark.parametrize(("make", "order"), [(generic_square, 1), (bent_square, 2), (bent_square, 3)])
def test_primal_and_dual_may_change_places_and_indicators_have_the_root_of_the_goal_for_a_unit(make, order):
    pair = Pair(make(4, 3), order, 3)
    indicators, ninefold = pair.indicators(), pair.indicators(9.0)
    assert_allclose(ninefold, 3.0 * indicators, rtol=1e-9)
    assert_allclose(pair.swapped().indicators(), indicators, rtol=1e-9)


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
    one = np.ones(mesh.t.shape[1])
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
        elements.append(mesh.t.shape[1])
        found.append((value(refined(refined(mesh)), order)[0] - first, told, bound))
    error, told, bound = np.array(found).T
    rates = np.diff(np.log(error)) / np.diff(np.log(elements))
    assert rates[-1] < 0.1 - order
    assert_allclose(told[1:], error[1:], rtol=0.05)
    assert np.all((0.5 * error < bound) & (bound < 1.2 * error))


# --- arguments ---------------------------------------------------------------------------------------------------


def test_wrong_arguments_are_named():
    pair = Pair(bent_square(3, 1), 2, 1)
    values, names = pair.arguments()
    unknowns = values[1].size
    for function in (goal_oriented, goal_error):
        with pytest.raises(ValueError, match=rf"^of the dual problem, potential must have shape .*= \({unknowns},\)"):
            function(*values[:2], np.zeros(3), values[3], **names)
        with pytest.raises(ValueError, match=r"^of the dual problem, source must be finite"):
            function(*values, **names | {"dual_source": np.full(values[3].size, np.nan)})
        with pytest.raises(ValueError, match=r"^reluctivity must be positive"):
            function(*values[:3], -values[3], **names)
        with pytest.raises(ValueError, match=r"^mesh must be a skfem.MeshTri or MeshTet; got MeshTri2"):
            function(values[0], *(each[: pair.mesh.nvertices] for each in values[1:3]), values[3])
