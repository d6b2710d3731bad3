"""Magnetic materials, and magnetisations that vary within a region."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from kohonen_adapt.arrays import DataFunction, Floats, Function
from kohonen_adapt.magnetostatics.materials.bh_table import Table
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY, Law

__all__ = ["Material", "Vector", "check_materials", "halbach", "radial"]

Vector = tuple[float, ...] | DataFunction


@dataclass(frozen=True)
class Material:
    """Material of a subdomain, with ``H = nu(|B|) B - Hc``.

    nu is ``1 / (mu0 permeability)`` or follows from a B-H law. A magnet has a remanence Br or a coercivity Hc, each of
    which determines the other: ``Hc = nu(|Br|) Br``.

    Parameters
    ----------
    permeability
        Relative to vacuum, > 0. Of a magnet: the recoil permeability.
    remanence
        Remanent flux density Br (x, y) in T, in space (x, y, z), or a callable of x, shape (d, n) in metres, that
        returns shape (d, n) and is smooth in each region of the mesh. Elements have its mean, from d + 1 points inside.
        See `radial` and `halbach`.
    current_density
        In A/m^2, positive out of the page (axisymmetric: along phi). Not in space.
    bh
        Magnetisation curve in place of the permeability: shape (n, 2) with columns B in T and H in A/m (see `Table`),
        or a law (`Brauer`, `Froehlich`, `Arctan`, or an object with the methods of `Law`).
    coercivity
        Hc (x, y) or (x, y, z) in A/m in place of the remanence, or a callable as for the remanence.

    Raises
    ------
    ValueError
        For a permeability that is not positive, a vector that has not two or three components, and values that are not
        finite; for both a curve and a permeability, or both a coercivity and a remanence; for curves that `Table`
        rejects.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import Brauer, Material
    >>> air, coil, iron = Material(), Material(current_density=2e6), Material(permeability=1000.0)
    >>> magnet = Material(permeability=1.05, remanence=(0.0, 1.2))
    >>> steel = Material(bh=Brauer(k1=50.0, k2=10.0, k3=1.5))
    >>> sheet = Material(bh=[[1.0, 100.0], [1.5, 700.0], [1.8, 8000.0], [2.1, 60000.0]])  # B in T, H in A/m
    """

    permeability: float = 1.0
    remanence: Vector = (0.0, 0.0)
    current_density: float = 0.0
    bh: Law | None = None
    coercivity: Vector | None = None

    def __post_init__(self) -> None:
        # Plain floats, so that materials compare and hash by value for any type of number.
        own = vars(self)
        own.update({name: _number(name, own[name]) for name in ("permeability", "current_density")})
        own["remanence"] = _vector("remanence", self.remanence)
        if self.permeability <= 0.0:
            raise ValueError(f"permeability must be positive (relative to vacuum, air 1.0); got {self.permeability}.")
        if self.bh is not None:
            if isinstance(self.bh, type):
                raise ValueError(f"bh must be a law with its parameters, or points; got the class {self.bh.__name__}.")
            own["bh"] = self.bh if isinstance(self.bh, Law) else Table(self.bh)
            if self.permeability != 1.0:
                raise ValueError(
                    f"a material has a bh curve or a permeability; got both, permeability {self.permeability:g}."
                )
        if self.coercivity is not None:
            own["coercivity"] = _vector("coercivity", self.coercivity)
            if self.remanence != (0.0, 0.0):
                raise ValueError("a magnet has a remanence or a coercivity, each of which gives the other; got both.")

    @property
    def turns(self) -> bool:
        """True if remanence or coercivity is a callable, without one value per region."""
        return callable(self.remanence) or callable(self.coercivity)

    @property
    def reluctivity(self) -> float:
        """``1 / (mu0 permeability)`` in m/H, or dH/dB at B = 0 of a B-H law."""
        if self.bh is not None:
            return float(self.bh.slope(np.zeros(1))[0])
        return 1.0 / (VACUUM_PERMEABILITY * self.permeability)


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a number; got {value!r}.") from None
    if not isfinite(number):
        raise ValueError(f"{name} must be finite; got {number}.")
    return number


def _vector(name: str, value: Any) -> Vector:
    if callable(value):
        return value
    if np.shape(value) not in {(2,), (3,)}:
        raise ValueError(f"{name} must have two components (x, y); got {value!r}. In space it has three.")
    vector = tuple(_number(name, part) for part in value)
    return vector if any(vector) else (0.0, 0.0)


def check_materials(materials: Any, dimension: int) -> None:
    if not isinstance(materials, Mapping):
        raise ValueError(f"materials must map subdomain names to Materials; got {materials!r}.")
    expected = {2: "two components (x, y) in the plane", 3: "three components (x, y, z) in space"}[dimension]
    for name, material in materials.items():
        if not isinstance(material, Material):
            raise ValueError(f"materials[{name!r}] must be a Material; got {material!r}.")
        for kind in ("remanence", "coercivity"):
            value = getattr(material, kind)
            if value is not None and not callable(value) and any(value) and len(value) != dimension:
                raise ValueError(f"{kind} of {name!r} must have {expected}; got {value!r}.")


def radial(magnitude: float, *, centre: tuple[float, float] = (0.0, 0.0)) -> Function:
    """Return a radial vector field, for the remanence or coercivity of a `Material`.

    Parameters
    ----------
    magnitude
        In T or A/m; negative towards the centre.
    centre
        In metres.

    Returns
    -------
    callable
        Function of x, shape (2, n) in metres, that returns shape (2, n).

    Examples
    --------
    >>> import numpy as np
    >>> from kohonen_adapt.magnetostatics import Material, radial
    >>> magnet = Material(permeability=1.05, remanence=radial(1.2))
    >>> radial(1.2)(np.array([[0.0], [0.5]])).round(9).tolist()
    [[0.0], [1.2]]
    """
    return halbach(magnitude, 0, centre=centre)


def halbach(magnitude: float, pole_pairs: int, *, centre: tuple[float, float] = (0.0, 0.0)) -> Function:
    """Return a Halbach field, for the remanence or coercivity of a `Material`.

    The direction at the polar angle phi is ``(1 + pole_pairs) phi`` (Halbach, Nucl. Instrum. Methods 169, 1980). A ring
    has its field outside for negative `pole_pairs` and inside for positive ones; 1 gives a uniform field.

    Parameters
    ----------
    magnitude, centre
        As in `radial`.
    pole_pairs
        Number of pole pairs, with its sign; 0 gives `radial`.

    Returns
    -------
    callable
        As in `radial`.

    Examples
    --------
    >>> import numpy as np
    >>> from kohonen_adapt.magnetostatics import Material, halbach
    >>> ring = Material(permeability=1.05, remanence=halbach(1.2, 2))
    >>> halbach(1.2, 2)(np.array([[0.5], [0.0]])).round(9).tolist()
    [[1.2], [0.0]]
    """

    def direction(x: Floats) -> Floats:
        angle = (1 + pole_pairs) * np.arctan2(x[1] - centre[1], x[0] - centre[0])
        return magnitude * np.stack((np.cos(angle), np.sin(angle)))

    return direction
