"""Dual-weighted error estimates at order 2 and 3, and by a dual of higher order.

The indicators of order 2 and 3 are products of residual estimates. The signed error estimate solves the dual problem by
elements of one order more, also at order 1.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from skfem import Basis, BilinearForm, LinearForm, Mesh, MeshTri, condense, solve
from skfem.helpers import dot, grad

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.estimators.equilibration import fixed_nodes
from kohonen_adapt.estimators.explicit import checked_reluctivity
from kohonen_adapt.estimators.residual_at_points import HIGHER_SCALES, LATTICE, Facets, divergences, residual_at_points
from kohonen_adapt.mesh.cells import TRIANGLE, cell_of
from kohonen_adapt.mesh.curved import Isoparametric, with_midside_offsets
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.polynomials import KINDS

__all__ = ["DualPair", "higher_order"]

CURVED = 2  # additional degrees of the quadrature in elements with curved sides


class Given(NamedTuple):
    # one problem ``-div(nu grad u - flux) = source``
    values: Floats  # (nunknowns,)
    source: Floats  # (nelements,)
    flux: Floats  # (2, 3, nelements), at the corners and linear between them


def higher_order(mesh: Mesh, potential: ArrayLike) -> int:
    if cell_of(mesh) is not TRIANGLE:
        return 1
    return next((order for order in (2, 3) if np.size(potential) == count_unknowns(mesh, order)), 1)


class DualPair:
    """Primal and dual problem on one mesh, by elements of order 1 to 3.

    Arguments are as in `goal_oriented`.
    """

    def __init__(self, mesh: MeshTri, order: int, reluctivity: ArrayLike) -> None:
        self.order, self.shape, self.size = order, Isoparametric(mesh), area(mesh)
        self.turned = np.argsort(mesh.t, axis=0)[None]  # scikit-fem sorts the corners of the straight triangles
        corners, curved = self.shape.corners, bool(self.shape.curved.any())
        self.mesh = with_midside_offsets(corners, self.shape.facet_offset) if curved else corners
        self.reluctivity = checked_reluctivity(mesh, reluctivity)
        self.degree = 2 * order + 2 + CURVED * curved

    def checked(self, values: ArrayLike, source: ArrayLike | None, flux: ArrayLike | None, of: str = "") -> Given:
        unknowns, count = count_unknowns(self.mesh, self.order), self.size.size
        source = np.zeros(count) if source is None else source
        flux = np.zeros((2, count)) if flux is None else flux
        rows = {"2": 2, "nelements": count} if np.ndim(flux) != 3 else {"2": 2, "3": 3, "nelements": count}
        try:
            nodal = finite_reals("potential", values, {"nunknowns": unknowns}, "unknown")
            load = finite_reals("source", source, {"nelements": count}, "element")
            prescribed = finite_reals("flux", flux, rows, "element")
        except ValueError as error:
            raise ValueError(f"{of}{error}") from error
        corners = prescribed if prescribed.ndim == 3 else np.repeat(prescribed[:, None], 3, axis=1)
        return Given(nodal, load, np.take_along_axis(corners, self.turned, axis=1))

    def indicators(self, primal: Given, dual: Given) -> Floats:
        return HIGHER_SCALES[self.order] * np.sqrt(self.residual(primal) * self.residual(dual))

    def residual(self, checked: Given, joined: Facets | None = None) -> Floats:
        weights = np.full(len(LATTICE), 0.5 / len(LATTICE))
        basis = Basis(self.mesh, KINDS[self.order](), quadrature=(LATTICE.T[1:], weights))
        flux = np.moveaxis(self._strength(basis, checked), 2, 1)
        load = checked.source + divergences(flux, self.shape)
        around = np.ones(self.size.size), np.ones(self.mesh.facets.shape[1])
        return residual_at_points(self.shape, self.size, flux, load, self.reluctivity, around, joined)

    def _strength(self, basis: Basis, checked: Given) -> Floats:
        barycentric = np.vstack((1.0 - basis.X.sum(axis=0), basis.X))
        slope = np.asarray(basis.interpolate(checked.values).grad)
        return self.reluctivity[:, None] * slope - np.einsum("cik,iq->ckq", checked.flux, barycentric)

    def error(self, primal: Given, dual: Given, fixed: ArrayLike | None) -> float:
        """Return the dual-weighted residual, an estimate of the error of the goal.

        The residual is ``int source w - (nu grad u_h - flux) . grad w`` for ``w = z - z_h``, where z is the dual
        solution by elements of one order more.
        """
        own, more = (Basis(self.mesh, KINDS[k](), intorder=self.degree) for k in (self.order, self.order + 1))
        nothing = dual._replace(values=np.zeros_like(dual.values))
        load = _residual_of(more, dual.source, self._strength(own, nothing))
        stiffness = BilinearForm(slopes).assemble(more, nu=self.reluctivity[:, None])
        better = solve(*condense(stiffness, load, D=held_unknowns(more, fixed_nodes(self.shape.corners, fixed))))
        strength = self._strength(own, primal)
        left, there = (_residual_of(basis, primal.source, strength) for basis in (more, own))
        return float(left @ better - there @ dual.values)


def _residual_of(basis: Basis, source: Floats, strength: Floats) -> Floats:
    return LinearForm(balance).assemble(basis, source=source[:, None], strength=strength)


def held_unknowns(basis: Basis, held: Mask) -> Ints:
    outer = (basis.mesh.f2t[1] < 0) & held[basis.mesh.facets].all(axis=0)
    return np.concatenate((basis.nodal_dofs[0, held], basis.facet_dofs[:, outer].ravel()))


def balance(v: Any, w: Any) -> Any:
    return w.source * v - dot(w.strength, grad(v))


def slopes(u: Any, v: Any, w: Any) -> Any:
    return w.nu * dot(grad(u), grad(v))
