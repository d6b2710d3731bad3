"""Check that a Ritz functional is stationary at the discrete solution.

The derivative of the functional by an unknown is the residual of the discrete equation. The residual must be
small compared to the terms in its sum, or compared to the largest terms anywhere, as after an iterative
solver.
"""

import numpy as np
from skfem import Mesh, MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import listed, point_text
from kohonen_adapt.kernels.tetrahedron.arrays import LOAD
from kohonen_adapt.mesh.curved_in_space import CurvedTetrahedra
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.mesh.quadratic_in_space import edges_of_elements, quadratic_coefficients
from kohonen_adapt.problem.derivatives import (
    Derivatives,
    curved_derivatives,
    derivatives_in_space,
    quadratic_derivatives,
)
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.surface_terms import corner_values, nodal_terms, reduced_regions

__all__ = ["check_in_space", "check_residual", "numbers_of", "sums"]

# Largest residual relative to the terms at an unknown, and relative to the largest terms anywhere. Linear solvers with
# relative tolerance 1e-5 leave 1e-6 of the largest, Newton's method less. Missing terms are as large as present terms.
OF_TERMS = 0.01
OF_LARGEST = 1e-3


def check_in_space(ritz: Ritz, mesh: MeshTet, values: Floats, fixed: Mask) -> None:
    corners, number = mesh.p[:, mesh.t], numbers_of(ritz, mesh.t.shape[1])
    if ritz.order == 1:
        nodal = nodal_terms(ritz.surface)
        on_corners = corner_values(values, nodal, mesh.t, reduced_regions(ritz.surface, number))
        total, size, doubt = sums(derivatives_in_space(corners, on_corners, number, ritz), mesh.t.T, len(values))
        if len(nodal):
            total, size = total - nodal[:, LOAD], size + np.abs(nodal[:, LOAD])
        check_residual(total, size, doubt, ~fixed, mesh.p.T, mesh)
        return
    coefficients, shape = quadratic_coefficients(mesh, values), CurvedTetrahedra(mesh)
    parts, rows = quadratic_derivatives(corners, coefficients, number, ritz), np.flatnonzero(shape.curved)
    own = curved_derivatives(corners[:, :, rows], shape.offset[:, :, rows], coefficients[:, rows], number[rows], ritz)
    for straight, curved in zip(parts, own, strict=True):
        straight[rows] = curved
    index = np.hstack([mesh.t.T, mesh.nvertices + edges_of_elements(mesh, mesh.t.T)])
    place = np.vstack([mesh.p.T[: mesh.nvertices], mesh.p[:, mesh.edges].mean(axis=1).T])
    check_residual(*sums(parts, index, len(values)), ~fixed, place, mesh)


def numbers_of(ritz: Ritz, count: int) -> Ints:
    return np.zeros(count, dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)


def sums(parts: Derivatives, index: Ints, count: int) -> tuple[Floats, Floats, Floats]:
    total, size, doubt = (np.bincount(index.ravel(), part.ravel(), count).astype(np.float64) for part in parts)
    return total, size, doubt


def check_residual(total: Floats, size: Floats, doubt: Floats, free: Mask, place: Floats, mesh: Mesh) -> None:
    allowed = OF_TERMS * size + OF_LARGEST * size.max(initial=0.0) + doubt
    excess = np.where(free, np.abs(total) - allowed, -np.inf)
    wrong = int(np.count_nonzero(excess > 0.0))
    if not wrong:
        return
    worst = int(np.argmax(excess))
    raise ValueError(
        f"the solution is not stationary for its Ritz: at {location(mesh, place[worst])} the residual is "
        f"{100.0 * abs(total[worst]) / size[worst]:.2g} % of the terms in its sum (tolerance about "
        f"{100.0 * OF_TERMS:g} %), and too large at {wrong} of "
        f"{np.count_nonzero(free)} free unknowns. Give Ritz every term of the equation (robin, source, flux, fixed "
        "values), or solve more accurately."
    )


def location(mesh: Mesh, x: Floats) -> str:
    corners = mesh.p[:, : mesh.nvertices]
    node = int(np.argmin(np.sum((corners - x[:, None]) ** 2, axis=0)))
    at = point_text(x)
    sets = named_sets(mesh.boundaries)
    names = [name for name, facets in sets.items() if np.any(mesh.facets[:, facets] == node)]
    if names:
        return f"{at} on boundary {listed(names)}"
    near = np.flatnonzero(np.any(mesh.t == node, axis=0))
    names = [name for name, rows in named_sets(mesh.subdomains).items() if np.isin(near, rows).any()]
    return f"{at} in subdomain {listed(names)}" if names else at
