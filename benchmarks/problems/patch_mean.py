"""Solve problem F and its dual for a goal, the mean over a patch."""

from dataclasses import replace
from functools import partial

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import l_shape, p1, poisson_l
from benchmarks.problems.orders import OfOrder, constants

BOX = (-0.75, -0.5, 0.5, 0.75)  # of the patch: x from, to, y from, to
WEIGHT = 16.0  # 1 / its area
DUAL_NORM_SQUARED = 0.2439706026  # |z|_1^2 of the exact dual solution, and J of the exact solution,
GOAL = 0.0970723613  # by P3 elements on meshes bisected for both problems, 138 571 unknowns


def patched_mesh(n: int) -> MeshTri:
    """The L-shape in n x n squares per unit, n a multiple of 8, with the patch as a subdomain."""
    return l_shape.l_shaped_mesh(n).with_subdomains({"patch": _inside, "rest": lambda x: ~_inside(x)})


def _inside(x: np.ndarray) -> np.ndarray:
    return (x[0] > BOX[0]) & (x[0] < BOX[1]) & (x[1] > BOX[2]) & (x[1] < BOX[3])


def weights(mesh: MeshTri) -> np.ndarray:
    """The source of the dual problem, (nelements,)."""
    weight = np.zeros(mesh.t.shape[1])
    weight[mesh.subdomains["patch"]] = WEIGHT
    return weight


Pair = tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]  # solution and load, of both problems


class PatchMean:
    """-lap u = 1 and -lap z = 1 / area on the patch, 0 all round; meshes by the map alone."""

    def sources(self, mesh: MeshTri) -> tuple[np.ndarray, np.ndarray]:
        """Of both problems, (nelements,)."""
        weight = weights(mesh)
        return np.ones(weight.size), weight

    def solve(self, mesh: MeshTri) -> Pair:
        """Both solutions, with their loads."""
        matrix = p1.stiffness(mesh)
        loads = [p1.integrate_hats(mesh, source) for source in self.sources(mesh)]
        one, other = ((p1.solve_dirichlet(mesh, matrix, load, np.zeros(load.size)), load) for load in loads)
        return one, other

    def estimates(self, mesh: MeshTri, solution: Pair) -> list[np.ndarray]:
        """Residual indicators of both, (nelements,) each."""
        pairs = zip(solution, self.sources(mesh), strict=True)
        return [p1.residual_indicators(mesh, values, source=source) for (values, _), source in pairs]

    def indicators(self, mesh: MeshTri, solution: Pair) -> np.ndarray:
        """The root of their product."""
        one, other = self.estimates(mesh, solution)
        return np.sqrt(one * other)

    def errors(self, mesh: MeshTri) -> tuple[float, float]:
        """The product of the errors of both solutions in the energy norm, and the error of the goal."""
        (u, load), (z, goal) = self.solve(mesh)
        missing = poisson_l.NORM_SQUARED - load @ u, DUAL_NORM_SQUARED - goal @ z
        return float(np.sqrt(missing[0] * missing[1])), float(abs(GOAL - goal @ u))


class PolishedPatchMean(PatchMean):
    """The same with both functionals, for the polish."""

    def ritz(self, mesh: MeshTri, solution: Pair) -> ka.Ritz:
        """int |grad u|^2 / 2 - u, and that of the dual problem."""
        region, fixed = np.zeros(mesh.t.shape[1], dtype=int), p1.on_boundary(mesh)
        region[mesh.subdomains["patch"]] = 1
        (u, _), (z, _) = solution
        one, other = map(np.linalg.norm, self.estimates(mesh, solution))
        dual = ka.Ritz(z, fixed, 1.0, source=(0.0, WEIGHT), region=region)
        return ka.Ritz(u, fixed, 1.0, source=1.0, dual=dual, share=float(other / one))


class PatchMeanOfOrder:
    """The same by elements of order 2 or 3, by the map alone."""

    def __init__(self, order: int) -> None:
        self.order = order
        self.primal = OfOrder(order, partial(constants, source=1.0), poisson_l.NORM_SQUARED, relative=False)
        self.dual = OfOrder(order, _of_dual, DUAL_NORM_SQUARED, relative=False)

    def solve(self, mesh: MeshTri) -> tuple[np.ndarray, np.ndarray]:
        """Values of all unknowns of both solutions."""
        return self.primal.solve(mesh), self.dual.solve(mesh)

    def estimates(self, mesh: MeshTri, solution: tuple[np.ndarray, np.ndarray]) -> list[np.ndarray]:
        """Residual indicators of both, (nelements,) each."""
        pairs = zip((self.primal, self.dual), solution, strict=True)
        return [one.indicators(mesh, values) for one, values in pairs]

    def indicators(self, mesh: MeshTri, solution: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """The root of their product."""
        one, other = self.estimates(mesh, solution)
        return np.sqrt(one * other)

    def each_error(self, mesh: MeshTri) -> tuple[float, float]:
        """The errors of both solutions in the energy norm."""
        u, z = self.solve(mesh)
        return self.primal.error(mesh, u), self.dual.error(mesh, z)

    def errors(self, mesh: MeshTri) -> tuple[float, float]:
        """The product of the errors of both solutions in the energy norm, and the error of the goal."""
        (u, z), basis = self.solve(mesh), self.primal.basis(mesh)
        goal = np.sum(weights(mesh)[:, None] * np.asarray(basis.interpolate(u)) * basis.dx)
        return self.primal.error(mesh, u) * self.dual.error(mesh, z), float(abs(GOAL - goal))


class PolishedPatchMeanOfOrder(PatchMeanOfOrder):
    """The same with both functionals, for the polish."""

    def ritz(self, mesh: MeshTri, solution: tuple[np.ndarray, np.ndarray]) -> ka.Ritz:
        """int |grad u|^2 / 2 - u, and that of the dual problem."""
        one, other = map(np.linalg.norm, self.estimates(mesh, solution))
        dual = self.dual.ritz(mesh, solution[1])
        return replace(self.primal.ritz(mesh, solution[0]), dual=dual, share=float(other / one))


def _of_dual(mesh: MeshTri) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    nu, _, flux = constants(mesh)
    return nu, weights(mesh), flux
