"""Solve plane elasticity on an L by scikit-fem, a problem of a user's own: its compliance is known."""

import numpy as np
from skfem import Basis, BoundaryFacetBasis, ElementTriP1, ElementVector, LinearForm, MeshTri, condense, solve
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity, linear_stress

YOUNG, POISSON = 1.0, 0.3  # plane strain
LAMBDA, Q = 0.544483736782464, 0.543075578836737  # of the first mode at a re-entrant corner of 270 degrees
ENERGY, COMPLIANCE = 4.15454423, "compliance"  # the one is half of the other


class ElasticL:
    """The L (-1, 1)^2 without a quadrant under the tractions of the corner's first mode, plane strain.

    Szabo and Babuska, Finite Element Analysis (1991), give its stresses ``r^(lambda - 1) f(phi)`` and the strain energy
    4.15454423 for Young's modulus, thickness and the half side 1 and Poisson's ratio 0.3.
    """

    title = "elasticity, L"
    settings = (0.0,)
    goal = None

    def start(self, setting: float) -> MeshTri:
        """As scikit-fem has it, its corner at the origin."""
        return MeshTri.init_lshaped().refined(4)

    def problem(self, setting: float) -> "ElasticL":
        """It is one itself."""
        return self

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Displacements, numbered as scikit-fem does; what a rigid motion would change is held at two nodes."""
        basis = Basis(mesh, ElementVector(ElementTriP1()))
        stiffness = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)
        return solve(*condense(stiffness, load(mesh), D=_held(mesh, basis)))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Of the tractions that jump over facets."""
        stress = stresses(mesh, solution)
        inner = mesh.f2t[1] >= 0
        first, second = mesh.f2t[:, inner]
        tangent = np.diff(mesh.p[:, mesh.facets[:, inner]], axis=1)[:, 0]
        jump = np.einsum("ijf,jf->if", stress[:, :, first] - stress[:, :, second], np.stack((tangent[1], -tangent[0])))
        squared = np.tile(np.sum(jump**2, axis=0) / 2, 2)
        return np.sqrt(np.bincount(np.concatenate((first, second)), squared, minlength=mesh.t.shape[1]) / YOUNG)

    def published(self, setting: float) -> dict[str, np.ndarray]:
        """What `measured` should find."""
        return {COMPLIANCE: np.array([2 * ENERGY])}

    def measured(self, mesh: MeshTri, setting: float) -> dict[str, np.ndarray]:
        """The same of a solution on a mesh."""
        return {COMPLIANCE: np.array([load(mesh) @ self.solve(mesh)])}


def load(mesh: MeshTri) -> np.ndarray:
    """Of the exact tractions on the outer boundary; on both sides of the corner there are none."""
    basis = BoundaryFacetBasis(mesh, ElementVector(ElementTriP1()), intorder=8)

    @LinearForm
    def work(v, w):
        return dot(np.einsum("ij...,j...->i...", exact_stress(w.x), w.n), v)

    return work.assemble(basis)


def exact_stress(x: np.ndarray) -> np.ndarray:
    """Of the mode at points (2, ...), (2, 2, ...)."""
    turn = np.array([[-1.0, -1.0], [1.0, -1.0]]) / np.sqrt(2)  # to axes of which the first halves the L
    u, v = np.einsum("ij,j...->i...", turn, x)
    r, phi = np.hypot(u, v), np.arctan2(v, u)
    one, three = (LAMBDA - 1) * phi, (LAMBDA - 3) * phi
    along = (2 - Q * (LAMBDA + 1)) * np.cos(one) - (LAMBDA - 1) * np.cos(three)
    across = (2 + Q * (LAMBDA + 1)) * np.cos(one) + (LAMBDA - 1) * np.cos(three)
    shear = (LAMBDA - 1) * np.sin(three) + Q * (LAMBDA + 1) * np.sin(one)
    stress = LAMBDA * r ** (LAMBDA - 1) * np.array([[along, shear], [shear, across]])
    return np.einsum("ki,kl...,lj->ij...", turn, stress, turn)


def stresses(mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
    """Of every element, (2, 2, nelements)."""
    basis = Basis(mesh, ElementVector(ElementTriP1()), intorder=0)
    return linear_stress(*lame_parameters(YOUNG, POISSON))(basis.interpolate(solution).grad)[..., 0]


def _held(mesh: MeshTri, basis: Basis) -> np.ndarray:
    """Both components at the corner, and one of the node that is farthest below it."""
    corner = np.argmin(np.hypot(*mesh.p))
    below = np.argmin(np.where(mesh.p[0] == mesh.p[0, corner], mesh.p[1], np.inf))
    return np.array([*basis.nodal_dofs[:, corner], basis.nodal_dofs[0, below]])
