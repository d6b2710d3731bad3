"""Run the loop of a remesher of tetrahedra: solve, estimate, turn that into a metric of the wanted nodes, remesh."""

from collections.abc import Callable

import numpy as np
from skfem import Basis, ElementTetP1, MeshTet

from benchmarks.problems.quadratic_solids import Quadratic
from benchmarks.problems.solids import Solid

LOOPS = 5
TRIALS = 6  # of the last loop, 2 of the others: remeshers take sizes and no number of nodes
NEAR = 1.02  # times the number of nodes, or less
EDGE = 1.1  # times rho^(-1/3): the edge length that gives about the density rho
FLAT = 1e-3  # of the median of the largest: curvatures are not taken for less

Asked = Solid | Quadratic
Metric = Callable[[Asked, MeshTet, np.ndarray], np.ndarray]
Remesh = Callable[[Asked, MeshTet, np.ndarray], MeshTet]


def adapted(problem: Asked, mesh: MeshTet, metric_of: Metric, remesh: Remesh) -> MeshTet:
    """The mesh after loops of solving, estimating and remeshing, with as many nodes as the start within 2 %."""
    count, correction = mesh.nvertices, 1.0
    for loop in range(LOOPS):
        metric = metric_of(problem, mesh, problem.solve(mesh))
        metric *= (count / expected_nodes(mesh, metric)) ** (2 / 3)
        for _ in range(TRIALS if loop == LOOPS - 1 else 2):
            found = remesh(problem, mesh, correction ** (2 / 3) * metric)
            ratio = found.nvertices / count
            correction /= ratio
            if max(ratio, 1 / ratio) < NEAR:
                break
        mesh = found
    return mesh


def sizes(problem: Asked, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
    """1 / h^2 (nnodes,) up to a factor, from the density that this package takes."""
    return at_nodes(mesh, problem.density(mesh, u)) ** (2 / 3)


def curvatures(problem: Asked, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
    """Tensors (6, nnodes) up to a factor: |H| of the recovered Hessian H, as `remeshing.curvature_metric`."""
    averaged = [at_nodes(mesh, component) for component in gradient(mesh, u)]
    second = np.array([[at_nodes(mesh, component) for component in gradient(mesh, values)] for values in averaged])
    eigenvalues, vectors = np.linalg.eigh((second + second.transpose(1, 0, 2)).transpose(2, 0, 1) / 2)
    size = np.abs(eigenvalues)
    size = np.maximum(size, FLAT * np.median(size.max(axis=1)))
    tensors = np.einsum("nik,nk,njk->ijn", vectors, size, vectors)
    return tensors[np.triu_indices(3)]


def gradient(mesh: MeshTet, u: np.ndarray) -> np.ndarray:
    """Of the values at nodes, (3, nelements)."""
    return np.asarray(Basis(mesh, ElementTetP1(), intorder=1).interpolate(u).grad)[:, :, 0]


def expected_nodes(mesh: MeshTet, metric: np.ndarray) -> float:
    """How many nodes a metric asks for, about."""
    if metric.ndim == 1:
        density = metric**1.5
    else:
        xx, xy, xz, yy, yz, zz = metric
        density = np.sqrt(xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz))
    return float(EDGE**3 * volumes(mesh) @ density[mesh.t].mean(axis=0))


def at_nodes(mesh: MeshTet, values: np.ndarray) -> np.ndarray:
    """Averages of values of elements by their volume, at nodes."""
    volume = volumes(mesh)
    total = np.bincount(mesh.t.ravel(), np.tile(volume, 4))
    return np.bincount(mesh.t.ravel(), np.tile(volume * values, 4)) / total


def volumes(mesh: MeshTet) -> np.ndarray:
    """Of all elements."""
    a, b, c, d = mesh.p[:, mesh.t].transpose(1, 0, 2)
    return np.abs(np.einsum("ij,ij->j", b - a, np.cross(c - a, d - a, axis=0))) / 6.0
