"""Assemble P1 elements on plain arrays, apart from the package, so that no change there moves the problems."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import spsolve
from skfem import MeshTri

Array = np.ndarray


def shape_gradients(mesh: MeshTri) -> tuple[Array, Array]:
    """Areas (nelements,) and gradients (3, 2, nelements) of the three hat functions of every element."""
    corners = mesh.p[:, mesh.t]
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    twice = opposite[0, 0] * opposite[1, 1] - opposite[1, 0] * opposite[0, 1]
    gradients = np.stack((-opposite[1], opposite[0]), axis=1) / twice
    return abs(twice) / 2, gradients


def area(mesh: MeshTri) -> Array:
    """Area of every element, (nelements,)."""
    return shape_gradients(mesh)[0]


def gradient(mesh: MeshTri, values: Array) -> Array:
    """Gradient (2, nelements) of the P1 function with these nodal values."""
    return np.einsum("ke,kde->de", values[mesh.t], shape_gradients(mesh)[1])


def energy_norm(mesh: MeshTri, values: Array, coefficient: Array | float = 1.0) -> float:
    """Square root of int coefficient |grad u|^2."""
    areas, _ = shape_gradients(mesh)
    return float(np.sqrt(areas @ (coefficient * (gradient(mesh, values) ** 2).sum(axis=0))))


def stiffness(mesh: MeshTri, coefficient: Array | float = 1.0) -> csr_matrix:
    """Matrix of int coefficient grad u . grad v."""
    areas, gradients = shape_gradients(mesh)
    return _assemble(mesh, np.einsum("ide,jde->ije", gradients, gradients) * (areas * coefficient))


def mass(mesh: MeshTri) -> csr_matrix:
    """Matrix of int u v."""
    return _assemble(mesh, (np.ones((3, 3)) + np.eye(3))[:, :, None] * shape_gradients(mesh)[0] / 12)


def _assemble(mesh: MeshTri, local: Array) -> csr_matrix:
    rows = np.broadcast_to(mesh.t[:, None], local.shape)
    columns = np.broadcast_to(mesh.t[None, :], local.shape)
    size = mesh.p.shape[1]
    return coo_matrix((local.ravel(), (rows.ravel(), columns.ravel())), (size, size)).tocsr()


def solve_dirichlet(mesh: MeshTri, matrix: csr_matrix, load: Array, boundary_values: Array) -> Array:
    """Solve with the given nodal values (nnodes,) on the whole outer boundary."""
    fixed = mesh.boundary_nodes()
    solution = np.zeros(mesh.p.shape[1])
    solution[fixed] = boundary_values[fixed]
    free = np.setdiff1d(np.arange(solution.size), fixed)
    reduced = (load - matrix @ solution)[free]
    solution[free] = spsolve(matrix[free][:, free].tocsc(), reduced)
    return solution


def on_boundary(mesh: MeshTri) -> Array:
    """Mask (nnodes,) of the nodes on the outer boundary."""
    mask = np.zeros(mesh.p.shape[1], dtype=bool)
    mask[mesh.boundary_nodes()] = True
    return mask


def integrate_hats(mesh: MeshTri, element_values: Array) -> Array:
    """Load vector int f v for a source that is constant on every element."""
    share = element_values * shape_gradients(mesh)[0] / 3
    return np.bincount(mesh.t.ravel(), np.tile(share, 3), minlength=mesh.p.shape[1])


def integrate_gradients(mesh: MeshTri, element_vectors: Array) -> Array:
    """Load vector int g . grad v for vectors (2, nelements)."""
    areas, gradients = shape_gradients(mesh)
    share = np.einsum("kde,de->ke", gradients, element_vectors) * areas
    return np.bincount(mesh.t.ravel(), share.ravel(), minlength=mesh.p.shape[1])


def residual_indicators(
    mesh: MeshTri,
    solution: Array,
    coefficient: Array | float = 1.0,
    source: Array | float = 0.0,
    flux: Array | float = 0.0,
) -> Array:
    """Unsquared: h_K^2 |f|^2 / c on the element and half of h_F [c du/dn - g.n]^2 / max(c) on each interior facet."""
    areas, _ = shape_gradients(mesh)
    coefficient = np.broadcast_to(coefficient, areas.shape)
    field = coefficient * gradient(mesh, solution) - flux
    inner = mesh.f2t[1] >= 0
    first, second = mesh.f2t[:, inner]
    ends = mesh.p[:, mesh.facets[:, inner]]
    tangent = ends[:, 1] - ends[:, 0]
    jump = field[:, first] - field[:, second]
    # with a tangent as long as the facet this is h_F times the integral of the squared normal jump
    squared = (jump[0] * tangent[1] - jump[1] * tangent[0]) ** 2 / np.maximum(coefficient[first], coefficient[second])
    jumps = np.bincount(np.concatenate((first, second)), np.tile(squared / 2, 2), minlength=areas.size)
    return np.sqrt(jumps + 2 * areas**2 * np.broadcast_to(source, areas.shape) ** 2 / coefficient)
