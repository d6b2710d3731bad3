"""Run the loop of a remesher: solve, estimate, turn that into a metric of the wanted number of nodes, remesh.

On triangles and tetrahedra alike, in d dimensions. A metric is 1 / h^2 of the wanted edge lengths h (nnodes,), or the
upper entries of tensors M (d (d + 1) / 2, nnodes) in which wanted edges e have e . M e = 1.
"""

from collections.abc import Callable, Iterator, Sequence
from math import factorial
from typing import Any

import numpy as np
from skfem import Mesh

import kohonen_adapt as ka

Array = np.ndarray
Remesh = Callable[[Mesh, Array], Mesh]
MetricOf = Callable[[Any, Mesh, Any], Array]
"""Problem, mesh and solution to a metric up to a factor."""

TOLERANCE = 1.02  # of the last number of nodes
TRIALS = {2: (1, 8), 3: (2, 6)}  # of every loop and of the last: remeshers take sizes and no number of nodes
NODES = {2: 2.0 / np.sqrt(3.0), 3: 1.1**3}  # of a unit of volume with edges of about one
FLAT = 1e-5  # of the largest eigenvalue; a larger share has larger errors on all layers of `problems/layers.py`


def remeshed_meshes(
    problem: Any,
    start: Mesh,
    counts: Sequence[int],
    metric_of: MetricOf,
    remesh: Remesh,
    trials: int | None = None,
) -> Iterator[tuple[Mesh, Any]]:
    """Every mesh of the loop with its solution, the start first; `counts` are the wanted numbers of nodes after it.

    Each remeshing corrects the metric by what the one before gave; the last is repeated until N is within 2 %, with
    at most this number of trials.
    """
    mesh, correction, power = start, 1.0, 2.0 / start.dim()
    others, last = TRIALS[start.dim()]
    for number, count in enumerate(counts, start=1):
        solution = problem.solve(mesh)
        yield mesh, solution
        metric = metric_of(problem, mesh, solution)
        metric *= (count / expected_nodes(mesh, metric)) ** power
        for _ in range((trials or last) if number == len(counts) else others):
            found = remesh(mesh, correction**power * metric)
            ratio = found.nvertices / count
            correction /= ratio
            if max(ratio, 1 / ratio) <= TOLERANCE:
                break
        mesh = found
    yield mesh, problem.solve(mesh)


def equidistributing(problem: Any, mesh: Mesh, solution: Any) -> Array:
    """1 / h^2 (nnodes,) from the same indicators and the same rule as the map's density."""
    norm, order = getattr(problem, "norm", "energy"), getattr(problem, "order", 1)
    density = ka.density_from_indicators(mesh, problem.indicators(mesh, solution), order=order, norm=norm)
    return at_nodes(mesh, density) ** (2.0 / mesh.dim())


def curvature_metric(problem: Any, mesh: Mesh, solution: Array) -> Array:
    """|H| of the recovered Hessian H of the solution, in the plane times det|H|^(-1/6) for the L2 norm.

    Loseille and Alauzet, *Continuous mesh framework*, SIAM J. Numer. Anal. 49 (2011), for p = infinity and 2.
    """
    eigenvalues, vectors = np.linalg.eigh(recovered_hessian(mesh, solution))
    size = np.abs(eigenvalues)
    size = np.maximum(size, 1e-3 * np.median(size.max(axis=1)))  # where the solution is flat
    if getattr(problem, "norm", "energy") == "L2":
        size *= size.prod(axis=1, keepdims=True) ** (-1 / 6)
    return _tensors(size, vectors)


def gradient_metric(problem: Any, mesh: Mesh, solution: Array) -> Array:
    """Tensors for the gradient of linear interpolants: |H| ||H||^(1/2) det|H|^(-1/4), or those for L2.

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
    tensors = np.einsum("nik,nk,njk->ijn", vectors, eigenvalues, vectors)
    return tensors[np.triu_indices(len(tensors))]


def recovered_hessian(mesh: Mesh, solution: Array) -> Array:
    """Symmetric (nnodes, d, d): gradient of the averaged gradient, averaged again."""
    averaged = [at_nodes(mesh, component) for component in gradient(mesh, solution)]
    second = np.array([[at_nodes(mesh, component) for component in gradient(mesh, values)] for values in averaged])
    return (second + second.transpose(1, 0, 2)).transpose(2, 0, 1) / 2


def edges(mesh: Mesh) -> Array:
    """Of every element from its first corner, (nelements, d, d), a row each."""
    corners = mesh.p[:, mesh.t]
    return (corners[:, 1:] - corners[:, :1]).transpose(2, 1, 0)


def volumes(mesh: Mesh) -> Array:
    """Of all elements."""
    return np.abs(np.linalg.det(edges(mesh))) / factorial(mesh.dim())


def gradient(mesh: Mesh, values: Array) -> Array:
    """Of the P1 function with these values at nodes, (d, nelements)."""
    rises = values[mesh.t[1:]] - values[mesh.t[0]]
    return np.linalg.solve(edges(mesh), rises.T[:, :, None])[:, :, 0].T


def at_nodes(mesh: Mesh, values: Array) -> Array:
    """Means (nnodes,) of values per element over the stars, weighted by volume."""
    size, corners = volumes(mesh), len(mesh.t)
    weighted, weights = (np.bincount(mesh.t.ravel(), np.tile(v, corners)) for v in (size * values, size))
    return weighted / weights


def expected_nodes(mesh: Mesh, metric: Array) -> float:
    """How many nodes a metric asks for, about."""
    dim = mesh.dim()
    if metric.ndim == 1:
        density = metric ** (dim / 2.0)
    else:
        tensors = np.empty((metric.shape[1], dim, dim))
        row, column = np.triu_indices(dim)
        tensors[:, row, column] = tensors[:, column, row] = metric.T
        density = np.sqrt(np.linalg.det(tensors))
    return float(NODES[dim] * volumes(mesh) @ density[mesh.t].mean(axis=0))
