"""Energy descent, kernel by kernel: derivatives, moves and flips against slow twins."""

import numpy as np
import pytest
from helpers.alternatives import functional, ritz_solution, size_of_functional, slow_descent, star_derivatives
from helpers.examples import examples
from helpers.meshes import areas_of, generic_square, inset, junction, perturbed, square
from hypothesis import given
from hypothesis import strategies as st

from kohonen_adapt import Ritz, Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, SLIDING, WITHOUT
from kohonen_adapt.kernels.triangle.flip import flip_edge
from kohonen_adapt.kernels.triangle.polish import affine
from kohonen_adapt.kernels.triangle.polish.descend import LEAST_CURVATURE, OVERSTEP
from kohonen_adapt.kernels.triangle.polish.flips import gain_of_flip
from kohonen_adapt.kernels.triangle.polish.linear import around, derivatives
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.problem.functional_value import functional_value

around, derivatives, flip_edge, gain_of_flip = (
    interpreted(loop) for loop in (around, derivatives, flip_edge, gain_of_flip)
)

FLOOR = 0.3


class Setting:
    """A mesh with a functional that changes from region to region, and the arrays of the kernels."""

    def __init__(self, mesh, seed, fixed=None, values=None, load=1.0):
        rng = np.random.default_rng(seed)
        movable = MovableMesh.of(mesh, Rules())
        self.tri, self.outline = movable.triangulation, movable.outline
        n = self.tri.nnodes
        regions = self.tri.elements.region.max() + 1
        self.ritz = Ritz(
            rng.normal(size=n) if values is None else values,
            np.isin(np.arange(n), mesh.boundary_nodes()) if fixed is None else fixed,
            10.0 ** rng.uniform(-1.5, 1.5, regions),
            load * rng.normal(size=regions),
            load * rng.normal(size=(2, regions)),
            self.tri.elements.region,
        )
        self.data = np.column_stack([self.ritz.coefficient, self.ritz.source, self.ritz.flux.T])[self.ritz.region]
        self.values, self.fixed = self.ritz.values.copy(), self.ritz.fixed.copy()
        self.functional = Functional.of(self.ritz, movable)
        self.constraints = self.outline.constraints._replace(kind=self.functional.kinds(self.outline, self.fixed))
        kernel_mesh = movable.kernel_mesh()._replace(constraints=self.constraints)
        trial = TrialFunction(self.values, self.fixed, None)
        self.loops = self.functional.loops(movable, trial, kernel_mesh)
        self.descents = self.loops.scratch(0)
        self.trial = self.descents.primal.trial

    @property
    def arrays(self):
        return self.tri.position, self.tri.elements.node, self.data, self.values

    def solve(self):
        """Put the solution in place of the values."""
        self.values[:] = ritz_solution(*self.arrays, self.fixed)

    def sweep(self):
        return affine.descend_nodes(self.descents, np.arange(self.tri.nnodes), FLOOR)


def all_flips(at, floor):
    """A sweep over all edges."""
    every = np.ones(len(at.tri.elements.node), dtype=np.bool_)
    return affine.descend_flips(at.descents, floor, every, 0, len(every), False)


MESHES = {
    "squares": lambda: square(5),
    "generic": lambda: generic_square(6),
    "regions": lambda: perturbed(inset(8), 1),
    "junction": lambda: perturbed(junction(6), 2),
}
each_mesh = pytest.mark.parametrize("build", MESHES.values(), ids=MESHES)


@each_mesh
def test_functional_equals_the_sum_over_the_elements(build):
    mesh = build()
    at = Setting(mesh, 0)
    assert functional_value(mesh, at.ritz) == pytest.approx(functional(*at.arrays), rel=1e-12)


@each_mesh
def test_derivatives_equal_the_chain_rule(build):
    at = Setting(build(), 1)
    for v in np.flatnonzero(at.outline.constraints.kind == FREE):
        _, _, (bx, by), bw, (xx, xy, yy), (xw, yw), ww = derivatives(at.tri.position, at.tri.star, at.trial, v)
        gradient, hessian = star_derivatives(*at.arrays, v)
        scale = np.abs(hessian).max()
        np.testing.assert_allclose([bx, by, bw], gradient, atol=1e-12 * scale)
        np.testing.assert_allclose([[xx, xy, xw], [xy, yy, yw], [xw, yw, ww]], hessian, atol=1e-12 * scale)


def test_the_chain_rule_equals_differences():
    at = Setting(generic_square(4), 2)
    position, node, data, values = at.arrays
    v = np.flatnonzero(at.outline.constraints.kind == FREE)[0]

    def moved(z):
        p, u = position.copy(), values.copy()
        p[v] += z[:2]
        u[v] += z[2]
        return p, node, data, u

    gradient, hessian = star_derivatives(*at.arrays, v)
    for k in range(3):
        h = 1e-6 * np.eye(3)[k]
        difference = functional(*moved(h)) - functional(*moved(-h))
        assert difference / 2e-6 == pytest.approx(gradient[k], rel=1e-6, abs=1e-6)
        change = star_derivatives(*moved(h), v)[0] - star_derivatives(*moved(-h), v)[0]
        np.testing.assert_allclose(change / 2e-6, hessian[k], rtol=1e-5, atol=1e-5)


@each_mesh
def test_a_star_knows_what_a_move_and_a_value_do_to_the_whole(build):
    at, rng = Setting(build(), 3), np.random.default_rng(3)
    constraints = at.outline.constraints
    for v in np.flatnonzero(constraints.kind != HELD):
        way = 1e-3 * rng.normal(size=2)
        if constraints.kind[v] == SLIDING:
            way = 1e-3 * constraints.chains.direction[constraints.own_chain[v]]
        before = functional(*at.arrays)
        arrays = at.tri.position, at.tri.star, at.trial, WITHOUT, v
        _, c0, r0, _ = around(*arrays, at.tri.position[v], 0.0)
        slope = derivatives(at.tri.position, at.tri.star, at.trial, v)
        assert (c0, r0) == pytest.approx((slope[1], slope[3]), rel=1e-10, abs=1e-12 * slope[0])
        at.tri.position[v] += way
        _, c, r, k = around(*arrays, at.tri.position[v], 0.0)
        w = rng.normal()
        at.values[v] += w
        assert functional(*at.arrays) - before == pytest.approx(c + r * w + k * w * w / 2 - c0, rel=1e-9, abs=1e-9)
        at.tri.position[v] -= way
        at.values[v] -= w


@each_mesh
@pytest.mark.parametrize("load", [0.0, 1.0, 30.0])
def test_a_sweep_equals_its_slow_twin(build, load):
    mesh = build()
    x, y = mesh.p
    at = Setting(mesh, 4, values=np.where(x == 0, y, 1 - 2 * y), fixed=(x == 0) | (x == 1), load=load)
    at.solve()
    constraints, chain = at.constraints, at.constraints.own_chain
    axes, rates = [None] * at.tri.nnodes, [None] * at.tri.nnodes
    for v in range(at.tri.nnodes):
        given = at.fixed[v]
        if constraints.kind[v] == FREE:
            axes[v] = np.eye(2)
        elif constraints.kind[v] == SLIDING:
            axes[v] = constraints.chains.direction[chain[v]][:, None]
            rates[v] = at.functional.on_chain[chain[v], 1] if given else None
        elif not given:
            axes[v] = np.zeros((2, 0))
    position, values, gain = slow_descent(*at.arrays, axes, rates, FLOOR, OVERSTEP, LEAST_CURVATURE)
    assert at.sweep() == pytest.approx(gain, rel=1e-7)
    assert gain > 0
    np.testing.assert_allclose(at.tri.position, position, atol=1e-8)
    np.testing.assert_allclose(at.values, values, atol=1e-8)


@given(seed=st.integers(0, 10**6), load=st.floats(0, 100), name=st.sampled_from(sorted(MESHES)))
@examples(40)
def test_every_sweep_and_every_flip_lowers_the_functional_by_what_it_says_or_more(seed, load, name):
    at = Setting(MESHES[name](), seed, load=load)
    for _ in range(2):
        before, size = functional(*at.arrays), size_of_functional(*at.arrays)
        gain = at.sweep()
        after = functional(*at.arrays)
        rounding = 1e-10 * (size + size_of_functional(*at.arrays))
        assert gain >= 0.0
        assert after <= before - gain + rounding
        lowered, flips = all_flips(at, FLOOR)
        at.tri.refill_star()
        assert functional(*at.arrays) == pytest.approx(after - lowered, abs=rounding)
        assert (lowered > 0.0) == (flips > 0)


@each_mesh
def test_a_flip_gains_what_the_functional_loses(build):
    at = Setting(perturbed(build(), 5), 5)
    elements, gained = at.tri.elements, 0
    for e, k in zip(*np.nonzero((elements.neighbour >= 0) & (elements.chain < 0)), strict=True):
        with np.errstate(divide="ignore"):  # a flip may leave no area
            gain = gain_of_flip(at.descents, WITHOUT, e, k, elements.neighbour[e, k])
        saved = [array.copy() for array in elements]
        before = functional(*at.arrays)
        flip_edge(elements, e, k)
        if areas_of(at.tri).min() > 0:
            assert max(0.0, before - functional(*at.arrays)) == pytest.approx(gain, rel=1e-9, abs=1e-10)
            gained += gain > 0
        else:
            assert gain == 0.0
        for array, old in zip(elements, saved, strict=True):
            array[:] = old
    assert gained > 5


@each_mesh
def test_marked_edges_are_flipped_as_if_all_were_looked_at(build):
    for seed in range(5):
        one, other = (Setting(perturbed(build(), seed), seed) for _ in range(2))
        m = len(one.tri.elements.node)
        gainful = np.empty(m, dtype=np.bool_)
        for first, last in ((0, m // 3), (m // 3, m)):
            affine.descend_flips(one.descents, FLOOR, gainful, first, last, True)
        assert 0 < np.count_nonzero(gainful) < m
        found = affine.descend_flips(one.descents, FLOOR, gainful, 0, len(gainful), False)
        assert found == all_flips(other, FLOOR)
        for mine, all_of_them in zip(one.tri.elements, other.tri.elements, strict=True):
            np.testing.assert_array_equal(mine, all_of_them)


@pytest.mark.parametrize("seed", range(5))
def test_without_a_source_no_flip_lowers_the_energy_of_a_delaunay_triangulation(seed):
    """Rippa, "Minimal roughness property of the Delaunay triangulation", Comput. Aided Geom. Design 7 (1990)."""
    at = Setting(generic_square(7, seed), seed)
    at.trial.data[:, 1] = 0.0
    assert all_flips(at, 0.0) == (0.0, 0)


def test_a_straight_function_moves_nothing():
    mesh = perturbed(generic_square(6), 1)
    at = Setting(mesh, 0, values=3 * mesh.p[0] - mesh.p[1], load=0.0)
    at.trial.data[:, 0] = 1.0
    before = at.tri.position.copy()
    assert at.sweep() == 0.0
    assert all_flips(at, FLOOR) == (0.0, 0)
    np.testing.assert_array_equal(at.tri.position, before)
