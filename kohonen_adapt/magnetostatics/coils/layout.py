"""Layout of a winding along a closed path."""

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import finite_triple, point_text
from kohonen_adapt.magnetostatics.coils.winding import Arc, Bar, Plane, Sides, Winding, crossing_side, sides_of
from kohonen_adapt.mesh.measures import magnitude, unit_vectors

__all__ = ["laid_out", "rectangle"]

ROUNDING = 1e-9  # tolerance relative to the extent of the path
FLAT = 1e-6  # tolerance of a plane path
SHARPEST = np.deg2rad(179.0)  # largest turn of a path
PARALLEL = 1e-6  # sine of the angle between directions, below which they do not differ


def laid_out(path: Floats, width: float, height: float, radius: float) -> Winding:
    size = np.ptp(path, axis=1).max()
    step = magnitude(np.roll(path, -1, axis=1) - path)
    if step.min() <= ROUNDING * size:
        point = point_text(path[:, np.argmin(step)])
        raise ValueError(f"path has the point {point} twice in succession; the coil closes its path by itself.")
    origin = path.mean(axis=1)
    frame = _frame(path, origin, size)
    along, across = frame[:2] @ (path - origin[:, None])
    y = along + 1j * across
    sides, crossing = sides_of(y), crossing_side(y)
    sharp = np.flatnonzero(np.abs(sides.turn) > SHARPEST)
    if sharp.size:
        raise ValueError(f"path turns back at the point {point_text(path[:, sharp[0]])}; remove the point.")
    if crossing is not None:
        point = point_text(path[:, crossing])
        raise ValueError(f"path crosses itself on the side from {point}; give a path without crossings.")
    pieces = _rounded(y, sides, width, radius, size) if radius > 0.0 else _mitred(y, sides, width)
    winding = Winding(origin, frame, pieces, width, height)
    for depth in (0.5 * width, -0.5 * width):
        if crossing_side(winding.offset_path(depth)) is not None:
            raise ValueError(f"a winding of width {width:g} m overlaps itself along this path; give a smaller width.")
    return winding


def _frame(path: Floats, origin: Floats, size: float) -> Floats:
    arm = path - origin[:, None]
    area = 0.5 * np.cross(arm, np.roll(arm, -1, axis=1), axis=0).sum(axis=1)
    if magnitude(area) <= FLAT * size**2:
        raise ValueError("path encloses no area; give the corners in succession, without crossings.")
    normal = unit_vectors(area)
    height = np.abs(normal @ arm).max()
    if height > FLAT * size:
        raise ValueError(
            f"path must be plane, because width is in its plane and height across; its points are up to {height:.3g} m "
            "off a plane. Give the field of another coil as applied_field."
        )
    first = path[:, 1] - path[:, 0]
    first = unit_vectors(first - normal * (normal @ first))
    return np.stack((first, np.cross(normal, first), normal))


def _mitred(y: Plane, sides: Sides, width: float) -> tuple[Bar, ...]:
    slope = np.tan(0.5 * sides.turn)
    loss = 0.5 * width * (slope + np.roll(slope, -1))
    short = np.flatnonzero(np.abs(loss) >= sides.length)
    if short.size:
        raise ValueError(
            f"a winding of width {width:g} m is wider than its bore at a side of {sides.length[short[0]]:.6g} m; give "
            "a smaller width or a larger path."
        )
    inner, outer = (y + half * (1j + slope) * sides.along for half in (0.5 * width, -0.5 * width))
    corner = np.stack((inner, np.roll(inner, -1), np.roll(outer, -1), outer), axis=1)
    return tuple(map(Bar, corner))


def _rounded(y: Plane, sides: Sides, width: float, radius: float, size: float) -> tuple[Bar | Arc, ...]:
    if radius < 0.5 * width * (1.0 - ROUNDING):
        raise ValueError(
            f"the radius, {radius:g} m, must be at least half the width of the winding, {0.5 * width:g} m, or 0 for "
            "mitred corners; give a larger radius or a smaller width."
        )
    cut = radius * np.abs(np.tan(0.5 * sides.turn))
    straight = sides.length - cut - np.roll(cut, -1)
    k = int(np.argmin(straight))
    if straight[k] < -ROUNDING * size:
        raise ValueError(
            f"corners with a radius of {radius:g} m need {sides.length[k] - straight[k]:.6g} m of a side that has "
            f"{sides.length[k]:.6g} m; give a smaller radius."
        )
    pieces, start = list[Bar | Arc](), y + cut * sides.along
    for k, (along, turn) in enumerate(zip(sides.along, sides.turn, strict=True)):
        if abs(turn) > ROUNDING:
            to_centre = 1j * np.sign(turn) * radius
            outward = np.angle(-to_centre * sides.along[k - 1])
            _append(pieces, Arc(start[k] + to_centre * along, radius, outward, turn, width))
        if straight[k] > ROUNDING * size:
            ends, shift = start[k] + straight[k] * np.array([0.0, 1.0]) * along, 0.5j * width * along
            pieces.append(Bar(np.concatenate((ends + shift, ends[::-1] - shift))))
    first, last = pieces[0], pieces[-1]
    if len(pieces) > 1 and isinstance(first, Arc) and isinstance(last, Arc) and first.turn == last.turn:
        _append(pieces, first)
        pieces = pieces[1:]
    return tuple(pieces)


def _append(pieces: list[Bar | Arc], arc: Arc) -> None:
    last = pieces[-1] if pieces else None
    if isinstance(last, Arc) and last.turn == arc.turn:
        pieces[-1] = last._replace(extent=last.extent + arc.extent)
    else:
        pieces.append(arc)


def rectangle(centre: ArrayLike, axis: ArrayLike, length: float, width: float, along: ArrayLike | None) -> Floats:
    middle = np.array(finite_triple(centre, "centre of a coil"))
    normal = np.array(finite_triple(axis, "axis of a coil"))
    if not normal.any():
        raise ValueError(f"axis of a coil must not be zero; got {axis!r}.")
    given = np.eye(3)[np.argmin(np.abs(normal))] if along is None else along
    first = np.array(finite_triple(given, "along of a coil"))
    second = np.cross(normal, first)
    if magnitude(second) <= PARALLEL * magnitude(normal) * magnitude(first):
        raise ValueError(f"axis and along of a coil must be directions that differ; got {axis!r} and {along!r}.")
    second = unit_vectors(second)
    first = np.cross(second, unit_vectors(normal))
    signs = np.array([[-0.5, 0.5, 0.5, -0.5], [-0.5, -0.5, 0.5, 0.5]])
    return middle[:, None] + np.outer(first, length * signs[0]) + np.outer(second, width * signs[1])
