"""The Ritz functional of a problem as its user states it, with the solution that belongs to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import MeshTri

__all__ = ["Ritz", "check_fits", "functional_value"]


@dataclass(frozen=True, eq=False)
class Ritz:
    """The functional that the exact solution minimises, and a P1 solution of it.

    ``Pi(u) = int coefficient / 2 |grad u|^2 - source u - flux . grad u``, of which
    ``-div(coefficient grad u - flux) = source`` is the Euler equation; where no value is fixed the natural boundary
    condition holds. What a problem's ``ritz(mesh, solution)`` returns.

    Parameters
    ----------
    values
        (nnodes,): nodal values of the solution.
    fixed
        (nnodes,) bool: the nodes whose values are given (Dirichlet).
    coefficient
        > 0: a constant, or one value per region number, (nregions,).
    source
        A constant, or one value per region number, (nregions,).
    flux
        A constant (2,), or one per region number, (2, nregions); of a magnet ``nu (-Br_y, Br_x)``.
    region
        (nelements,) of integers >= 0: the number that each element looks its constants up by. None where there are no
        tables to look up. The constants must not change inside a region of the mesh, a connected set of elements that
        carry the same subdomain names.

    Raises
    ------
    ValueError
        If a shape does not fit, something is not finite, the coefficient is not positive, or a region number has no
        entry in a table.
    """

    values: ArrayLike
    fixed: ArrayLike
    coefficient: ArrayLike
    source: ArrayLike = 0.0
    flux: ArrayLike = (0.0, 0.0)
    region: ArrayLike | None = None

    def __post_init__(self) -> None:
        region = None if self.region is None else _numbers(self.region)
        values, fixed = _floats("values", self.values), np.array(self.fixed)
        if values.ndim != 1:
            raise ValueError(f"values of Ritz must have shape (nnodes,); got {values.shape}.")
        if fixed.dtype != np.bool_ or fixed.shape != values.shape:
            raise ValueError(
                f"fixed of Ritz must be bool of shape (nnodes,) = {values.shape}; got {fixed.dtype} of shape "
                f"{fixed.shape}. From node numbers: numpy.isin(numpy.arange(nnodes), numbers)."
            )
        coefficient = _constants("coefficient", self.coefficient, (), region)
        if not np.all(coefficient > 0.0):
            raise ValueError(f"coefficient of Ritz must be > 0; got {coefficient.min()}.")
        source, flux = _constants("source", self.source, (), region), _constants("flux", self.flux, (2,), region)
        # Copies: what the caller does to his arrays later must not change a functional in use.
        names = ("values", "fixed", "coefficient", "source", "flux", "region")
        for name, own in zip(names, (values, fixed, coefficient, source, flux, region), strict=True):
            object.__setattr__(self, name, own)


def _floats(name: str, given: ArrayLike) -> NDArray[np.float64]:
    array = np.array(given)
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} of Ritz must be real numbers; got {array.dtype}.")
    array = array.astype(np.float64)
    bad = np.count_nonzero(~np.isfinite(array))
    if bad:
        raise ValueError(f"{name} of Ritz must be finite; {bad} of {array.size} are not.")
    return array


def _numbers(given: ArrayLike) -> NDArray[np.int64]:
    number = np.array(given)
    if number.ndim != 1 or number.dtype.kind not in "iu":
        raise ValueError(
            f"region of Ritz must be integers of shape (nelements,); got {number.dtype} of shape {number.shape}."
        )
    if number.min(initial=0) < 0:
        raise ValueError(f"region of Ritz must hold numbers >= 0; got {number.min()}.")
    return number.astype(np.int64)


def _constants(
    name: str, given: ArrayLike, shape: tuple[int, ...], region: NDArray[np.int64] | None
) -> NDArray[np.float64]:
    """A constant of this shape, or a table with one per region number in its last axis."""
    table = _floats(name, given)
    if table.shape == shape:
        return table
    expected = f"{shape} or {(*shape, 'nregions')}".replace("'", "")
    if table.ndim != len(shape) + 1 or table.shape[:-1] != shape:
        raise ValueError(f"{name} of Ritz must have shape {expected}; got {table.shape}.")
    if region is None:
        raise ValueError(f"{name} of Ritz is a table of {table.shape[-1]}; give region, the number of each element.")
    if region.max(initial=-1) >= table.shape[-1]:
        raise ValueError(
            f"{name} of Ritz has {table.shape[-1]} values but region has numbers up to {region.max()}; give one for "
            "each number from 0 on."
        )
    if table.shape[-1] == region.size > region.max(initial=-1) + 1:
        raise ValueError(
            f"{name} of Ritz must have one value per region number, {region.max() + 1}; got {region.size}, the "
            "number of elements."
        )
    return table


def check_fits(ritz: Ritz, nodes: int, elements: int) -> None:
    """Refuse a functional of another mesh."""
    if np.shape(ritz.values) != (nodes,):
        raise ValueError(f"values of Ritz must have shape (nnodes,) = ({nodes},); got {np.shape(ritz.values)}.")
    if ritz.region is not None and np.shape(ritz.region) != (elements,):
        raise ValueError(f"region of Ritz must have shape (nelements,) = ({elements},); got {np.shape(ritz.region)}.")


def functional_value(mesh: MeshTri, ritz: Ritz) -> float:
    """The functional of the solution on its own mesh, or an error if that is another one."""
    check_fits(ritz, mesh.p.shape[1], mesh.t.shape[1])
    (x0, x1, x2), (y0, y1, y2) = mesh.p[:, mesh.t]
    u0, u1, u2 = np.asarray(ritz.values)[mesh.t]
    doubled = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    along_x = (u0 * (y1 - y2) + u1 * (y2 - y0) + u2 * (y0 - y1)) / doubled
    along_y = (u0 * (x2 - x1) + u1 * (x0 - x2) + u2 * (x1 - x0)) / doubled
    coefficient, source, flux_x, flux_y = (
        table if np.ndim(table) == 0 else np.asarray(table)[np.asarray(ritz.region)]
        for table in (ritz.coefficient, ritz.source, *np.asarray(ritz.flux))
    )
    density = 0.5 * coefficient * (along_x**2 + along_y**2) - source * (u0 + u1 + u2) / 3.0
    density -= flux_x * along_x + flux_y * along_y
    return 0.5 * float(np.sum(np.abs(doubled) * density))
