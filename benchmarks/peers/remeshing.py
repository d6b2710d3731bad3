"""Run the loop of a remesher: solve, estimate, turn that into a metric of the wanted number of nodes, remesh."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import p1

Array = np.ndarray
Remesh = Callable[[MeshTri, Array], MeshTri]
"""Mesh and metric at its nodes to a new mesh. A metric is 1 / h^2 of the wanted edge lengths h (nnodes,), or the
entries xx, xy, yy of tensors M (3, nnodes) in which wanted edges e have e . M e = 1."""
MetricOf = Callable[[Any, MeshTri, Any], Array]
"""Problem, mesh and solution to a metric up to a factor."""

TOLERANCE = 1.02  # of the last number of nodes
TRIALS = 8
FLAT = 1e-5  # of the largest eigenvalue; a larger share has larger errors on all layers of `problems/layers.py`


def remeshed_meshes(
    problem: Any,
    start: MeshTri,
    counts: Sequence[int],
    metric_of: MetricOf,
    remesh: Remesh,
    trials: int = TRIALS,
) -> Iterator[tuple[MeshTri, Any]]:
    """Every mesh of the loop with its solution, the start first; `counts` are the wanted numbers of nodes after it.

    Each remeshing corrects the metric by what the one before gave; the last is repeated until N is within 2 %, with
    at most this number of trials.
    """
    mesh, correction = start, 1.0
    for number, count in enumerate(counts, start=1):
        solution = problem.solve(mesh)
        yield mesh, solution
        metric = metric_of(problem, mesh, solution)
        metric *= count / expected_nodes(mesh, metric)
        for _ in range(trials if number == len(counts) else 1):
            found = remesh(mesh, correction * metric)
            ratio = found.p.shape[1] / count
            correction /= ratio
            if max(ratio, 1 / ratio) <= TOLERANCE:
                break
        mesh = found
    yield mesh, problem.solve(mesh)


def equidistributing(problem: Any, mesh: MeshTri, solution: Any) -> Array:
    """1 / h^2 (nnodes,) from the same indicators and the same rule as the map's density."""
    norm, order = getattr(problem, "norm", "energy"), getattr(problem, "order", 1)
    return at_nodes(mesh, ka.density_from_indicators(mesh, problem.indicators(mesh, solution), order=order, norm=norm))


def curvature_metric(problem: Any, mesh: MeshTri, solution: Array) -> Array:
    """Tensors (3, nnodes) from the recovered Hessian H of the solution: |H|, times det|H|^(-1/6) for the L2 norm.

    Loseille and Alauzet, *Continuous mesh framework*, SIAM J. Numer. Anal. 49 (2011), for p = infinity and 2.
    """
    eigenvalues, vectors = np.linalg.eigh(recovered_hessian(mesh, solution))
    size = np.abs(eigenvalues)
    size = np.maximum(size, 1e-3 * np.median(size.max(axis=1)))  # where the solution is flat
    if getattr(problem, "norm", "energy") == "L2":
        size *= size.prod(axis=1, keepdims=True) ** (-1 / 6)
    return _tensors(size, vectors)


def gradient_metric(problem: Any, mesh: MeshTri, solution: Array) -> Array:
    """Tensors (3, nnodes) for the gradient of linear interpolants: |H| ||H||^(1/2) det|H|^(-1/4), or those for L2.

    Huang, *Metric tensors for anisotropic mesh generation*, J. Comput. Phys. 204 (2005).
    """
    if getattr(problem, "norm", "energy") == "L2":
        return curvature_metric(problem, mesh, solution)
    eigenvalues, vectors = np.linalg.eigh(recovered_hessian(mesh, solution))
    size = np.abs(eigenvalues)
    size = np.maximum(size, FLAT * size.max())
    return _tensors(
        size * np.sqrt(size.max(axis=1, keepdims=True) / np.sqrt(size.prod(axis=1, keepdims=True))), vectors
    )


def _tensors(eigenvalues: Array, vectors: Array) -> Array:
    tensors = np.einsum("nik,nk,njk->nij", vectors, eigenvalues, vectors)
    return np.stack((tensors[:, 0, 0], tensors[:, 0, 1], tensors[:, 1, 1]))


def recovered_hessian(mesh: MeshTri, solution: Array) -> Array:
    """Symmetric (nnodes, 2, 2): gradient of the averaged gradient, averaged again."""
    averaged = [at_nodes(mesh, component) for component in p1.gradient(mesh, solution)]
    second = [[at_nodes(mesh, component) for component in p1.gradient(mesh, values)] for values in averaged]
    hessian = np.moveaxis(np.array(second), -1, 0)
    return (hessian + hessian.transpose(0, 2, 1)) / 2


def at_nodes(mesh: MeshTri, values: Array) -> Array:
    """Means (nnodes,) of values per element over the stars, weighted by area."""
    areas, _ = p1.shape_gradients(mesh)
    count = mesh.p.shape[1]
    weighted, weights = (np.bincount(mesh.t.ravel(), np.tile(v, 3), count) for v in (areas * values, areas))
    return weighted / weights


def expected_nodes(mesh: MeshTri, metric: Array) -> float:
    """Half the number of triangles of the metric's unit edges that cover the mesh."""
    root = metric if metric.ndim == 1 else np.sqrt(metric[0] * metric[2] - metric[1] ** 2)
    areas, _ = p1.shape_gradients(mesh)
    return float(areas @ root[mesh.t].mean(axis=0)) * 2 / np.sqrt(3)
