"""A source that varies inside regions is polished on tetrahedra, too, and judged by the function itself."""

import numpy as np
from helpers.linear_problems import assembled, solved
from helpers.solids import halved_cube

import kohonen_adapt as ka
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.problem.functional_value import functional_value

CENTRES, WIDTHS = ((0.3, 0.4, 0.6), (0.8, 0.7, 0.3)), (0.15, 0.3)
HALVES = halved_cube((6, 6, 6), 0)


class Spots:
    """-div(k grad u) = f with two Gaussians, k and a factor of f by half of the unit cube, u = 0 on the boundary."""

    def __init__(self, k=(1.0, 1.0), factor=(1.0, 1.0)):
        self.k, self.factor, self.seen = np.array(k), np.array(factor), []

    def source(self, x, region):
        spots = [np.exp(-np.sum((x.T - c) ** 2, axis=-1).T / s**2) for c, s in zip(CENTRES, WIDTHS, strict=True)]
        return self.factor[region] * sum(spots)

    def stated(self, x, region):
        self.seen.append(np.all((x[0] > 0.5) == (region == 1)))
        return self.source(x, region)

    def region(self, mesh):
        return np.isin(np.arange(mesh.nelements), mesh.subdomains["right"]).astype(int)

    def solve(self, mesh):
        region = self.region(mesh)
        given = mesh, self.k[region], lambda x: self.source(x, region[:, None]), np.zeros((3, region.size))
        return solved(*assembled(*given), np.zeros(mesh.nvertices), mesh.boundary_nodes())

    def indicators(self, mesh, solution):
        return np.sqrt(area(mesh)) * np.abs(self.source(mesh.p[:, mesh.t].mean(axis=1), self.region(mesh)))

    def ritz(self, mesh, solution):
        fixed = np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes())
        return ka.Ritz(solution, fixed, self.k, self.stated, region=self.region(mesh))

    def functional(self, mesh):
        return functional_value(mesh, self.ritz(mesh, self.solve(mesh)))


PROBLEMS = [Spots(), Spots(k=(1.0, 10.0)), Spots(factor=(1.0, 0.0)), Spots(k=(1.0, 3.0), factor=(1.0, -2.0))]


def test_adapt_recycles_nodes_by_it_and_refuses_nothing():
    result = ka.adapt(HALVES, PROBLEMS[3], passes=1)
    assert result.error is None and not any(step.unpolished for step in result.history)
    assert "Ritz" not in result.message
    assert all(step.polish_gain > 0.0 for step in result.history[1:])
    assert PROBLEMS[3].functional(result.mesh) < PROBLEMS[3].functional(HALVES)
