"""Elements of order 3 and 4 on tetrahedra by scikit-fem: continuity, rates, and the same matrices as of the space."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from skfem import Basis, ElementTetP1, MeshTet, condense, solve
from skfem.models import laplace, unit_load

import kohonen_adapt as ka
from kohonen_adapt.elements import ElementTetP3, ElementTetP4
from kohonen_adapt.mesh.elements.space import Space

ELEMENTS = {3: ElementTetP3, 4: ElementTetP4}


def permuted(cells=2):
    """A cube whose inner nodes are displaced, with nodes and the corners of elements in random order."""
    mesh, rng = MeshTet.init_tensor(*[np.linspace(0.0, 1.0, cells + 1)] * 3), np.random.default_rng(0)
    p, inner = mesh.p.copy(), mesh.interior_nodes()
    p[:, inner] += rng.uniform(-0.2, 0.2, (3, inner.size)) / cells
    number = rng.permutation(mesh.nvertices)
    t = rng.permuted(number[mesh.t], axis=0)
    moved = np.empty_like(p)
    moved[:, number] = p
    return MeshTet(moved, t)


@pytest.mark.parametrize("order", ELEMENTS)
def test_unknowns_and_matrix_are_those_of_the_space(order):
    mesh = permuted()
    basis, space = Basis(mesh, ELEMENTS[order]()), Space(mesh, order, arcs=order > 3)
    assert space.doflocs.shape[1] == basis.N
    whole = laplace.assemble(basis)
    u = np.random.default_rng(1).normal(size=basis.N)
    slope = space.gradient(u)
    assert u @ (whole @ u) == pytest.approx(np.sum(space.weights * np.sum(slope**2, axis=0)), rel=1e-11)
    assert_allclose(
        unit_load.assemble(basis), space.loads(np.ones(mesh.nelements), np.zeros_like(space.points)), atol=1e-16
    )


class Notched:
    """-lap u = 1 in a cube without an octant, u = 0 around, by scikit-fem at orders 1 to 4."""

    order, orders, calibrated = 4, (1, 4), True

    def solve(self, mesh, order=4):
        from skfem import ElementTetP2

        basis = Basis(mesh, {1: ElementTetP1, 2: ElementTetP2, **ELEMENTS}[order]())
        matrix, load = laplace.assemble(basis), unit_load.assemble(basis)
        return order, basis, solve(*condense(matrix, load, D=basis.get_dofs())), load

    def indicators(self, mesh, solution):
        order, basis, u, _ = solution
        return np.sqrt(basis.dx.sum(axis=1)) * np.abs(basis.interpolate(u)).mean(axis=1) / order**2

    def energy_norm(self, mesh, solution):
        return float(np.sqrt(solution[2] @ solution[3]))

    def ritz(self, mesh, solution):
        order, basis, u, _ = solution
        if order > 2:
            raise ka.NotOffered("it is of a high order")
        fixed = np.zeros(basis.N, dtype=bool)
        fixed[basis.get_dofs().flatten()] = True
        return ka.Ritz(u, fixed, 1.0, source=1.0, order=order)


def test_an_own_problem_is_solved_at_order_4():
    cube = MeshTet.init_tensor(*[np.linspace(-1.0, 1.0, 3)] * 3)
    mesh = cube.restrict(np.flatnonzero(~np.all(cube.p[:, cube.t].mean(axis=1) > 0.0, axis=0)))
    result = ka.adapt(mesh, Notched(), passes=2, target_nodes=90)
    order, _, u, load = result.solution
    assert order == result.best.order == 4 and "layer" in result.message
    assert 0.1988 < 0.5 * u @ load < 0.1989845  # of problem F
