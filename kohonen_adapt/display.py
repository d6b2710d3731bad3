"""Serve every view of a mesh, whatever draws it: units of length, outlined facets, ends of a colour scale."""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.curved import displacements, facet_displacements, is_second_order
from kohonen_adapt.mesh.names import codes_of_names, named_sets

__all__ = [
    "DECADES",
    "PARTS",
    "counted",
    "divided",
    "divisions_of",
    "in_unit",
    "lattice",
    "level_of_share",
    "outlined_facets",
    "plural",
    "significant",
    "straight_and_bent",
]

UNITS = {"": 1.0, "m": 1.0, "mm": 1e3}
"""Units of the axes, and the factors for metres; "" is for a mesh without a unit."""

PARTS = 8
"""Pieces of a bent side, and of a side of an element that has one, that are drawn straight."""

DECADES = 3
"""How far below the largest indicator the colours reach."""


def in_unit(unit: str) -> float:
    """The factor by which lengths of a mesh are drawn in a unit; a ValueError if it is unknown."""
    if unit not in UNITS:
        raise ValueError(f"unit must be one of {', '.join(map(repr, UNITS))}; got {unit!r}.")
    return UNITS[unit]


def outlined_facets(mesh: MeshTri) -> Ints:
    """Facets on the rim and between elements of different subdomain names."""
    codes = codes_of_names([(rows, 0) for rows in named_sets(mesh.subdomains).values()], mesh.t.shape[1])
    one, other = mesh.f2t
    return np.flatnonzero((other < 0) | (codes[one] != codes[other]))


def straight_and_bent(mesh: MeshTri, facets: Ints) -> tuple[Ints, Floats]:
    """The straight ones of facets, and points along the bent ones, as many as look round, (2, points, bent facets)."""
    off = facet_displacements(mesh)[:, facets]
    bent = np.any(off, axis=0)
    share = np.linspace(0.0, 1.0, PARTS + 1)[:, None]
    (a, b), bow = np.moveaxis(mesh.p[:, mesh.facets[:, facets[bent]]], 1, 0)[:, :, None], off[:, None, bent]
    return facets[~bent], (1.0 - share) * a + share * b + 4.0 * share * (1.0 - share) * bow


def counted(count: int, what: str) -> str:
    """A number of things: 1 node, 2 nodes."""
    return f"{count} {what if count == 1 else plural(what)}"


def plural(what: str) -> str:
    """Several of them."""
    return {"tetrahedron": "tetrahedra", "patch": "patches"}.get(what, f"{what}s")


def significant(value: float, digits: int) -> str:
    """Return a number with so many significant digits, trailing zeros kept.

    Examples
    --------
    >>> significant(-132.9997, 5), significant(2.0, 3), significant(12345.6, 5)
    ('-133.00', '2.00', '12346')
    """
    return f"{value:#.{digits}g}".removesuffix(".")


def level_of_share(values: Floats, weights: Floats, share: float) -> float:
    """The value that this share of the weights does not exceed."""
    order = np.argsort(values)
    running = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(running, share * running[-1])])


def lattice(divisions: int) -> tuple[Floats, Ints]:
    """The points of a triangle whose sides are divided into so many parts, and the triangles between them.

    Returns
    -------
    ndarray (3, k)
        Barycentric coordinates of the k = (n + 1) (n + 2) / 2 points; of one division the corners in their order.
    ndarray (3, n^2)
        Points of the triangles.
    """
    n = divisions
    places = [(i, j) for j in range(n + 1) for i in range(n + 1 - j)]
    number = {place: k for k, place in enumerate(places)}
    share = np.array([(n - i - j, i, j) for i, j in places], dtype=float).T / n
    upright = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in places if i + j < n]
    others = [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in places if i + j < n - 1]
    return share, np.array(upright + others).T


def divisions_of(points: int) -> int:
    """The divisions of the lattice that has so many points; 0 if none has."""
    n = round((np.sqrt(8.0 * points + 1.0) - 3.0) / 2.0)
    return n if n > 0 and (n + 1) * (n + 2) == 2 * points else 0


def divided(mesh: MeshTri, divisions: int) -> MeshTri:
    """Every element as a lattice with nodes of its own, numbered as (k, nelements); with the names of subdomains."""
    share, triangles = lattice(divisions)
    count = mesh.t.shape[1]
    p = np.einsum("iq,dik->dqk", share, mesh.p[:, mesh.t])
    if is_second_order(mesh):
        between = 4.0 * share[[1, 2, 0]] * share[[2, 0, 1]]
        p += np.einsum("iq,kid->dqk", between, displacements(mesh))
    p = np.ascontiguousarray(p.reshape(2, -1))
    t = (triangles[:, :, None] * count + np.arange(count)).reshape(3, -1)
    parts = {
        name: (np.arange(divisions**2)[:, None] * count + np.asarray(rows)).ravel()
        for name, rows in named_sets(mesh.subdomains).items()
    }
    return MeshTri(p, np.ascontiguousarray(t)).with_subdomains(parts)
