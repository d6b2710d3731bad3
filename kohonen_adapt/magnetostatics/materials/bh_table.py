"""B-H law through measured points."""

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # loads its modules at their first use
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY, VACUUM_RELUCTIVITY, Continued

__all__ = ["Table", "read_bh"]

# Above these values units are wrong. Iron-cobalt has a polarisation of 2.4 T. The best steels that reach 1.7 T have a
# relative permeability near 10^5, and oersted in place of A/m multiplies the permeability by 79.6.
LARGEST_POLARISATION = 3.0
LARGEST_PERMEABILITY = 2e5
STEEL = 1.7

SMOOTH = (
    "For measured points with noise: read_bh(path, smooth=True) or Table(points, smooth=True), in a case "
    'bh = {file = "NAME", smooth = true} or {points = [...], smooth = true}.'
)
SHOWN = 60  # characters of an invalid line in a message
SATURATED = (
    100.0  # relative differential permeability at the end of a table, above which the table is far from saturation
)


@dataclass(frozen=True, init=False)
class Table(Continued):
    """Monotone piecewise cubic H(B) through measured points (PCHIP).

    The slopes are those of Fritsch and Butland (1984). From the last point on, or from where the slope would fall below
    mu0, dB/dH = mu0. A table that ends far from saturation, at a relative differential permeability above 100, raises a
    warning, because larger B are a guess.

    Parameters
    ----------
    points : (n, 2)
        B in T and H in A/m, both strictly increasing from (0, 0), which is added if missing.
    smooth
        Take measured points with noise, in any order. The polarisation B - mu0 H is made to rise with H by isotonic
        regression (pool adjacent violators), and the points of a pool are replaced by their mean. In saturation, at
        relative differential permeabilities below 100, points are pooled until dB/dH falls with H, too.

    Raises
    ------
    ValueError
        For other shapes, a single point, points that are not finite, negative or, unless `smooth`, not increasing, and
        magnitudes typical of gauss or oersted.

    Examples
    --------
    >>> import numpy as np
    >>> from kohonen_adapt.magnetostatics import Table
    >>> law = Table([[1.0, 100.0], [1.5, 700.0], [1.8, 8000.0], [2.1, 60000.0]])  # B in T, H in A/m
    >>> law.field_strength(np.array([0.0, 1.5])).round(6).tolist()
    [0.0, 700.0]
    """

    points: tuple[tuple[float, float], ...]

    def __init__(self, points: ArrayLike, smooth: bool = False) -> None:
        array = _checked(points, smooth)
        vars(self)["points"] = tuple(map(tuple, array.tolist()))
        b, h = array.T
        slope, secant = scipy.interpolate.PchipInterpolator(b, h).derivative()(b), np.diff(h) / np.diff(b)
        # scipy's end slope can be zero, an infinite permeability. Up to 3 secants the curve remains monotone.
        slope[[0, -1]] = np.clip(slope[[0, -1]], 0.5 * secant[[0, -1]], 3.0 * secant[[0, -1]])
        curve = scipy.interpolate.CubicHermiteSpline(b, h, slope)
        steep = curve.derivative().solve(VACUUM_RELUCTIVITY, extrapolate=False)
        steep = steep[np.isfinite(steep) & (steep > 0.0)]  # nan marks a piece of constant slope
        first = float(steep.min(initial=b[-1]))
        whole = b[:-1][secant >= VACUUM_RELUCTIVITY * (1 - 1e-9)]
        vars(self).update(_strength=curve, _slope=curve.derivative(), _energy=curve.antiderivative())
        vars(self)["end"] = float(whole.min(initial=first))
        if self.end == 0.0 or slope[0] >= VACUUM_RELUCTIVITY:
            raise ValueError(
                "bh must begin with a slope dB/dH above mu0; it is less permeable than vacuum from its start, "
                f"{b[1]:g} T at {h[1]:g} A/m. B must be in T, not in another unit, and H in A/m."
            )
        permeability = 1.0 / (VACUUM_PERMEABILITY * slope[-1])
        if self.end == b[-1] and permeability > SATURATED:
            warnings.warn(
                f"the table ends at {b[-1]:g} T, {h[-1]:g} A/m far from saturation (relative differential permeability "
                f"{permeability:.0f}); beyond, dB/dH = mu0 is assumed. Add points up to saturation.",
                stacklevel=2,
            )


def read_bh(path: str | Path, *, smooth: bool = False) -> Table:
    r"""Read a table of B and H from a text file.

    The file has two columns, B in T and H in A/m, separated by commas, semicolons, tabs or blanks. Between semicolons
    numbers may have decimal commas. Lines that begin with ``#`` are ignored. One header line is allowed; if its first
    name begins with H, the columns are H and B.

    Parameters
    ----------
    path
        The file.
    smooth
        Take measured points with noise, which do not rise from line to line, as `Table` does.

    Returns
    -------
    Table
        The law.

    Raises
    ------
    ValueError
        For a line that does not hold two numbers, and for points that `Table` refuses.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from kohonen_adapt.magnetostatics import Material, read_bh
    >>> _ = Path("steel.csv").write_text("B, H\n1.0, 100\n1.5, 700\n1.8, 8000\n2.1, 60000\n")
    >>> steel = Material(bh=read_bh("steel.csv"))
    """
    if not Path(path).is_file():  # a device or a pipe has no end
        raise FileNotFoundError(f"read_bh expected a text file with columns B and H; there is none at '{path}'.")
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is no text in UTF-8: {error}.") from None
    rows, heading = list[tuple[float, float]](), None
    for number, line in enumerate(map(str.strip, text.splitlines()), 1):
        if not line or line.startswith("#"):
            continue
        words = (line.replace(",", ".") if ";" in line else line).strip(";, \t")
        try:
            first, second = map(float, re.split(r"[;,\s]+", words))
        except ValueError:
            heading = None if heading or rows else re.match(r"\W*([A-Za-z])", line)
            if heading is None:
                raise ValueError(
                    f"{path}, line {number}: expected two numbers, B in T and H in A/m; got {line[:SHOWN]!r}."
                ) from None
        else:
            rows.append((first, second))
    table = np.array(rows).reshape(-1, 2)
    swapped = heading is not None and heading[1] in "Hh"
    try:
        return Table(table[:, ::-1] if swapped else table, smooth)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _checked(points: Any, smooth: bool) -> Floats:
    try:
        array = np.array(points, float)
    except (TypeError, ValueError):
        raise ValueError(f"bh must be numbers of shape (n, 2), columns B in T and H in A/m; got {points!r}.") from None
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(f"bh must have shape (n, 2), columns B in T and H in A/m; got {array.shape}.")
    if not np.all(np.isfinite(array)):
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ValueError(f"bh must be finite; row {row} is {array[row].tolist()}.")
    array = _smoothed(array) if smooth else array
    if len(array) and np.any(array[0] != 0.0):
        array = np.vstack(([0.0, 0.0], array))
    if len(array) < 3:
        raise ValueError(
            f"bh must have at least two points besides (0, 0); got {max(len(array) - 1, 0)}. "
            "For a constant permeability: Material(permeability=...)."
        )
    falls = np.flatnonzero(np.any(np.diff(array, axis=0) <= 0.0, axis=1))
    if falls.size:
        (b, h), (after_b, after_h) = array[falls[0] : falls[0] + 2]
        raise ValueError(
            f"bh must have B and H strictly increasing from (0, 0); {b:g} T, {h:g} A/m precedes {after_b:g} T, "
            f"{after_h:g} A/m. {SMOOTH}"
        )
    _check_units(*array.T)
    return array


def _smoothed(array: Floats) -> Floats:
    if np.any(array < 0.0):
        b, h = array[np.argmax((array < 0.0).any(axis=1))]
        raise ValueError(f"bh to be smoothed must have B and H of at least 0; got {b:g} T, {h:g} A/m.")
    h, place, count = np.unique(array[:, 1], return_inverse=True, return_counts=True)
    b = np.bincount(place, array[:, 0]) / count
    pools = scipy.optimize.isotonic_regression(b - VACUUM_PERMEABILITY * h, weights=count).blocks[:-1]
    points = _pooled(np.column_stack([b, h, count]), pools)
    points = points[(points[:, 0] > VACUUM_PERMEABILITY * points[:, 1]) & (points[:, 1] > 0.0)]
    while len(points) > 2:
        b, h, _ = np.vstack([np.zeros(3), points]).T
        permeability = np.diff(b) / np.diff(h) / VACUUM_PERMEABILITY
        later = np.append(np.maximum.accumulate(permeability[:0:-1])[::-1], 0.0)
        flat = np.flatnonzero((permeability < np.minimum(later, SATURATED))[1:])
        if not len(flat):
            break
        points = _pooled(points, np.delete(np.arange(len(points)), flat[0] + 1))
    return points[:, :2]


def _pooled(points: Floats, starts: Ints) -> Floats:
    # Columns are B, H and the number of measured points.
    count = np.add.reduceat(points[:, 2], starts)
    return np.column_stack([np.add.reduceat(points[:, :2] * points[:, 2:], starts) / count[:, None], count])


def _check_units(b: Floats, h: Floats) -> None:
    polarisation = float(np.max(b - VACUUM_PERMEABILITY * h))
    if polarisation > LARGEST_POLARISATION:
        raise ValueError(
            f"bh has a polarisation B - mu0 H up to {polarisation:.4g} T, more than any material: B must be in tesla "
            "(1 gauss = 1e-4 T) and stand in the first column, H in A/m (1 oersted = 79.577 A/m) in the second."
        )
    permeability = float(np.max(b[1:] / (VACUUM_PERMEABILITY * h[1:])))
    if permeability > LARGEST_PERMEABILITY and b[-1] > STEEL:
        raise ValueError(
            f"bh has a relative permeability up to {permeability:.4g} and reaches {b[-1]:.4g} T, more than any steel: "
            "H must be in A/m (1 oersted = 79.577 A/m)."
        )
