"""Problems on tetrahedra with known energies: an edge, the Fichera corner, a magnet under iron, and a smooth bump."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTetP0, ElementTetP1, LinearForm, MeshTet, condense
from skfem.helpers import dot, grad

import kohonen_adapt as ka

WIDTH = 0.12  # of the bump, in a cube of side 1
ON = 1e-9  # coordinates nearer to a plane than this are on it

Points = Callable[[np.ndarray], np.ndarray]


def nothing(x: np.ndarray) -> np.ndarray:
    """Zero at all points (3, ...)."""
    return np.zeros(x.shape[1:])


def one(x: np.ndarray) -> np.ndarray:
    """One at all points."""
    return np.ones(x.shape[1:])


def bump(x: np.ndarray) -> np.ndarray:
    """A Gaussian in the middle of the cube."""
    return np.exp(-((x - 0.5) ** 2).sum(axis=0) / (2.0 * WIDTH**2))


def bump_source(x: np.ndarray) -> np.ndarray:
    """Minus its Laplacian."""
    squares = ((x - 0.5) ** 2).sum(axis=0)
    return -bump(x) * (squares / WIDTH**4 - 3.0 / WIDTH**2)


@dataclass(frozen=True)
class Solid:
    """-div(nu grad u - flux) = source, with u given on the boundary named so, natural elsewhere.

    Attributes
    ----------
    box
        Where its nodes are along each axis, for so many cells per unit.
    keep, given
        Which middles of elements are in it, and at which points of its boundary u is given.
    values, source
        Of u where it is given, and of the source, at points.
    iron, magnet
        The middles of elements with nu = 1000, and of those with the unit flux upwards.
    energy
        The least functional, ``1/2 a(u, u) - l(u)``, or None where u is the `bump`.
    """

    name: str
    box: Callable[[int], tuple[np.ndarray, ...]]
    given: Points
    energy: float | None
    keep: Points = one
    values: Points = nothing
    source: Points = one
    iron: Points = nothing
    magnet: Points = nothing

    def mesh(self, cells: int) -> MeshTet:
        """Cubes of six tetrahedra, with the names that the problem has."""
        mesh = MeshTet.init_tensor(*self.box(cells))
        return self.named(mesh.restrict(np.flatnonzero(self.keep(middles(mesh)))))

    def named(self, mesh: MeshTet) -> MeshTet:
        """A mesh of the same body with these names."""
        rows = mesh.boundary_facets()
        on = rows[self.given(mesh.p[:, mesh.facets[:, rows]]).all(axis=0)]
        parts = {"iron": self.iron, "magnet": self.magnet}
        regions = {name: np.flatnonzero(where(middles(mesh))) for name, where in parts.items()}
        kept = {name: found for name, found in regions.items() if found.size}
        return MeshTet(mesh.p, mesh.t).with_subdomains(kept).with_boundaries({"given": on})

    def coefficients(self, mesh: MeshTet) -> tuple[np.ndarray, np.ndarray]:
        """nu (nelements,) and flux (3, nelements)."""
        nu, flux = np.ones(mesh.nelements), np.zeros((3, mesh.nelements))
        parts = mesh.subdomains or {}
        nu[parts.get("iron", [])], flux[2, parts.get("magnet", [])] = 1000.0, 1.0
        return nu, flux

    def solve(self, mesh: MeshTet) -> tuple[np.ndarray, float]:
        """The solution at the nodes, and its error in the energy norm."""
        nu, flux = self.coefficients(mesh)
        basis, constants = Basis(mesh, ElementTetP1(), intorder=4), Basis(mesh, ElementTetP0(), intorder=4)
        fields = {"nu": constants.interpolate(nu), "g": np.repeat(flux[:, :, None], basis.dx.shape[1], axis=2)}
        stiffness = BilinearForm(lambda u, v, w: w["nu"] * dot(grad(u), grad(v))).assemble(basis, **fields)
        load = LinearForm(lambda v, w: self.source(w.x) * v + dot(w["g"], grad(v))).assemble(basis, **fields)
        fixed = np.unique(mesh.facets[:, mesh.boundaries["given"]])
        u = np.where(np.isin(np.arange(mesh.nvertices), fixed), self.values(mesh.p), 0.0)
        matrix, right, u, free = condense(stiffness, load, x=u, D=fixed)
        u[free] = spsolve(matrix.tocsc(), right)
        if self.energy is not None:
            return u, float(np.sqrt(max(0.0, 2.0 * (0.5 * u @ (stiffness @ u) - load @ u - self.energy))))
        x, slope = basis.global_coordinates(), basis.interpolate(u).grad
        exact = -(x - 0.5) / WIDTH**2 * bump(np.asarray(x))
        return u, float(np.sqrt(np.sum(((slope - exact) ** 2).sum(axis=0) * basis.dx)))

    def density(self, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
        """Nodes per volume that the residual of a solution asks for."""
        nu, flux = self.coefficients(mesh)
        eta = ka.estimators.residual(mesh, u, nu, source=self.source(middles(mesh)), flux=flux)
        return ka.density_from_indicators(mesh, eta)


def middles(mesh: MeshTet) -> np.ndarray:
    """Of all elements, (3, nelements)."""
    return mesh.p[:, mesh.t].mean(axis=1)


def steps(low: float, high: float, cells: int) -> np.ndarray:
    """Coordinates of so many cells per unit."""
    return np.linspace(low, high, round((high - low) * cells) + 1)


def outside_l(x: np.ndarray) -> np.ndarray:
    """On the six sides of the L-shaped prism."""
    inner = ((np.abs(x[0]) < ON) & (x[1] < ON)) | ((np.abs(x[1]) < ON) & (x[0] > -ON))
    return (np.abs(np.abs(x[:2]) - 1.0) < ON).any(axis=0) | inner


EDGE = Solid(
    "E",
    lambda cells: (steps(-1, 1, cells), steps(-1, 1, cells), steps(0, 1, cells)),
    outside_l,
    -0.5 * 0.2140758036140825,  # the L-shape's in the plane
    keep=lambda x: ~((x[0] > 0) & (x[1] < 0)),
)
FICHERA = Solid(
    "F",
    lambda cells: (steps(-1, 1, cells),) * 3,
    one,
    -0.19897165,  # Richardson extrapolation of order 2
    keep=lambda x: ~(x > 0).all(axis=0),
)
MAGNET = Solid(
    "M",
    lambda cells: (steps(0, 2, cells), steps(0, 2, cells), steps(-2, 2, cells)),
    lambda x: (x[0] > 2 - ON) | (x[1] > 2 - ON) | (np.abs(x[2]) > 2 - ON),
    -0.03758919,  # likewise
    source=nothing,
    iron=lambda x: (x[0] < 1) & (x[1] < 0.5) & (np.abs(x[2] - 1) < 0.25),
    magnet=lambda x: (x[:2] < 0.5).all(axis=0) & (np.abs(x[2]) < 0.5),
)
BUMP = Solid("B", lambda cells: (steps(0, 1, cells),) * 3, one, None, values=bump, source=bump_source)
