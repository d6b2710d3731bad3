"""Residual and dual-weighted estimators of solutions of orders 1 to 3."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from skfem import Basis, BilinearForm, LinearForm, Mesh, MeshTri, condense, solve
from skfem.helpers import dot, grad

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.estimators.discrete_flux import checked_reluctivity
from kohonen_adapt.estimators.equilibration import fixed_nodes
from kohonen_adapt.estimators.explicit import linear_residual
from kohonen_adapt.mesh.basis import KINDS, facet_products
from kohonen_adapt.mesh.cells import TRIANGLE, cell_of
from kohonen_adapt.mesh.curved import Isoparametric, with_midside_offsets
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.mesh.measures import area, hat_gradients, signed_area
from kohonen_adapt.mesh.validity import check_mesh

__all__ = [
    "HIGHER_SCALES",
    "LATTICE",
    "DualPair",
    "Facets",
    "divergences",
    "higher_order",
    "residual",
    "residual_at_points",
]

# Factors of the indicators that bring the root of their sum of squares near the error.
# Order 2: the bare residual is 5.9 - 6.4 times the error for smooth fields on squares and random meshes, 6.0 - 6.1 for
# a rectangular magnet and 6.0 - 6.2 at corners of iron (test_quadratic.py). The factor 1 / 6.1 is right within 5 %.
# Order 3: 8.5 - 10.0 for smooth fields, 9.6 for a rectangular magnet, 10.1 for the same, adapted (test_cubic.py). The
# factor 1 / 9.7 is right within 12 %.
# A round magnet on curved elements: 5.9 - 6.0 at order 2, 10.2 - 10.6 at order 3 (`benchmarks curves`).
HIGHER_SCALES = {2: 1.0 / 6.1, 3: 1.0 / 9.7}

ENDS, OPPOSITE = TRIANGLE.facets, list(TRIANGLE.opposite)  # in the order of scikit-fem

# Barycentric coordinates of the corners and the midsides, one row each.
LATTICE = np.vstack((np.eye(3), [np.eye(3)[list(ends)].mean(axis=0) for ends in ENDS]))

Facets = tuple[Ints, Ints, Floats]  # periodic facets, the matching facets, and the factor between their values

CURVED = 2  # additional degrees of the quadrature in elements with curved sides

ORDERS = (1, 2, 3)


def residual_at_points(
    shape: Isoparametric,
    size: Floats,
    flux: Floats,
    load: Floats,
    weight: Floats,
    around: tuple[Floats, Floats],
    joined: Facets | None = None,
) -> Floats:
    """Return unsquared residual indicators, shape (nelements,).

    With ``q = nu grad u - flux`` ::

        eta_K^2 = h_K^2 ||source + div q||_K^2 / nu + 1/2 sum_F h_F ||[q . n]||_F^2 / max(nu).

    Parameters
    ----------
    shape, size : (nelements,)
        The elements and their areas.
    flux : (2, 3, nelements) or (2, 6, nelements)
        The flux q, a polynomial in every element, by its values at the corners and, if of degree 2, at the midsides, in
        the order of `LATTICE`.
    load : (n, nelements)
        ``source + div q`` at n points whose mean square equals the mean square over the element.
    weight : (nelements,)
        The reluctivity nu.
    around : (nelements,), (nfacets,)
        Factors of the integrals over elements and facets: 1 in the plane, the circumference ``2 pi r`` around an axis.
    joined
        As in `residual`.
    """
    elements, facets = around
    squared = np.mean(load**2, axis=0)
    return np.sqrt(size**2 * elements * squared / weight + _jumps(shape, flux, weight, joined, facets))


def divergences(flux: Floats, shape: Isoparametric) -> Floats:
    """Return the divergence of a vector field, in each element or at its midsides.

    `flux` contains values on `LATTICE`, shape (2, points, nelements). A linear field, with 3 points, has one value per
    element, (1, nelements); a quadratic field has values at the midsides, (3, nelements), because the mean square there
    is the mean square of a linear function over the element.
    """
    hats = hat_gradients(shape.corners)
    if flux.shape[1] == 3:
        return np.einsum("cik,cik->k", flux, hats)[None]
    slopes, rows = np.stack([_slopes(barycentric) for barycentric in LATTICE[3:]]), np.flatnonzero(shape.curved)
    found = np.einsum("cpk,spi,cik->sk", flux, slopes, hats, optimize=True)
    for divergence, barycentric, slope in zip(found, LATTICE[3:], slopes, strict=True):
        curved_hats = shape.hat_gradients(rows, np.repeat(barycentric[:, None], rows.size, axis=1))
        divergence[rows] = np.einsum("cpk,pi,cik->k", flux[:, :, rows], slope, curved_hats, optimize=True)
    return found


def _slopes(barycentric: Floats) -> Floats:
    at_middles = [4.0 * (barycentric[a] * np.eye(3)[b] + barycentric[b] * np.eye(3)[a]) for a, b in ENDS]
    return np.vstack((np.diag(4.0 * barycentric - 1.0), at_middles))


def _jumps(shape: Isoparametric, flux: Floats, weight: Floats, joined: Facets | None, around: Floats) -> Floats:
    mesh, degree = shape.corners, flux.shape[1] // 3  # 1 or 2
    nfacets, normals = mesh.facets.shape[1], outward(shape)
    outflow, largest = np.zeros((degree + 1, nfacets)), np.zeros(nfacets)
    sides, along, clockwise = np.zeros(nfacets, dtype=int), np.zeros(nfacets, dtype=bool), signed_area(mesh) < 0.0
    for side, ends in enumerate(ENDS):
        facet = mesh.t2f[side]
        first = mesh.t[ends[0]] == mesh.facets[0, facet]
        points = zip((*ends, 3 + side), normals[side], strict=True)
        at = [np.einsum("ck,ck->k", flux[:, point], normal) for point, normal in list(points)[: degree + 1]]
        np.add.at(outflow[0], facet, np.where(first, at[0], at[1]))
        np.add.at(outflow[1], facet, np.where(first, at[1], at[0]))
        if degree == 2:
            np.add.at(outflow[2], facet, at[2])
        np.maximum.at(largest, facet, weight)
        np.add.at(sides, facet, 1)
        along[facet] = first ^ (side == 2) ^ clockwise  # of boundary facets: counter-clockwise
    jump, turned = np.where(sides == 2, outflow, 0.0), [1, 0, 2][: degree + 1]
    if joined is not None:
        one, other, sign = joined
        same = along[one] != along[other]  # True if the matching facets run in opposite directions
        opposite = np.where(same, outflow[:, other], outflow[turned][:, other])
        jump[:, one] = outflow[:, one] + sign * opposite
        jump[:, other] = sign * np.where(same, jump[:, one], jump[turned][:, one])
        largest[one] = largest[other] = np.maximum(largest[one], largest[other])
    squared = np.einsum("if,ij,jf->f", jump, facet_products(degree), jump)
    return 0.5 * np.sum((around * squared / largest)[mesh.t2f], axis=0)


def outward(shape: Isoparametric) -> Floats:
    """Return outward normals of the sides, shape (3 sides, 3 points, 2, nelements).

    The points are both ends and the midside. Each normal has the length of the tangent for a parameter from 0 to 1, so
    that an integral over the side is the integral of the product with this normal from 0 to 1.
    """
    mesh = shape.corners
    straight = -2.0 * (area(mesh) * hat_gradients(mesh))[:, OPPOSITE].swapaxes(0, 1)
    (along, up), sense = shape.offset[:, OPPOSITE], np.sign(signed_area(mesh)) * [[1.0], [1.0], [-1.0]]
    bow = 4.0 * np.stack((sense * up, -sense * along), axis=1)
    return np.stack((straight + bow, straight - bow, straight), axis=1)


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
    check_mesh(mesh, curved=order > 1, space=True)
    if order == 1:
        return linear_residual(mesh, potential, reluctivity, source, flux, joined)
    if cell_of(mesh) is not TRIANGLE:
        raise ValueError(f"order must be 1 on tetrahedra; got {order!r}. Orders 2 and 3 are for triangles.")
    problem = DualPair(mesh, order, reluctivity)
    facets = None if joined is None else (np.asarray(joined[0]), np.asarray(joined[1]), np.asarray(joined[2]))
    return problem.residual(problem.checked(potential, source, flux), facets)
