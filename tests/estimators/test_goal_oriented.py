"""Goal-oriented indicators: what is sure about the error of a functional, and meshes that make it small."""

from functools import cached_property

import numpy as np
import pytest
from helpers.examples import examples
from helpers.linear_problems import assembled, solved
from helpers.meshes import generic_square
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from kohonen_adapt.estimators import equilibrated, equilibrated_flux, goal_error, goal_oriented
from kohonen_adapt.mesh.measures import area, gradient


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
        return solved(*assembled(self.mesh, self.reluctivity, *data), values, self.mesh.boundary_nodes())

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
        return assembled(self.mesh, self.reluctivity, *self.dual)[1] @ self.potential

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


# By P2 elements on goal-adapted meshes of 8 000 nodes, refined once; it settles to 1e-5.


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
        with pytest.raises(ValueError, match=r"^of the dual problem, potential must satisfy the P1 equations"):
            function(*values, **names | {"dual_source": pair.dual[0] + 1.0})
        with pytest.raises(ValueError, match=r"^fixed must be a mask of bool"):
            function(*values, **names, fixed=np.arange(nnodes))
