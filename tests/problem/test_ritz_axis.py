"""The functional around an axis: exact fields, traces, integrals against a slow twin, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.meshes import generic_square
from numpy.testing import assert_allclose
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3, MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Ritz
from kohonen_adapt.mesh.elements.functions import ON_AXIS, kinds_at_axis
from kohonen_adapt.mesh.elements.polynomials import evaluated, local_coefficients, modes_of
from kohonen_adapt.problem.functional_value import functional_value

ORDERS = {1: ElementTriP1(), 2: ElementTriP2(), 3: ElementTriP3()}


class Slope:
    """H = b, so that it stands for the coefficient 1."""

    def field_strength(self, b):
        return b

    def energy(self, b):
        return 0.5 * b**2


def with_values(mesh, order, function, **given):
    places = Basis(mesh, ORDERS[order]).doflocs
    axis = places[0] < 1e-12
    return Ritz(np.where(axis, 0.0, function(places)), axis, order=order, axisymmetric=True, **given)


def coefficients(mesh, ritz):
    node, values = mesh.t.T, np.asarray(ritz.values)
    kind = kinds_at_axis(mesh.p[0, node])
    modes = None if ritz.order == 1 else modes_of(mesh, node, values, ritz.order, kind=kind)
    return local_coefficients(values[node], modes), kind


@pytest.mark.parametrize("order", [2, 3])
def test_a_uniform_field_is_exact_in_elements_of_any_shape(order):
    """u = x^2: 1/2 int 4 x, less int 3 x^2, less (1, 2) . int (2 x, 0)."""
    mesh = generic_square(5, seed=3)
    assert set(ON_AXIS[kinds_at_axis(mesh.p[0, mesh.t.T])].sum(axis=1)) == {0, 1, 2}
    ritz = with_values(mesh, order, lambda x: x[0] ** 2, coefficient=1.0, source=3.0, flux=(1.0, 2.0))
    assert functional_value(mesh, ritz) == pytest.approx(1.0 - 1.0 - 1.0, rel=1e-12)
    assert functional_value(mesh, replace(ritz, laws=(Slope(),))) == pytest.approx(-1.0, rel=1e-12)


def test_a_field_that_changes_along_the_axis_is_exact_by_cubic_elements():
    """u = x^2 (1 + z): 1/2 int (4 (1 + z)^2 x + x^3)."""
    ritz = with_values(generic_square(5, seed=3), 3, lambda x: x[0] ** 2 * (1.0 + x[1]), coefficient=1.0)
    assert functional_value(generic_square(5, seed=3), ritz) == pytest.approx(7.0 / 3.0 + 1.0 / 8.0, rel=1e-12)


@pytest.mark.parametrize("order", ORDERS)
def test_traces_agree_and_fall_like_the_square_of_the_distance(order):
    mesh, rng = generic_square(5, seed=3), np.random.default_rng(0)
    ritz = with_values(mesh, order, lambda x: rng.normal(size=x.shape[1]), coefficient=1.0)
    own, kind = coefficients(mesh, ritz)
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    start, end = mesh.facets[:, inner]
    for at in (0.0, 0.13, 0.5, 0.8):
        sides = []
        for element in mesh.f2t[:, inner]:
            share = (1 - at) * (mesh.t[:, element] == start) + at * (mesh.t[:, element] == end)
            sides.append(evaluated(own[element], share.T, kind[element]))
        assert_allclose(sides[0], sides[1], atol=1e-12)
    for k in np.unique(kind[kind > 0]):
        element = np.flatnonzero(kind == k)[:1]
        near = np.where(ON_AXIS[k], 1.0, 0.0) / ON_AXIS[k].sum()
        share = [near + size * (np.array([0.2, 0.3, 0.5]) - near) for size in (1e-3, 1e-4)]
        large, small = (float(evaluated(own[element], each[None], kind[element])[0]) for each in share)
        assert large / small == pytest.approx(100.0, rel=0.05)


def test_what_a_functional_around_an_axis_refuses():
    mesh = MeshTri().refined(2)
    ritz = with_values(mesh, 1, lambda x: x[0] ** 2, coefficient=1.0)
    with pytest.raises(ValueError, match=r"axisymmetric of Ritz must be True or False; got 1\."):
        replace(ritz, axisymmetric=1)
    loose = replace(ritz, fixed=np.zeros(25, dtype=bool))
    with pytest.raises(ValueError, match=r"must be fixed to 0 on the axis x = 0; 5 of 5 nodes there are not"):
        functional_value(mesh, loose)
    left = mesh.translated((-0.5, 0.0))
    with pytest.raises(ValueError, match=r"an axisymmetric Ritz needs a mesh at x >= 0; got nodes down to x = -0\.5\."):
        functional_value(left, ritz)


def test_the_polish_says_why_it_does_not_lower_it():
    class Problem:
        def solve(self, mesh):
            return None

        def ritz(self, mesh, solution):
            return with_values(mesh, 1, lambda x: x[0] ** 2, coefficient=1.0, flux=lambda x, region: x)

    with pytest.raises(ValueError, match=r"flux of Ritz can be a function only at order 1, in the plane, with"):
        ka.polish(MeshTri().refined(2), Problem())
