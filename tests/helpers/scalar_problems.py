"""Scalar problems of orders 1 to 3 in the plane, assembled by scikit-fem: a load, a corner, a square magnet."""

from dataclasses import replace

import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP0,
    ElementTriP1,
    ElementTriP2,
    ElementTriP3,
    ElementTriP4,
    FacetBasis,
    LinearForm,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import dot, grad
from skfem.models.poisson import laplace, unit_load

import kohonen_adapt as ka
from helpers.meshes import on_rim, perturbed

KAPPA = {"left": 3.0, "bottom": 0.0}
ELEMENTS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3, 4: ElementTriP4}
MAGNET_ENERGY = {False: 0.0908370426, True: 0.1134912582}  # without and with iron: P2 on bisected meshes, extrapolated
LOAD_ENERGY = 0.2140758027  # on the L-shape, likewise
CORNER_ENERGY = 1.8362266618751626

stiffness = BilinearForm(lambda u, v, w: w["nu"] * dot(grad(u), grad(v)))
pull = LinearForm(lambda v, w: w["gx"] * grad(v)[0] + w["gy"] * grad(v)[1])


class Scalar:
    """-div(nu grad u - g) = f, u given all round but on the `natural` boundary.

    `parts` has nu and g of subdomains; elsewhere they are 1 and 0. `energy` is a(u, u) of
    the exact solution. Indicators are the distance from the solution of the next order.
    """

    def __init__(self, order=1, parts=(), source=0.0, energy=None, natural=""):
        self.order, self.parts, self.load, self.exact, self.natural = order, dict(parts), source, energy, natural

    def given(self, x):
        return np.zeros(x.shape[1])

    def source(self, x, region=None):
        return np.full(x.shape[1:], self.load)

    def region(self, mesh):
        numbers = np.zeros(mesh.nelements, dtype=int)
        for number, name in enumerate(self.parts, 1):
            numbers[mesh.subdomains[name]] = number
        return numbers

    def tables(self):
        rows = [(1.0, (0.0, 0.0)), *self.parts.values()]
        return np.array([nu for nu, _ in rows]), np.array([g for _, g in rows]).T

    def basis(self, mesh, order):
        return Basis(mesh, ELEMENTS[order](), intorder=2 * order + 4 * callable(self.load))

    def fixed(self, basis):
        facets = basis.mesh.boundary_facets()
        if self.natural:
            facets = np.setdiff1d(facets, basis.mesh.boundaries[self.natural])
        return np.isin(np.arange(basis.N), basis.get_dofs(facets).flatten())

    def matrix(self, basis):
        return stiffness.assemble(basis, nu=self._constant(basis, self.tables()[0]))

    def solve(self, mesh):
        return self.solved(mesh, self.order)

    def solved(self, mesh, order):
        basis = self.basis(mesh, order)
        gx, gy = self.pulls(basis)
        right = pull.assemble(basis, gx=gx, gy=gy) + LinearForm(lambda v, w: self.source(w.x) * v).assemble(basis)
        fixed = np.flatnonzero(self.fixed(basis))
        start = np.zeros(basis.N)
        start[fixed] = self.given(basis.doflocs[:, fixed])
        return solve(*condense(self.matrix(basis), right, x=start, D=fixed))

    def pulls(self, basis):
        return (self._constant(basis, each) for each in self.tables()[1])

    def _constant(self, basis, table):
        return basis.with_element(ElementTriP0()).interpolate(table[self.region(basis.mesh)])

    def indicators(self, mesh, solution):
        basis = self.basis(mesh, self.order + 1)
        finer = basis.interpolate(self.solved(mesh, self.order + 1)).grad
        coarse = basis.with_element(ELEMENTS[self.order]()).interpolate(solution).grad
        squares = np.sum(np.sum((finer - coarse) ** 2, axis=0) * basis.dx, axis=1)
        return np.sqrt(self.tables()[0][self.region(mesh)] * squares)

    def energy_norm(self, mesh, solution):
        return float(np.sqrt(solution @ self.matrix(self.basis(mesh, self.order)) @ solution))

    def energy(self, mesh, order):
        solution = self.solved(mesh, order)
        return float(solution @ self.matrix(self.basis(mesh, order)) @ solution)

    def error(self, mesh, solution):
        """In the energy norm: the energy of a Galerkin solution falls short by its square."""
        return float(np.sqrt(abs(self.exact - self.energy_norm(mesh, solution) ** 2)))

    def ritz(self, mesh, solution):
        nu, g = self.tables()
        fixed, region = self.fixed(self.basis(mesh, self.order)), self.region(mesh)
        return ka.Ritz(solution, fixed, nu, self.load, flux=g, region=region, order=self.order)


class Corner(Scalar):
    """Laplace on the L-shape with the exact solution r^(2/3) sin(2 theta / 3)."""

    def __init__(self, order=1):
        super().__init__(order, energy=CORNER_ENERGY)

    def given(self, x):
        z = (x[0] + 1j * x[1]) * np.exp(-0.75j * np.pi)  # the branch cut lies outside
        return (np.exp(0.5j * np.pi) * np.power(z, 2 / 3)).imag

    def error(self, mesh, solution):
        """By Green's formula, as values given are interpolated: (grad u, grad u_h) is an integral over the outline."""
        outline = FacetBasis(mesh, ELEMENTS[self.order](), intorder=14)
        x, values = np.asarray(outline.global_coordinates()), np.asarray(outline.interpolate(solution))
        turn = np.exp(-0.75j * np.pi)
        slope = 2 / 3 * turn * (turn * (x[0] + 1j * x[1])) ** (-1 / 3)
        along = slope.real * outline.normals[0] - slope.imag * outline.normals[1]
        both = float(np.sum(np.where(values == 0.0, 0.0, along * values) * outline.dx))  # 0 beside the corner
        return float(np.sqrt(abs(self.exact - 2.0 * both + self.energy_norm(mesh, solution) ** 2)))


def loaded(order=1):
    """-lap u = 1 on the L-shape."""
    return Scalar(order, source=1.0, energy=LOAD_ENERGY)


def magnet(order=1, iron=True):
    """A square magnet, over iron or alone, on `magnet_mesh`."""
    parts = {"magnet": (1.0, (-1.0, 0.0))} | ({"iron": (1e-3, (0.0, 0.0))} if iron else {})
    return Scalar(order, parts, energy=MAGNET_ENERGY[iron])


def magnet_mesh(n, iron=True):
    """(-1, 1)^2 in n x n squares; n a multiple of 20 puts every interface on grid lines."""
    parts = {"magnet": lambda x: (abs(x[0]) < 0.3) & (abs(x[1]) < 0.2)}
    if iron:
        parts["iron"] = lambda x: (abs(x[0]) < 0.5) & (abs(x[1] + 0.4) < 0.2)
    return MeshTri.init_tensor(*[np.linspace(-1.0, 1.0, n + 1)] * 2).with_subdomains(parts)


class Gaussians(Scalar):
    """-lap u = sum exp(-|x - c|^2 / s^2)."""

    def __init__(self, centres, widths, order=1, natural=""):
        self.centres, self.widths = centres, widths
        super().__init__(order, source=self.source, natural=natural)

    def source(self, x, region=None):
        pairs = zip(self.centres, self.widths, strict=True)
        return sum(np.exp(-((x[0] - c[0]) ** 2 + (x[1] - c[1]) ** 2) / s**2) for c, s in pairs)


class Varying(Scalar):
    """-lap u = f with a quadratic f, u = 0 all round."""

    def __init__(self, order=1):
        super().__init__(order, source=self.source)

    def source(self, x, region=None):
        return 3.0 * x[0] * x[1] - x[1] ** 2


class Turning(Scalar):
    """-lap u = 1 - div g with a quadratic g, u = 0 all round."""

    def flux(self, x, region=None):
        return np.stack([1.0 + x[0] * x[1], x[1] ** 2 - 2.0 * x[0]])

    def pulls(self, basis):
        return self.flux(np.asarray(basis.global_coordinates()))

    def basis(self, mesh, order):
        return Basis(mesh, ELEMENTS[order](), intorder=4)

    def ritz(self, mesh, solution):
        return replace(super().ritz(mesh, solution), flux=self.flux)


def pushed_at(x):
    return 1.0 + x[0] * x[1] - x[1] ** 2


class Cooled:
    """-div grad u = 1 with a Robin condition on the left, a Neumann one below, u = 0 at the top; straight by skfem."""

    def __init__(self, order):
        self.order = order

    def forms(self, mesh):
        basis = Basis(mesh, ELEMENTS[self.order](), intorder=6)
        matrix = BilinearForm(lambda u, v, w: dot(grad(u), grad(v))).assemble(basis)
        load = LinearForm(lambda v, w: 1.0 * v).assemble(basis)
        for name, kappa in KAPPA.items():
            facets = FacetBasis(mesh, ELEMENTS[self.order](), facets=mesh.boundaries[name], intorder=6)
            matrix = matrix + kappa * BilinearForm(lambda u, v, w: u * v).assemble(facets)
            values = facets.interpolate(pushed_at(basis.doflocs))
            load = load + LinearForm(lambda v, w: w["values"] * v).assemble(facets, values=values)
        return basis, matrix, load

    def solve(self, mesh):
        basis, matrix, load = self.forms(mesh)
        inner = basis.complement_dofs(basis.get_dofs("top"))
        values = np.zeros(basis.N)
        values[inner] = solve(matrix[inner][:, inner], load[inner])
        return values

    def indicators(self, mesh, values):
        nodal = values[: mesh.p.shape[1]]
        return ka.estimators.residual(mesh, nodal, np.ones(mesh.t.shape[1]))

    def ritz(self, mesh, values):
        basis, *_ = self.forms(mesh)
        fixed = np.isin(np.arange(basis.N), basis.get_dofs("top").flatten())
        robin = {name: (kappa, pushed_at) for name, kappa in KAPPA.items()}
        return ka.Ritz(values, fixed, 1.0, 1.0, order=self.order, robin=robin)


class Aimed(Cooled):
    """The same for minus three times the integral of u, by its dual problem, whose conditions have no load."""

    def ritz(self, mesh, values):
        basis, matrix, _ = self.forms(mesh)
        ritz, weight = super().ritz(mesh, values), LinearForm(lambda v, w: 1.0 * v)
        inner, dual = ~ritz.fixed, np.zeros(basis.N)
        dual[inner] = solve(matrix[inner][:, inner], -3.0 * weight.assemble(basis)[inner])
        robin = {name: (kappa, 0.0) for name, kappa in KAPPA.items()}
        other = ka.Ritz(dual, ritz.fixed, 1.0, -3.0, order=self.order, robin=robin)
        return replace(ritz, dual=other, share=0.5)


def slab():
    return perturbed(MeshTri().refined(3), 1).with_defaults()


class Load:
    """-div grad u = 1 with u = 0 on the boundary, in the plane or in space, with attributes of a problem."""

    def __init__(self, **more):
        vars(self).update(more)

    def solve(self, mesh):
        basis = Basis(mesh, mesh.elem())
        return solve(*condense(laplace.assemble(basis), unit_load.assemble(basis), D=mesh.boundary_nodes()))

    def indicators(self, mesh, solution):
        one = np.ones(mesh.nelements)
        return ka.estimators.residual(mesh, solution, one, source=one)

    def ritz(self, mesh, solution):
        return ka.Ritz(solution, on_rim(mesh), 1.0, source=1.0)
