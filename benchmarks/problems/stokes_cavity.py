"""Solve creeping flow in a square by scikit-fem, a problem of a user's own: its stream function is known."""

import numpy as np
from scipy.sparse import bmat
from skfem import (
    Basis,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    Functional,
    InteriorFacetBasis,
    LinearForm,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import div
from skfem.models.general import divergence
from skfem.models.poisson import laplace, vector_laplace

VELOCITY, PRESSURE, STREAM = ElementVector(ElementTriP2()), ElementTriP1(), ElementTriP2()
CENTRE = "stream function at the centre"


class StokesCavity:
    """Example 30 of scikit-fem, -laplace u + grad p = (0, x) in the unit square, with u = 0 on its boundary.

    The stream function is the deflection of a clamped plate under a load of one: at the centre 0.00126531908 (Taylor
    and Govindjee, Commun. Numer. Methods Eng. 20, 2004, 757). Taylor and Hood's elements.
    """

    title = "Stokes, scikit-fem's example 30"
    settings = (0.0,)
    goal = None
    order = 2

    def start(self, setting: float) -> MeshTri:
        """As scikit-fem cuts a square."""
        return MeshTri.init_sqsymmetric().refined(2)

    def problem(self, setting: float) -> "StokesCavity":
        """It is one itself."""
        return self

    def solve(self, mesh: MeshTri) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and pressure, numbered as scikit-fem does."""
        velocity = Basis(mesh, VELOCITY, intorder=4)
        pressure = velocity.with_element(PRESSURE)
        coupling = -divergence.assemble(velocity, pressure)
        matrix = bmat([[vector_laplace.assemble(velocity), coupling.T], [coupling, None]], "csr")
        load = np.concatenate((buoyancy.assemble(velocity), np.zeros(pressure.N)))
        held = np.concatenate((velocity.get_dofs().all(), [velocity.N]))  # and the pressure at one node
        both = solve(*condense(matrix, load, D=held))
        return both[: velocity.N], both[velocity.N :]

    def indicators(self, mesh: MeshTri, solution: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Of the divergence in elements, and of the tractions that jump over facets."""
        sides = []
        for side in (0, 1):
            facets = InteriorFacetBasis(mesh, VELOCITY, side=side, intorder=4)
            sides += [facets.interpolate(solution[0]), facets.with_element(PRESSURE).interpolate(solution[1])]
        names = dict(zip(("u", "p", "other_u", "other_p"), sides, strict=True))
        squared = jump.elemental(facets, **names) / 2
        total = np.bincount(mesh.f2t[:, mesh.f2t[1] >= 0].ravel(), np.tile(squared, 2), minlength=mesh.t.shape[1])
        velocity = Basis(mesh, VELOCITY, intorder=4)
        return np.sqrt(total + squared_divergence.elemental(velocity, u=velocity.interpolate(solution[0])))

    def published(self, setting: float) -> dict[str, np.ndarray]:
        """What `measured` should find."""
        return {CENTRE: np.array([0.00126531908])}

    def measured(self, mesh: MeshTri, setting: float) -> dict[str, np.ndarray]:
        """The same of a solution on a mesh."""
        stream, velocity = Basis(mesh, STREAM, intorder=4), Basis(mesh, VELOCITY, intorder=4)
        right = vorticity.assemble(stream, u=velocity.interpolate(self.solve(mesh)[0]))
        values = solve(*condense(laplace.assemble(stream), right, D=stream.get_dofs()))
        return {CENTRE: stream.probes(np.full((2, 1), 0.5)) @ values}


@LinearForm
def buoyancy(v, w):
    """Of the load (0, x)."""
    return w.x[0] * v[1]


@LinearForm
def vorticity(v, w):
    """What the stream function's load is."""
    return (w.u.grad[1, 0] - w.u.grad[0, 1]) * v


@Functional
def jump(w):
    """Over a facet, times its length."""
    normal = np.einsum("ij...,j...->i...", w.u.grad - w.other_u.grad, w.n) - (w.p - w.other_p) * w.n
    return w.h * np.sum(normal**2, axis=0)


@Functional
def squared_divergence(w):
    """Of the velocity."""
    return div(w.u) ** 2
