"""The P1 equations of A_z: assembly, fixed values, solution."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from skfem import MeshTri

from kohonen_adapt.estimators.gradients import gradient, hat_gradients
from kohonen_adapt.magnetostatics.coefficients import Coefficients, named
from kohonen_adapt.triangles import area

__all__ = ["Value", "equations", "fixed_values", "solve_potential", "solved"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.int64]
Value = float | Callable[[Floats], ArrayLike]


def fixed_values(mesh: MeshTri, potential: Mapping[str, Value]) -> tuple[Bools, Floats]:
    """Which nodes have a fixed potential, (nnodes,) bool, and the values there, (nnodes,) with zeros elsewhere.

    A boundary hands its value to all nodes of its facets; at a node of several, the last in the mapping counts.
    """
    fixed = np.zeros(mesh.p.shape[1], dtype=bool)
    values = np.zeros(mesh.p.shape[1])
    for name, value in potential.items():
        nodes = np.unique(mesh.facets[:, named(mesh.boundaries, name, "boundary")])
        fixed[nodes] = True
        values[nodes] = _evaluated(name, value, mesh.p[:, nodes])
    _check_tied(mesh, fixed)
    return fixed, values


def solve_potential(mesh: MeshTri, given: Coefficients, fixed: Bools, values: Floats) -> Floats:
    """Nodal A_z, (nnodes,) in Wb/m, of ``-div(nu grad A - flux) = J`` with A = `values` at the `fixed` nodes."""
    potential = values.copy()
    free = np.flatnonzero(~fixed)
    if free.size:
        potential[free] = solved(*equations(mesh, given, values, free))
    if not np.all(np.isfinite(potential)):
        raise np.linalg.LinAlgError(
            "the potential came out infinite or not a number; look for extreme permeabilities, sources, potentials "
            "or elements that are almost flat."
        )
    return potential


def equations(mesh: MeshTri, given: Coefficients, values: Floats, free: Indices) -> tuple[csc_array, Floats]:
    """Matrix of ``int nu grad u . grad v`` over the free nodes, and the right-hand side that belongs to it."""
    size, hats = area(mesh), hat_gradients(mesh)
    with np.errstate(over="ignore", invalid="ignore"):
        pull = given.flux - given.reluctivity * gradient(mesh, values, hats)
        load = size * (given.current_density / 3.0 + np.einsum("ck,cik->ik", pull, hats))
    right = np.bincount(mesh.t.ravel(), load.ravel(), values.size).astype(np.float64)
    return _stiffness(mesh, given.reluctivity * size, hats, free), right[free]


def solved(matrix: csc_array, right: Floats) -> Floats:
    """Solution of a symmetric and positive definite system.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is singular.
    """
    # The pivots may stay on the diagonal: half the time of the defaults. Relaxed supernodes and panels of several
    # columns, other defaults, never pay here, and on some meshes the first multiply the time (`benchmarks round`).
    try:
        factors = splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            relax=1,
            panel_size=1,
            options={"SymmetricMode": True, "Equil": False},
        )
    except RuntimeError as error:
        raise np.linalg.LinAlgError(
            f"the equations of the potential are singular ({error}); look for extreme permeabilities or elements "
            "that are almost flat."
        ) from error
    return factors.solve(right)


def _stiffness(mesh: MeshTri, weight: Floats, hats: Floats, free: Indices) -> csc_array:
    """Sum over the elements of `weight` times the products of the gradients of hat functions, symmetric."""
    number = np.full(mesh.p.shape[1], -1, dtype=np.int32)
    number[free] = np.arange(free.size)
    # A product off the diagonal is worked out once and stands in two places; those on it are summed beforehand.
    off = np.einsum("cik,cik->ik", hats, hats[:, [1, 2, 0]]) * weight
    on = np.bincount(mesh.t.ravel(), (np.einsum("cik,cik->ik", hats, hats) * weight).ravel(), number.size)
    start, end = number[mesh.t], number[mesh.t[[1, 2, 0]]]
    inner = (start >= 0) & (end >= 0)
    off, start, end, diagonal = off[inner], start[inner], end[inner], number[free]
    row, column = np.concatenate((start, end, diagonal)), np.concatenate((end, start, diagonal))
    return coo_array((np.concatenate((off, off, on[free])), (row, column)), shape=(free.size, free.size)).tocsc()


def _evaluated(name: str, value: Value, x: Floats) -> Floats:
    given = np.asarray(value(x) if callable(value) else value, dtype=float)
    if given.shape not in {(), x.shape[1:]}:
        raise ValueError(
            f"potential of {name!r} must be a float or have shape (n,) = {x.shape[1:]}; got {given.shape}."
        )
    everywhere = np.broadcast_to(given, x.shape[1:])
    bad = np.count_nonzero(~np.isfinite(everywhere))
    if bad:
        raise ValueError(f"potential of {name!r} must be finite; it is not at {bad} of its {everywhere.size} nodes.")
    return everywhere


def _check_tied(mesh: MeshTri, fixed: Bools) -> None:
    """Every connected part of the mesh needs a fixed value, or its potential is known up to a constant only."""
    graph = coo_array((np.ones(mesh.facets.shape[1], dtype=np.int8), tuple(mesh.facets)), shape=(fixed.size,) * 2)
    parts, part = connected_components(graph, directed=False)
    loose = np.setdiff1d(np.arange(parts), part[fixed])
    if loose.size:
        node = int(np.flatnonzero(part == loose[0])[0])
        raise ValueError(
            f"the potential is fixed nowhere on {loose.size} of the {parts} connected parts of the mesh, "
            f"first the one of node {node}. Fix it there by a boundary name."
        )
