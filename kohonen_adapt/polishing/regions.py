"""Constants and laws of a functional by region of a mesh."""

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats
from kohonen_adapt.polishing.energy_tables import Tables, tabulated
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import EnergyLaw, flux_table

__all__ = [
    "LINEAR",
    "VariesInside",
    "constants_of",
    "first_of_regions",
    "laws_of_regions",
    "numbers_of_regions",
]

LINEAR = 1e-9  # largest deviation of linear Dirichlet values, relative to the range of all values


class VariesInside(ValueError):
    """Error for constants that change inside a region of the mesh."""


def numbers_of_regions(ritz: Ritz, region: NDArray[np.int32]) -> NDArray[np.int64]:
    first = first_of_regions(region)
    number = np.zeros(len(region), dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
    stray = np.flatnonzero(number != number[first][region])
    if len(stray):
        e = int(stray[0])
        raise VariesInside(
            f"region of Ritz must be constant on each region of the mesh; elements {first[region[e]]} and {e} are in "
            f"the same region but have {number[first[region[e]]]} and {number[e]}. Split the region by subdomains of "
            "the mesh, or define a varying flux as a function."
        )
    return number[first]


def first_of_regions(region: NDArray[np.int32]) -> NDArray[np.intp]:
    return np.unique(region, return_index=True)[1]


def constants_of(ritz: Ritz, number: NDArray[np.int64], dim: int = 2) -> Floats:
    flux = np.zeros(dim) if callable(ritz.flux) else flux_table(np.asarray(ritz.flux), dim)
    tables = (ritz.coefficient, 0.0 if callable(ritz.source) else ritz.source, *flux)
    rows = [np.broadcast_to(table, max(1, np.size(table)))[number * (np.ndim(table) > 0)] for table in tables]
    return np.stack(rows, axis=1)


def laws_of_regions(ritz: Ritz, number: NDArray[np.int64], largest: float) -> tuple[NDArray[np.int32], Tables]:
    """Return the table index of every region, -1 without law, and the tables."""
    distinct: list[EnergyLaw] = []
    law = np.full(len(number), -1, dtype=np.int32)
    for place, row in enumerate(number if ritz.laws else ()):
        found = ritz.laws[row]
        if found is not None:
            same = [k for k, other in enumerate(distinct) if other is found]
            law[place] = same[0] if same else len(distinct)
            distinct += [] if same else [found]
    return law, tabulated(distinct, largest if distinct else 0.0)
