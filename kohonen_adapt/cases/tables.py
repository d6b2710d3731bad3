"""Tables of a case for materials, coils, goals, outputs, curves and schedules."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import cos, radians, sin
from pathlib import Path
from typing import Any, Literal

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.cases.readers import (
    FLAG,
    NUMBER,
    POINT,
    POINTS,
    TEXT,
    VECTOR,
    Kind,
    Maker,
    Reader,
    call_checked,
    list_of,
    make_from_table,
    make_named,
    read_table,
    tuple_of,
)
from kohonen_adapt.checks import point_text
from kohonen_adapt.geometry.plane.curves import Arc, Line
from kohonen_adapt.geometry.plane.spline import Spline
from kohonen_adapt.geometry.space.surfaces import Cone, Cylinder, Plane, Sphere
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.materials.bh_table import Table, read_bh
from kohonen_adapt.magnetostatics.materials.laws import Arctan, Brauer, Froehlich, Law
from kohonen_adapt.magnetostatics.materials.material import Material, Vector, halbach, radial
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.flux_density_at import FluxDensityAt
from kohonen_adapt.magnetostatics.quantities.goals import FluxLinkage, Force, StoredEnergy, Torque
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.mesh.motions import Pair, Reflection, Rotation, Translation
from kohonen_adapt.som.schedule import Schedule, Stage

__all__ = [
    "COILS",
    "GOALS",
    "LAWS",
    "MOTIONS",
    "PAIRS",
    "PATTERNS",
    "QUANTITIES",
    "SHAPES",
    "SURFACES",
    "Quantity",
    "coil",
    "goal",
    "material_in",
    "quantity",
    "schedule",
    "shape",
    "surface",
]

Position = tuple[float, ...]  # two or three coordinates
Axis = Literal["x", "y", "z"]
Makers = dict[str, Maker]
TRIPLE = tuple_of([NUMBER] * 3)

LAWS: Makers = {"brauer": Brauer, "froehlich": Froehlich, "arctan": Arctan}


def _parallel(magnitude: float, degrees: float) -> Vector:
    return magnitude * cos(radians(degrees)), magnitude * sin(radians(degrees))


PATTERNS: Makers = {"radial": radial, "halbach": halbach, "parallel": _parallel}


def _vector(given: Any, location: str) -> Vector:
    return make_named(PATTERNS, "pattern", given, location) if isinstance(given, dict) else VECTOR(given, location)


MAGNET = Kind(
    (list, dict),
    f'{POINT.wanted} or a pattern as {{pattern = "radial", magnitude = 1.2}}; in space three numbers',
    read=_vector,
)
"""A remanence or a coercivity."""


def material_in(folder: Path) -> Reader:
    def law(given: Any, location: str) -> Law:
        return _law(given, location, folder)

    def read(given: Any, location: str) -> Material:
        return make_from_table(Material, given, location, {"bh": law, "remanence": MAGNET, "coercivity": MAGNET})

    return read


def _law(given: Any, location: str, folder: Path) -> Law:
    if isinstance(given, list):
        return call_checked(Table, {"points": POINTS(given, location)}, location)
    if isinstance(given, str):
        return _read(folder / given, location)
    if not isinstance(given, dict):
        raise ValueError(
            f'{location} must be a list of [B, H], the name of a file, or a law as {{law = "brauer", ...}}; '
            f"got {given!r}."
        )
    if "file" in given:
        values = read_table(given, {"file": TEXT, "smooth": FLAG}, location)
        return _read(folder / values["file"], location, values.get("smooth", False))
    if "points" in given:
        return call_checked(Table, read_table(given, {"points": POINTS, "smooth": FLAG}, location), location)
    return make_named(LAWS, "law", given, location)


def _read(path: Path, location: str, smooth: bool = False) -> Table:
    # Reading a device or a pipe might never end.
    try:
        if path.is_file():
            return read_bh(path, smooth=smooth)
    except (OSError, ValueError) as error:
        raise ValueError(f"{location}: {error}") from None
    raise ValueError(f"{location} must name a file with a table of B and H; there is none at '{path}'.")


COILS: Makers = {
    "path": Coil,
    "circular": Coil.circular,
    "racetrack": Coil.racetrack,
    "straight_limb": Coil.straight_limb,
}
OF_COILS: dict[str, Reader] = {
    "path": lambda given, location: np.transpose(list_of(TRIPLE)(given, location)),
    **dict.fromkeys(("centre", "axis", "along"), TRIPLE),
    **dict.fromkeys(("section", "bore"), POINT),
}
coil = partial(make_named, COILS, "shape", special=OF_COILS)


@dataclass(frozen=True)
class Quantity:
    function: Callable[[Any], float]  # of a `Field` or a `SolidField`
    unit: str  # of a total with a depth, or of a local value
    bodies: tuple[str, ...] = ()
    centre: Position | None = None  # axis of a torque
    local: bool = False  # value at a point

    def __call__(self, field: Field | SolidField) -> float:
        return float(self.function(field))


def _component_of(vector: Floats, component: Axis) -> float:
    if "xyz".index(component) >= len(vector):
        raise ValueError(f"component must be one that the field has, x or y in the plane; got {component!r}.")
    return vector["xyz".index(component)]


def _force(body: str | list[str], component: Axis) -> Quantity:
    names = _names(body)
    return Quantity(lambda field: _component_of(field.force(names), component), "N", names)


def _torque(body: str | list[str], centre: Position = (), component: Axis = "z") -> Quantity:
    names = _names(body)

    def value(field: Field | SolidField) -> float:
        if isinstance(field, SolidField):
            return _component_of(field.torque(names, centre or (0.0, 0.0, 0.0)), component)
        if component != "z":
            raise ValueError(f"a torque in the plane is about the z axis; got component {component!r}.")
        return field.torque(names, centre or (0.0, 0.0))

    return Quantity(value, "N m", names, centre or (0.0, 0.0))


def _flux_linkage(coil: str | list[str], turns: float = 1.0) -> Quantity:
    names = _names(coil)
    return Quantity(lambda field: field.flux_linkage(names, turns), "Wb", names)


def _inductance(coil: str, turns: float = 1.0) -> Quantity:
    return Quantity(lambda field: _method_of(field, "inductance")(coil, turns), "H")


def _flux(surface: str) -> Quantity:
    return Quantity(lambda field: _method_of(field, "flux")(surface), "Wb")


def _method_of(field: Field | SolidField, name: str) -> Callable[..., float]:
    if not hasattr(field, name):
        raise ValueError(f"quantity {name} is for tetrahedra only.")
    return getattr(field, name)


def _potential(at: Position) -> Quantity:
    return Quantity(lambda field: _value_inside(field.potential_at(np.reshape(at, (-1, 1))), at, field), "", local=True)


def _flux_density(at: Position, component: Axis, recovered: bool = False) -> Quantity:
    def value(field: Field | SolidField) -> float:
        found = field.flux_density_at(np.reshape(at, (-1, 1)), recovered=recovered)
        return _component_of(_value_inside(found, at, field), component)

    return Quantity(value, "T", local=True)


def _value_inside(value: Floats, at: Position, field: Field | SolidField) -> Any:
    if np.isnan(value).any():
        low, high = field.mesh.p.min(axis=1), field.mesh.p.max(axis=1)
        raise ValueError(
            f"at must be a point [x, y] of the mesh, in metres; {list(at)} is outside. The mesh is from "
            f"{point_text(low)} to {point_text(high)} m."
        )
    return value[..., 0]


def _names(given: str | list[str]) -> tuple[str, ...]:
    if not given:
        raise ValueError("a body or a coil must be at least one subdomain; got an empty list.")
    return (given,) if isinstance(given, str) else tuple(given)


QUANTITIES: Makers = {
    "force": _force,
    "torque": _torque,
    "flux_linkage": _flux_linkage,
    "inductance": _inductance,
    "flux": _flux,
    "flux_density": _flux_density,
    "potential": _potential,
    "energy": lambda: Quantity(lambda field: field.energy, "J"),
    "coenergy": lambda: Quantity(lambda field: field.coenergy, "J"),
}
quantity = partial(make_named, QUANTITIES, "quantity")

GOALS: Makers = {
    "force": Force,
    "torque": Torque,
    "flux_linkage": FluxLinkage,
    "energy": StoredEnergy,
    "flux_density": FluxDensityAt,
}
goal = partial(make_named, GOALS, "quantity")


SHAPES: Makers = {"arc": Arc, "line": Line, "spline": Spline}
OF_SPLINES: dict[str, Reader] = {
    "points": lambda given, location: np.reshape(POINTS(given, location), (-1, 2)).T,
}
shape = partial(make_named, SHAPES, "curve", special=OF_SPLINES)

# The half angle of a cone is in radians.
SURFACES: Makers = {
    "plane": Plane,
    "sphere": Sphere,
    "cylinder": Cylinder,
    "cone": Cone,
}
surface = partial(make_named, SURFACES, "surface")

MOTIONS: Makers = {
    "rotation": Rotation,
    "translation": Translation,
    "reflection": Reflection,
}


def _pair(given: Any, location: str) -> Pair:
    one, other = (TEXT(name, f"{location}[{k}]") for k, name in enumerate(given[:2]))
    return (one, other, *(make_named(MOTIONS, "motion", motion, f"{location}[2]") for motion in given[2:]))


PAIRS = list_of(
    Kind((list,), '["name", "name"] or ["name", "name", {motion = ...}]', lambda given: len(given) in (2, 3), _pair)
)
"""Pairs of boundaries, each with an optional table of the motion between them."""

STAGES = list_of(
    Kind((dict,), "{radius = ..., epochs = ..., learning_rate = ...}", read=partial(make_from_table, Stage))
)
schedule = partial(make_from_table, Schedule, special={"stages": STAGES})
