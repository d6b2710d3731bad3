"""Hold estimates on tetrahedra against the error, on uniform meshes and on those refined where they say."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags_array
from scipy.sparse.linalg import cg
from skfem import Basis, BilinearForm, ElementTetP1, LinearForm, MeshTet, condense
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from benchmarks.table import aligned
from kohonen_adapt import estimators

ESTIMATORS = {"residual": estimators.residual, "recovery": estimators.recovery}
NODES, FEW = 12_000, 3_000  # refinement ends beyond
MARKED = 0.5  # of the squared estimate: what the elements that are refined have together (Doerfler)
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """``-div grad u = 1`` with u = 0 where a node is given, and the exact ``int |grad u|^2``."""

    name: str
    start: Callable[[], MeshTet]
    given: Callable[[MeshTet], NDArray[np.intp]]
    energy: float


def report(seeds: Sequence[int], quick: bool) -> str:
    """Estimate over error on a uniform mesh, and on the last one refined by that estimate."""
    logging.getLogger("skfem").setLevel(logging.ERROR)  # of arrays that its refinement has in another order
    rows = [row for case in cases() for row in _rows(case, FEW if quick else NODES)]
    return aligned(["effectivity on tetrahedra", "mesh", "N", "least quality", "error %", *ESTIMATORS], rows)


def cases() -> list[Case]:
    """An edge that runs in, three edges that meet in a corner, and a smooth solution."""
    return [
        Case("E, L-shape times (0, 1)", lambda: _without(4, lambda x: (x[0] > 0) & (x[1] < 0), 2), _around, 0.21407580),
        Case("F, Fichera's corner", lambda: _without(4, lambda x: (x > 0).all(axis=0), 4), _outer, 0.39794330),
        Case("S, cube", lambda: _ticks(8, 0.0, 8), _outer, energy_of_the_cube()),
    ]


def energy_of_the_cube() -> float:
    """``int u`` for ``-div grad u = 1`` on the unit cube, u = 0 around: its series over odd i, j, k, to 1e-9."""
    odd = np.arange(1.0, 400.0, 2.0)
    i, j = np.meshgrid(odd, odd)
    s = np.pi * np.sqrt(i**2 + j**2)  # the sum over k is that of a line: int of (1 - cosh) / s^2
    line = (1.0 - np.tanh(s / 2.0) / (s / 2.0)) / s**2
    return float(np.sum(line * 64.0 / (np.pi * i) ** 2 / (np.pi * j) ** 2))


def solved(case: Case, mesh: MeshTet) -> tuple[Floats, float]:
    """The P1 solution, and its error in the energy norm: what its energy lacks."""
    basis = Basis(mesh, ElementTetP1())
    stiffness = BilinearForm(lambda u, v, _: dot(grad(u), grad(v))).assemble(basis)
    load = LinearForm(lambda v, _: v).assemble(basis)
    matrix, right, found, free = condense(stiffness, load, D=case.given(mesh))
    found[free] = cg(matrix, right, rtol=1e-10, M=diags_array(1.0 / matrix.diagonal()))[0]
    return found, float(np.sqrt(case.energy - load @ found))


def _rows(case: Case, most: int) -> list[list[Any]]:
    start = case.start()
    meshes = {"uniform": start} | {f"refined by {name}": _refined(case, start, name, most) for name in ESTIMATORS}
    return [_row(case, name, mesh) for name, mesh in meshes.items()]


def _row(case: Case, name: str, mesh: MeshTet) -> list[Any]:
    found, error = solved(case, mesh)
    ratio = [np.linalg.norm(indicators(mesh, found, each)) / error for each in ESTIMATORS]
    return [case.name, name, mesh.p.shape[1], ka.quality(mesh).min(), 100.0 * error / np.sqrt(case.energy), *ratio]


def indicators(mesh: MeshTet, found: Floats, name: str) -> Floats:
    """By the name of the estimator."""
    ones = np.ones(mesh.nelements)
    return ESTIMATORS[name](mesh, found, ones, source=ones)


def _refined(case: Case, mesh: MeshTet, name: str, most: int) -> MeshTet:
    while mesh.p.shape[1] < most:
        eta = indicators(mesh, solved(case, mesh)[0], name)
        order = np.argsort(-eta)
        share = np.cumsum(eta[order] ** 2) / np.sum(eta**2)
        mesh = mesh.refined(order[: np.searchsorted(share, MARKED) + 1])
    return mesh


def _ticks(n: int, low: float, layers: int) -> MeshTet:
    ticks = np.linspace(low, 1.0, n + 1)
    return MeshTet.init_tensor(ticks, ticks, np.linspace(0.0 if layers < n else low, 1.0, layers + 1))


def _without(n: int, gone: Callable[[Floats], NDArray[np.bool_]], depth: int) -> MeshTet:
    """(-1, 1)^2 times (0, 1), or (-1, 1)^3, in n cells per unit, less the part whose middles are gone."""
    mesh = _ticks(2 * n, -1.0, n * depth // 2)
    return mesh.remove_elements(np.flatnonzero(gone(mesh.p[:, mesh.t].mean(axis=1))))


def _outer(mesh: MeshTet) -> NDArray[np.intp]:
    return mesh.boundary_nodes()


def _around(mesh: MeshTet) -> NDArray[np.intp]:
    """All of the boundary but its flat ends above and below."""
    sides = mesh.facets_satisfying(lambda x: (x[2] > 1e-9) & (x[2] < 1 - 1e-9), boundaries_only=True)
    return np.unique(mesh.facets[:, sides])
