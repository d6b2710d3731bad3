"""Adapt scikit-fem's example 22, -div grad u = 1 on an L with u = 0 on its boundary, at a constant number of nodes."""

import numpy as np
from skfem import Basis, ElementTriP1, MeshTri, condense, solve
from skfem.models.poisson import laplace, unit_load

import kohonen_adapt as ka


class Poisson:
    """Two methods make a problem. The third gives the table its Energy Error, the fourth lets nodes go down it."""

    def solve(self, mesh):
        basis = Basis(mesh, ElementTriP1())
        return solve(*condense(laplace.assemble(basis), unit_load.assemble(basis), D=mesh.boundary_nodes()))

    def indicators(self, mesh, solution):
        one = np.ones(mesh.t.shape[1])
        return ka.estimators.residual(mesh, solution, one, source=one)

    def energy_norm(self, mesh, solution):
        return np.sqrt(unit_load.assemble(Basis(mesh, ElementTriP1())) @ solution)

    def ritz(self, mesh, solution):
        fixed = np.isin(np.arange(mesh.p.shape[1]), mesh.boundary_nodes())
        return ka.Ritz(solution, fixed, coefficient=1.0, source=1.0)


def main():
    result = ka.adapt(MeshTri.init_lshaped().refined(4), Poisson(), passes=4)
    print(result)
    return result


if __name__ == "__main__":
    main()
