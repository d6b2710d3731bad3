"""Terms of Robin conditions in a Ritz functional."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import is_number
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.names import named
from kohonen_adapt.mesh.near_axis import on_axis
from kohonen_adapt.mesh.polynomials import trace_columns, traces_at

__all__ = ["Load", "Robin", "added_on_sides", "checked_conditions", "facet_terms", "sides_of_boundary"]

Load = float | Callable[[Floats], ArrayLike]
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


def sides_of_boundary(mesh: MeshTri, name: str) -> tuple[Ints, Ints]:
    """Return elements (f,) and opposite corners (f,) of the facets of a boundary.

    Raises ValueError if the boundary is unknown or not on the outer boundary of the mesh.
    """
    facets = np.asarray(named(mesh.boundaries, name, "boundary"))
    number_facets(mesh)
    inside = int(np.count_nonzero(mesh.f2t[1, facets] >= 0))
    if inside:
        raise ValueError(
            f"boundary {name!r} in robin of Ritz must be on the outer boundary of the mesh; {inside} of "
            f"{facets.size} facets are inside."
        )
    element = mesh.f2t[0, facets]
    beside = np.any(mesh.t.T[element][:, :, None] == mesh.facets[:, facets].T[:, None, :], axis=2)
    return element, np.argmin(beside, axis=1)


def facet_terms(
    ends: Floats, order: int, terms: tuple[float, Load], axisymmetric: bool = False, off: Floats | None = None
) -> tuple[Floats, Floats]:
    """Return A (f, k, k) and b (f, k) of the terms ``c . A c / 2 - b . c`` of facets.

    The coefficients c are in the order of `traces_at`. `ends` has shape (f, 2, 2), and `off`, shape (f, 2), contains
    the midside offsets. The load is interpolated at the unknowns. Around an axis both integrals have the factor 1 / x.
    """
    coefficient, load = terms
    off = np.zeros_like(ends[:, 0]) if off is None else off
    share = np.append([0.0, 1.0], np.arange(1, order) / order)
    given = load_at(_along(ends, off, share).reshape(-1, 2).T, load).reshape(-1, order + 1)
    mass = _masses(ends, order, off, axisymmetric)
    if axisymmetric:
        factor = factors(ends, share)
        given = given / np.where(factor > 0.0, factor, 1.0)
    loads = np.linalg.solve(traces_at(share, order), given.T)
    return coefficient * mass, np.einsum("fij,jf->fi", mass, loads)


def _along(ends: Floats, off: Floats, share: Floats) -> Floats:
    """Return the points at fractions (n,) of the length of facets, shape (f, n, 2)."""
    chord = ends[:, :1] + share[:, None] * (ends[:, 1:] - ends[:, :1])
    return chord + 4.0 * (share * (1.0 - share))[:, None] * off[:, None]


def _masses(ends: Floats, order: int, off: Floats, axisymmetric: bool) -> Floats:
    """Return the mass matrices of facets, around an axis with the factor 1 / x."""
    here, way = traces_at(AT, order), ends[:, 1] - ends[:, 0]
    measure = WEIGHTS * np.hypot(*(way[:, None] + 4.0 * (1.0 - 2.0 * AT)[:, None] * off[:, None]).transpose(2, 0, 1))
    if axisymmetric:
        measure = measure * factors(ends, AT) ** 2 / _along(ends, off, AT)[:, :, 0]
    return np.einsum("qi,qj,fq->fij", here, here, measure)


def factors(ends: Floats, share: Floats) -> Floats:
    """Return the factors of functions on facets that end at an axis, shape (f, n)."""
    on = on_axis(ends[:, :, 0])
    return 1.0 - on[:, :1] * (1.0 - share) - on[:, 1:] * share


def added_on_sides(
    corners: Floats,
    coefficients: Floats,
    sides: tuple[Ints, Ints],
    terms: tuple[float, Load],
    axisymmetric: bool,
    bend: Floats | None,
) -> float:
    """Return the terms of a condition on sides, for coefficients (m, functions).

    `corners` has shape (m, 3, 2), `sides` contains elements and opposite corners (f,), and `bend` the midside offsets
    (m, 3, 2).
    """
    (e, k), order = sides, (3, 6, 10).index(coefficients.shape[1]) + 1
    ends = np.stack([corners[e, (k + 1) % 3], corners[e, (k + 2) % 3]], axis=1)
    matrix, load = facet_terms(ends, order, terms, axisymmetric, None if bend is None else bend[e, k])
    trace = coefficients[e[:, None], trace_columns(k, order)]
    return float(0.5 * np.einsum("fi,fij,fj", trace, matrix, trace) - np.sum(load * trace))


def load_at(x: Floats, load: Load) -> Floats:
    """Return a load at points (2, n), shape (n,).

    Raises ValueError for another shape, and for values that are not finite.
    """
    values = np.asarray(load(x) if callable(load) else load, dtype=float)
    if values.shape not in {(), x.shape[1:]} or not np.all(np.isfinite(values)):
        raise ValueError(
            f"a load in robin of Ritz must be finite numbers of shape (n,) = {x.shape[1:]}; got {values!r}."
        )
    return np.broadcast_to(values, x.shape[1:])
