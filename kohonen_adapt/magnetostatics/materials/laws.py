"""Isotropic B-H laws, extrapolated to any B."""

from dataclasses import dataclass
from math import pi
from typing import Any, Protocol, runtime_checkable

import numpy as np
import scipy  # loads `scipy.optimize` at its first use

from kohonen_adapt.arrays import Floats, FloatsPair, Function
from kohonen_adapt.checks import is_number

__all__ = [
    "VACUUM_PERMEABILITY",
    "Arctan",
    "Brauer",
    "Continued",
    "Froehlich",
    "Inverse",
    "Law",
    "Scaled",
    "flux_density_of",
    "reluctivities",
]

VACUUM_PERMEABILITY = 4e-7 * pi  # H/m
VACUUM_RELUCTIVITY = 1.0 / VACUUM_PERMEABILITY  # m/H

EPSILON = float(np.finfo(float).eps)
STEPS = 3  # of Newton's method for all values, after which most have converged
BISECTIONS = 100  # of values that have not converged
PIECES = 512  # of the table of a law from which its inversion starts


@runtime_checkable
class Law(Protocol):
    """B-H law for arrays of B >= 0 in T.

    H must rise with B, from 0 at B = 0.
    """

    def field_strength(self, b: Floats) -> Floats:
        """Return H(B) in A/m."""

    def slope(self, b: Floats) -> Floats:
        """Return dH/dB in m/H, > 0."""

    def energy(self, b: Floats) -> Floats:
        """Return ``int_0^B H dB`` in J/m^3."""


class Continued(Law):
    """B-H law that is extrapolated with dB/dH = mu0.

    Attributes
    ----------
    end
        The flux density in T from which dB/dH = mu0: the slope falls below mu0 there, or the law ends.
    """

    end: float
    # H, dH/dB and int H dB of B up to the end
    _strength: Function
    _slope: Function
    _energy: Function

    def field_strength(self, b: Floats) -> Floats:
        inside = np.minimum(b, self.end)
        return self._strength(inside) + VACUUM_RELUCTIVITY * (b - inside)

    def slope(self, b: Floats) -> Floats:
        return np.where(np.less(b, self.end), self._slope(np.minimum(b, self.end)), VACUUM_RELUCTIVITY)

    def energy(self, b: Floats) -> Floats:
        inside = np.minimum(b, self.end)
        excess = b - inside
        return self._energy(inside) + excess * (self._strength(inside) + 0.5 * VACUUM_RELUCTIVITY * excess)


@dataclass(frozen=True)
class Brauer(Continued):
    """``H = (k1 + k2 exp(k3 B^2)) B`` (Brauer, IEEE Trans. Magn. 11, 1975).

    Parameters
    ----------
    k1, k2
        In m/H, k1 >= 0 and k2 > 0. Their sum is the reluctivity at B = 0.
    k3
        In 1/T^2, > 0.

    Raises
    ------
    ValueError
        For numbers outside these ranges, and if the permeability at B = 0 is not above the permeability of vacuum.

    Examples
    --------
    >>> import numpy as np
    >>> from kohonen_adapt.magnetostatics import Brauer
    >>> law = Brauer(k1=50.0, k2=10.0, k3=1.5)
    >>> law.field_strength(np.array([0.0, 1.0, 2.0])).round().tolist()  # at 0, 1 and 2 T, in A/m
    [0.0, 95.0, 8169.0]
    """

    k1: float
    k2: float
    k3: float

    def __post_init__(self) -> None:
        _check_above(0.0, "k2 of Brauer", self.k2)
        _check_above(0.0, "k3 of Brauer", self.k3)
        _check_above(0.0, "k1 of Brauer", self.k1, or_equal=True)
        if self.k1 + self.k2 >= VACUUM_RELUCTIVITY:
            raise ValueError(
                f"k1 + k2 of Brauer, the reluctivity at B = 0, must be below that of vacuum, {VACUUM_RELUCTIVITY:.6g} "
                f"m/H; got {self.k1 + self.k2:g}. Are they in other units?"
            )
        bound = np.sqrt(np.log(VACUUM_RELUCTIVITY / self.k2) / self.k3)
        end = scipy.optimize.brentq(lambda b: float(self._slope(b)) - VACUUM_RELUCTIVITY, 0.0, bound)
        vars(self)["end"] = end

    def _strength(self, b: Floats) -> Floats:
        return (self.k1 + self.k2 * np.exp(self.k3 * b**2)) * b

    def _slope(self, b: Floats) -> Floats:
        return self.k1 + self.k2 * np.exp(self.k3 * b**2) * (1.0 + 2.0 * self.k3 * b**2)

    def _energy(self, b: Floats) -> Floats:
        return 0.5 * self.k1 * b**2 + 0.5 * self.k2 / self.k3 * np.expm1(self.k3 * b**2)


@dataclass(frozen=True)
class Froehlich(Continued):
    """Law ``B = mu H / (1 + mu H / Bs)`` (Froehlich, 1881).

    ``mu = mu0 permeability`` is the permeability at B = 0. From where dB/dH would fall below mu0, dB/dH = mu0.

    Parameters
    ----------
    permeability
        Relative to vacuum, at B = 0; > 1.
    saturation
        Bs in T, > 0, the limit of B without the extrapolation.

    Raises
    ------
    ValueError
        For numbers outside these ranges.

    Examples
    --------
    >>> import numpy as np
    >>> from kohonen_adapt.magnetostatics import Froehlich
    >>> law = Froehlich(permeability=2000.0, saturation=2.0)
    >>> law.field_strength(np.array([0.0, 1.0, 2.0])).round().tolist()  # at 0, 1 and 2 T, in A/m
    [0.0, 796.0, 70380.0]
    """

    permeability: float
    saturation: float

    def __post_init__(self) -> None:
        _check_above(1.0, "permeability of Froehlich, relative and at B = 0,", self.permeability)
        _check_above(0.0, "saturation of Froehlich", self.saturation)
        vars(self)["end"] = self.saturation * (1.0 - self.permeability**-0.5)

    def _strength(self, b: Floats) -> Floats:
        return VACUUM_RELUCTIVITY / self.permeability * b / (1.0 - b / self.saturation)

    def _slope(self, b: Floats) -> Floats:
        return VACUUM_RELUCTIVITY / self.permeability / (1.0 - b / self.saturation) ** 2

    def _energy(self, b: Floats) -> Floats:
        fraction = b / self.saturation
        # For small B the difference would be rounding error.
        series = fraction**2 * np.polyval(1.0 / np.arange(9.0, 1.0, -1.0), fraction)
        normalised = np.where(fraction < 0.01, series, -np.log1p(-fraction) - fraction)
        return VACUUM_RELUCTIVITY / self.permeability * self.saturation**2 * normalised


@dataclass(frozen=True)
class Arctan(Law):
    """Law ``B = mu0 H + 2 Js / pi arctan(pi (permeability - 1) mu0 H / (2 Js))``.

    dB/dH is always above mu0.

    Parameters
    ----------
    permeability
        Relative to vacuum, at B = 0; > 1.
    saturation
        Js in T, > 0, the limit of the polarisation.

    Raises
    ------
    ValueError
        For numbers outside these ranges.

    Examples
    --------
    >>> import numpy as np
    >>> from kohonen_adapt.magnetostatics import Arctan
    >>> law = Arctan(permeability=2000.0, saturation=2.0)
    >>> law.field_strength(np.array([0.0, 1.0, 2.0])).round().tolist()  # at 0, 1 and 2 T, in A/m
    [0.0, 506.0, 22660.0]
    """

    permeability: float
    saturation: float

    def __post_init__(self) -> None:
        _check_above(1.0, "permeability of Arctan, relative and at B = 0,", self.permeability)
        _check_above(0.0, "saturation of Arctan", self.saturation)

    def field_strength(self, b: Floats) -> Floats:
        # B(H) is concave, so Newton's method rises from a value below the root and does not pass the root.
        b = np.asarray(b, float)
        below = np.maximum(b / self.permeability, b - self.saturation)
        strength = VACUUM_RELUCTIVITY * np.maximum(below, 0.0)
        for _ in range(100):
            step = (b - self._flux_density(strength)) / self._rate(strength)
            strength = strength + step
            if np.all(np.abs(step) <= 1e-13 * strength):
                break
        return strength

    def slope(self, b: Floats) -> Floats:
        return 1.0 / self._rate(self.field_strength(b))

    def energy(self, b: Floats) -> Floats:
        strength = self.field_strength(b)
        scaled = strength * self._steepness
        integral = strength * np.arctan(scaled) - 0.5 * np.log1p(scaled**2) / self._steepness
        return strength * b - 0.5 * VACUUM_PERMEABILITY * strength**2 - 2.0 * self.saturation / pi * integral

    @property
    def _steepness(self) -> float:
        return pi * (self.permeability - 1.0) * VACUUM_PERMEABILITY / (2.0 * self.saturation)

    def _flux_density(self, h: Floats) -> Floats:
        return VACUUM_PERMEABILITY * h + 2.0 * self.saturation / pi * np.arctan(self._steepness * h)

    def _rate(self, h: Floats) -> Floats:
        return VACUUM_PERMEABILITY * (1.0 + (self.permeability - 1.0) / (1.0 + (self._steepness * h) ** 2))


def reluctivities(law: Law, b: Floats) -> FloatsPair:
    """Return the secant H / B and the differential dH/dB in m/H, equal at B = 0."""
    slope = np.asarray(law.slope(b), float)
    small = b < 1e-9  # T: the quotient would be rounding error
    return np.where(small, slope, law.field_strength(b) / np.where(small, 1.0, b)), slope


@dataclass(frozen=True)
class Scaled:
    """B-H law times a factor, as the angle around an axis."""

    law: Law
    factor: float

    def field_strength(self, b: Floats) -> Floats:
        return self.factor * self.law.field_strength(b)

    def energy(self, b: Floats) -> Floats:
        return self.factor * self.law.energy(b)

    def secants(self, b: Floats) -> FloatsPair:
        secant, differential = reluctivities(self.law, b)
        return self.factor * secant, self.factor * differential


@dataclass(frozen=True)
class Inverse:
    """Inverse B(H) of a B-H law, as an `EnergyLaw` of a scalar potential."""

    law: Law

    def field_strength(self, h: Floats) -> Floats:
        return flux_density_of(self.law, h)

    def energy(self, h: Floats) -> Floats:
        # the co-energy int_0^H B dH
        b = flux_density_of(self.law, h)
        return h * b - self.law.energy(b)

    def secants(self, h: Floats) -> FloatsPair:
        # the permeabilities B / H and dB/dH
        secant, differential = reluctivities(self.law, flux_density_of(self.law, h))
        return 1.0 / secant, 1.0 / differential


def flux_density_of(law: Law, h: Floats) -> Floats:
    """Return B >= 0 in T of a law at field strengths H >= 0 in A/m.

    Newton's method from a table of the law, and bisections of what has not converged after few steps.
    """
    if isinstance(law, Arctan):  # defined by its inverse
        return law._flux_density(h)
    target, top = np.ravel(np.asarray(h, float)), 1.0
    while float(law.field_strength(np.array([top]))[0]) < target.max(initial=0.0):
        top *= 2.0
    grid = top * np.arange(PIECES + 1) / PIECES
    strength = np.asarray(law.field_strength(grid))
    piece = np.clip(np.searchsorted(strength, target, side="right") - 1, 0, PIECES - 1)
    low, high, lowest = grid[piece], grid[piece + 1], strength[piece]
    found = low + (target - lowest) * ((high - low) / (strength[piece + 1] - lowest))
    for _ in range(STEPS):
        found = np.clip(found - (law.field_strength(found) - target) / law.slope(found), low, high)
    far = np.abs(law.field_strength(found) - target) > 2.0 * EPSILON * (found * law.slope(found) + target)
    rows, (low, high) = np.flatnonzero(far), np.stack([low, high])[:, far]
    for _ in range(BISECTIONS if rows.size else 0):
        found[rows] = middle = 0.5 * (low + high)
        below = law.field_strength(middle) < target[rows]
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return found.reshape(np.shape(h))


def _check_above(bound: float, label: str, value: Any, or_equal: bool = False) -> None:
    if not (is_number(value) and bound <= value < np.inf) or (value == bound and not or_equal):
        raise ValueError(f"{label} must be a finite number {'>=' if or_equal else '>'} {bound:g}; got {value!r}.")
