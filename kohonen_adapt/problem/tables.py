"""Validation and evaluation of the data of a Ritz functional."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Int64s, Ints, Mask
from kohonen_adapt.checks import finite_values
from kohonen_adapt.mesh.elements.functions import ON_AXIS, kinds_at_axis

__all__ = [
    "EnergyLaw",
    "check_axis",
    "checked_constants",
    "checked_floats",
    "checked_flux",
    "checked_laws",
    "checked_regions",
    "checked_signs",
    "constants_at",
    "flux_at",
    "flux_table",
    "numbers_of",
    "source_at",
]

Varying = Callable[[Floats, Ints], ArrayLike]  # of x (d, n) and region numbers (n,)

AXIS_TOLERANCE = 1e-12  # of the largest x: rounding error of a node on the axis


class EnergyLaw(Protocol):
    def field_strength(self, b: Floats) -> Floats:
        """Return the field strength H(b), increasing from 0."""

    def energy(self, b: Floats) -> Floats:
        """Return the energy density ``int_0^b H db``."""


def checked_floats(name: str, given: ArrayLike) -> Floats:
    array = np.array(given)
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} of Ritz must be real numbers; got {array.dtype}.")
    array = array.astype(np.float64)
    bad = np.count_nonzero(~np.isfinite(array))
    if bad:
        raise ValueError(f"{name} of Ritz must be finite; {bad} of {array.size} are not.")
    return array


def checked_regions(given: ArrayLike) -> Int64s:
    number = np.array(given)
    if number.ndim != 1 or number.dtype.kind not in "iu":
        raise ValueError(
            f"region of Ritz must be integers of shape (nelements,); got {number.dtype} of shape {number.shape}."
        )
    if number.min(initial=0) < 0:
        raise ValueError(f"region of Ritz must hold numbers >= 0; got {number.min()}.")
    return number.astype(np.int64)


def checked_constants(name: str, given: ArrayLike, shape: tuple[int, ...], region: Int64s | None) -> Floats:
    """Return `given` with `shape`, or with (*shape, regions) if `region` is given."""
    table = checked_floats(name, given)
    if table.shape == shape:
        return table
    expected = f"{shape} or {(*shape, 'nregions')}".replace("'", "")
    if table.ndim != len(shape) + 1 or table.shape[:-1] != shape:
        raise ValueError(f"{name} of Ritz must have shape {expected}; got {table.shape}.")
    if region is None:
        raise ValueError(
            f"{name} of Ritz is a table of {table.shape[-1]} values and requires region, the number of every element."
        )
    if region.max(initial=-1) >= table.shape[-1]:
        raise ValueError(
            f"{name} of Ritz must have a value for every region number from 0 to {region.max()}; got "
            f"{table.shape[-1]} values."
        )
    if table.shape[-1] == region.size > region.max(initial=-1) + 1:
        raise ValueError(
            f"{name} of Ritz must have one value per region number, {region.max() + 1}; got {region.size}, the "
            "number of elements."
        )
    return table


def checked_flux(given: ArrayLike, region: Int64s | None, name: str = "flux") -> Floats:
    table = checked_floats(name, given)
    if table.ndim == 0 and table == 0.0:
        return table
    if table.shape[:1] in ((2,), (3,)):
        return checked_constants(name, table, table.shape[:1], region)
    raise ValueError(
        f"{name} of Ritz must have shape (2,) or (2, nregions), on tetrahedra (3,) or (3, nregions); got {table.shape}."
    )


def flux_table(flux: Floats, dim: int) -> Floats:
    if flux.ndim and len(flux) != dim:
        raise ValueError(f"flux of Ritz must have {dim} components on a mesh of {dim} dimensions; got {len(flux)}.")
    return flux if flux.ndim else np.zeros(dim)


def checked_laws(given: Sequence[EnergyLaw | None], region: Int64s | None) -> tuple[EnergyLaw | None, ...]:
    if not isinstance(given, list | tuple):
        raise ValueError(f"laws of Ritz must be a sequence with None or a law per region number; got {given!r}.")
    needed = 1 if region is None else int(region.max(initial=-1)) + 1
    if given and len(given) < needed:
        raise ValueError(f"laws of Ritz must have None or a law for each of {needed} region numbers; got {len(given)}.")
    for number, law in enumerate(given):
        missing = [name for name in ("field_strength", "energy") if not callable(getattr(law, name, None))]
        if law is not None and missing:
            raise ValueError(
                f"laws[{number}] of Ritz must be None or have the methods field_strength(b) and energy(b); got {law!r}."
            )
    return tuple(given)


def checked_signs(given: Mapping[tuple[str, str], int]) -> dict[tuple[str, str], int]:
    expected = "signs of Ritz must map pairs of names of boundaries to 1 or -1"
    if not isinstance(given, Mapping):
        raise ValueError(f"{expected}; got {given!r}.")
    for names, sign in given.items():
        if not (isinstance(names, tuple) and len(names) == 2 and isinstance(sign, int | float) and sign in (1, -1)):
            raise ValueError(f"{expected}; got {names!r}: {sign!r}.")
    return dict(given)


def check_axis(values: Floats, fixed: Mask, mesh: MeshTri) -> None:
    x = mesh.p[0]
    if x.min() < -AXIS_TOLERANCE * x.max():
        raise ValueError(f"an axisymmetric Ritz needs a mesh at x >= 0; got nodes down to x = {x.min():g}.")
    on_axis = np.unique(mesh.t[ON_AXIS[kinds_at_axis(x[mesh.t].T)].T])
    unfixed = on_axis[~fixed[on_axis] | (values[on_axis] != 0.0)]
    if unfixed.size:
        raise ValueError(
            f"values of an axisymmetric Ritz must be fixed to 0 on the axis x = 0; {unfixed.size} of {on_axis.size} "
            f"nodes there are not, first node {unfixed[0]}."
        )


def numbers_of(ritz: Any, mesh: Mesh) -> Ints:  # region numbers of elements
    return np.zeros(mesh.nelements, np.int64) if ritz.region is None else np.asarray(ritz.region)


def constants_at(table: Any, region: Ints | int, *shape: int) -> Floats:
    """Return constants of a shape at points of regions (n,), (*shape, n).

    The table has one column per region, or one value for all.
    """
    array, points = np.asarray(table, float), np.shape(region)
    found = array[..., region] if array.ndim > len(shape) else array[(..., *(None for _ in points))]
    return np.broadcast_to(found, (*shape, *points))


def flux_at(x: Floats, region: Ints, function: Varying, name: str = "flux", rank: int = 2) -> Floats:
    """Return varying data at points (d, k, m) of elements.

    The values have shape (d, k, m), or shape (k, m) if `rank` is 1.
    """
    flat, regions = x.reshape(len(x), -1), np.tile(region, x.shape[1])
    values = finite_values(f"{name} of Ritz", lambda at: function(at, regions), flat, flat.shape[-rank:])
    return values.reshape(x.shape[-rank - 1 :])


source_at = partial(flux_at, name="source", rank=1)
