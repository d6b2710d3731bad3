"""Equilibrated error bounds, with the duality gap for nonlinear material.

A flux in exact equilibrium with the source bounds the error in the energy norm from above.
"""

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Function, Int64s, Mask
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.estimators.discrete_flux import DiscreteFlux, discrete_flux
from kohonen_adapt.kernels.triangle.equilibrate import GIVEN, NATURAL, FluxData, equilibrate, patch_scratch
from kohonen_adapt.mesh.cells import TETRAHEDRON, check_kind
from kohonen_adapt.mesh.elements.rules import triangle_rule
from kohonen_adapt.mesh.host import summed
from kohonen_adapt.mesh.measures import area, gradient
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.mesh.validity import check_mesh

__all__ = [
    "duality_gap",
    "equilibrated",
    "equilibrated_correction",
    "equilibrated_flux",
    "fixed_nodes",
]

# Limit for the residual at a node, relative to the largest sum of absolute terms at any node. Direct solvers leave
# 1e-15, iterative solvers and Newton's method 1e-8. A Dirichlet node that `fixed` omits leaves 1e-2 and more.
UNBALANCED = 1e-6
DEGREE = 4  # of the quadrature of the duality gap, exact for linear material


def equilibrated(
    mesh: MeshTri,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    *,
    source: ArrayLike | None = None,
    flux: ArrayLike | None = None,
    fixed: ArrayLike | None = None,
) -> Floats:
    """Return equilibrated error indicators of a P1 solution.

    For ``-div(nu grad u - flux) = source`` the indicator is ``eta_K^2 = int_K |sigma* - sigma_h|^2 / nu_K`` with
    ``sigma_h = nu grad u_h - flux`` and the flux sigma* of `equilibrated_flux`. The theorem of Prager and Synge (Quart.
    Appl. Math. 5, 1947) states ::

        int nu |grad(u - u_h)|^2 + int |sigma* - sigma|^2 / nu = sum eta_K^2.

    The root of the sum of squares is therefore never below the error, without a constant, for any reluctivity and mesh.
    Measured values are 1.04 to 1.3 times the error. The bound is for the error on the meshed polygon, with data
    constant per element and Dirichlet values linear along each facet, in the plane and not around an axis.

    Parameters
    ----------
    mesh, potential, reluctivity, source, flux
        As in `residual`, for triangles only. The potential must satisfy the P1 equations at all nodes that are not
        fixed.
    fixed : (nnodes,) of bool, optional
        Nodes with a Dirichlet value; None means all boundary nodes. A boundary facet between two of these nodes is a
        Dirichlet facet, and every other boundary facet has the natural condition ``n . sigma = 0``.

    Returns
    -------
    ndarray (nelements,)
        As in `residual`.

    Raises
    ------
    ValueError
        As in `residual`, and if the potential violates the P1 equations at a node that is not fixed, or at a fixed node
        without a Dirichlet facet, as inside the mesh. Parts of the mesh that share a single node are also refused.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.isin(np.arange(9), mesh.interior_nodes()) / 16  # solves -div grad u = 1 with u = 0 on the boundary
    >>> eta = ka.estimators.equilibrated(mesh, u, np.ones(8), source=np.ones(8))
    >>> squared_error = 0.0351443 - 1 / 64  # int |grad u|^2 of the exact solution minus int |grad u_h|^2
    >>> bool(squared_error <= np.sum(eta**2) <= 1.5 * squared_error)
    True
    """
    _check_plane(mesh)
    discrete = discrete_flux(mesh, potential, reluctivity, source, flux, varying=False)
    correction = equilibrated_correction(discrete, fixed)
    return np.sqrt(discrete.product(correction, correction))


def equilibrated_flux(
    mesh: MeshTri,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    *,
    source: ArrayLike | None = None,
    flux: ArrayLike | None = None,
    fixed: ArrayLike | None = None,
) -> Floats:
    """Return a flux in equilibrium, near the flux of a P1 solution.

    The flux sigma* satisfies ``-div sigma* = source`` in every element. Its normal component is continuous across
    facets and zero on boundary facets with the natural condition. Sigma* is linear in every element (BDM1) and a sum
    over all nodes a. The term of node a lives on the elements around a, has the divergence
    ``grad phi_a . sigma_h - phi_a source`` and no normal component on the boundary of this patch, and is as near to
    ``phi_a sigma_h`` as possible in the norm ``sqrt(int |.|^2 / nu)`` (Braess and Schoeberl, Math. Comp. 77, 2008; Ern
    and Vohralik, SIAM J. Numer. Anal. 53, 2015). In magnetostatics ``H* = (-sigma*_y, sigma*_x)``.

    Parameters
    ----------
    mesh, potential, reluctivity, source, flux, fixed
        As in `equilibrated`.

    Returns
    -------
    ndarray (2, 3, nelements)
        Values at the three corners of every element, in the order of ``mesh.t`` and in the unit of `flux`; axes are
        component, corner, element. At barycentric coordinates l_i the flux is ``sum l_i sigma*_i``.

    Raises
    ------
    ValueError
        As in `equilibrated`.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.isin(np.arange(9), mesh.interior_nodes()) / 16  # solves -div grad u = 1 with u = 0 on the boundary
    >>> ka.estimators.equilibrated_flux(mesh, u, np.ones(8), source=np.ones(8)).shape
    (2, 3, 8)
    """
    _check_plane(mesh)
    discrete = discrete_flux(mesh, potential, reluctivity, source, flux, varying=False)
    return discrete.at_corners + equilibrated_correction(discrete, fixed)


def duality_gap(
    mesh: MeshTri,
    potential: ArrayLike,
    field: ArrayLike,
    energy: Function,
    coenergy: Function,
    *,
    flux: ArrayLike | None = None,
) -> Floats:
    """Return indicators that bound the energy of a P1 function above the minimum.

    Let u minimise ``J(u) = int W(|grad u|) - flux . grad u - source u`` with W convex, and let sigma* be a flux in
    equilibrium (`equilibrated_flux`). Every function u_h with the same Dirichlet values satisfies ::

        J(u_h) - J(u) <= sum_K int_K W(|grad u_h|) + W*(|s|) - grad u_h . s,    s = sigma* + flux,

    by Fenchel's inequality (Repin, Math. Comp. 69, 2000), where ``W*(h) = max_b (b h - W(b))``. The sum of squared
    indicators is twice this bound. In magnetostatics W is the energy density int H dB of a material without its
    remanence, W* its co-energy density int B dH, and s the field ``H* + Hc``, turned like `flux`. For linear material,
    ``W = nu b^2 / 2`` and ``W* = h^2 / (2 nu)``, the result equals the equilibrated indicators. W* is integrated by a
    quadrature of degree 4, and for nonlinear material the bound holds up to the error of the quadrature.

    Parameters
    ----------
    mesh
        As in `equilibrated`.
    potential
        Nodal values (nnodes,) of u_h, which need not solve the discrete equations.
    field : (2, 3, nelements)
        The flux sigma* at the corners of the elements, from `equilibrated_flux` with the reluctivity at u_h.
    energy
        The function W. Called with ``|grad u_h| >= 0`` of all elements, (1, nelements); returns densities of the same
        shape.
    coenergy
        The function W*. Called with ``|s| >= 0`` at quadrature points of all elements, (npoints, nelements); returns
        densities of the same shape.
    flux : (2, nelements), optional
        As in `residual`; for magnets the turned coercive field ``(-Hc_y, Hc_x)``.

    Returns
    -------
    ndarray (nelements,)
        Unsquared indicators ``sqrt(2 gap_K)``, in the unit of the energy norm.

    Raises
    ------
    ValueError
        As in `residual`, and if densities are not finite or have the wrong shape.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.isin(np.arange(9), mesh.interior_nodes()) / 16  # solves -div grad u = 1 with u = 0 on the boundary
    >>> given = (mesh, u, np.ones(8))
    >>> flux = ka.estimators.equilibrated_flux(*given, source=np.ones(8))
    >>> eta = ka.estimators.duality_gap(mesh, u, flux, lambda b: b**2 / 2, lambda h: h**2 / 2)
    >>> np.allclose(eta, ka.estimators.equilibrated(*given, source=np.ones(8)))  # linear material
    True
    """
    _check_plane(mesh)
    check_mesh(mesh, curved=False, space=False)
    nnodes, nelements = mesh.nvertices, mesh.nelements
    nodal = finite_reals("potential", potential, {"nnodes": nnodes}, "node")
    corners = finite_reals("field", field, {"2": 2, "3": 3, "nelements": nelements}, "element")
    empty = np.zeros((2, nelements)) if flux is None else flux
    prescribed = finite_reals("flux", empty, {"2": 2, "nelements": nelements}, "element")
    slope = gradient(mesh, nodal)
    barycentric, weights = triangle_rule(DEGREE)
    at_points = barycentric @ (corners + prescribed[:, None])
    size = np.linalg.norm(at_points, axis=0)
    stored = _densities("energy", energy, np.linalg.norm(slope, axis=0)[None])
    gap = stored + _densities("coenergy", coenergy, size) - np.einsum("ck,cqk->qk", slope, at_points)
    # By Fenchel's inequality the gap is negative by rounding only.
    return np.sqrt(2.0 * area(mesh) * np.maximum(weights @ gap, 0.0))


def _densities(name: str, function: Function, values: Floats) -> Floats:
    densities = np.asarray(function(values))
    if densities.shape != values.shape or not np.all(np.isfinite(densities)):
        raise ValueError(
            f"{name} must return a finite density for each of the values it is given, of shape {values.shape}; "
            f"got shape {densities.shape} with {np.count_nonzero(~np.isfinite(densities))} not finite."
        )
    return densities


def equilibrated_correction(discrete: DiscreteFlux, fixed: ArrayLike | None) -> Floats:
    """Return ``sigma* - sigma_h`` at the corners of elements, (2, 3, nelements)."""
    mesh = discrete.space.mesh
    fixed_mask = fixed_nodes(mesh, fixed)
    problem, order = _problem(mesh, discrete, fixed_mask)
    rows, imbalance = np.zeros((*order.shape, 2)), np.zeros(mesh.nvertices)
    seen = np.zeros(mesh.t.T.shape, bool)
    equilibrate(problem, patch_scratch(np.bincount(mesh.t.ravel()).max()), seen, rows, imbalance)
    _check_balance(mesh, discrete, fixed_mask, imbalance)
    correction = np.empty_like(rows)
    np.put_along_axis(correction, order[:, :, None], rows, axis=1)
    return correction.T + discrete.mean[:, None] - discrete.at_corners


def fixed_nodes(mesh: MeshTri, fixed: ArrayLike | None) -> Mask:
    if fixed is None:
        return np.isin(np.arange(mesh.nvertices), mesh.facets[:, mesh.f2t[1] < 0])
    fixed_mask = np.asarray(fixed)
    if fixed_mask.shape != mesh.p.shape[1:] or fixed_mask.dtype != bool:
        raise ValueError(
            f"fixed must be a mask of bool of shape (nnodes,) = {mesh.p.shape[1:]}, True where the value is given; "
            f"got an array of {fixed_mask.dtype} of shape {fixed_mask.shape}."
        )
    return fixed_mask


def _check_plane(mesh: object) -> None:
    if type(mesh) is TETRAHEDRON.mesh:
        raise ValueError(
            "mesh must be a skfem.MeshTri: fluxes are not equilibrated in space; got MeshTet1. Take "
            "estimators.residual or estimators.recovery."
        )
    check_kind(mesh, curved=False, space=False)


def _problem(mesh: MeshTri, discrete: DiscreteFlux, fixed_mask: Mask) -> tuple[FluxData, Int64s]:
    triangulation = Triangulation.of(mesh)
    node, neighbour = triangulation.elements.node, triangulation.elements.neighbour
    order = np.argmax(node[:, :, None] == mesh.t.T[:, None], axis=2)
    space = discrete.space
    outflow = -2.0 * space.volumes * np.einsum("ck,cik->ik", discrete.mean, space.hats)
    dirichlet = fixed_mask[node[:, [1, 2, 0]]] & fixed_mask[node[:, [2, 0, 1]]]
    neighbour = np.where(neighbour >= 0, neighbour, np.where(dirichlet, GIVEN, NATURAL)).astype(np.int32)
    outflow = np.ascontiguousarray(np.take_along_axis(outflow.T, order, axis=1))
    return FluxData(triangulation.position, node, neighbour, outflow, discrete.source, discrete.reluctivity), order


def _check_balance(mesh: MeshTri, discrete: DiscreteFlux, fixed_mask: Mask, imbalance: Floats) -> None:
    space, fluxes = discrete.space, (discrete.mean, discrete.prescribed.mean(axis=1))
    parts = [np.einsum("ck,cik->ik", flux, space.hats) for flux in fluxes]
    size = space.volumes * (np.abs(parts[0] + parts[1]) + np.abs(parts[1]) + np.abs(discrete.source) / 3.0)
    largest = summed(mesh.t, size).max()
    bad = np.flatnonzero(imbalance > UNBALANCED * largest)
    if bad.size:
        first, left = bad[0], imbalance[bad[0]] / largest
        kind = "fixed, but without a boundary facet of given values" if fixed_mask[first] else "not fixed"
        raise ValueError(
            "potential must satisfy the P1 equations where no boundary value is given; it does not at "
            f"{bad.size} of {fixed_mask.size} nodes, first {first} ({kind}; {left:.1e} of the largest balance is left "
            "over). Give `fixed` all nodes of given values, and the reluctivity, source and flux that "
            "the potential was solved with; values given inside the mesh, and parts of it that hang together by a "
            "single node, are not covered."
        )
