"""`adapt` and `polish` refuse a solution that is not stationary for its functional, and say where."""

import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.layer import Layer
from helpers.poisson_solids import Minimised
from helpers.scalar_problems import Cooled, Scalar, Turning, pushed_at
from scipy.sparse.linalg import cg
from skfem import (
    Basis,
    LinearForm,
    MeshTet,
    MeshTri,
)

import kohonen_adapt as ka
from kohonen_adapt.mesh.elements.functions import KINDS

load = LinearForm(lambda v, w: v)
MESH = MeshTri.init_tensor(np.linspace(0, 1, 9) ** 1.2, np.linspace(0, 1, 8)).with_defaults()
CUBE = MeshTet().refined(2)


class Stated(Cooled):
    """The problem by an iterative solver, with other terms in its functional."""

    def __init__(self, order=1, rtol=1e-13, **stated):
        super().__init__(order)
        self.rtol, self.stated = rtol, stated

    def solve(self, mesh):
        basis, matrix, load = self.forms(mesh)
        inner, values = basis.complement_dofs(basis.get_dofs("top")), np.zeros(basis.N)
        values[inner] = cg(matrix[inner][:, inner], load[inner], rtol=self.rtol)[0]
        return values

    def ritz(self, mesh, values):
        return replace(super().ritz(mesh, values), **self.stated)


PUSHED = {"bottom": (0.0, pushed_at)}


def refused(mesh, problem, message):
    for run in (ka.polish, ka.adapt):
        with pytest.raises(ValueError, match=message):
            run(mesh, problem)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_forgotten_robin_condition_is_named_with_its_boundary(order):
    refused(
        MESH,
        Stated(order, robin=PUSHED),
        r"^the solution is not stationary for its Ritz: at \(0, [0-9.e-]+\) on boundary (.*, )?'left'.* the residual "
        r"is 1?\d\d % of the terms .* free unknowns\. Give Ritz every term of the equation \(robin, source, flux, "
        r"fixed values\), or solve more accurately\.$",
    )


def test_another_load_and_another_coefficient_in_a_region():
    mesh = MESH.with_subdomains({"chip": lambda x: x[0] < 0.5, "board": lambda x: x[0] > 0.5})
    other = PUSHED | {"left": (3.0, 0.1)}
    refused(mesh, Stated(robin=other), r"^the solution is not stationary .* on boundary (.*, )?'left'")
    region = np.isin(np.arange(mesh.nelements), mesh.subdomains["chip"]).astype(int)
    refused(mesh, Stated(source=[1.0, 9.0], region=region), r"^the solution is not stationary .* in subdomain .*'chip'")


def test_tetrahedra_without_their_source():
    class Sourceless(Minimised):
        def ritz(self, mesh, solution):
            return replace(super().ritz(mesh, solution), source=0.0)

    refused(CUBE, Sourceless(), r"^the solution is not stationary for its Ritz: at \(.*\)")
    assert ka.polish(CUBE, Minimised(), sweeps=1).nvertices == CUBE.nvertices


@pytest.mark.parametrize("order", [1, 2, 3])
def test_all_terms_and_the_tolerance_of_an_iterative_solver_pass(order):
    ka.polish(MESH, Stated(order), sweeps=0)
    ka.polish(MESH, Stated(order, rtol=1e-5), sweeps=0)


def test_a_solver_that_has_not_converged_is_refused():
    refused(MESH, Stated(rtol=0.3), "^the solution is not stationary .* or solve more accurately")


class Ring(Scalar):
    """-lap u = sign(x - 1/2), periodic in x, and 0 on the floor and at the top.

    By symmetry u is 0 on both sides, with residuals that are opposite.
    """

    def __init__(self, sign):
        super().__init__(source=self.source)
        self.sign = sign

    def source(self, x, region=None):
        return np.sign(x[0] - 0.5)

    def ritz(self, mesh, solution):
        fixed = np.abs(mesh.p[1] - 0.5) == 0.5
        return ka.Ritz(solution, fixed, 1.0, self.source, signs={("left", "right"): self.sign})


def test_periodic_residuals_count_together():
    mesh, pairs = MeshTri.init_symmetric().refined(2).with_defaults(), [("left", "right")]
    ka.polish(mesh, Ring(1), periodic=pairs, sweeps=0)
    with pytest.raises(ValueError, match=r"^the solution is not stationary .* on boundary .*left"):
        ka.polish(mesh, Ring(-1), periodic=pairs, sweeps=0)


def test_a_later_pass_that_does_not_converge_ends_the_loop():
    class Tired(Stated):
        def solve(self, mesh):
            self.rtol = 1e-13 if mesh is MESH else 0.3
            return super().solve(mesh)

    result = ka.adapt(MESH, Tired(), passes=2)
    assert result.status is ka.Status.FAILED and re.match("the solution is not stationary", str(result.error))


@pytest.mark.parametrize(("k", "rule"), [(300.0, 6), (450.0, 1)])
def test_a_source_that_the_first_mesh_does_not_resolve_is_no_error(k, rule):
    mesh, problem = MeshTri().refined(5), Layer(k, rule=rule)
    result = ka.adapt(mesh, problem, passes=2)
    assert result.error is None and result.best.number == 2
    assert result.history[0].unpolished == "the mesh does not resolve the source of its Ritz"
    assert problem.error(result.mesh) < 0.7 * problem.error(mesh)


@pytest.mark.parametrize(("by_flux", "k", "rule"), [(True, 1500.0, 5), (False, 1e4, 8)])
def test_no_rule_sees_a_layer_in_all_elements(by_flux, k, rule):
    """Only a few points of every rule are within a layer of a fiftieth of an element, or of a three-hundredth."""
    mesh, problem = MeshTri().refined(5), Layer(k, (0.43, 0.37), rule, by_flux=by_flux)
    result = ka.adapt(mesh, problem, passes=2)
    assert result.error is None and result.best.number == 2
    data = "flux" if by_flux else "source"
    assert result.history[0].unpolished == f"the mesh does not resolve the {data} of its Ritz"
    assert problem.error(result.mesh) < 0.9 * problem.error(mesh)


def test_a_solver_may_have_another_rule_than_ritz():
    """At k = 100 off the centre a rule of degree 1 differs by up to 7 % of the terms at a node."""
    result = ka.adapt(MeshTri().refined(5), Layer(100.0, (0.43, 0.37), 1), passes=1)
    assert result.error is None and result.history[0].functional is not None


class MagnetLayer(Turning):
    """-div(grad u - g) = 0, u = 0 on the boundary, for a flux g with a layer; `Ritz` has `times` g."""

    def __init__(self, k, rule, times=1.0):
        super().__init__()
        self.k, self.rule, self.times = k, rule, times

    def basis(self, mesh, order):
        return Basis(mesh, KINDS[order](), intorder=self.rule)

    def flux(self, x, region=None):
        r = np.hypot(x[0] - 0.43, x[1] - 0.37)
        return np.stack([1.0 + np.tanh(self.k * (0.25 - r)), 0.0 * r])

    def indicators(self, mesh, solution):
        flux = self.flux(mesh.p[:, mesh.t].mean(axis=1))
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements), flux=flux)

    def ritz(self, mesh, solution):
        return replace(super().ritz(mesh, solution), flux=lambda x, region: self.times * self.flux(x))


@pytest.mark.parametrize("rule", [0, 6])
def test_a_flux_that_changes_in_a_few_elements(rule):
    """By the rule of degree 6 and k = 1000 the input was refused before fluxes were compared as sources are."""
    for k in (20.0, 1000.0):
        assert ka.adapt(MeshTri().refined(5), MagnetLayer(k, rule), passes=1).error is None
    refused(MeshTri().refined(5), MagnetLayer(20.0, rule, times=1.3), r"^the solution is not stationary for its Ritz")


def test_a_wrong_ritz_of_a_source_that_is_resolved_is_refused():
    problem = Layer(30.0, reaction=50.0)
    with pytest.raises(ValueError, match=r"^the solution is not stationary for its Ritz"):
        ka.adapt(MeshTri().refined(5), problem)
    assert ka.adapt(MeshTri().refined(5), Layer(30.0), passes=1).history[0].functional is not None


def test_the_polish_alone_says_that_the_source_is_not_resolved():
    with pytest.raises(ValueError, match=r"^polish requires .*: the mesh does not resolve the source of its Ritz"):
        ka.polish(MeshTri().refined(5), Layer(300.0))
