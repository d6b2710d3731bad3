"""The P1 equations of the potential: assembly and solution."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import SuperLU, splu
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.multigrid import by_multigrid
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients

__all__ = [
    "Scalar",
    "assembled",
    "check_finite",
    "equations",
    "factorised",
    "loads",
    "scalar_of",
    "solve_scalar",
    "solved",
]


@dataclass(frozen=True)
class Scalar:
    """``-div(reluctivity grad u - flux) = source`` in the plane of the mesh."""

    reluctivity: Floats  # (nelements,)
    flux: Floats  # (2, nelements)
    source: Floats  # (nelements,)


def scalar_of(mesh: MeshTri, symmetry: Symmetry, given: Coefficients) -> Scalar:
    """The scalar problem of linear material; of nonlinear material that at B = 0."""
    return Scalar(
        symmetry.reluctivity(mesh, given.reluctivity),
        -symmetry.flux(-given.coercivity),
        symmetry.source(given.current_density),
    )


def solve_scalar(mesh: MeshTri, given: Scalar, conditions: Conditions) -> Floats:
    """Nodal values of the solution, (nnodes,)."""
    potential = conditions.values.copy()
    free = conditions.free
    if free.size:
        matrix, right = equations(mesh, given, potential, free)
        if conditions.robin is not None:
            right = right - (conditions.robin @ potential)[free]
        potential[free] = conditions.expanded(solved(*conditions.reduced(matrix, right)))
    check_finite(potential)
    return potential


def equations(mesh: MeshTri, given: Scalar, values: Floats, free: Ints) -> tuple[csc_array, Floats]:
    """Matrix of ``int nu grad u . grad v`` over the free nodes, and the right-hand side that belongs to it."""
    size, hats = area(mesh), hat_gradients(mesh)
    with np.errstate(over="ignore", invalid="ignore"):
        right = loads(mesh, given.source, given.flux - given.reluctivity * gradient(mesh, values, hats), hats)
    own, next_one = np.einsum("cik,cik->ik", hats, hats), np.einsum("cik,cik->ik", hats, hats[:, [1, 2, 0]])
    weight = given.reluctivity * size
    return assembled(mesh, own * weight, next_one * weight, free), right[free]


def loads(mesh: MeshTri, source: Floats, flux: Floats, hats: Floats | None = None) -> Floats:
    """``int source phi + flux . grad phi`` of every node's hat function phi, (nnodes,)."""
    hats = hat_gradients(mesh) if hats is None else hats
    load = area(mesh) * (source / 3.0 + np.einsum("ck,cik->ik", flux, hats))
    return np.bincount(mesh.t.ravel(), load.ravel(), mesh.p.shape[1]).astype(np.float64)


def solved(matrix: csc_array, right: Floats) -> Floats:
    """Solution of a symmetric and positive definite system: a large one by multigrid, others by factors.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is singular.
    """
    solution = by_multigrid(matrix, right)
    return factorised(matrix).solve(right) if solution is None else solution


def factorised(matrix: csc_array) -> SuperLU:
    """The factors of a symmetric and positive definite matrix; LinAlgError if it is singular."""
    # The pivots may stay on the diagonal: half the time of the defaults. Relaxed supernodes and panels of several
    # columns, other defaults, never pay here, and on some meshes the first multiply the time (`benchmarks round`).
    try:
        return splu(
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


def check_finite(values: Floats) -> None:
    """Refuse a solution that is none."""
    if not np.all(np.isfinite(values)):
        raise np.linalg.LinAlgError(
            "the potential came out infinite or not a number; look for extreme permeabilities, sources, potentials "
            "or elements that are almost flat."
        )


def assembled(mesh: MeshTri, own: Floats, next_one: Floats, free: Ints) -> csc_array:
    """The symmetric matrix of the free nodes whose elements add `own` on the diagonal, for each of their corners, and
    `next_one` for each corner and the next, (3, nelements) each.
    """
    number = np.full(mesh.p.shape[1], -1, dtype=np.int32)
    number[free] = np.arange(free.size)
    # A product off the diagonal is worked out once and stands in two places; those on it are summed beforehand.
    on = np.bincount(mesh.t.ravel(), own.ravel(), number.size)
    start, end = number[mesh.t], number[mesh.t[[1, 2, 0]]]
    inner = (start >= 0) & (end >= 0)
    off, start, end, diagonal = next_one[inner], start[inner], end[inner], number[free]
    row, column = np.concatenate((start, end, diagonal)), np.concatenate((end, start, diagonal))
    return coo_array((np.concatenate((off, off, on[free])), (row, column)), shape=(free.size, free.size)).tocsc()
