"""Goal-oriented indicators: what is sure about the error of a functional, and meshes that make it small."""

from functools import cached_property

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import generic_square, square
from helpers.scalar_problems import stiffness
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from skfem import Basis, ElementTriP0, ElementTriP1, LinearForm, condense, solve
from skfem.helpers import grad

import kohonen_adapt as ka
from kohonen_adapt.estimators import equilibrated, equilibrated_flux, goal_error, goal_oriented, residual
from kohonen_adapt.mesh.measures import area


@LinearForm
def load(v, w):
    return w["f"] * v + w["gx"] * grad(v)[0] + w["gy"] * grad(v)[1]


def by_element(mesh, *values):
    """The basis of P1, and constants of the elements on it."""
    basis = Basis(mesh, ElementTriP1())
    return basis, [basis.with_element(ElementTriP0()).interpolate(each) for each in values]


def load_of(mesh, source, flux):
    basis, (f, gx, gy) = by_element(mesh, source, *flux)
    return load.assemble(basis, f=f, gx=gx, gy=gy)


def solved_with(mesh, reluctivity, right, values):
    """Of the given values on the whole boundary."""
    basis, (nu,) = by_element(mesh, reluctivity)
    return solve(*condense(stiffness.assemble(basis, nu=nu), right, x=values, D=mesh.boundary_nodes()))


def gradient(mesh, nodal):
    return np.asarray(Basis(mesh, ElementTriP1()).interpolate(nodal).grad)[..., 0]


class Pair:
    """A primal and a dual problem with random data on one mesh; values given on its whole boundary."""

    def __init__(self, mesh, reluctivity, primal, dual, values):
        self.mesh, self.reluctivity, self.primal, self.dual, self.values = mesh, reluctivity, primal, dual, values

    @classmethod
    def random(cls, n, seed):
        mesh, rng = generic_square(n, seed), np.random.default_rng(seed)
        count = mesh.t.shape[1]
        data = [(rng.normal(size=count), rng.normal(size=(2, count))) for _ in range(2)]
        return cls(mesh, 10 ** rng.uniform(-2, 0, count), *data, rng.normal(size=mesh.p.shape[1]))

    def solved(self, data, values):
        return solved_with(self.mesh, self.reluctivity, load_of(self.mesh, *data), values)

    @cached_property
    def potential(self):
        return self.solved(self.primal, self.values)

    @cached_property
    def weight(self):
        return self.solved(self.dual, np.zeros_like(self.values))

    def refined(self):
        nodal = np.concatenate((self.values, self.values[self.mesh.facets].mean(axis=0)))
        primal, dual = (tuple(np.tile(part, 4) for part in data) for data in (self.primal, self.dual))
        return Pair(self.mesh.refined(), np.tile(self.reluctivity, 4), primal, dual, nodal)

    def goal(self):
        return load_of(self.mesh, *self.dual) @ self.potential

    def arguments(self):
        names = {"source": self.primal[0], "flux": self.primal[1]}
        names |= {"dual_source": self.dual[0], "dual_flux": self.dual[1]}
        return (self.mesh, self.potential, self.weight, self.reluctivity), names

    def estimates(self):
        """Equilibrated estimates of the primal and of the dual problem."""
        both = ((self.potential, self.primal), (self.weight, self.dual))
        return [
            np.linalg.norm(equilibrated(self.mesh, nodal, self.reluctivity, source=data[0], flux=data[1]))
            for nodal, data in both
        ]

    def products(self):
        """What each element adds to the product of both corrections ``sigma* - sigma_h``, by their corners."""
        corrections = []
        for nodal, data in ((self.potential, self.primal), (self.weight, self.dual)):
            given = (self.mesh, nodal, self.reluctivity)
            strength = self.reluctivity * gradient(self.mesh, nodal) - data[1]
            corrections.append(equilibrated_flux(*given, source=data[0], flux=data[1]) - strength[:, None])
        one, other = corrections
        product = np.sum(one * other, axis=(0, 1)) + np.sum(one.sum(axis=1) * other.sum(axis=1), axis=0)
        return area(self.mesh) / 12.0 * product / self.reluctivity

    def error(self):
        values, names = self.arguments()
        return goal_error(*values, **names)

    def indicators(self):
        values, names = self.arguments()
        return goal_oriented(*values, **names)


# --- theorems ----------------------------------------------------------------------------------------------------


@examples(40)
@given(n=st.integers(3, 8), seed=st.integers(0, 10**6))
def test_the_goal_lies_between_two_bounds(n, seed):
    """|J(u) - J(u_h) - sum / 2| <= product of the equilibrated estimates / 2, on finer and finer meshes."""
    pair = Pair.random(n, seed)
    middle, radius = 0.5 * np.sum(pair.products()), 0.5 * np.prod(pair.estimates())
    for finer in (pair.refined(), pair.refined().refined()):
        assert abs(finer.goal() - pair.goal() - middle) <= radius * (1 + 1e-9)
    assert abs(pair.error() - middle) <= radius * (1 + 1e-9)


def test_indicators_are_the_sizes_of_what_the_estimate_adds_up():
    pair = Pair.random(6, 1)
    indicators, (primal, dual) = pair.indicators(), pair.estimates()
    assert_allclose(indicators**2, np.abs(pair.products()), rtol=1e-9)
    assert abs(pair.error()) < np.sum(indicators**2) < primal * dual


def test_where_the_goal_is_the_load_the_indicators_are_those_of_the_energy():
    """J(u) = load of u: the dual is the primal, and J(u) - J(u_h) the square of the error's energy norm."""
    pair = Pair.random(6, 2)
    pair = Pair(pair.mesh, pair.reluctivity, pair.primal, pair.primal, np.zeros_like(pair.values))
    energy = equilibrated(pair.mesh, pair.potential, pair.reluctivity, source=pair.primal[0], flux=pair.primal[1])
    assert_allclose(pair.indicators(), energy, rtol=1e-10)
    finest = pair.refined().refined().refined()
    assert np.sum(pair.products()) >= finest.goal() - pair.goal() > pair.error() > 0.8 * (finest.goal() - pair.goal())


# --- adapted meshes: the error of a goal falls faster than with the energy's indicators ---------------------------


class Goal:
    """J(u) = int grad u . M grad u / 2 with a smooth symmetric matrix M(x), (2, 2, ...)."""

    def __init__(self, matrix, reluctivity, flux):
        self.matrix, self.reluctivity, self.flux = matrix, reluctivity, flux

    def solve(self, mesh):
        nu, zero = self.reluctivity(mesh), np.zeros(mesh.p.shape[1])
        potential = solved_with(mesh, nu, load_of(mesh, 0.0 * nu, self.flux(mesh)), zero)
        dual_flux = self.dual_flux(mesh, potential)
        dual = solved_with(mesh, nu, load_of(mesh, 0.0 * nu, dual_flux), zero)
        return potential, dual, dual_flux

    def dual_flux(self, mesh, potential):
        basis = Basis(mesh, ElementTriP1(), intorder=14)
        values = self.matrix(np.asarray(basis.global_coordinates()))
        mean = np.sum(values * basis.dx, axis=-1) / area(mesh)
        return np.einsum("ijk,jk->ik", mean, gradient(mesh, potential))

    def value(self, mesh):
        potential, _, dual_flux = self.solve(mesh)
        return 0.5 * area(mesh) @ np.sum(dual_flux * gradient(mesh, potential), axis=0)

    def arguments(self, mesh, solution):
        potential, dual, dual_flux = solution
        return (mesh, potential, dual, self.reluctivity(mesh)), {"flux": self.flux(mesh), "dual_flux": dual_flux}

    def indicators(self, mesh, solution):
        values, names = self.arguments(mesh, solution)
        return goal_oriented(*values, **names)

    def estimate(self, mesh):
        """With the derivative as the nearest function that is linear in every element: its mean is the same."""
        solution = self.solve(mesh)
        values, names = self.arguments(mesh, solution)
        basis = Basis(mesh, ElementTriP1(), intorder=14)
        weight = self.matrix(np.asarray(basis.global_coordinates())) * basis.dx / area(mesh)[:, None]
        share = np.vstack((1.0 - basis.X.sum(axis=0), basis.X))
        moments = np.einsum("ijkq,mq,jk->imk", weight, share, gradient(mesh, solution[0]))
        nearest = 12.0 * moments - 3.0 * moments.sum(axis=1, keepdims=True)
        return goal_error(*values, **names | {"dual_flux": nearest})


class Energy(Goal):
    """The same problem, adapted for its energy as it is by default: with a polish that lowers that."""

    def indicators(self, mesh, solution):
        return residual(mesh, solution[0], self.reluctivity(mesh), flux=self.flux(mesh))

    def ritz(self, mesh, solution):
        data = np.vstack((self.reluctivity(mesh), self.flux(mesh)))
        kinds, number = np.unique(data, axis=1, return_inverse=True)
        fixed = np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes())
        return ka.Ritz(solution[0], fixed, kinds[0], flux=kinds[1:], region=number.ravel())


def gap_mesh(n=40):
    """A magnet above an iron block, a gap of 0.2 between them, in (-1, 1)^2; n a multiple of 20."""
    regions = {
        "magnet": lambda x: (abs(x[0]) < 0.3) & (abs(x[1] - 0.2) < 0.2),
        "iron": lambda x: (abs(x[0]) < 0.5) & (abs(x[1] + 0.4) < 0.2),
    }
    return square(n, -1.0, 1.0).with_subdomains(regions)


def gap_reluctivity(mesh):
    reluctivity = np.ones(mesh.t.shape[1])
    reluctivity[mesh.subdomains["iron"]] = 1e-3
    return reluctivity


def gap_flux(mesh):
    flux = np.zeros((2, mesh.t.shape[1]))
    flux[0, mesh.subdomains["magnet"]] = -1.0
    return flux


def force_on_the_block(x):
    """Maxwell's stress along y times the slope of a weight: one within 0.05 of the block, zero beyond 0.15."""
    across, along = np.maximum(np.abs(x[0]) - 0.5, 0.0), np.maximum(np.abs(x[1] + 0.4) - 0.2, 0.0)
    distance = np.hypot(across, along)
    step = np.clip((distance - 0.05) / 0.1, 0.0, 1.0)
    slope = -60.0 * step * (1.0 - step) / np.maximum(distance, 1e-12)
    right, up = slope * across * np.sign(x[0]), slope * along * np.sign(x[1] + 0.4)
    return np.stack([np.stack([-up, right]), np.stack([right, up])])


# By P2 elements on goal-adapted meshes of 8 000 nodes, refined once; it settles to 1e-5.
FORCE, EXACT = (force_on_the_block, gap_reluctivity, gap_flux), 0.0153650


@pytest.mark.slow
def test_the_error_of_the_goal_falls_faster_than_with_the_energy_and_its_estimate_is_of_the_right_size():
    """At the same number of nodes, 1681, after four passes. The estimate is 0.77 to 1.67 times the error."""
    meshes = {
        kind: [ka.adapt(gap_mesh(), kind(*FORCE), passes=4, seed=seed).mesh for seed in range(3)]
        for kind in (Goal, Energy)
    }
    goal = Goal(*FORCE)
    by_goal, by_energy = (np.array([EXACT - goal.value(mesh) for mesh in meshes[kind]]) for kind in (Goal, Energy))
    at_first = EXACT - goal.value(gap_mesh())
    assert np.linalg.norm(by_energy) > 2.0 * np.linalg.norm(by_goal)
    assert abs(at_first) > 7.0 * np.max(np.abs(by_goal))
    found = np.array([goal.estimate(mesh) for mesh in (gap_mesh(), *meshes[Goal])])
    assert np.all(np.abs(np.log2(found / [at_first, *by_goal])) < 1.0)
    found = np.array([goal.estimate(mesh) for mesh in meshes[Energy]])
    assert np.linalg.norm(by_energy - found) < 0.3 * np.linalg.norm(by_energy)


# --- arguments ---------------------------------------------------------------------------------------------------


def test_wrong_arguments_are_named():
    pair = Pair.random(5, 1)
    values, names = pair.arguments()
    nnodes = pair.mesh.p.shape[1]
    for function in (goal_oriented, goal_error):
        with pytest.raises(ValueError, match=rf"^potential must have shape \(nnodes,\) = \({nnodes},\); got \(3,\)"):
            function(values[0], np.zeros(3), *values[2:], **names)
        with pytest.raises(ValueError, match=r"^of the dual problem, potential must have shape \(nnodes,\)"):
            function(*values[:2], np.zeros(3), values[3], **names)
        with pytest.raises(ValueError, match=r"^of the dual problem, source must be finite"):
            function(*values, **names | {"dual_source": np.full(pair.reluctivity.size, np.nan)})
        with pytest.raises(ValueError, match=r"^of the dual problem, potential must satisfy the P1 equations"):
            function(*values, **names | {"dual_source": pair.dual[0] + 1.0})
        with pytest.raises(ValueError, match=r"^fixed must be a mask of bool"):
            function(*values, **names, fixed=np.arange(nnodes))


def test_arguments_stay_as_they_are():
    pair = Pair.random(5, 1)
    arrays = (pair.potential, pair.weight, pair.reluctivity, *pair.primal, *pair.dual)
    before = [array.copy() for array in arrays]
    for array in arrays:
        array.setflags(write=False)
    assert np.array_equal(pair.indicators(), pair.indicators())
    assert all(np.array_equal(old, new) for old, new in zip(before, arrays, strict=True))
