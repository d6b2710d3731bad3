"""Energies of nonlinear laws as tables for kernels, by region."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Int32s, Int64s
from kohonen_adapt.kernels.functionals import STEPS
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import EnergyLaw, flux_table

__all__ = [
    "LINEAR",
    "Tables",
    "VariesInside",
    "constants_of",
    "first_of_regions",
    "laws_of_regions",
    "numbers_of_regions",
    "tabulated",
]

# Octaves of the squared gradient in a table, below and above the largest of the solution. The extrapolation above,
# from 16 times the largest gradient, uses the last secant, and below, where the energy is negligible, a parabola.
BELOW, ABOVE = 28, 8
CHECKED = 20  # octaves below the largest in which laws are checked
ROUNDING = 1e-9  # largest relative decrease of the field strength in a step
ROUGH = 0.01  # largest deviation of energies from the integral of the field strength, relative to the largest energy


class Tables(NamedTuple):
    """Energies over the square s of the gradient.

    Each octave of s has `STEPS` equal steps. Between steps a cubic interpolates the energies and their
    derivatives, with a relative error below 1e-8 at the sharpest bends and below 1e-10 on average.
    """

    first: int  # the smallest s is 2^(first - 1)
    energy: Floats  # (nlaws, rows, 2): W and dW/ds


def tabulated(laws: Sequence[EnergyLaw], largest: float) -> Tables:
    """Return the tables of laws for a largest gradient of the solution.

    Raises
    ------
    ValueError
        If a law returns another shape or values that are not finite, if its field strength decreases, or if its
        energy is not the integral of its field strength.
    """
    top = int(np.frexp(largest**2)[1])
    if not laws:
        return Tables(top - BELOW, np.zeros((0, 1, 2)))
    octave = np.ldexp(0.5, top - BELOW + np.arange(BELOW + ABOVE))
    steps = np.outer(octave, 1.0 + np.arange(STEPS) / STEPS).ravel()
    b = np.sqrt(np.append(steps, 2.0 * octave[-1]))
    return Tables(top - BELOW, np.stack([_table(law, b) for law in laws]))


def _table(law: EnergyLaw, b: Floats) -> Floats:
    with np.errstate(over="ignore", invalid="ignore"):  # laws may overflow far above the solution
        strength, energy = (np.asarray(values, float) for values in (law.field_strength(b), law.energy(b)))
        if not strength.shape == energy.shape == b.shape:
            raise ValueError(
                f"laws of Ritz must return arrays of the shape of b, {b.shape}; {law!r} returned {strength.shape} as "
                f"field strength and {energy.shape} as energy."
            )
        table = np.stack([energy, 0.5 * strength / b], axis=1)
    checked = slice((BELOW - CHECKED) * STEPS, (BELOW + 1) * STEPS + 1)
    _check(law, b[checked], strength[checked], energy[checked])
    return table


def _check(law: EnergyLaw, b: Floats, strength: Floats, energy: Floats) -> None:
    if not (np.all(np.isfinite(strength)) and np.all(np.isfinite(energy))):
        raise ValueError(f"laws of Ritz must be finite up to b = {b[-1]:g}; {law!r} is not.")
    integral = np.cumsum(0.5 * (strength[:-1] + strength[1:]) * np.diff(b))
    astray = np.abs(energy[1:] - energy[0] - integral) > ROUGH * energy[-1]
    bad = astray | (np.diff(strength) < -ROUNDING * strength[1:]) | (strength[:-1] <= 0.0)
    if np.any(bad):
        raise ValueError(
            f"laws of Ritz must have a field strength that increases with b, and an energy that is the integral of the "
            f"field strength; {law!r} violates this near b = {b[np.argmax(bad)]:g}."
        )


LINEAR = 1e-9  # largest deviation of linear Dirichlet values, relative to the range of all values


class VariesInside(ValueError):
    pass


def numbers_of_regions(ritz: Ritz, region: Int32s) -> Int64s:
    first = first_of_regions(region)
    number = np.zeros(len(region), np.int64) if ritz.region is None else np.asarray(ritz.region)
    stray = np.flatnonzero(number != number[first][region])
    if len(stray):
        e = int(stray[0])
        raise VariesInside(
            f"region of Ritz must be constant on each region of the mesh; elements {first[region[e]]} and {e} are in "
            f"the same region but have {number[first[region[e]]]} and {number[e]}. Split the region by subdomains of "
            "the mesh, or define a varying flux as a function."
        )
    return number[first]


def first_of_regions(region: Int32s) -> NDArray[np.intp]:
    return np.unique(region, return_index=True)[1]


def constants_of(ritz: Ritz, number: Int64s, dim: int = 2) -> Floats:
    flux = np.zeros(dim) if callable(ritz.flux) else flux_table(np.asarray(ritz.flux), dim)
    tables = (ritz.coefficient, 0.0 if callable(ritz.source) else ritz.source, *flux)
    rows = [np.broadcast_to(table, max(1, np.size(table)))[number * (np.ndim(table) > 0)] for table in tables]
    return np.stack(rows, axis=1)


def laws_of_regions(ritz: Ritz, number: Int64s, largest: float) -> tuple[Int32s, Tables]:
    """Return the table index of every region, -1 without law, and the tables."""
    distinct: list[EnergyLaw] = []
    law = np.full(len(number), -1, np.int32)
    for place, row in enumerate(number if ritz.laws else ()):
        found = ritz.laws[row]
        if found is not None:
            same = [k for k, other in enumerate(distinct) if other is found]
            law[place] = same[0] if same else len(distinct)
            distinct += [] if same else [found]
    return law, tabulated(distinct, largest if distinct else 0.0)
