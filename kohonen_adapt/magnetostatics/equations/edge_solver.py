"""Conjugate gradients for edge elements."""

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from scipy.sparse import csc_array, csr_matrix
from scipy.sparse.linalg import splu

from kohonen_adapt.arrays import Floats, Function, Mask
from kohonen_adapt.log import logger
from kohonen_adapt.magnetostatics.equations.system import Solver
from kohonen_adapt.mesh.elements.assembly import Subspaces

__all__ = ["EdgeSolver"]

RELAXATION = 1.3  # of Gauss and Seidel's method: 1.0 takes 6 to 15 % more steps, and 1.6 up to 30 %
FALL = 1e4  # of the error squared, in the last steps, whose rate is used
ROUNDING = 1e-28  # residual that is rounding error, relative, squared


@dataclass(frozen=True)
class EdgeSolver(Solver):
    """Conjugate gradients for the singular equations of a vector potential.

    No gauge is imposed, because the equations are consistent: the load has no component along gradients. The
    preconditioner is a symmetric sweep of Gauss and Seidel.
    """

    # At 98 000 to 1 070 000 edges sweeps take 0.5 to 1 times the time of algebraic multigrid for vectors at the nodes
    # between both halves of a sweep (Hiptmair and Xu, SIAM J. Numer. Anal. 45, 2007).
    most_iterations: int = 10_000
    rtol: float = 1e-6  # of B in the energy norm; the error of the energy is its square
    floor: float = 0.0  # right-hand side that is rounding error

    def solve(self, matrix: csc_array, right: Floats, subspaces: Subspaces | None = None) -> Floats:
        if np.linalg.norm(right) <= self.floor:
            return np.zeros_like(right)
        swept = _Swept(csr_matrix(matrix.T))
        solution, steps = self._conjugate_gradients(swept, swept.forward(right))
        logger.debug("Conjugate gradients: %d steps for %d unknowns", steps, right.size)
        if steps >= self.most_iterations:
            raise np.linalg.LinAlgError(
                f"conjugate gradients have not converged in {steps} steps; check for extreme permeabilities or "
                "elements that are almost flat."
            )
        return swept.backward(solution)

    def _conjugate_gradients(self, swept: "_Swept", right: Floats) -> tuple[Floats, int]:
        # The error squared falls by a known amount in every step (Hestenes and Stiefel, J. Res. NBS 49, 1952). The rest
        # is at most the last fall times the largest ratio of both in steps before (after Meurant, Papez and Tichy,
        # Numer. Algorithms 88, 2021).
        solution, residual, direction = np.zeros_like(right), right.copy(), np.zeros_like(right)
        falls, total, size, first = list[float](), 0.0, 1.0, 0.0
        while len(falls) < self.most_iterations:
            if falls and falls[-1] <= self.rtol**2 * total and _rest_after(falls) <= self.rtol**2 * total:
                break
            corrected = swept.diagonal * residual
            last, size = size, float(residual @ corrected)
            first = first or size
            if size <= ROUNDING * first:
                break
            direction *= size / last if falls else 0.0
            direction += corrected
            image = swept.product(direction)
            length = size / float(direction @ image)
            solution += length * direction
            residual -= length * image
            falls.append(length * size)
            total += falls[-1]
        return solution, len(falls)


def _rest_after(falls: list[float]) -> float:
    fall = np.array(falls)
    start = np.max(np.flatnonzero(fall >= FALL * fall[-1]), initial=0)
    rest = np.cumsum(fall[:start:-1])[::-1]
    return float(fall[-1] * np.max(rest / fall[start:-1], initial=0.0))


class _Swept:
    # Equations between the halves of a sweep of Gauss and Seidel. A product costs as much as one with the matrix
    # (Eisenstat, SIAM J. Sci. Stat. Comput. 2, 1981).

    def __init__(self, matrix: csr_matrix) -> None:
        count, column = np.diff(matrix.indptr), matrix.indices
        row = np.repeat(np.arange(count.size, dtype=np.int32), count)
        diagonal = matrix.diagonal()
        self.diagonal = np.where(diagonal > 0.0, diagonal, 1.0)
        self._between = (1.0 - 2.0 / RELAXATION) * self.diagonal
        values = matrix.data.copy()
        values[row == column] = self.diagonal / RELAXATION

        def triangle(kept: Mask) -> csr_matrix:
            start = np.append(0, np.cumsum(kept, dtype=np.int32))[matrix.indptr]
            return csr_matrix((values[kept], column[kept], start), matrix.shape)

        self.forward, self.backward = _substitutions(triangle(column <= row), triangle(column >= row))

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
