"""A linear magnetic material: permeability, remanence and current density."""

from dataclasses import dataclass
from math import isfinite, pi
from typing import Any

import numpy as np

__all__ = ["VACUUM_PERMEABILITY", "Material"]

VACUUM_PERMEABILITY = 4e-7 * pi  # H/m


@dataclass(frozen=True)
class Material:
    """What fills a subdomain: ``H = nu (B - Br)`` with the reluctivity ``nu = 1 / (mu0 permeability)``.

    Parameters
    ----------
    permeability
        Relative to vacuum, > 0. Of a magnet: the recoil permeability.
    remanence
        Remanent flux density Br (x, y) in T.
    current_density
        In A/m^2, positive out of the page.

    Raises
    ------
    ValueError
        For a permeability that is not positive, a remanence without two components, and anything not finite.
    """

    permeability: float = 1.0
    remanence: tuple[float, float] = (0.0, 0.0)
    current_density: float = 0.0

    def __post_init__(self) -> None:
        # Plain floats, so that materials compare and hash by value whatever kind of number they were given.
        object.__setattr__(self, "permeability", _number("permeability", self.permeability))
        object.__setattr__(self, "current_density", _number("current_density", self.current_density))
        object.__setattr__(self, "remanence", _pair("remanence", self.remanence))
        if self.permeability <= 0.0:
            raise ValueError(f"permeability must be positive (relative to vacuum, air 1.0); got {self.permeability}.")

    @property
    def reluctivity(self) -> float:
        """``1 / (mu0 permeability)`` in m/H."""
        return 1.0 / (VACUUM_PERMEABILITY * self.permeability)


def _number(name: str, given: Any) -> float:
    try:
        number = float(given)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a number; got {given!r}.") from None
    if not isfinite(number):
        raise ValueError(f"{name} must be finite; got {number}.")
    return number


def _pair(name: str, given: Any) -> tuple[float, float]:
    if np.shape(given) != (2,):
        raise ValueError(f"{name} must have two components (x, y); got {given!r}.")
    x, y = given
    return _number(name, x), _number(name, y)
