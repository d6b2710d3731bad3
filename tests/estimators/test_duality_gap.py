"""The duality gap bounds how far the energy of a P1 function lies above the minimum, for nonlinear material too."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.linear_problems import Linear, assembled, rim_of
from helpers.meshes import generic_square, inset
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTriP0, ElementTriP1, MeshTri
from skfem.helpers import dot, grad

from kohonen_adapt.estimators import duality_gap, equilibrated_flux
from kohonen_adapt.mesh.measures import area, gradient


class Sinh:
    """H = a sinh(b): W = a (cosh b - 1), and its conjugate in closed form; `a` per element."""

    def __init__(self, softness):
        self.a = softness

    def reluctivity(self, b):
        return np.where(b > 1e-6, self.a * np.sinh(b) / np.maximum(b, 1e-6), self.a)

    def slope(self, b):
        return self.a * np.cosh(b)

    def energy(self, b):
        return self.a * (np.cosh(b) - 1.0)

    def coenergy(self, h):
        return h * np.arcsinh(h / self.a) - np.hypot(self.a, h) + self.a


class LinearLaw:
    """H = a b."""

    def __init__(self, reluctivity):
        self.a = reluctivity

    def energy(self, b):
        return 0.5 * self.a * b**2

    def coenergy(self, h):
        return 0.5 * h**2 / self.a


class Nonlinear:
    """A nonlinear problem with zero on the whole boundary, and its P1 solution by Newton's method."""

    def __init__(self, mesh, law, source, flux):
        self.mesh, self.law, self.source, self.flux = mesh, law, source, flux
        self.basis = Basis(mesh, ElementTriP1())
        self.constant = self.basis.with_element(ElementTriP0())
        self.load = assembled(mesh, np.ones(source.size), source, flux)[1]
        self.potential = np.zeros(mesh.nvertices)
        for _ in range(100):
            if self.step() < 1e-13:
                break

    def size(self):
        return np.linalg.norm(gradient(self.mesh, self.potential), axis=0)

    def stiffness(self, along, across):
        """Of ``across`` times the identity plus the rest in the direction of the gradient."""
        slope, size = gradient(self.mesh, self.potential), np.maximum(self.size(), 1e-12)
        fields = zip("cdxy", (across, along - across, *(slope / size)), strict=True)
        form = BilinearForm(
            lambda u, v, w: (
                w.c * dot(grad(u), grad(v))
                + w.d * (w.x * grad(u)[0] + w.y * grad(u)[1]) * (w.x * grad(v)[0] + w.y * grad(v)[1])
            )
        )
        return form.assemble(self.basis, **{name: self.constant.interpolate(f) for name, f in fields})

    def step(self):
        """One damped step; returns how far it went."""
        secant = self.law.reluctivity(self.size())
        rest = self.load - self.stiffness(secant, secant) @ self.potential
        free, change = self.mesh.interior_nodes(), np.zeros(rest.size)
        matrix = self.stiffness(self.law.slope(self.size()), secant)
        change[free] = spsolve(matrix[free][:, free].tocsc(), rest[free])
        before, length = self.functional(), 1.0
        self.potential += change
        while self.functional() > before + 1e-12 * abs(before) and length > 1e-6:
            length /= 2
            self.potential -= length * change
        return np.max(np.abs(change))

    def functional(self):
        return area(self.mesh) @ self.law.energy(self.size()) - self.load @ self.potential

    def refined(self):
        law = Sinh(np.tile(self.law.a, 4))
        return Nonlinear(self.mesh.refined(), law, np.tile(self.source, 4), np.tile(self.flux, 4))

    def indicators(self):
        reluctivity = self.law.reluctivity(self.size())
        field = equilibrated_flux(self.mesh, self.potential, reluctivity, source=self.source, flux=self.flux)
        law = self.law
        return duality_gap(self.mesh, self.potential, field, law.energy, law.coenergy, flux=self.flux)


@examples(15)
@given(n=st.integers(3, 6), seed=st.integers(0, 10**6), load=st.sampled_from([0.1, 3.0, 30.0]))
def test_the_gap_bounds_the_height_above_the_minimum(n, seed, load):
    mesh, rng = generic_square(n, seed), np.random.default_rng(seed)
    count = mesh.nelements
    softness = 10 ** rng.uniform(-1, 0, count)
    problem = Nonlinear(mesh, Sinh(softness), load * rng.normal(size=count), rng.normal(size=(2, count)))
    height = 2 * (problem.functional() - problem.refined().functional())
    assert height <= np.sum(problem.indicators() ** 2) * (1 + 1e-9)


@pytest.mark.parametrize("load", [0.1, 10.0, 50.0])
def test_the_gap_is_near_the_height(load):
    """A saturated core with a magnet, in linear range and far above the knee: the bound is within 1.3 of the truth."""
    mesh = inset(16)
    core = np.isin(np.arange(mesh.nelements), mesh.subdomains["core"])
    flux = np.where(core, load * np.array([[-0.1], [0.05]]), 0.0)
    problem = Nonlinear(mesh, Sinh(np.where(core, 0.1, 1.0)), np.where(core, 0.0, load), flux)
    height = 2 * (problem.functional() - problem.refined().refined().functional())
    assert 1.0 < np.sqrt(np.sum(problem.indicators() ** 2) / height) < 1.3


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
