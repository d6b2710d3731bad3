"""A source that varies inside regions is polished on tetrahedra, too, and judged by the function itself."""

import numpy as np
import pytest
from skfem import Basis, BilinearForm, ElementTetP1, ElementTetP2, LinearForm, MeshTet, condense, solve
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from kohonen_adapt.problem.functional_value import functional_value

conduction = BilinearForm(lambda u, v, w: w["k"] * dot(grad(u), grad(v)))
CENTRES, WIDTHS = ((0.3, 0.4, 0.6), (0.8, 0.7, 0.3)), (0.15, 0.3)
LINE = np.linspace(0.0, 1.0, 7)
CUBE = MeshTet.init_tensor(LINE, LINE, LINE)
HALVES = CUBE.with_subdomains({"a": lambda x: x[0] < 0.5, "b": lambda x: x[0] > 0.5})


class Spots:
    """-div(k grad u) = f with two Gaussians, k and a factor of f by half of the unit cube, u = 0 on the boundary."""

    def __init__(self, k=(1.0, 1.0), factor=(1.0, 1.0)):
        self.k, self.factor, self.seen = np.array(k), np.array(factor), []

    def source(self, x, region):
        spots = (
            np.exp(-sum((x[i] - c[i]) ** 2 for i in range(3)) / s**2) for c, s in zip(CENTRES, WIDTHS, strict=True)
        )
        return self.factor[region] * sum(spots)

    def stated(self, x, region):
        self.seen.append(len(x) == 3 and (not region.any() or np.all((x[0] > 0.5) == (region == 1))))
        return self.source(x, region)

    def region(self, mesh):
        return np.isin(np.arange(mesh.nelements), (mesh.subdomains or {}).get("b", [])).astype(int)

    def solved(self, mesh, element):
        basis = Basis(mesh, element, intorder=7)
        region = np.tile(self.region(mesh)[:, None], basis.dx.shape[1])
        load = LinearForm(lambda v, w: self.source(w.x, region) * v).assemble(basis)
        matrix = conduction.assemble(basis, k=self.k[region])
        return solve(*condense(matrix, load, D=basis.get_dofs())), matrix

    def solve(self, mesh):
        return self.solved(mesh, ElementTetP1())[0]

    def indicators(self, mesh, solution):
        finer = Basis(mesh, ElementTetP2(), intorder=2)
        exact = finer.interpolate(self.solved(mesh, ElementTetP2())[0]).grad
        own = finer.with_element(ElementTetP1()).interpolate(solution).grad
        return np.sqrt(np.sum(np.sum((exact - own) ** 2, axis=0) * finer.dx, axis=1))

    def ritz(self, mesh, solution):
        fixed = np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes())
        return ka.Ritz(solution, fixed, self.k, self.stated, region=self.region(mesh))

    def energy(self, mesh, element=None):
        solution, matrix = self.solved(mesh, element or ElementTetP1())
        return float(solution @ matrix @ solution)

    def error(self, mesh, exact):
        return np.sqrt(exact - self.energy(mesh))

    def functional(self, mesh):
        return functional_value(mesh, self.ritz(mesh, self.solve(mesh)))


PROBLEMS = [
    (CUBE, Spots()),
    (HALVES, Spots(k=(1.0, 10.0))),
    (HALVES, Spots(factor=(1.0, 0.0))),
    (HALVES, Spots(k=(1.0, 3.0), factor=(1.0, -2.0))),
]


@pytest.mark.parametrize(("mesh", "problem"), PROBLEMS)
def test_the_polish_lowers_the_error_by_a_tenth_and_more(mesh, problem):
    exact = problem.energy(mesh, ElementTetP2())
    better = ka.polish(mesh, problem)
    assert better.nvertices == mesh.nvertices and all(problem.seen)
    assert problem.functional(better) < problem.functional(mesh)
    assert problem.error(better, exact) < 0.9 * problem.error(mesh, exact)


def test_adapt_recycles_nodes_by_it_and_refuses_nothing():
    mesh, problem = PROBLEMS[3]
    exact = problem.energy(mesh, ElementTetP2())
    result, plain = (ka.adapt(mesh, problem, passes=1, polish=on) for on in (True, False))
    assert result.error is None and not any(step.unpolished for step in result.history)
    assert "Ritz" not in result.message
    assert all(step.polish_gain > 0.0 for step in result.history[1:])
    assert result.mesh.nvertices == plain.mesh.nvertices == mesh.nvertices
    assert problem.error(result.mesh, exact) < 0.9 * problem.error(plain.mesh, exact)


@pytest.mark.parametrize("sweeps", [1, 2, 5])
def test_no_polish_raises_the_functional_of_a_source_that_jumps_inside_a_region(sweeps):
    class Jump(Spots):
        def source(self, x, region):
            return np.where((x[0] > 0.37) & (x[1] < 0.71), 10.0, 0.0)

    problem = Jump()
    assert problem.functional(ka.polish(CUBE, problem, sweeps=sweeps)) <= problem.functional(CUBE)
