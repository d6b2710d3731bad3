"""Poisson's equation on an L with elements of order 4, on layers at the corner, and the error of the energy norm."""

import argparse
from pathlib import Path

import numpy as np
from scipy.special import zeta
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3, ElementTriP4, MeshTri, condense, solve
from skfem.models.poisson import laplace, unit_load

import kohonen_adapt as ka

ELEMENTS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3, 4: ElementTriP4}


class Poisson:
    """-div grad u = 1 with u = 0 on the boundary, by scikit-fem's elements of order 1 to 4."""

    orders, order, calibrated = (1, 4), 4, True

    def solve(self, mesh, order=None):
        basis = Basis(mesh, ELEMENTS[order or self.order](), intorder=8)
        stiffness, load = laplace.assemble(basis), unit_load.assemble(basis)
        return basis, solve(*condense(stiffness, load, D=basis.get_dofs()))

    def indicators(self, mesh, solution):
        """Change of the gradient to the next order; at order 4, the highest, extrapolated from orders 2, 3 and 4."""
        order = solution[0].elem.maxdeg
        if order < 4:
            return self.change(mesh, order, order + 1)
        before, last = self.change(mesh, 2, 3), self.change(mesh, 3, 4)
        power = 2.0 * np.log(np.linalg.norm(before) / np.linalg.norm(last)) / np.log(3.5 / 2.5)
        return last * np.sqrt(3.5**power * zeta(power, 4.5))  # the squared change from n to n + 1 as (n + 1/2)^-power

    def change(self, mesh, low, high):
        gradients = [basis.interpolate(u).grad for basis, u in (self.solve(mesh, low), self.solve(mesh, high))]
        weights = Basis(mesh, ElementTriP1(), intorder=8).dx
        return np.sqrt(np.sum(np.sum((gradients[1] - gradients[0]) ** 2, axis=0) * weights, axis=1))

    def energy_norm(self, mesh, solution):
        return np.sqrt(unit_load.assemble(solution[0]) @ solution[1])

    def ritz(self, mesh, solution):
        basis, u = solution
        fixed = np.isin(np.arange(basis.N), basis.get_dofs().flatten())
        return ka.Ritz(u, fixed, coefficient=1.0, source=1.0, order=basis.elem.maxdeg)


def main(folder="."):
    Path(folder).mkdir(parents=True, exist_ok=True)
    result = ka.adapt(MeshTri.init_lshaped().refined(3), Poisson(), passes=2)
    print(result)
    ka.write_mesh(Path(folder) / "high_order.vtu", result.mesh, cell_data={"indicator": result.indicators})
    return result


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default=".", help="folder for what it writes (default: %(default)s)")
    main(parser.parse_args().out)
