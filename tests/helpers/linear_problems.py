"""-div(nu grad u - g) = f with data of any kind in every element, by scikit-fem's own forms."""

import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    ElementTetP1,
    ElementTriP1,
    ElementTriP2,
    ElementTriP3,
    ElementTriP4,
    LinearForm,
    MeshTri2,
    condense,
    solve,
)
from skfem.helpers import dot, grad

from kohonen_adapt import estimators

KINDS = {(2, 1): ElementTriP1, (2, 2): ElementTriP2, (2, 3): ElementTriP3, (2, 4): ElementTriP4, (3, 1): ElementTetP1}


def basis_of(mesh, order=1):
    degree = 12 if isinstance(mesh, MeshTri2) else 2 * order
    return Basis(mesh, KINDS[len(mesh.p), order](), intorder=degree)


def assembled(mesh, nu, source, flux, order=1):
    """Matrix and load of nu per element, f per element or a function, and g per element or at its corners."""
    basis, corners = basis_of(mesh, order), np.broadcast_to(1.0, (len(mesh.t), 1))
    share = np.vstack((1.0 - basis.X.sum(axis=0), basis.X))
    flux = flux if np.ndim(flux) == 3 else flux[:, None] * corners
    matrix = BilinearForm(lambda u, v, w: w.nu * dot(grad(u), grad(v))).assemble(basis, nu=nu[:, None])
    load = LinearForm(lambda v, w: w.f * v + dot(w.g, grad(v)))
    f = source(np.asarray(basis.global_coordinates())) if callable(source) else source[:, None]
    return matrix, load.assemble(basis, f=f, g=np.einsum("cik,iq->ckq", flux, share))


def solved(matrix, load, values, fixed):
    """The solution with these values at the unknowns of a mask, or at some by their numbers."""
    return solve(*condense(matrix, load, x=values, D=np.flatnonzero(fixed) if fixed.dtype == bool else fixed))


def rim_of(mesh, order=1):
    """A mask of the unknowns on the boundary."""
    basis = basis_of(mesh, order)
    return np.isin(np.arange(basis.N), basis.get_dofs().flatten())


class Linear:
    """A problem with values given at some unknowns, and its solution."""

    def __init__(self, mesh, values, fixed, reluctivity, source, flux, order=1):
        self.mesh, self.values, self.fixed = mesh, values, fixed
        self.reluctivity, self.source, self.flux = reluctivity, source, flux
        self.matrix, self.load = assembled(mesh, reluctivity, source, flux, order)
        self.potential = solved(self.matrix, self.load, values, fixed)
        for array in (mesh.p, mesh.t, self.potential, reluctivity, source, flux, fixed):
            array.setflags(write=False)  # arguments stay as they are

    def at(self, order):
        """The same by elements of an order, with zeros all around."""
        fixed = rim_of(self.mesh, order)
        return Linear(self.mesh, np.zeros(fixed.size), fixed, self.reluctivity, self.source, self.flux, order)

    def refined(self):
        """The same problem, each element cut in four; given values are linear along the old facets."""
        fixed = self.fixed[self.mesh.facets].all(axis=0) & (self.mesh.f2t[1] < 0)
        return Linear(
            self.mesh.refined(),
            self.onto_refined(self.values),
            np.concatenate((self.fixed, fixed)),
            np.tile(self.reluctivity, 4),
            np.tile(self.source, 4),
            np.tile(self.flux, 4),
        )

    def onto_refined(self, nodal):
        return np.concatenate((nodal, nodal[self.mesh.facets].mean(axis=0)))

    def error(self, levels=2):
        """Distance to the solution on finer meshes: below the error, and the nearer to it the more levels."""
        potential, finer = self.potential, self
        for _ in range(levels):
            potential, finer = finer.onto_refined(potential), finer.refined()
        difference = finer.potential - potential
        return np.sqrt(difference @ finer.matrix @ difference)

    def arguments(self):
        return {"source": self.source, "flux": self.flux, "fixed": self.fixed}

    def estimate(self):
        return estimators.equilibrated(self.mesh, self.potential, self.reluctivity, **self.arguments())

    def sigma(self):
        return estimators.equilibrated_flux(self.mesh, self.potential, self.reluctivity, **self.arguments())
