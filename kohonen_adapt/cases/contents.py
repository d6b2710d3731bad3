"""Hold what a case says, and complete it by what its mesh file has to say."""

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from skfem import Mesh, MeshTri

from kohonen_adapt.cases.tables import Quantity
from kohonen_adapt.cases.turning import turned_materials
from kohonen_adapt.io import Groups, read_groups, read_mesh
from kohonen_adapt.io.read import shown_curves
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.magnetostatics.quantities.bodies import bores
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential
from kohonen_adapt.mesh.cells import TETRAHEDRON, check_kind
from kohonen_adapt.mesh.curved import corners_of, is_second_order
from kohonen_adapt.outline.curves import Arc, Line
from kohonen_adapt.outline.spline import Spline

__all__ = ["Case"]


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
    rim
        What the whole rim of the mesh is called; empty where the file has names for it.
    file, text
        The name of the file it was read from, and what that says; empty for a case from elsewhere.
    """

    mesh: Path
    scale: float
    stated: Magnetostatics | MagneticScalarPotential
    adapt: dict[str, Any]
    outputs: dict[str, Quantity]
    turn: dict[str, float] = field(default_factory=dict)
    rim: str = ""
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
    def problem(self) -> Magnetostatics | MagneticScalarPotential:
        """What is to be solved: of the mesh file are points that its potential names, and where magnets are turned to.

        Of tetrahedra it is what a case for the plane means there.

        Raises
        ------
        ValueError
            If a magnet turns in part, or the file is damaged.
        OSError
            If it cannot be read.
        """
        if isinstance(self.stated, MagneticScalarPotential):
            return self.stated
        if self.mesh.is_file() and type(self.drawn) is TETRAHEDRON.mesh:
            return in_space(self.stated)
        return self._turned(self._with_points(self.stated))

    @property
    def goal(self) -> Goal | None:
        """The goal of the problem."""
        return self.problem.goal

    def _with_points(self, stated: Magnetostatics) -> Magnetostatics:
        given = stated.boundaries
        wanted = given.potential.keys() - given.points.keys()
        if not wanted or not self.mesh.is_file():
            return stated
        found = {name: self.scale * places for name, places in self.groups.places.items() if name in wanted}
        return replace(stated, points={**given.points, **found}) if found else stated

    def _turned(self, problem: Magnetostatics) -> Magnetostatics:
        if not self.turn:
            return problem
        return replace(problem, materials=turned_materials(problem.materials, self.drawn, self.turn))

    @cached_property
    def drawn(self) -> MeshTri:
        """The mesh as the file has it, in metres, its rim named; its corners where sides are straight or parts turn.

        Raises
        ------
        ValueError
            If the file is damaged, or has something else of the name of the rim.
        OSError
            If it cannot be read.
        """
        mesh = read_mesh(self.mesh, scale=self.scale)
        check_kind(mesh, bent=True, space=True)
        _check_turn(mesh, self.turn)
        mesh = corners_of(mesh) if self.turn or self.stated.order == 1 else mesh
        return _with_rim(mesh, self.rim) if self.rim else mesh

    @property
    def labelled_outputs(self) -> dict[str, Quantity]:
        """The outputs by name and unit, as ``pull (N/m)``: totals are per metre unless there is a depth or an axis."""
        potential = "Wb/m" if isinstance(self.problem, Magnetostatics) else "A"
        return {
            f"{name} ({(each.unit or potential) if each.local else self._as_total(each.unit)})": each
            for name, each in self.outputs.items()
        }

    @property
    def energy_unit(self) -> str:
        """Of squared indicators, whatever the depth."""
        return "J/m" if isinstance(self.problem, Magnetostatics) and not self.problem.axisymmetric else "J"

    def _as_total(self, unit: str) -> str:
        problem = self.problem
        flat = isinstance(problem, Magnetostatics) and not problem.axisymmetric and problem.depth is None
        return f"{unit}/m" if flat else unit

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
        if not isinstance(self.problem, Magnetostatics):
            return {**self.adapt, "pinned": self.pins(mesh)}
        curves = dict(self.adapt.get("curves") or {})
        taken = np.concatenate([[], *(np.asarray((mesh.boundaries or {}).get(name, [])) for name in curves)])
        told = dict[str, Arc | Line | Spline]()
        for each in self.outputs.values():
            told |= bores(mesh, each.bodies, each.centre) if each.centre is not None else {}
        paired = {name for pair in self.adapt.get("periodic", self.problem.pairs) for name in pair[:2]}
        shown = {} if self.turn or is_second_order(mesh) else shown_curves(self.mesh, mesh, self.scale)
        for name, curve in (shown | told).items():
            facets = np.asarray(mesh.boundaries[name])
            if name not in paired and not np.isin(facets, taken).any():
                curves[name], taken = curve, np.append(taken, facets)
        return {**self.adapt, "pinned": self.pins(mesh)} | ({"curves": curves} if curves else {})


def _check_turn(mesh: Mesh, turn: dict[str, float]) -> None:
    if type(mesh) is TETRAHEDRON.mesh and turn:
        raise ValueError("turn is for meshes of the plane; draw what turns at its angle.")


def in_space(stated: Magnetostatics) -> MagneticScalarPotential:
    """What a case that could be one of the plane says of tetrahedra; refused is what it says of the plane alone."""
    plain = Magnetostatics(stated.materials, stated.potential or {"": 0.0}, estimator=stated.estimator)
    shared = ("materials", "potential", "estimator", "goal")
    alone = [each.name for each in fields(stated) if each.name not in shared and not _same(each.name, stated, plain)]
    if alone:
        raise ValueError(f"{', '.join(alone)}: for meshes of the plane only, and the mesh is one of tetrahedra.")
    return MagneticScalarPotential(**{name: getattr(stated, name) for name in shared})


def _same(name: str, one: Magnetostatics, other: Magnetostatics) -> bool:
    """Whether an argument is as nobody asked for, of the order by its kind: `Chosen`, or 1, as it is in space."""
    given, default = getattr(one, name), getattr(other, name)
    return bool(given == default and type(given) is type(default)) or (name == "order" and given == 1)


def _with_rim(mesh: MeshTri, name: str) -> MeshTri:
    """The mesh with a name for its whole rim, holes included, unless it has that already."""
    rim, known = mesh.boundary_facets(), (mesh.boundaries or {}).get(name)
    if known is not None and np.array_equal(np.sort(np.asarray(known)), rim):
        return mesh  # as in a mesh that a run has written
    if known is not None or name in (mesh.subdomains or {}):
        raise ValueError(
            f"rim must be a name that the mesh has not, for the whole of its rim; it has another {name!r}. Choose "
            "another name, or leave rim out."
        )
    return mesh.with_boundaries({name: rim})
