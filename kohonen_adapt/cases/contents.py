"""Hold what a case says, and read its tables that stand for materials, outputs and curves."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from skfem import MeshTri

from kohonen_adapt.cases.kinds import NUMBER, TEXT, Kind, Reader, called, list_of, made, made_by_name, tuple_of
from kohonen_adapt.cases.turning import turned_materials
from kohonen_adapt.io import Groups, read_groups, read_mesh
from kohonen_adapt.io.read import shown_curves
from kohonen_adapt.magnetostatics.materials.bh_table import Table, read_bh
from kohonen_adapt.magnetostatics.materials.laws import Arctan, Brauer, Froehlich, Law
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.magnetostatics.quantities.bodies import bores
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.mesh.motions import Motion, Pair, Reflection, Rotation, Translation
from kohonen_adapt.outline.curves import Arc, Line
from kohonen_adapt.outline.spline import Spline

__all__ = ["LAWS", "MOTIONS", "PAIRS", "QUANTITIES", "SHAPES", "Case", "Quantity", "material_in", "quantity", "shape"]

Point = tuple[float, float]

POINTS = list_of(tuple_of([NUMBER, NUMBER]))

LAWS: dict[str, Callable[..., Law]] = {"brauer": Brauer, "froehlich": Froehlich, "arctan": Arctan}


def material_in(folder: Path) -> Reader:
    """A reader of tables under ``materials``; files of curves are sought from the folder."""

    def read(given: Any, place: str) -> Material:
        return made(Material, given, place, {"bh": lambda curve, where: _law(curve, where, folder)})

    return read


def _law(given: Any, place: str, folder: Path) -> Law:
    if isinstance(given, list):
        return called(Table, {"points": POINTS(given, place)}, place)
    if isinstance(given, str):
        return _read(folder / given, place)
    if not isinstance(given, dict):
        raise ValueError(
            f'{place} must be a list of [B, H], the name of a file, or a law as {{law = "brauer", ...}}; got {given!r}.'
        )
    return made_by_name(LAWS, "law", given, place)


def _read(path: Path, place: str) -> Table:
    # Nothing but a plain file: a device or a pipe would never end.
    try:
        if path.is_file():
            return read_bh(path)
    except (OSError, ValueError) as error:
        raise ValueError(f"{place}: {error}") from None
    raise ValueError(f"{place} must name a file with a table of B and H; there is none at '{path}'.")


@dataclass(frozen=True)
class Quantity:
    """A function of a field, the unit of a total of it, and the subdomains that it asks for."""

    function: Callable[[Field], float]
    unit: str
    bodies: tuple[str, ...] = ()
    centre: Point | None = None  # about which the bodies are turned

    def __call__(self, field: Field) -> float:
        """Its value."""
        return float(self.function(field))


def _force(body: str | list[str], component: Literal["x", "y"]) -> Quantity:
    names = _names(body)
    return Quantity(lambda field: field.force(names)["xy".index(component)], "N", names)


def _torque(body: str | list[str], centre: Point = (0.0, 0.0)) -> Quantity:
    names = _names(body)
    return Quantity(lambda field: field.torque(names, centre), "N m", names, centre)


def _flux_linkage(coil: str | list[str], turns: float = 1.0) -> Quantity:
    names = _names(coil)
    return Quantity(lambda field: field.flux_linkage(names, turns), "Wb", names)


def _names(given: str | list[str]) -> tuple[str, ...]:
    if not given:
        raise ValueError("a body or a coil must be at least one subdomain; got an empty list.")
    return (given,) if isinstance(given, str) else tuple(given)


QUANTITIES: dict[str, Callable[..., Quantity]] = {
    "force": _force,
    "torque": _torque,
    "flux_linkage": _flux_linkage,
    "energy": lambda: Quantity(lambda field: field.energy, "J"),
    "coenergy": lambda: Quantity(lambda field: field.coenergy, "J"),
}


def quantity(given: Any, place: str) -> Quantity:
    """Read a table under ``outputs``."""
    return made_by_name(QUANTITIES, "quantity", given, place)


def _spline(points: list[Point], closed: bool = False) -> Spline:
    return Spline(np.reshape(points, (-1, 2)).T, closed=closed)


SHAPES: dict[str, Callable[..., Arc | Line | Spline]] = {"arc": Arc, "line": Line, "spline": _spline}


def shape(given: Any, place: str) -> Arc | Line | Spline:
    """Read a table under ``adapt.curves``: a curve in metres."""
    return made_by_name(SHAPES, "curve", given, place)


MOTIONS: dict[str, Callable[..., Motion]] = {
    "rotation": Rotation,
    "translation": Translation,
    "reflection": Reflection,
}


def _pair(given: Any, place: str) -> Pair:
    one, other = (TEXT(name, f"{place}[{k}]") for k, name in enumerate(given[:2]))
    return (one, other, *(made_by_name(MOTIONS, "motion", motion, f"{place}[2]") for motion in given[2:]))


PAIRS = list_of(
    Kind((list,), '["name", "name"] or ["name", "name", {motion = ...}]', lambda given: len(given) in (2, 3), _pair)
)
"""Pairs of boundaries, each with a table of the motion between them where that is named."""


@dataclass(frozen=True)
class Case:
    """Checked settings.

    Attributes
    ----------
    mesh
        The mesh file.
    scale
        Metres per unit of it.
    stated
        What is to be solved; `problem` knows what the mesh file has to say to it, too.
    adapt
        Arguments of `kohonen_adapt.adapt` by name.
    outputs
        Name to a function of the field.
    turn
        Subdomain to the angle, in degrees, by which it is turned about the origin.
    file, text
        The name of the file it was read from, and what that says; empty for a case from elsewhere.
    """

    mesh: Path
    scale: float
    stated: Magnetostatics
    adapt: dict[str, Any]
    outputs: dict[str, Quantity]
    turn: dict[str, float] = field(default_factory=dict)
    file: str = ""
    text: str = ""

    @cached_property
    def groups(self) -> Groups:
        """The physical groups of the mesh file, in its unit; read once, so that the file may go after the mesh is read.

        Raises
        ------
        ValueError
            If the file is damaged.
        OSError
            If it cannot be read.
        """
        return read_groups(self.mesh)

    @cached_property
    def problem(self) -> Magnetostatics:
        """What is to be solved: of the mesh file are points that its potential names, and where magnets are turned to.

        Raises
        ------
        ValueError
            If a magnet turns in part, or the file is damaged.
        OSError
            If it cannot be read.
        """
        return self._turned(self._with_points())

    def _with_points(self) -> Magnetostatics:
        given = self.stated.boundaries
        wanted = given.potential.keys() - given.points.keys()
        if not wanted or not self.mesh.is_file():
            return self.stated
        found = {name: self.scale * places for name, places in self.groups.places.items() if name in wanted}
        return replace(self.stated, points={**given.points, **found}) if found else self.stated

    def _turned(self, problem: Magnetostatics) -> Magnetostatics:
        if not self.turn:
            return problem
        return replace(problem, materials=turned_materials(problem.materials, self.drawn, self.turn))

    @cached_property
    def drawn(self) -> MeshTri:
        """The mesh as the file has it, in metres.

        Raises
        ------
        ValueError
            If the file is damaged.
        OSError
            If it cannot be read.
        """
        return read_mesh(self.mesh, scale=self.scale)

    @property
    def labelled_outputs(self) -> dict[str, Quantity]:
        """The outputs by name and unit, as ``pull (N/m)``: per metre unless there is a depth or an axis."""
        totals = self.problem.axisymmetric or self.problem.depth is not None
        per_metre = "" if totals else "/m"
        return {f"{name} ({each.unit}{per_metre})": each for name, each in self.outputs.items()}

    @property
    def pinned(self) -> list[int | str]:
        """Names and numbers of what is to stay where it is."""
        given = self.adapt.get("pinned", [])
        return [given] if isinstance(given, str) else given

    def pins(self, mesh: MeshTri) -> list[int | str]:
        """The same, and the nodes of its mesh, in metres, that are in groups of points.

        Parameters
        ----------
        mesh
            What `fitting_mesh` gives.

        Returns
        -------
        list of int and str
            As `adapt` takes them for ``pinned``.
        """
        return [*self.pinned, *self.groups.held(mesh.scaled(1.0 / self.scale))]

    def options(self, mesh: MeshTri) -> dict[str, Any]:
        """The arguments of `adapt` for its mesh: what is pinned, and what is round, too.

        Round is what the mid-side nodes of a file of second order show, where nothing turns, and the bore of a body
        whose torque is asked, but for boundaries of pairs and those that share facets with others that have a curve.

        Parameters
        ----------
        mesh
            What `fitting_mesh` gives.

        Returns
        -------
        dict
            By name.
        """
        curves = dict(self.adapt.get("curves") or {})
        taken = np.concatenate([[], *(np.asarray((mesh.boundaries or {}).get(name, [])) for name in curves)])
        told = dict[str, Arc | Line | Spline]()
        for each in self.outputs.values():
            told |= bores(mesh, each.bodies, each.centre) if each.centre is not None else {}
        paired = {name for pair in self.adapt.get("periodic", self.problem.pairs) for name in pair[:2]}
        shown = {} if self.turn else shown_curves(self.mesh, mesh, self.scale)
        for name, curve in (shown | told).items():
            facets = np.asarray(mesh.boundaries[name])
            if name not in paired and not np.isin(facets, taken).any():
                curves[name], taken = curve, np.append(taken, facets)
        return {**self.adapt, "pinned": self.pins(mesh)} | ({"curves": curves} if curves else {})
