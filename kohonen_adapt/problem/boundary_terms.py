"""Terms of Robin conditions and of discontinuous potentials in a Ritz functional."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from skfem import MeshTet, MeshTri

from kohonen_adapt.arrays import DataFunction, Floats, FloatsPair, Int64s, Ints, IntsPair, Mask
from kohonen_adapt.checks import finite_values, is_number
from kohonen_adapt.kernels.tetrahedron.arrays import LOAD, NO_SURFACE, OFFSET
from kohonen_adapt.mesh.elements.functions import on_axis, trace_columns, traces_at
from kohonen_adapt.mesh.names import outer_facets_of

__all__ = [
    "Robin",
    "SurfaceTerms",
    "checked_conditions",
    "checked_surface",
    "corner_values",
    "nodal_terms",
    "reduced_regions",
    "robin_value",
    "sides_of_boundary",
    "surface_work",
    "terms_of_sides",
]

Load = float | DataFunction
Robin = Mapping[str, tuple[float, Load]]

AT, WEIGHTS = (0.5 * (part + shift) for part, shift in zip(np.polynomial.legendre.leggauss(6), (1.0, 0.0), strict=True))


def checked_conditions(given: Robin) -> dict[str, tuple[float, Load]]:
    expected = "robin of Ritz must map names of boundaries to (coefficient, load)"
    if not isinstance(given, Mapping):
        raise ValueError(f"{expected}; got {given!r}.")
    for name, terms in given.items():
        if not isinstance(terms, tuple | list) or len(terms) != 2:
            raise ValueError(f"{expected}; got {terms!r} for {name!r}.")
        coefficient, load = terms
        if not is_number(coefficient) or not 0.0 <= coefficient < np.inf:
            raise ValueError(f"the coefficient in robin of Ritz must be a number >= 0; got {coefficient!r}, {name!r}.")
        if not callable(load) and not (is_number(load) and np.isfinite(load)):
            raise ValueError(f"the load in robin of Ritz must be a number or a function of x; got {load!r}, {name!r}.")
    return {name: (float(coefficient), load) for name, (coefficient, load) in given.items()}


def sides_of_boundary(mesh: MeshTri, name: str) -> IntsPair:
    """Return elements (f,) and opposite corners (f,) of the facets of a boundary."""
    facets = outer_facets_of(mesh, name, f"boundary {name!r} in robin of Ritz")
    element = mesh.f2t[0, facets]
    beside = np.any(mesh.t.T[element][:, :, None] == mesh.facets[:, facets].T[:, None, :], axis=2)
    return element, np.argmin(beside, axis=1)


def terms_of_sides(
    corners: Floats,
    sides: IntsPair,
    order: int,
    terms: tuple[float, Load],
    axisymmetric: bool,
    offset: Floats | None,
) -> tuple[IntsPair, Floats, Floats]:
    """Return A (f, k, k) and b (f, k) of the terms ``c . A c / 2 - b . c`` of sides.

    Before them are returned the places (f, k) of the coefficients c, which are indices of coefficients (k, m).
    `corners` and the midside offsets `offset` have shape (2, 3, m), `sides` contains elements and opposite corners
    (f,). The load is interpolated at the unknowns. Around an axis both integrals have the factor 1 / x.
    """
    (element, k), (coefficient, load) = sides, terms
    start, end = (corners[:, (k + turn) % 3, element][..., None] for turn in (1, 2))
    bow = np.zeros_like(start) if offset is None else 4.0 * offset[:, k, element][..., None]
    at_axis = on_axis(np.hstack((start[0], end[0]))) & axisymmetric

    def points(fraction: Floats) -> FloatsPair:
        # with the factor s, which is 0 on the axis
        factor = 1.0 - at_axis[:, :1] * (1.0 - fraction) - at_axis[:, 1:] * fraction
        return start + fraction * (end - start) + fraction * (1.0 - fraction) * bow, factor

    x, factor = points(AT)
    measure = WEIGHTS * np.hypot(*(end - start + (1.0 - 2.0 * AT) * bow))
    if axisymmetric:
        measure = measure * factor**2 / x[0]
    traces, fraction = traces_at(AT, order), np.append([0.0, 1.0], np.arange(1, order) / order)
    mass = np.einsum("qi,qj,fq->fij", traces, traces, measure)
    x, factor = points(fraction)
    flat = x.reshape(2, -1)
    loads = finite_values("a load in robin of Ritz", load, flat, flat.shape[1:]).reshape(factor.shape)
    loads = loads / np.where(factor > 0.0, factor, 1.0)
    interpolant = np.linalg.solve(traces_at(fraction, order), loads.T)
    places = trace_columns(k, order), element[:, None]
    return places, coefficient * mass, np.einsum("fij,jf->fi", mass, interpolant)


def robin_value(
    corners: Floats,
    coefficients: Floats,
    sides: IntsPair,
    terms: tuple[float, Load],
    axisymmetric: bool,
    offset: Floats | None,
) -> float:
    """Return the terms of a condition on sides, for coefficients (k, m)."""
    order = (3, 6, 10).index(len(coefficients)) + 1
    places, matrix, load = terms_of_sides(corners, sides, order, terms, axisymmetric, offset)
    trace = coefficients[places]
    return float(0.5 * np.einsum("fi,fij,fj", trace, matrix, trace) - np.sum(load * trace))


@dataclass(frozen=True, eq=False)
class SurfaceTerms:
    """Offsets and loads of a functional on tetrahedra.

    In reduced regions the function is u minus an offset, as a scalar potential is outside iron if u is the total
    potential in iron. The functional is ``Pi(u - offset) - sum load (u - offset)``.

    Attributes
    ----------
    nodal
        Offset and load at the unknowns, shape (nunknowns, 2). Offsets are 0 except on surfaces between reduced regions
        and the rest, loads are 0 except on faces of regions.
    reduced
        Reduced regions by their number in `Ritz`, shape (nregions,).
    on_mesh
        Function of a mesh with the same subdomains that returns `nodal` there, for the same potential.
    """

    nodal: Floats
    reduced: Mask
    on_mesh: Callable[[MeshTet], Floats]


def checked_surface(given: SurfaceTerms | None, unknowns: int, region: Int64s | None) -> None:
    if given is None:
        return
    found = f"nodal of shape {np.shape(given.nodal)}" if isinstance(given, SurfaceTerms) else repr(given)
    if not isinstance(given, SurfaceTerms) or np.shape(given.nodal) != (unknowns, 2):
        raise ValueError(f"surface of Ritz must be SurfaceTerms with nodal of shape ({unknowns}, 2); got {found}.")
    needed = 1 if region is None else int(region.max(initial=0)) + 1
    if len(given.reduced) < needed:
        raise ValueError(f"reduced of SurfaceTerms must have {needed} entries; got {len(given.reduced)}.")


def nodal_terms(surface: SurfaceTerms | None) -> Floats:
    return NO_SURFACE if surface is None else surface.nodal


def reduced_regions(surface: SurfaceTerms | None, number: Ints) -> Mask:
    return np.zeros(np.shape(number), bool) if surface is None else np.asarray(surface.reduced)[number]


def corner_values(values: Floats, nodal: Floats, node: Ints, reduced: Mask) -> Floats:
    if not len(nodal):
        return values[node]
    return values[node] - np.where(reduced, nodal[node, OFFSET], 0.0)


def surface_work(values: Floats, nodal: Floats) -> float:
    return float(nodal[:, LOAD] @ (values - nodal[:, OFFSET])) if len(nodal) else 0.0
