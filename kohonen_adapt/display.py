"""Units, outlines and number formats shared by plots and reports."""

from collections.abc import Sequence
from itertools import product
from math import comb, floor, log10

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import as_reals
from kohonen_adapt.mesh.curved import Isoparametric, midside_offsets, offsets_of_sides
from kohonen_adapt.mesh.names import labelled, named_sets

__all__ = [
    "PARTS",
    "by_error",
    "counted",
    "decades_of",
    "divided",
    "divisions_of",
    "field_values",
    "in_unit",
    "lattice",
    "lattice_points",
    "level_of_share",
    "listed_numbers",
    "outlined_facets",
    "plural",
    "significant",
    "straight_and_curved",
    "straight_and_curved_elements",
]

UNITS = {"": 1.0, "m": 1.0, "mm": 1e3}
"""Units of the axes to the factors from metres; "" is for a mesh without a unit."""

PARTS = 8
"""Straight segments that draw a curved side."""

MOST_DIGITS, OF_UNKNOWN_ERROR = 8, 5
"""Most significant digits of a number with an error, and digits of a number of unknown error."""

DECADES, MOST_DECADES = 3, 6
"""Least and largest number of decades of a colour scale below the largest indicator."""


def in_unit(unit: str) -> float:
    if unit not in UNITS:
        raise ValueError(f"unit must be one of {', '.join(map(repr, UNITS))}; got {unit!r}.")
    return UNITS[unit]


def outlined_facets(mesh: MeshTri) -> Ints:
    number, _ = labelled(named_sets(mesh.subdomains), mesh.nelements)
    one, other = mesh.f2t
    return np.flatnonzero((other < 0) | (number[one] != number[other]))


def straight_and_curved(mesh: MeshTri, facets: Ints) -> tuple[Ints, Floats]:
    """Return straight facets, and points on the curved facets, (2, PARTS + 1, n)."""
    off = offsets_of_sides(mesh)[:, facets]
    curved = np.any(off, axis=0)
    a, b = np.moveaxis(mesh.p[:, mesh.facets[:, facets[curved]]], 1, 0)
    return facets[~curved], _on_parabolas(a, b, off[:, curved]).transpose(1, 0, 2)


def straight_and_curved_elements(mesh: MeshTri) -> tuple[Ints, Ints, Floats]:
    # outlines of shape (n, 3 PARTS, 2) of the curved elements
    off = midside_offsets(mesh).T
    curved = np.any(off, axis=(1, 2))
    corners = mesh.p[:, mesh.t[:, curved]].T  # (n, 3, 2)
    points = _on_parabolas(corners, np.roll(corners, -1, axis=1), np.roll(off[curved], 1, axis=1))
    outlines = points[:-1].transpose(1, 2, 0, 3).reshape(-1, 3 * PARTS, 2)
    return np.flatnonzero(~curved), np.flatnonzero(curved), outlines


def _on_parabolas(start: Floats, end: Floats, bow: Floats) -> Floats:
    # points of all parabolas along the first axis
    share = np.linspace(0.0, 1.0, PARTS + 1).reshape(-1, *(1 for _ in start.shape))
    return (1.0 - share) * start + share * end + 4.0 * share * (1.0 - share) * bow


def counted(count: int, what: str) -> str:
    return f"{count} {what if count == 1 else plural(what)}"


def plural(what: str) -> str:
    return {"tetrahedron": "tetrahedra", "patch": "patches", "pass": "passes"}.get(what, f"{what}s")


def significant(value: float, digits: int) -> str:
    """Return a number with so many significant digits, trailing zeros kept.

    Numbers below a million have no exponent, but may have more digits.

    Examples
    --------
    >>> significant(-132.9997, 5), significant(2.0, 3), significant(123.4, 2)
    ('-133.00', '2.00', '123')
    """
    text = f"{value:#.{digits}g}".removesuffix(".")
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e6 else text


def by_error(value: float, error: float | None) -> str:
    # down to the second digit of the error, of 2 to 8 significant digits
    if error is None:
        return significant(value, OF_UNKNOWN_ERROR)
    if not error or not value:
        return significant(value, 2) if error else f"{value:.{MOST_DIGITS}g}"
    digits = floor(log10(abs(value))) - floor(log10(abs(error))) + 2
    return significant(value, min(max(digits, 2), MOST_DIGITS))


def listed_numbers(values: Floats, most: int) -> str:
    # the different values to four digits, or the range of more than `most`
    texts = list(dict.fromkeys(f"{value:.4g}" for value in np.sort(values)))
    return ", ".join(texts) if len(texts) <= most else f"{texts[0]} to {texts[-1]}"


def level_of_share(values: Floats, weights: Floats, share: float) -> float:
    return float(np.quantile(values, share, weights=weights, method="inverted_cdf"))


def decades_of(arrays: Sequence[Floats]) -> tuple[float, float]:
    # limits of a logarithmic scale with the top decade of every array, as far as `MOST_DECADES` reach
    tops = [float(values[np.isfinite(values)].max(initial=0.0)) for values in arrays]
    high, least = max(tops, default=0.0), min((top for top in tops if top > 0.0), default=0.0)
    return min(10.0**-DECADES * high, max(10.0**-MOST_DECADES * high, 0.1 * least)), high


def lattice(divisions: int) -> tuple[Floats, Ints]:
    """Return the points and triangles of a triangle with divided sides.

    Returns
    -------
    ndarray (3, k)
        Barycentric coordinates of the k = (n + 1) (n + 2) / 2 points; of one division the corners in their order.
    ndarray (3, n^2)
        Points of the triangles.
    """
    n, share = divisions, lattice_points(divisions, 2)
    places = [(i, j) for j in range(n + 1) for i in range(n + 1 - j)]
    number = {place: k for k, place in enumerate(places)}
    upright = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in places if i + j < n]
    others = [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in places if i + j < n - 1]
    return share, np.array(upright + others).T


def lattice_points(divisions: int, dim: int) -> Floats:
    """Return the barycentric coordinates of a lattice in an element, (d + 1, k)."""
    every = (place[::-1] for place in product(range(divisions + 1), repeat=dim))
    return np.array([(divisions - sum(place), *place) for place in every if sum(place) <= divisions]).T / divisions


def divisions_of(points: int, dim: int = 2) -> int:
    return next((n for n in range(1, points) if comb(n + dim, dim) == points), 0)


def field_values(name: str, given: ArrayLike, mesh: Mesh, nodal: bool) -> Floats:
    """Return the checked values of a field as floats.

    Shapes are (nnodes,), (nelements,), or on triangles (k, nelements), at the points of a lattice in every element.
    """
    shape = {"nnodes": int(mesh.nvertices)} if nodal else {"nelements": mesh.nelements}
    if np.ndim(given) == len(mesh.p) == 2:
        shape = {"k": len(np.asarray(given)), "nelements": mesh.nelements}
        if not divisions_of(shape["k"]):
            raise ValueError(
                f"{name} must have shape (k, nelements) = (k, {mesh.nelements}) with k = (n + 1) (n + 2) / 2 points of "
                f"a lattice in every element, 3 for the corners; got {np.shape(given)}."
            )
    return as_reals(name, given, shape)


def divided(mesh: MeshTri, divisions: int) -> MeshTri:
    # The new elements are numbered as (divisions^2, nelements), and keep the names of subdomains.
    share, triangles = lattice(divisions)
    count = mesh.nelements
    t = (triangles[:, :, None] * count + np.arange(count)).reshape(3, -1)
    parts = {
        name: (np.arange(divisions**2)[:, None] * count + np.asarray(rows)).ravel()
        for name, rows in named_sets(mesh.subdomains).items()
    }
    return MeshTri(Isoparametric(mesh).points_in_each(share), np.ascontiguousarray(t)).with_subdomains(parts)
