"""The polish at order 2 and 3: what it takes off is what the functional falls by, and the solution follows."""

import numpy as np
import pytest
from helpers.descents import Start
from helpers.meshes import l_shape, perturbed
from helpers.scalar_problems import Corner, loaded, magnet
from numpy.testing import assert_allclose, assert_array_equal
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3, MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Ritz, Rules
from kohonen_adapt.geometry.movable import unchanged
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import Surgery
from kohonen_adapt.kernels.triangle.arrays import WITH
from kohonen_adapt.kernels.triangle.polish.exchange import weigh
from kohonen_adapt.mesh.elements.polynomials import evaluated, local_coefficients, modes_of
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.polishing.energy_recycling import compute_gains, offers_of, with_spare_rows
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.transfer import transferred
from kohonen_adapt.problem.functional_value import functional_value

ELEMENTS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3}
each_order = pytest.mark.parametrize("order", (2, 3))
PROBLEMS = {"L": Corner, "F": loaded, "M": magnet}


def started(mesh, problem):
    """From its solution."""
    return Start.of(mesh, problem.ritz(mesh, problem.solve(mesh)))


@pytest.mark.parametrize("order", (1, 2, 3))
def test_coefficients_are_those_of_scikit_fem(order):
    mesh, rng = perturbed(MeshTri().refined(3), 0), np.random.default_rng(0)
    basis = Basis(mesh, ELEMENTS[order](), intorder=2 * order)
    values = rng.normal(size=basis.N)
    assert count_unknowns(mesh, order) == basis.N
    node = mesh.t.T[:, [1, 2, 0]].copy()  # corners in another order
    modes = None if order == 1 else modes_of(mesh, node, values, order)
    share = rng.dirichlet([1.0, 1.0, 1.0], size=len(node))
    x = np.einsum("mk,mkc->cm", share, mesh.p.T[node])
    assert_allclose(evaluated(local_coefficients(values[node], modes), share), basis.probes(x) @ values)


@each_order
def test_edges_with_values_given_linearly_are_split_where_that_gains(order):
    setting, legs = started(l_shape(6), Corner(order)), []
    before = setting.value()
    for _ in range(4):
        decrease, after = setting.recycle(), setting.value()
        assert before - after == pytest.approx(decrease, rel=1e-7)
        before, (x, y) = after, setting.movable.triangulation.position.T
        legs.append(np.flatnonzero(((x == 0.0) & (y < 0.0)) | ((y == 0.0) & (x > 0.0))))
    assert len(legs[0]) < len(legs[3])
    assert setting.trial.fixed[legs[3]].all() and np.abs(setting.trial.values[legs[3]]).max() <= 1e-15
    elements, modes = setting.movable.triangulation.elements, setting.trial.modes
    on_legs = np.isin(elements.node, legs[3])
    e, k = np.nonzero((elements.neighbour < 0) & np.roll(on_legs, -1, axis=1) & np.roll(on_legs, -2, axis=1))
    assert len(e) >= len(legs[3]) - 2
    assert modes.dirichlet[e, k].all() and np.abs(modes.side[e, k]).max() <= 1e-15
    e, k = np.nonzero(elements.neighbour >= 0)
    assert not modes.dirichlet[e, k].any()


@each_order
def test_a_polynomial_that_the_elements_have_is_carried_as_it_is(order):
    mesh = perturbed(MeshTri().refined(3), 1)
    basis = Basis(mesh, ELEMENTS[order]())

    def exact(x):
        return x[0] ** order - 2.0 * x[0] * x[1] + x[1]

    movable = MovableMesh.of(mesh, Rules("recycle").guarded())
    values = exact(basis.doflocs)
    functional = Functional.of(Ritz(values, np.zeros(basis.N, dtype=bool), 1.0, order=order), movable, mesh)
    before, start_element = movable.copy(), unchanged(movable.triangulation).start_element
    free = movable.constraints.kind == 0
    movable.triangulation.position[free] += 0.003 * np.random.default_rng(2).normal(size=(free.sum(), 2))
    after = transferred(functional, before, movable, start_element)
    moved = movable.mesh()
    expected = modes_of(
        moved, movable.triangulation.elements.node, exact(Basis(moved, ELEMENTS[order]()).doflocs), order
    )
    assert_allclose(after.values, exact(moved.p), atol=1e-13)
    assert_allclose(after.modes.side, expected.side, atol=1e-12)
    assert_allclose(after.modes.bubble, expected.bubble, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("letter", "order", "squares", "target"), [("L", 2, 8, 0.0040), ("F", 2, 16, 0.00096), ("L", 3, 10, 2.6e-4)]
)
def test_four_passes_reach_the_optimal_rate_at_a_corner(letter, order, squares, target):
    mesh, given = l_shape(squares), PROBLEMS[letter](order)
    result = ka.adapt(mesh, given, passes=4)
    assert len(result.solution) <= 1.03 * len(given.solve(mesh))
    assert given.error(result.mesh, result.solution) <= 1.03 * target


def test_an_order_that_a_problem_does_not_say_is_refused():
    with pytest.raises(ValueError, match="order of Ritz must be the degree of the elements, 1, 2 or 3; got 4"):
        ka.Ritz(np.zeros(3), np.zeros(3, dtype=bool), 1.0, order=4)
    with pytest.raises(
        ValueError, match=r"values of Ritz must have shape \(nunknowns of order 2,\) = \(25,\); got \(9,\)"
    ):
        functional_value(MeshTri().refined(1), ka.Ritz(np.zeros(9), np.zeros(9, dtype=bool), 1.0, order=2))


@pytest.mark.parametrize("order", [2, 3])
def test_what_was_in_memory_before_has_no_say(order):
    """A collapse costs the same, whatever other nodes, or nobody, have left in the room of a thread."""
    at = started(perturbed(l_shape(3), 1), loaded(order))
    movable, functional, trial, recycled = at.movable, at.functional, at.trial, at.recycled
    mesh = Surgery.on(movable, np.ones(movable.nnodes), movable.nnodes, recycled).mesh
    offers = offers_of(movable, functional, trial.fixed, mesh)
    loops = functional.loops(movable, with_spare_rows(trial, len(mesh.position), len(mesh.elements.node)), mesh)
    most, costs = compute_gains(loops, mesh, offers), offers.cost.copy()
    assert np.isfinite(costs).sum() > 10
    for v in range(movable.nnodes):
        loops.scratches.clear()
        room = loops.scratch(0)
        for array in room.primal.block:
            array[:] = np.nan if array.dtype == np.float64 else -5
        weigh(mesh, room, WITH, offers, most, movable.floor, v, v + 1, False)
    assert_array_equal(offers.cost, costs)
