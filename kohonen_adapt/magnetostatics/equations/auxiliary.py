"""Conjugate gradients for edge elements."""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_matrix, diags_array, tril, triu
from scipy.sparse.linalg import splu

from kohonen_adapt.arrays import Floats, Function, Mask
from kohonen_adapt.log import logger
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.edge_elements import EdgeElements
from kohonen_adapt.magnetostatics.equations.system import Solver
from kohonen_adapt.mesh.elements.assembly import Subspaces

__all__ = ["EdgeSolver"]

SHIFT = 1e-8  # of the diagonal of the auxiliary matrix, which is singular without prescribed values
DAMPING = 0.5  # of Jacobi's method on the levels of the auxiliary matrix
RELAXATION = 1.3  # of Gauss and Seidel's method: 1.0 takes 6 to 15 % more steps, and 1.6 up to 30 %
FALL = 1e4  # of the error squared, in the last steps, whose rate is used
ROUNDING = 1e-28  # residual that is rounding error, relative, squared


@dataclass(frozen=True)
class EdgeSolver(Solver):
    """Conjugate gradients for the singular equations of a vector potential.

    No gauge is imposed, because the equations are consistent: the load has no component along gradients. The
    preconditioner is a symmetric sweep of Gauss and Seidel. Above `large` unknowns it solves an auxiliary problem for
    vectors at the nodes by algebraic multigrid between both halves of the sweep (Hiptmair and Xu, SIAM J. Numer. Anal.
    45, 2007), and the number of steps hardly grows with the mesh.
    """

    # At 98 000 edges sweeps take 0.5 to 1 times the time of the auxiliary space, but
    # their steps rise with the mesh.
    large: int = 500_000
    most_iterations: int = 10_000
    rtol: float = 1e-6  # of B in the energy norm; the error of the energy is its square
    floor: float = 0.0  # right-hand side that is rounding error
    edges: EdgeElements | None = None
    conditions: Conditions | None = None

    def solve(self, matrix: csc_array, right: Floats, subspaces: Subspaces | None = None) -> Floats:
        if np.linalg.norm(right) <= self.floor:
            return np.zeros_like(right)
        symmetric = csr_matrix(matrix.T)
        auxiliary = self._auxiliary(symmetric) if right.size > self.large else None
        if auxiliary is None:
            swept = _Swept(symmetric)
            inner, steps = self._conjugate_gradients(swept.product, swept.forward(right), swept.precondition)
            solution = swept.backward(inner)
        else:
            solution, steps = self._conjugate_gradients(lambda x: symmetric @ x, right, auxiliary)
        logger.debug("Conjugate gradients: %d steps for %d unknowns", steps, right.size)
        if steps >= self.most_iterations:
            raise np.linalg.LinAlgError(
                f"conjugate gradients have not converged in {steps} steps; check for extreme permeabilities or "
                "elements that are almost flat."
            )
        return solution

    def _conjugate_gradients(self, product: Function, right: Floats, precondition: Function) -> tuple[Floats, int]:
        # The error squared falls by a known amount in every step (Hestenes and Stiefel, J. Res. NBS 49, 1952). The rest
        # is at most the last fall times the largest ratio of both in steps before (after Meurant, Papez and Tichy,
        # Numer. Algorithms 88, 2021).
        solution, residual, direction = np.zeros_like(right), right.copy(), np.zeros_like(right)
        falls, total, size, first = list[float](), 0.0, 1.0, 0.0
        while len(falls) < self.most_iterations:
            if falls and falls[-1] <= self.rtol**2 * total and _rest_after(falls) <= self.rtol**2 * total:
                break
            corrected = precondition(residual)
            last, size = size, float(residual @ corrected)
            first = first or size
            if size <= ROUNDING * first:
                break
            direction *= size / last if falls else 0.0
            direction += corrected
            image = product(direction)
            length = size / float(direction @ image)
            solution += length * direction
            residual -= length * image
            falls.append(length * size)
            total += falls[-1]
        return solution, len(falls)

    def _auxiliary(self, matrix: csr_matrix) -> Function | None:
        if find_spec("pyamg") is None or self.edges is None or self.conditions is None:
            return None
        import pyamg
        from pyamg.relaxation.relaxation import gauss_seidel

        conditions, edges = self.conditions, self.edges
        inner = np.ones(edges.mesh.nvertices, bool)
        inner[edges.nodes[:, conditions.fixed]] = False
        if not inner.any():
            return None
        ends = edges.nodes[:, conditions.free]
        entries = np.ones(ends.size), (np.tile(np.arange(ends.shape[1]), 2), ends.ravel())
        averages = csr_matrix(coo_array(entries, (ends.shape[1], inner.size)).tocsr()[:, np.flatnonzero(inner)])
        half = 0.5 * edges.directions[:, conditions.free].T  # circulation of a vector at one end of an edge
        nodal = _nodal_matrix(matrix, averages, half, conditions)
        levels = pyamg.smoothed_aggregation_solver(
            nodal, symmetry="symmetric", strength=("symmetric", {"theta": 0.1}), max_coarse=200
        ).levels
        cycle, back = _cycle_of(levels), csr_matrix(averages.T)
        lower, above = csr_matrix(tril(matrix)), csr_matrix(triu(matrix, 1))

        def precondition(residual: Floats) -> Floats:
            result = np.zeros_like(residual)
            gauss_seidel(lower, result, residual, 1, "forward")
            rest = conditions.from_classes(above @ result)
            vectors = cycle(back @ (half * rest[:, None]))
            result -= conditions.to_classes(np.einsum("ij,ij->i", half, averages @ vectors))
            gauss_seidel(matrix, result, residual, 1, "backward")
            return result

        return precondition


def _rest_after(falls: list[float]) -> float:
    fall = np.array(falls)
    start = np.max(np.flatnonzero(fall >= FALL * fall[-1]), initial=0)
    rest = np.cumsum(fall[:start:-1])[::-1]
    return float(fall[-1] * np.max(rest / fall[start:-1], initial=0.0))


def _nodal_matrix(matrix: csr_matrix, averages: csr_matrix, half: Floats, conditions: Conditions) -> csr_matrix:
    """Return the matrix of nodal vectors, the same for x, y and z.

    Half the sum over the components is the matrix of ``int nu grad phi . grad phi``, because ``|curl(phi e)|`` is the
    part of grad phi across e.
    """
    if conditions.join is not None:
        matrix = csr_matrix(conditions.join @ matrix @ conditions.join.T)
    columns = matrix.indices
    products = sum(np.repeat(component, np.diff(matrix.indptr)) * component[columns] for component in half.T)
    weighted = csr_matrix((0.5 * matrix.data * products, columns, matrix.indptr), matrix.shape)
    nodal = csr_matrix(averages.T @ (weighted @ averages))
    diagonal = nodal.diagonal()
    shift = SHIFT * np.where(diagonal > 0.0, diagonal, diagonal.max(initial=1.0))
    nodal = csr_matrix(nodal + diags_array(shift))
    nodal.indices, nodal.indptr = nodal.indices.astype(np.int32), nodal.indptr.astype(np.int32)
    return nodal


def _cycle_of(levels: list[Any]) -> Function:
    # one step of Jacobi's method before and after the coarse level
    if len(levels) == 1:
        lowest = np.linalg.pinv(levels[0].A.toarray(), hermitian=True)
        return lambda right: lowest @ right
    level, coarse = levels[0], _cycle_of(levels[1:])
    step = DAMPING / level.A.diagonal()[:, None]

    def cycle(right: Floats) -> Floats:
        result = step * right
        result += level.P @ coarse(level.R @ (right - level.A @ result))
        return result + step * (right - level.A @ result)

    return cycle


class _Swept:
    # Equations between the halves of a sweep of Gauss and Seidel. A product costs as much as one with the matrix
    # (Eisenstat, SIAM J. Sci. Stat. Comput. 2, 1981).

    def __init__(self, matrix: csr_matrix) -> None:
        count, column = np.diff(matrix.indptr), matrix.indices
        row = np.repeat(np.arange(count.size, dtype=np.int32), count)
        diagonal = matrix.diagonal()
        self._diagonal = np.where(diagonal > 0.0, diagonal, 1.0)
        self._between = (1.0 - 2.0 / RELAXATION) * self._diagonal
        values = matrix.data.copy()
        values[row == column] = self._diagonal / RELAXATION

        def triangle(kept: Mask) -> csr_matrix:
            start = np.append(0, np.cumsum(kept, dtype=np.int32))[matrix.indptr]
            return csr_matrix((values[kept], column[kept], start), matrix.shape)

        self.forward, self.backward = _substitutions(triangle(column <= row), triangle(column >= row))

    def precondition(self, x: Floats) -> Floats:
        return self._diagonal * x

    def product(self, x: Floats) -> Floats:
        after = self.backward(x)
        between = self._between * after
        between += x
        after += self.forward(between)
        return after


def _substitutions(lower: csr_matrix, upper: csr_matrix) -> tuple[Function, Function]:
    if find_spec("pyamg") is None:
        factor = splu(lower.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"Equil": False})
        return factor.solve, lambda right: factor.solve(right, "T")
    from pyamg.relaxation.relaxation import gauss_seidel

    def substitution(matrix: csr_matrix, sweep: str) -> Function:
        def solve(right: Floats) -> Floats:
            result = np.zeros_like(right)
            gauss_seidel(matrix, result, right, 1, sweep)
            return result

        return solve

    return substitution(lower, "forward"), substitution(upper, "backward")
