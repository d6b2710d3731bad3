"""Serve every view of a mesh, whatever draws it: units of length, outlined facets, ends of a colour scale."""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.names import codes_of_names, named_sets

__all__ = ["DECADES", "counted", "in_unit", "level_of_share", "outlined_facets"]

UNITS = {"": 1.0, "m": 1.0, "mm": 1e3}
"""Units of the axes, and the factors for metres; "" is for a mesh without a unit."""

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


def counted(count: int, what: str) -> str:
    """A number of things: 1 node, 2 nodes."""
    return f"{count} {what}{'s' * (count != 1)}"


def level_of_share(values: Floats, weights: Floats, share: float) -> float:
    """The value that this share of the weights does not exceed."""
    order = np.argsort(values)
    running = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(running, share * running[-1])])
