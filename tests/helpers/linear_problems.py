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
