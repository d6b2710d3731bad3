"""Compare the errors on meshes of L with the least there can be, and tell what stands between.

With the exact error e_K of every element E sqrt(T / 2) is (sum of e_K / sqrt 2) times the spread sqrt(1 + cv^2) of the
e_K. The limit of the first factor over all shapes of elements is 0.6917: right isosceles triangles with their legs on
the axes of the Hessian. So the error at T elements is that limit, times what shapes lose, times what an uneven spread
loses; E sqrt(N) is greater by sqrt(2 N / T), the less the fewer nodes outlines have.
"""

from collections.abc import Sequence

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import p1
from benchmarks.problems.l_shape import LShape, exact, exact_gradient, l_shaped_mesh, mean_gradient
from benchmarks.table import aligned

BEST = 0.6917  # sqrt(1/3) * 1.6943 / sqrt(2), the integral over the L of the eigenvalue of the Hessian being 1.6943
PASSES = 3
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_POINTS, _WEIGHTS = (_POINTS + 1) / 2, _WEIGHTS / 2


def report(seeds: Sequence[int], quick: bool) -> str:
    """The factors of the error on the default's mesh, medians over the seeds."""
    rows = []
    for squares in (8, 16) if quick else (8, 16, 32, 64):
        start, problem = l_shaped_mesh(squares), LShape()
        meshes = [ka.adapt(start, problem, passes=PASSES, seed=seed).mesh for seed in seeds]
        rows.append([start.p.shape[1], *np.median([factors(mesh) for mesh in meshes], axis=0).tolist()])
    header = ["limit: L by default, N", "E sqrt(N)", "E sqrt(T/2)", f"limit {BEST}, times shape", "times spread"]
    return aligned(header, [[str(row[0]), *row[1:]] for row in rows])


def factors(mesh: MeshTri) -> list[float]:
    """E sqrt(N), E sqrt(T / 2), what shapes lose, what the spread loses."""
    squared = element_errors(mesh, LShape().solve(mesh))
    nodes, elements = mesh.p.shape[1], mesh.t.shape[1]
    error, total = np.sqrt(squared.sum()), np.sqrt(squared).sum()
    spread = error * np.sqrt(elements) / total
    return [
        float(error * nodes**0.5),
        float(error * (elements / 2) ** 0.5),
        float(total / 2**0.5 / BEST),
        float(spread),
    ]


def element_errors(mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
    """Squared error of every element, (nelements,): |grad u|^2 - 2 grad u . grad u_h + |grad u_h|^2."""
    areas, _ = p1.shape_gradients(mesh)
    discrete = p1.gradient(mesh, solution)
    mixed = (mean_gradient(mesh) * discrete).sum(axis=0)
    return np.maximum(0.0, energies(mesh) + areas * ((discrete**2).sum(axis=0) - 2 * mixed))


def energies(mesh: MeshTri) -> np.ndarray:
    """int |grad u|^2 over every element, by Green's formula: u is harmonic, so it is that of u du/dn around it."""
    corners = mesh.p[:, mesh.t]
    (ax, ay), (bx, by) = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turn = np.sign(ax * by - ay * bx)
    total = np.zeros(mesh.t.shape[1])
    for k in range(3):
        start, end = corners[:, k], corners[:, (k + 1) % 3]
        total += turn * flow(start, end)
    return total


def flow(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """int u du/dn on straight lines from start to end (2, n), n to the right; graded toward the re-entrant corner."""
    swapped = np.hypot(*end) < np.hypot(*start)
    near, far = np.where(swapped, end, start), np.where(swapped, start, end)
    at_corner = np.hypot(*near) < 1e-9
    way = end - start
    total = np.zeros(start.shape[1])
    for point, weight in zip(_POINTS, _WEIGHTS, strict=True):
        t, rate = graded(at_corner, point)
        x = near + t * (far - near)
        slope = exact_gradient(x)
        total += weight * rate * exact(x) * (slope[0] * way[1] - slope[1] * way[0])
    return total


def graded(at_corner: np.ndarray, point: float) -> tuple[np.ndarray, np.ndarray]:
    """Parameter t and its rate; from the corner on u du/dn is a multiple of r^(1/3), for t = s^3 a polynomial in s."""
    return np.where(at_corner, point**3, point), np.where(at_corner, 3 * point**2, 1.0)
