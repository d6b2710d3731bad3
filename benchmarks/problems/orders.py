"""Solve problems L, F, M and C by scikit-fem's elements of order 2 or 3, with residual indicators."""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
from scipy.sparse.linalg import splu
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP0,
    ElementTriP2,
    ElementTriP3,
    FacetBasis,
    InteriorFacetBasis,
    LinearForm,
    MeshTri,
    condense,
)
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from benchmarks.problems import c_core, l_shape, p1, poisson_l, square_magnet

ELEMENTS = {2: ElementTriP2, 3: ElementTriP3}
LATTICE = {  # points that determine a gradient, of order 1 or 2
    2: np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    3: np.array([[0.0, 1.0, 0.0, 0.5, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0, 0.5, 0.5]]),
}


@BilinearForm
def stiffness(u: Any, v: Any, w: Any) -> Any:
    """nu grad u . grad v."""
    return w["nu"] * dot(grad(u), grad(v))


@LinearForm
def load(v: Any, w: Any) -> Any:
    """f v + g . grad v."""
    return w["f"] * v + w["gx"] * grad(v)[0] + w["gy"] * grad(v)[1]


class OfOrder:
    """``-div(nu grad u - g) = f`` with constants per element and values given all round, for `adapt`.

    `data` gives nu, f and g, (nelements,) and (2, nelements) for g; `region` a number per element that they depend on;
    `exact` the energy a(u, u), to which errors are relative if `relative`.
    """

    def __init__(
        self,
        order: int,
        data: Callable[[MeshTri], tuple[np.ndarray, np.ndarray, np.ndarray]],
        exact: float,
        relative: bool,
    ) -> None:
        self.order, self.data, self.exact, self.relative = order, data, exact, relative

    def basis(self, mesh: MeshTri) -> Basis:
        """Of the elements."""
        return Basis(mesh, ELEMENTS[self.order](), intorder=2 * (self.order - 1))

    def given(self, x: np.ndarray) -> np.ndarray:
        """Values on the outline."""
        return np.zeros(x.shape[1])

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Values of all unknowns."""
        basis = self.basis(mesh)
        constants = basis.with_element(ElementTriP0())
        nu, f, gx, gy = (constants.interpolate(values) for values in (*self.data(mesh)[:2], *self.data(mesh)[2]))
        matrix, right = stiffness.assemble(basis, nu=nu), load.assemble(basis, f=f, gx=gx, gy=gy)
        outline, start = basis.get_dofs().flatten(), np.zeros(basis.N)
        start[outline] = self.given(basis.doflocs[:, outline])
        reduced, reduced_right, solution, inner = condense(matrix, right, x=start, D=outline)
        options = {"SymmetricMode": True}
        factors = splu(reduced.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        solution[inner] = factors.solve(reduced_right)
        return solution

    def energy_norm(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Square root of a(u, u)."""
        basis = self.basis(mesh)
        nu = basis.with_element(ElementTriP0()).interpolate(self.data(mesh)[0])
        slope = basis.interpolate(solution).grad
        return float(np.sqrt(np.sum(np.asarray(nu) * (slope**2).sum(axis=0) * basis.dx)))

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """The functional, with a region number per element for every set of constants."""
        nu, f, g = self.data(mesh)
        tables, region = np.unique(np.vstack([nu, f, g]), axis=1, return_inverse=True)
        basis = self.basis(mesh)
        fixed = np.isin(np.arange(basis.N), basis.get_dofs().flatten())
        return ka.Ritz(solution, fixed, tables[0], tables[1], tables[2:], region.ravel(), order=self.order)

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """In the energy norm: the energy of a Galerkin solution falls short by its square."""
        missing = abs(self.exact - self.energy_norm(mesh, solution) ** 2)
        return float(np.sqrt(missing / self.exact)) * 100 if self.relative else float(np.sqrt(missing))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Residual indicators, element and jump part: ``h^2 |f + div|^2 / nu`` and ``h |jump|^2 / nu``."""
        nu, f, g = self.data(mesh)
        areas = p1.area(mesh)
        residual = f[:, None] + nu[:, None] * self._laplacian(mesh, solution)
        inside = 2.0 * areas**2 * np.mean(residual**2, axis=1) / nu
        return np.sqrt(inside + 0.5 * self._jumps(mesh, solution, nu, g)[mesh.t2f].sum(axis=0))

    def _laplacian(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """lap u_h at the lattice, (nelements, points): scikit-fem's elements have no second derivatives."""
        points = LATTICE[self.order]
        basis = Basis(mesh, ELEMENTS[self.order](), quadrature=(points, np.ones(points.shape[1])))
        slope = basis.interpolate(solution).grad  # (2, nelements, points)
        inverse = basis.mapping.invDF(points)  # d(reference i) / dx_j, constant in every element
        derivative = _derivatives(self.order)
        return np.einsum("ijkq,jkp,iqp->kq", inverse, slope, derivative, optimize=True)

    def _jumps(self, mesh: MeshTri, solution: np.ndarray, nu: np.ndarray, g: np.ndarray) -> np.ndarray:
        """``|F| int [nu du/dn - g . n]^2 / max(nu)`` of every facet, (nfacets,)."""
        flux, largest, normal, found = 0.0, 0.0, None, np.zeros(mesh.facets.shape[1])
        for side, sign in ((0, 1.0), (1, -1.0)):
            facets = InteriorFacetBasis(mesh, ELEMENTS[self.order](), side=side, intorder=2 * (self.order - 1))
            element = mesh.f2t[side, facets.find][:, None]
            slope = facets.interpolate(solution).grad
            field = nu[element] * slope - g[:, element]
            normal = facets.normals if normal is None else normal
            flux = flux + sign * (field * normal).sum(axis=0)
            largest = np.maximum(largest, nu[element])
        length = facets.dx.sum(axis=1)
        found[facets.find] = length * np.sum(flux**2 / largest * facets.dx, axis=1)
        return found


class LaplaceOnL(OfOrder):
    """Problem L: values given are those of the exact solution."""

    def __init__(self, order: int) -> None:
        super().__init__(order, constants, l_shape.NORM_SQUARED, relative=False)

    def given(self, x: np.ndarray) -> np.ndarray:
        return l_shape.exact(x)

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """By Green's formula, as values given are interpolated: (grad u, grad u_h) is an integral over the outline."""
        outline = FacetBasis(mesh, ELEMENTS[self.order](), intorder=14)
        x, values = outline.global_coordinates(), np.asarray(outline.interpolate(solution))
        # u_h = 0 on the sides of the corner, where the gradient has no bound
        flux = np.where(values == 0.0, 0.0, (l_shape.exact_gradient(np.asarray(x)) * outline.normals).sum(axis=0))
        both = float(np.sum(flux * values * outline.dx))
        return float(np.sqrt(abs(self.exact - 2.0 * both + self.energy_norm(mesh, solution) ** 2)))


@cache
def _derivatives(order: int) -> np.ndarray:
    """d / d(reference i) at point q of what is 1 at point p of the lattice and 0 at the others, (2, q, p)."""
    x, y = LATTICE[order]
    one, zero = np.ones_like(x), np.zeros_like(x)
    powers = [one, x, y, x * x, x * y, y * y][: x.size]
    along = [zero, one, zero, 2 * x, y, zero][: x.size]
    aside = [zero, zero, one, zero, x, 2 * y][: x.size]
    inverse = np.linalg.inv(np.stack(powers, axis=1))
    return np.stack([np.stack(along, axis=1) @ inverse, np.stack(aside, axis=1) @ inverse])


def constants(mesh: MeshTri, source: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of ``-lap u = source``."""
    count = mesh.t.shape[1]
    return np.ones(count), np.full(count, source), np.zeros((2, count))


def magnet(mesh: MeshTri, iron: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of problem M."""
    nu, g = square_magnet.reluctivity(mesh, iron), square_magnet.flux(mesh)
    return nu, np.zeros_like(nu), g


def core(mesh: MeshTri) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of problem C."""
    nu = c_core.reluctivity(mesh)
    return nu, np.zeros_like(nu), c_core.flux(mesh)


def problem(letter: str, order: int, iron: bool = False) -> OfOrder:
    """Problem L, F, M or C at that order."""
    if letter == "L":
        return LaplaceOnL(order)
    if letter == "F":
        return OfOrder(order, partial(constants, source=1.0), poisson_l.NORM_SQUARED, relative=False)
    if letter == "M":
        return OfOrder(order, partial(magnet, iron=iron), square_magnet.REFERENCE_ENERGY[iron], relative=True)
    return OfOrder(order, core, c_core.REFERENCE_ENERGY, relative=True)
