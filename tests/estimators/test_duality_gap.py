"""The duality gap bounds how far the energy of a P1 function lies above the minimum, for nonlinear material too."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.linear_problems import Linear, rim_of
from helpers.meshes import generic_square
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from skfem import MeshTri

from kohonen_adapt.estimators import duality_gap
from kohonen_adapt.magnetostatics import Arctan, Brauer, Froehlich, Magnetostatics, Material
from kohonen_adapt.problem.functional_value import functional_value


class LinearLaw:
    """H = a b."""

    def __init__(self, reluctivity):
        self.a = reluctivity

    def energy(self, b):
        return 0.5 * self.a * b**2

    def coenergy(self, h):
        return 0.5 * h**2 / self.a


def functional_of(problem, mesh):
    return functional_value(mesh, problem.ritz(mesh, problem.solve(mesh)))


@examples(15)
@given(
    law=st.sampled_from([Brauer(50.0, 10.0, 1.5), Froehlich(1000.0, 2.0), Arctan(1000.0, 2.0)]),
    n=st.integers(3, 6),
    seed=st.integers(0, 10**6),
    load=st.sampled_from([1e4, 1e6, 1e7]),
)
def test_the_gap_bounds_the_height_above_the_minimum(law, n, seed, load):
    """Of steel and a magnet beside a current, far below the knee and above it."""
    rng = np.random.default_rng(seed)
    mesh = generic_square(n, seed).with_boundaries({"rim": lambda x: x[0] > -1.0}, boundaries_only=True)
    part = rng.integers(0, 3, mesh.nelements)
    mesh = mesh.with_subdomains({name: np.flatnonzero(part == k) for k, name in enumerate(("steel", "magnet", "coil"))})
    materials = {
        "steel": Material(bh=law),
        "magnet": Material(bh=law, coercivity=tuple(0.1 * load * rng.normal(size=2))),
        "coil": Material(current_density=load * rng.normal()),
    }
    problem = Magnetostatics(materials, {"rim": 0.0}, order=1, estimator="equilibrated")
    height = 2.0 * (functional_of(problem, mesh) - functional_of(problem, mesh.refined()))
    assert height <= np.sum(problem.indicators(mesh, problem.solve(mesh)) ** 2) * (1 + 1e-9)


def linear_problem():
    mesh, rng = generic_square(7, 3), np.random.default_rng(0)
    nu, count = 10 ** rng.uniform(-2, 0, mesh.nelements), mesh.nelements
    source, flux = rng.normal(size=count), rng.normal(size=(2, count))
    return Linear(mesh, np.zeros(mesh.nvertices), rim_of(mesh), nu, source, flux)


def test_for_linear_material_it_is_the_equilibrated_estimate():
    problem = linear_problem()
    law, mesh = LinearLaw(problem.reluctivity), problem.mesh
    gap = duality_gap(mesh, problem.potential, problem.sigma(), law.energy, law.coenergy, flux=problem.flux)
    assert_allclose(gap, problem.estimate(), rtol=1e-6)


FLAT = MeshTri(np.array([[0.0, 1.0, 2.0, 0.0], [0.0, 0.0, 0.0, 1.0]]), np.array([[0, 0], [1, 1], [2, 3]]))


def test_wrong_arguments_are_named():
    problem = linear_problem()
    mesh, potential, field, law = problem.mesh, problem.potential, problem.sigma(), LinearLaw(problem.reluctivity)
    count, broken = mesh.nelements, field.copy()
    broken[0, 1, 4] = np.nan
    calls = {
        rf"field must have shape \(2, 3, nelements\) = \(2, 3, {count}\)": (mesh, potential, field[:, 0], law.energy),
        "field must be finite; it is not at 1 of": (mesh, potential, broken, law.energy),
        rf"energy must return a finite density .* shape \(1, {count}\); got shape \(\)": (
            *(mesh, potential, field),
            lambda b: 1.0,
        ),
        "every element must have an area above zero": (FLAT, np.zeros(4), np.zeros((2, 3, 2)), law.energy),
    }
    for message, arguments in calls.items():
        with pytest.raises(ValueError, match=message):
            duality_gap(*arguments, law.coenergy)
