"""A functional with a term frozen at the solution is another one in every pass, and compares no passes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.meshes import on_rim
from helpers.scalar_problems import Gaussians
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementTriP1, MeshTri
from skfem.helpers import dot, grad

import kohonen_adapt as ka

EXACT = 9.6397238440219  # first eigenvalue of -lap on the L-shape (Betcke and Trefethen, SIAM Review 47, 2005)


@cache
def pair_of(points, elements):
    """Of the coordinates and the corners of elements, as bytes."""
    return pair_on(MeshTri(np.frombuffer(points).reshape(2, -1), np.frombuffer(elements, np.int64).reshape(3, -1)))


def pair(mesh):
    return pair_of(mesh.p.tobytes(), mesh.t.astype(np.int64).tobytes())


def pair_on(mesh):
    basis, inside = Basis(mesh, ElementTriP1()), mesh.interior_nodes()
    stiffness = BilinearForm(lambda u, v, w: dot(grad(u), grad(v))).assemble(basis)[inside][:, inside]
    mass = BilinearForm(lambda u, v, w: u * v).assemble(basis)[inside][:, inside]
    value, vector = eigsh(stiffness, 1, mass, sigma=9.0, v0=np.ones(len(inside)))
    solution = np.zeros(mesh.nvertices)
    solution[inside] = vector[:, 0] * np.sign(vector.sum())
    return float(value[0]), solution


class Membrane:
    """-lap u = lambda u, with the right side frozen in the functional."""

    calibrated = True

    def __init__(self, **options):
        self.options = options

    def solve(self, mesh):
        return pair(mesh)[1]

    def indicators(self, mesh, solution):
        source = pair(mesh)[0] * solution[mesh.t].mean(axis=0)
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements), source=source)

    def ritz(self, mesh, solution):
        value, fixed = pair(mesh)[0], on_rim(mesh)

        def source(x, region):
            return value * np.asarray(ka.interpolate(mesh, solution, x))

        return ka.Ritz(solution, fixed, 1.0, source, **self.options)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({}, "the functional is another one in every pass, as with a term frozen at the solution."),
        ({"comparable": False}, "its functional depends on the solution (`comparable=False` of `Ritz`)."),
    ],
)
def test_passes_with_a_frozen_term_compare_by_the_estimate(options, reason):
    mesh = MeshTri.init_lshaped().refined(3)
    result = ka.adapt(mesh, Membrane(**options), passes=2)
    before, after = (pair(each)[0] / EXACT - 1.0 for each in (mesh, result.mesh))
    assert after < 0.3 * before
    assert result.estimate == min(step.estimate for step in result.history)
    assert result.message.endswith(f" Passes were compared by the estimate, because {reason}")


def test_a_source_that_is_a_new_function_in_every_pass_is_the_same_functional():
    class Load(Gaussians):
        def ritz(self, mesh, solution):
            return replace(super().ritz(mesh, solution), source=lambda x, region: self.source(x))

    result = ka.adapt(MeshTri.init_lshaped().refined(3), Load(np.zeros((1, 2)), [0.5]), passes=2)
    assert all(step.comparable for step in result.history)
