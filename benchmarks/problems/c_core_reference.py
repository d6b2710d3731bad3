"""Compute the reference energy of problem C by P2 elements on meshes bisected where their error is, until it settles.

`python -m benchmarks.problems.c_core_reference` prints the energy of every mesh and the limit it points to.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementTriP0, ElementTriP2, Functional, InteriorFacetBasis, LinearForm
from skfem import condense as condensed
from skfem.helpers import dot, grad

from benchmarks.peers.bisection import Bisection, mark_bulk
from benchmarks.problems import p1
from benchmarks.problems.c_core import c_core_mesh, flux, reluctivity

SHARE = 0.5
DEGREES_OF_FREEDOM = 600_000


@BilinearForm
def stiffness(u, v, w):
    """nu grad u . grad v."""
    return w["nu"] * dot(grad(u), grad(v))


@LinearForm
def load(v, w):
    """flux . grad v; the flux has no y component."""
    return w["flux"] * grad(v)[0]


@Functional
def jump(w):
    """h [nu du/dn - flux . n]^2 / max(nu)."""
    first, second = (w[f"nu{side}"] * dot(grad(w[f"u{side}"]), w.n) - w[f"flux{side}"] * w.n[0] for side in (0, 1))
    return w.h * (first - second) ** 2 / np.maximum(w["nu0"], w["nu1"])


def energies() -> Iterator[tuple[int, int, float]]:
    """Nodes, degrees of freedom and a(u_h, u_h) on finer and finer meshes without end."""
    state = Bisection.of(c_core_mesh("c_core.msh"))
    while True:
        mesh = state.mesh()
        basis = Basis(mesh, ElementTriP2())
        solution, energy = solve(basis)
        yield mesh.p.shape[1], basis.N, energy
        state = state.refined(mark_bulk(indicators(basis, solution), SHARE))


def solve(basis: Basis) -> tuple[np.ndarray, float]:
    """Degrees of freedom of the P2 solution and its energy."""
    coefficients = basis.with_element(ElementTriP0())
    nu, gx = (coefficients.interpolate(values) for values in (reluctivity(basis.mesh), flux(basis.mesh)[0]))
    matrix, right = stiffness.assemble(basis, nu=nu), load.assemble(basis, flux=gx)
    reduced, reduced_right, solution, inner = condensed(matrix, right, D=basis.get_dofs())
    factors = splu(reduced.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    solution[inner] = factors.solve(reduced_right)
    return solution, float(solution @ (matrix @ solution))


def indicators(basis: Basis, solution: np.ndarray) -> np.ndarray:
    """Residual indicators, element and jump part, (nelements,), unsquared."""
    mesh = basis.mesh
    nu, gx = reluctivity(mesh), flux(mesh)[0]
    fields = {}
    for side in (0, 1):
        facets = InteriorFacetBasis(mesh, ElementTriP2(), side=side)
        coefficients = InteriorFacetBasis(mesh, ElementTriP0(), side=side, quadrature=facets.quadrature)
        fields[f"u{side}"] = facets.interpolate(solution)
        fields[f"nu{side}"], fields[f"flux{side}"] = coefficients.interpolate(nu), coefficients.interpolate(gx)
    on_facets = np.zeros(mesh.facets.shape[1])
    on_facets[facets.find] = jump.elemental(facets, **fields)
    inside = nu * 2 * p1.shape_gradients(mesh)[0] ** 2 * laplacian(basis, solution) ** 2
    return np.sqrt(inside + 0.5 * on_facets[mesh.t2f].sum(axis=0))


def laplacian(basis: Basis, solution: np.ndarray) -> np.ndarray:
    """lap u_h (nelements,) by the chain rule: scikit-fem's P2 elements have no second derivatives."""
    corners, sides = np.split(solution[basis.element_dofs], 2)
    first, second, third = p1.shape_gradients(basis.mesh)[1]
    squares = [(hat**2).sum(axis=0) for hat in (first, second, third)]
    products = [(a * b).sum(axis=0) for a, b in ((first, second), (second, third), (first, third))]
    return 4 * (corners * squares).sum(axis=0) + 8 * (sides * products).sum(axis=0)


def extrapolated(before: Sequence[float], now: Sequence[float]) -> float:
    """The limit of energies that fall short by a multiple of unknowns^-2, the rate of adapted P2 elements."""
    return now[1] + (now[1] - before[1]) / ((now[0] / before[0]) ** 2 - 1)


def main() -> None:
    """Print the energies until there are `DEGREES_OF_FREEDOM`, and the limit that each pair in a row points to."""
    for (_, *before), (nodes, *now) in pairwise(energies()):
        limit = extrapolated(before, now)
        print(f"{nodes:7d} nodes {now[0]:8d} unknowns  {now[1]:.15e}  limit {limit:.15e}", flush=True)
        if now[0] > DEGREES_OF_FREEDOM:
            break


if __name__ == "__main__":
    main()
