"""Residual estimator of orders 1 to 3, by jumps of fluxes across facets."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.estimators.discrete_flux import DiscreteFlux, discrete_flux
from kohonen_adapt.mesh.cells import CELLS, TRIANGLE, cell_of, centroids_of
from kohonen_adapt.mesh.elements.functions import facet_products, nodes, reference_functions
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import summed
from kohonen_adapt.mesh.measures import is_in_front
from kohonen_adapt.mesh.validity import check_mesh

__all__ = [
    "HIGHER_SCALES",
    "LATTICE",
    "Facets",
    "outflows",
    "residual",
    "residual_indicators",
    "residual_of",
    "residual_on_lattice",
    "rows_of_ends",
]

# Factors of the indicators that bring the root of their sum of squares near the error.
# Order 2: the bare residual is 5.9 - 6.4 times the error for smooth fields on squares and random meshes, 6.0 - 6.1 for
# a rectangular magnet and 6.0 - 6.2 at corners of iron (test_orders.py). The factor 1 / 6.1 is right within 5 %.
# Order 3: 8.5 - 10.0 for smooth fields, 9.6 for a rectangular magnet, 10.1 for the same, adapted (test_orders.py). The
# factor 1 / 9.7 is right within 12 %.
# A round magnet on curved elements: 5.9 - 6.0 at order 2, 10.2 - 10.6 at order 3 (`benchmarks curves`).
HIGHER_SCALES = {2: 1.0 / 6.1, 3: 1.0 / 9.7}

LATTICE = nodes(2, 2, spread=False)  # corners and midsides of triangles

Facets = tuple[Ints, Ints, Floats]  # periodic facets, the matching facets, and the factor between their values

SWAPPED = [[1], [0], [2]]  # points of a facet in the opposite direction
ORDERS = (1, 2, 3)


def outflows(mesh: Mesh, outflow: Floats) -> Floats:
    """Return the flux out of both elements at points of facets, (npoints, nfacets).

    The points are the ends of facets, in the order of ``mesh.facets``, and then midsides, or the centroids alone.

    Parameters
    ----------
    outflow : (npoints, d + 1, nelements)
        Flux out of every element at the points of its facets, the ends in the order of `Cell.facets`.
    """
    cell, nfacets = cell_of(mesh), mesh.nfacets
    row = np.broadcast_to(np.arange(len(outflow))[:, None, None], outflow.shape)
    if len(outflow) >= cell.dim:
        row = np.concatenate([rows_of_ends(mesh), row[cell.dim :]])
    place = row * nfacets + mesh.t2f
    return summed(place, outflow, len(outflow) * nfacets).reshape(-1, nfacets)


def rows_of_ends(mesh: Mesh) -> Ints:
    """Return the rows of the ends of sides in ``mesh.facets``, (d, d + 1, nelements)."""
    ends = mesh.t[np.transpose(cell_of(mesh).facets)]
    return np.argmax(mesh.facets[:, None, mesh.t2f] == ends, axis=0)


def residual_indicators(
    mesh: Mesh,
    size: Floats,
    outflow: Floats,
    load: Floats,
    weight: Floats,
    joined: Facets | None,
    around: tuple[Floats | float, Floats | float] = (1.0, 1.0),
) -> Floats:
    """Return unsquared residual indicators, shape (nelements,).

    With ``q = nu grad u - flux`` ::

        eta_K^2 = h_K^2 ||source + div q||_K^2 / nu + 1/2 sum_F h_F ||[q . n]||_F^2 / max(nu).

    Parameters
    ----------
    mesh, size : (nelements,)
        The corners of the elements, and their areas or volumes.
    outflow
        ``q . n`` times the root of ``h_F |F|``, as for `outflows`. The jump is integrated over facets, or taken at
        their centroids if these are the only points.
    load : (n, nelements)
        ``source + div q`` at n points whose mean square equals the mean square over the element.
    weight : (nelements,)
        The reluctivity nu.
    joined
        As in `residual`.
    around : (nelements,), (nfacets,)
        Factors of the integrals over elements and facets: 1 in the plane, the circumference ``2 pi r`` around an axis.
    """
    # h_K^d = |K|. If h_K were the longest edge, the source would count twice as much as the jumps.
    inside = size ** (1.0 + 2.0 / mesh.dim()) * around[0] * np.mean(load**2, axis=0) / weight
    total, nearby = outflows(mesh, outflow), np.where(mesh.f2t < 0, mesh.f2t[0], mesh.f2t)
    jump, largest = np.where(mesh.f2t[1] < 0, 0.0, total), weight[nearby].max(axis=0)
    if joined is not None:
        one, other, sign = joined
        row = np.arange(len(total))[:, None]
        if len(total) > 1:  # ends of matching facets are in the same order if only one of these runs clockwise
            middle = centroids_of(mesh)[:, mesh.f2t[0]]
            left = is_in_front(mesh.p[:, mesh.facets], middle)
            row = np.where(left[one] == left[other], SWAPPED[: len(total)], row)
        jump[:, one] = total[:, one] + sign * total[row, other]
        jump[:, other] = sign * jump[row, one]
        largest[one] = largest[other] = np.maximum(largest[one], largest[other])
    products = facet_products(len(jump) - 1) if len(jump) > 1 else np.ones((1, 1))
    squared = np.einsum("if,ij,jf->f", jump, products, jump)
    return np.sqrt(inside + 0.5 * np.sum((around[1] * squared / largest)[mesh.t2f], axis=0))


def residual_on_lattice(
    space: Space,
    flux: Floats,
    source: Floats,
    weight: Floats,
    joined: Facets | None,
    around: tuple[Floats | float, Floats | float] = (1.0, 1.0),
    divergence: Floats | None = None,
) -> Floats:
    """Return residual indicators of a flux that is a polynomial in triangles.

    The values of the flux are on `LATTICE`, shape (2, 6, nelements), or at the corners alone, (2, 3, nelements). The
    divergence is taken from these values, unless it is given at the midsides, (3, nelements), because the mean square
    there is the mean square of a linear function over the element. Normals have the length of the tangent for a
    parameter from 0 to 1, so that an integral over the side is the integral of the product with the normal.
    """
    hats, shape = space.hats[:, :, None], (2, 3, len(LATTICE), weight.size)
    if space.curved.any():
        hats = space.shape.hats_in(np.arange(weight.size), LATTICE)
    if divergence is None:
        slopes = reference_functions(LATTICE[3:], flux.shape[1] // 3)[1]
        at_midsides = np.broadcast_to(hats, shape)[:, 1:, 3:]
        divergence = np.einsum("cpk,pis,cisk->sk", flux, slopes, at_midsides, optimize=True)
    points = np.transpose([(*ends, 3 + side) for side, ends in enumerate(TRIANGLE.facets)])[: 1 + flux.shape[1] // 3]
    determinant = TRIANGLE.determinant(hats) / 3.0  # the hats sum to zero
    normal = np.broadcast_to(-hats / np.abs(determinant), shape)[:, TRIANGLE.opposite, points]
    outflow = np.sum(flux[:, points] * normal, axis=0)
    return residual_indicators(space.corners, space.volumes, outflow, source + divergence, weight, joined, around)


def residual(
    mesh: Mesh,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    *,
    source: ArrayLike | None = None,
    flux: ArrayLike | None = None,
    joined: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    order: int = 1,
) -> Floats:
    """Return residual error indicators of a P1, P2 or P3 solution.

    For ``-div q = source`` with ``q = nu grad u - flux`` the indicator of element K is ::

        eta_K^2 = h_K^2 ||source + div q||_K^2 / nu_K + 1/2 sum_F h_F ||[q . n]||_F^2 / max(nu),

    summed over the interior facets F of K, with the larger reluctivity of both elements at F. Boundary facets add
    nothing. In the plane h_K is the square root of the area of K and h_F the length of F; in space they are the cube
    root of the volume and the square root of the area. The maximum of nu makes the effectivity independent of the ratio
    of the materials (Bernardi and Verfuerth, Numer. Math. 85, 2000). With the nu of each element in its place the
    estimate concentrates all nodes in the iron. In magnetostatics the jump is the jump of the tangential field strength
    H_t.

    Parameters
    ----------
    mesh
        A `MeshTri` or `MeshTet` with straight sides; above order 1 a `MeshTri`, or a `MeshTri2` with curved sides.
    potential : (nnodes,) or (nunknowns,)
        Nodal values of the solution u; above order 1 the unknowns of `skfem.ElementTriP2` or `skfem.ElementTriP3`.
    reluctivity : (nelements,)
        The coefficient nu > 0.
    source : (nelements,), optional
        Right-hand side; None is zero.
    flux : (d, nelements), optional
        Prescribed flux in d dimensions, for magnets in the plane ``nu (-Br_y, Br_x)``; None is zero. A flux that varies
        inside elements has shape (d, d + 1, nelements), with values at the corners in the order of ``mesh.t`` and
        linear between them. Its mean alone would jump from element to element and change the estimate by 50 %.
    joined : (k,), (k,), (k,), optional
        Facets on one side of periodic boundaries, the matching facets on the opposite side, and the factor between the
        values of u there, 1 (periodic) or -1 (antiperiodic). These pairs count as interior facets.
    order
        Order of the elements: 1, on triangles also 2 and 3.

    Returns
    -------
    ndarray (nelements,)
        Unsquared indicators of the energy norm ``sqrt(int nu |grad e|^2)``, in its unit. The root of their sum of
        squares is 3.4 to 4.4 times the error; on tetrahedra 2.8 to 3.8 times, with slivers up to 5.2 times; about 6.1
        times at order 2, and 9.7 times at order 3, as in `kohonen_adapt.magnetostatics.Magnetostatics`.

    Raises
    ------
    ValueError
        If an argument has the wrong shape, is not finite or not positive, if the mesh is invalid or has elements of
        another kind, or for an order that the elements do not have.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.isin(np.arange(9), mesh.interior_nodes()) / 16  # solves -div grad u = 1 with u = 0 on the boundary
    >>> eta = ka.estimators.residual(mesh, u, np.ones(8), source=np.ones(8))
    >>> eta.shape
    (8,)
    >>> bool(ka.estimators.residual(mesh, mesh.p[0], np.ones(8)).max() < 1e-12)  # a solution without error
    True
    """
    if isinstance(order, bool) or order not in ORDERS:
        raise ValueError(f"order must be 1, 2 or 3; got {order!r}.")
    facets: Any = joined and tuple(map(np.asarray, joined))
    if order > 1:
        check_mesh(mesh)
        if cell_of(mesh) is not TRIANGLE:
            raise ValueError(f"order must be 1 on tetrahedra; got {order!r}. Orders 2 and 3 are for triangles.")
    return residual_of(discrete_flux(mesh, potential, reluctivity, source, flux, order), facets)


def residual_of(discrete: DiscreteFlux, joined: Facets | None = None) -> Floats:
    space, weight = discrete.space, discrete.reluctivity
    if space.order > 1:
        return residual_on_lattice(space, discrete.at(LATTICE), discrete.source, weight, joined)
    # At order 1 a jump is that at the centroid of a facet, and the divergence of a varying flux does not count.
    cell = CELLS[space.dim]
    normal = -cell.dim * space.volumes * space.hats[:, cell.opposite]  # of length |F|
    normal /= np.linalg.norm(normal, axis=0) ** (0.5 - 0.5 / (cell.dim - 1))  # |F|, in space divided by the root of h_F
    flux = discrete.at_corners[:, np.transpose(cell.facets)].mean(axis=1)
    outflow = np.sum(flux * normal, axis=0)[None]
    return residual_indicators(space.corners, space.volumes, outflow, discrete.source[None], weight, joined)
