"""Problems on tetrahedra with known energies: an edge, the Fichera corner, a magnet under iron, a cube, and a bump."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import LinearOperator, aslinearoperator, cg, splu
from skfem import Basis, BilinearForm, ElementTetP1, LinearForm, MeshTet, condense
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from benchmarks.problems.poisson_l import NORM_SQUARED

WIDTH = 0.12  # of the bump, in a cube of side 1
DIRECT, CLOSE = 20_000, 1e-10  # unknowns that are solved for directly; more by conjugate gradients to this residual
ON = 1e-9  # coordinates nearer to a plane than this are on it
TABLES = np.array([1.0, 1000.0, 1.0]), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""nu and flux of what is neither, of iron and of a magnet."""

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


class Box(NamedTuple):
    """A box with edges along the axes, from its lowest corner to its highest."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def holds(self, x: np.ndarray) -> np.ndarray:
        """Which of some points (3, ...) are in it."""
        low, high = (np.reshape(corner, (3,) + (1,) * (x.ndim - 1)) for corner in self)
        return np.all((low < x) & (x < high), axis=0)


@dataclass(frozen=True)
class Solid:
    """-div(nu grad u - flux) = source, with u given on the boundary named so, natural elsewhere; as `ka.adapt` asks.

    Attributes
    ----------
    body
        The box that it is in.
    given
        At which points of its boundary u is given.
    energy
        The least functional, ``1/2 a(u, u) - l(u)``, or None where u is the `bump`.
    notch
        What is not part of it.
    iron, magnet
        Where nu is 1000, and where the flux is a unit upwards.
    source, values
        Of the source a constant or a function of points; u where it is given.
    """

    name: str
    body: Box
    given: Points
    energy: float | None
    notch: Box | None = None
    iron: Box | None = None
    magnet: Box | None = None
    source: float | Points = 1.0
    values: Points = nothing

    @property
    def parts(self) -> dict[str, Box]:
        """Subdomains by name."""
        return {name: box for name, box in (("iron", self.iron), ("magnet", self.magnet)) if box is not None}

    def mesh(self, cells: int | tuple[int, int, int]) -> MeshTet:
        """Boxes of six tetrahedra, so many per unit of each axis, with the names that the problem has."""
        return self.on_grid(*map(steps, *self.body, np.broadcast_to(cells, 3)))

    def coarsest(self) -> MeshTet:
        """As few boxes as there can be, each cut in eight."""
        boxes = [box for box in (self.body, self.notch, *self.parts.values()) if box is not None]
        planes = [np.unique(along) for along in zip(*(corner for box in boxes for corner in box), strict=True)]
        return self.on_grid(*(np.union1d(x, (x[1:] + x[:-1]) / 2) for x in planes))

    def on_grid(self, *planes: np.ndarray) -> MeshTet:
        """The boxes between some planes across the axes, each of six tetrahedra."""
        mesh = MeshTet.init_tensor(*planes)
        if self.notch is not None:
            mesh = mesh.restrict(np.flatnonzero(~self.notch.holds(middles(mesh))))
        return self.named(mesh)

    def named(self, mesh: MeshTet) -> MeshTet:
        """A mesh of this body with the names that places tell, whatever names it has."""
        rows = mesh.boundary_facets()
        on = rows[self.given(mesh.p[:, mesh.facets[:, rows]].mean(axis=1)) > 0]
        parts = {name: np.flatnonzero(box.holds(middles(mesh))) for name, box in self.parts.items()}
        return MeshTet(mesh.p, mesh.t).with_subdomains(parts).with_boundaries({"given": on})

    def regions(self, mesh: MeshTet) -> np.ndarray:
        """Of every element its column in `TABLES`, (nelements,)."""
        region = np.zeros(mesh.nelements, dtype=np.int64)
        parts = mesh.subdomains or {}
        region[parts.get("iron", [])], region[parts.get("magnet", [])] = 1, 2
        return region

    def system(self, mesh: MeshTet) -> tuple[csr_array, np.ndarray, np.ndarray, np.ndarray]:
        """Stiffness, load, u with its given values, and the nodes where these are."""
        basis = Basis(mesh, ElementTetP1(), intorder=4 if callable(self.source) else 1)
        nu, flux = (table[..., self.regions(mesh), None] for table in TABLES)
        stiffness = BilinearForm(lambda u, v, w: nu * dot(grad(u), grad(v))).assemble(basis)
        load = LinearForm(lambda v, w: self.sources(np.asarray(w.x)) * v + dot(flux, grad(v))).assemble(basis)
        fixed = np.unique(mesh.facets[:, mesh.boundaries["given"]])
        u = np.where(np.isin(np.arange(mesh.nvertices), fixed), self.values(mesh.p), 0.0)
        return stiffness, load, u, fixed

    def sources(self, x: np.ndarray) -> np.ndarray:
        """The source at points (3, ...)."""
        return self.source(x) if callable(self.source) else np.full(x.shape[1:], self.source)

    def solve(self, mesh: MeshTet) -> np.ndarray:
        """The solution at the nodes."""
        stiffness, load, u, fixed = self.system(mesh)
        matrix, right, u, free = condense(stiffness, load, x=u, D=fixed)
        if right.size > DIRECT:
            u[free], failed = cg(matrix, right, rtol=CLOSE, M=jacobi(matrix))
            if failed:
                raise RuntimeError(f"conjugate gradients did not come to {CLOSE:g} with {right.size} unknowns.")
            return u
        factors = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        u[free] = factors.solve(right)
        return u

    def error(self, mesh: MeshTet, u: np.ndarray) -> float:
        """Of a solution, in the energy norm."""
        if self.energy is not None:
            stiffness, load, _, _ = self.system(mesh)
            return float(np.sqrt(max(0.0, 2.0 * (0.5 * u @ (stiffness @ u) - load @ u - self.energy))))
        basis = Basis(mesh, ElementTetP1(), intorder=4)
        x, slope = np.asarray(basis.global_coordinates()), basis.interpolate(u).grad
        return float(np.sqrt(np.sum(((slope + (x - 0.5) / WIDTH**2 * bump(x)) ** 2).sum(axis=0) * basis.dx)))

    def work(self, mesh: MeshTet, u: np.ndarray) -> float:
        """The load times a solution, which is the square of its energy norm if u is zero where it is given."""
        return float(self.system(mesh)[1] @ u)

    def indicators(self, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
        """The residual estimate of every element."""
        nu, flux = (table[..., self.regions(mesh)] for table in TABLES)
        return ka.estimators.residual(mesh, u, nu, source=self.sources(middles(mesh)), flux=flux)

    def ritz(self, mesh: MeshTet, u: np.ndarray) -> ka.Ritz:
        """The functional that the solution minimises."""
        if callable(self.source):
            raise ka.NotOffered("its source varies")
        fixed = np.isin(np.arange(mesh.nvertices), mesh.facets[:, mesh.boundaries["given"]])
        return ka.Ritz(u, fixed, TABLES[0], source=self.source, flux=TABLES[1], region=self.regions(mesh))


def jacobi(matrix: csr_array) -> LinearOperator:
    """Jacobi's preconditioner."""
    return aslinearoperator(diags_array(1.0 / matrix.diagonal()))


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
    Box((-1, -1, 0), (1, 1, 1)),
    outside_l,
    -0.5 * NORM_SQUARED,  # the L-shape's in the plane
    notch=Box((0, -1, 0), (1, 0, 1)),
)
FICHERA = Solid(
    "F",
    Box((-1, -1, -1), (1, 1, 1)),
    one,
    -0.1989845,  # to 5e-7: order 7 on graded hexahedra of NGSolve, extrapolated, and fine P2
    notch=Box((0, 0, 0), (1, 1, 1)),
)
MAGNET = Solid(
    "M",
    Box((0, 0, -2), (2, 2, 2)),
    lambda x: (x[0] > 2 - ON) | (x[1] > 2 - ON) | (np.abs(x[2]) > 2 - ON),
    -0.0375878,  # to 2e-7, likewise by order 5
    iron=Box((0, 0, 0.75), (1, 0.5, 1.25)),
    magnet=Box((0, 0, -0.5), (0.5, 0.5, 0.5)),
    source=0.0,
)
UNIT = Box((0, 0, 0), (1, 1, 1))
CUBE = Solid("S", UNIT, one, -0.0100842501568)  # from its Fourier series
BUMP = Solid("B", UNIT, one, None, source=bump_source, values=bump)
