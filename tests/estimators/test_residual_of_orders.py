"""The residual estimate of solutions of order 2 and 3: exact cases, error, twin in magnetostatics, refusals."""

import re

import numpy as np
import pytest
from helpers.devices import turned_magnet
from helpers.meshes import generic_square, square
from numpy.testing import assert_allclose
from skfem import Basis, BilinearForm, ElementTriP1, ElementTriP2, ElementTriP3, MeshTet, condense
from skfem import solve as solve_system
from skfem.helpers import dot, grad

from kohonen_adapt.estimators import residual
from kohonen_adapt.magnetostatics import Magnetostatics

KINDS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3}


@pytest.mark.parametrize("order", [2, 3])
def test_solutions_in_the_space_have_no_indicators(order):
    mesh = generic_square(4, 0)
    u = Basis(mesh, KINDS[order]()).project(lambda x: x[0] ** order - 2.0 * x[0] ** (order - 1) * x[1])
    source = np.zeros(mesh.nelements)
    if order == 2:  # div grad u = 2
        source -= 2.0
        assert residual(mesh, u, np.ones(mesh.nelements), source=source, order=order).max() < 1e-9
    harmonic = Basis(mesh, KINDS[order]()).project(lambda x: ((x[0] + 1j * x[1]) ** order).real)
    assert residual(mesh, harmonic, np.ones(mesh.nelements), order=order).max() < 1e-9


@pytest.mark.parametrize(("order", "times", "within"), [(2, 6.1, 0.05), (3, 9.7, 0.15)])
def test_the_estimate_is_a_known_multiple_of_the_error(order, times, within):
    mesh = generic_square(8, 1)
    harmonic = Basis(mesh, KINDS[order](), intorder=12)
    matrix = BilinearForm(lambda u, v, _: dot(grad(u), grad(v))).assemble(harmonic)
    u = harmonic.project(lambda x: np.exp(2.0 * x[0]) * np.sin(2.0 * x[1]))
    u = solve_system(*condense(matrix, np.zeros(u.size), x=u, D=harmonic.get_dofs()))
    x, y = harmonic.global_coordinates()
    exact = 2.0 * np.exp(2.0 * x) * np.stack([np.sin(2.0 * y), np.cos(2.0 * y)])
    error = np.sqrt(np.sum((np.asarray(harmonic.interpolate(u).grad) - exact) ** 2 * harmonic.dx))
    estimate = np.linalg.norm(residual(mesh, u, np.ones(mesh.nelements), order=order))
    assert estimate == pytest.approx(times * error, rel=within)


@pytest.mark.parametrize(("order", "scale"), [(1, 3.6), (2, 6.1), (3, 9.7)])
def test_indicators_are_those_of_magnetostatics(order, scale):
    mesh, plain = turned_magnet(16, 90)
    problem = Magnetostatics(plain.materials, plain.potential, order=order)
    field, scalar = problem.solve(mesh), problem.ritz(mesh, problem.solve(mesh))
    flux = np.asarray(scalar.flux)[:, scalar.region]
    found = residual(mesh, field.unknown, field.reluctivity, flux=flux, order=order)
    assert_allclose(found, scale * problem.indicators(mesh, field), rtol=1e-6, atol=1e-9 * found.max())


@pytest.mark.parametrize("order", [1, 2, 3])
def test_joined_facets_count_as_those_inside(order):
    """A function of period 1 on a square, cut at x = 0 or at x = 1/2."""
    half = 4
    mesh = square(8)
    sides = [mesh.facets_satisfying(lambda x, at=at: np.isclose(x[0], at), boundaries_only=True) for at in (0.0, 1.0)]
    one, other = (each[np.argsort(mesh.p[1, mesh.facets[:, each]].mean(axis=0))] for each in sides)
    joined = one, other, np.ones(one.size)

    def indicators(shift):
        u = Basis(mesh, KINDS[order]()).project(lambda x: np.abs((x[0] + shift) % 1.0 - 0.5) * x[1] ** (order > 1))
        return residual(mesh, u, np.ones(mesh.nelements), joined=joined, order=order)

    def by_column(values, columns):
        column = np.floor(8.0 * mesh.p[0, mesh.t].mean(axis=0)).astype(int)
        return np.sqrt(np.bincount((column + columns) % 8, values**2, 8))

    assert_allclose(by_column(indicators(0.5), half), by_column(indicators(0.0), 0), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(
    ("mesh", "order", "size", "message"),
    [
        (generic_square(2, 0), 4, 9, "order must be 1, 2 or 3; got 4."),
        (generic_square(2, 0), True, 9, "order must be 1, 2 or 3; got True."),
        (generic_square(2, 0), "2", 9, "order must be 1, 2 or 3; got '2'."),
        (MeshTet(), 2, 8, "order must be 1 on tetrahedra; got 2. Orders 2 and 3 are for triangles."),
    ],
)
def test_wrong_orders_are_refused(mesh, order, size, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        residual(mesh, np.zeros(size), np.ones(mesh.nelements), order=order)


def test_values_of_another_order_are_refused():
    mesh = generic_square(3, 0)
    with pytest.raises(ValueError, match="potential must have shape"):
        residual(mesh, mesh.p[0], np.ones(mesh.nelements), order=2)
