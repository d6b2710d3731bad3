"""Time a round of problem L as scikit-fem users write it: the yardstick of all timings, frozen so as not to move."""

import time

import numpy as np
from skfem import Basis, BilinearForm, ElementTriP1, Functional, InteriorFacetBasis, MeshTri, condense, solve
from skfem.helpers import dot, grad

from benchmarks.problems.l_shape import exact, l_shaped_mesh


@BilinearForm
def laplace(u, v, w):
    """Integrand of the stiffness matrix."""
    return dot(grad(u), grad(v))


@Functional
def jump(w):
    """Integrand of the indicators on a facet, as in scikit-fem's example 22."""
    n = w.n
    dw1, dw2 = grad(w["u1"]), grad(w["u2"])
    return w.h * ((dw1[0] - dw2[0]) * n[0] + (dw1[1] - dw2[1]) * n[1]) ** 2


def reference_round(mesh: MeshTri) -> tuple[np.ndarray, np.ndarray]:
    """Assemble, solve with scipy's spsolve and estimate; the solution and the unsquared indicators."""
    basis = Basis(mesh, ElementTriP1())
    matrix = laplace.assemble(basis)
    boundary = basis.get_dofs()
    values = basis.zeros()
    values[boundary] = exact(basis.doflocs)[boundary]
    solution = solve(*condense(matrix, x=values, D=boundary))

    sides = [InteriorFacetBasis(mesh, ElementTriP1(), side=side) for side in (0, 1)]
    fields = {f"u{side + 1}": sides[side].interpolate(solution) for side in (0, 1)}
    on_facets = np.zeros(mesh.facets.shape[1])
    on_facets[sides[0].find] = jump.elemental(sides[0], **fields)
    return solution, np.sqrt(0.5 * on_facets[mesh.t2f].sum(axis=0))


def seconds_per_round(mesh: MeshTri) -> float:
    """Wall time of one round on a mesh that has not been used before."""
    fresh = MeshTri(mesh.p.copy(), mesh.t.copy())
    start = time.perf_counter()
    reference_round(fresh)
    return time.perf_counter() - start


def main() -> None:
    """Print the time of a round for three sizes."""
    for n in (16, 32, 64):
        mesh = l_shaped_mesh(n)
        seconds = float(np.median([seconds_per_round(mesh) for _ in range(5)]))
        nodes = mesh.p.shape[1]
        print(f"N = {nodes:6d}: {seconds:.4f} s, {1e6 * seconds / nodes:.1f} microseconds per node")


if __name__ == "__main__":
    main()
