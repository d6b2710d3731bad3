"""Checked arguments of magnetostatic problems, and their meaning on a mesh."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, TypeVar

import numpy as np
from skfem import MeshTet, MeshTri
from skfem.mesh import MeshTet1, MeshTet2

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import checked_mapping, is_number, listed, nearest_name
from kohonen_adapt.geometry.plane.curves import Arc, Curves
from kohonen_adapt.geometry.rules import checked_pair
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.coils.placement import check_placement, checked_coils
from kohonen_adapt.magnetostatics.equations.applied_field import Drive, permeable
from kohonen_adapt.magnetostatics.equations.conditions import Conditions, Value, conditions_of, fixed_values
from kohonen_adapt.magnetostatics.equations.energy import PlaneEnergy
from kohonen_adapt.magnetostatics.equations.given_field import (
    AppliedField,
    Sources,
    checked_field,
    field_at,
)
from kohonen_adapt.magnetostatics.equations.newton import Newton, Steps, refuse_unconverged
from kohonen_adapt.magnetostatics.equations.symmetry import (
    AXISYMMETRIC,
    PLANAR,
    Mirror,
    checked_symmetry,
    mirror_of,
    surface,
)
from kohonen_adapt.magnetostatics.equations.system import IN_SPACE
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients, coefficients
from kohonen_adapt.magnetostatics.materials.material import Material, check_materials
from kohonen_adapt.magnetostatics.quantities.bodies import bores
from kohonen_adapt.magnetostatics.quantities.goals import Goal, Torque, check_goal
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.mesh.blended import exact_area
from kohonen_adapt.mesh.cells import TETRAHEDRON, remedy_for
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.elements.functions import EQUIDISTANT
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, magnitude
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.names import connected_components_of
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.problem.protocol import AutoOrder

__all__ = ["Arguments", "ArgumentsInSpace", "check_plane_mesh", "checked_choices", "checked_order", "solved"]

ORDERS = range(1, 9)
ESTIMATORS = ("residual", "recovery", "equilibrated")  # see `estimation.energy_indicators`
ASYMMETRY = 0.01  # allowed asymmetric part of the applied field on a plane, relative to the largest

SolidKind = TypeVar("SolidKind", bound=SolidField)


@dataclass(frozen=True, eq=False)
class Arguments:
    """Checked arguments of `Magnetostatics`, where each is documented.

    Mappings are copied. `energy_on` is the functional of the problem on a mesh.
    """

    method: ClassVar[Newton] = Newton()  # subclasses may override

    materials: Mapping[str, Material]
    potential: Mapping[str, Value] | None = None
    estimator: str = "residual"
    ampere_turns: Mapping[str, float] | None = None
    depth: float | None = None
    axisymmetric: bool = False
    open_boundary: str | None = None
    periodic: Sequence[Pair] = ()
    antiperiodic: Sequence[Pair] = ()
    order: int = AutoOrder(2)  # `dataclasses.replace` with another estimator chooses again
    goal: Goal | None = None
    applied_field: tuple[float, float] = (0.0, 0.0)
    points: Mapping[str, tuple[float, float] | Floats] | None = None
    curved: bool = True
    sides: Curves | None = None

    def __post_init__(self) -> None:
        order = checked_choices(self, 2, ORDERS, ESTIMATORS)
        check_materials(self.materials, 2)
        self._check_fixed()
        self._check_depth()
        self._check_sides()
        self._check_bound()
        # Copies, so that later changes by the caller do not alter a solved problem.
        checked = {
            "order": order,
            "applied_field": self._checked_field(),
            "materials": dict(self.materials),
            "potential": dict(self.potential or {}),
            "ampere_turns": _checked_turns(self.ampere_turns, self.materials),
            "points": _checked_points(self.points),
            "periodic": _checked_pairs("periodic", self.periodic),
            "antiperiodic": _checked_pairs("antiperiodic", self.antiperiodic),
        }
        vars(self).update(checked)

    @property
    def per_metre(self) -> bool:
        return self.depth is None and not self.axisymmetric

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Names of matching boundaries, periodic pairs before antiperiodic ones.

        A pair with a third entry names the motion between its boundaries.
        """
        return (*self.periodic, *self.antiperiodic)

    def conditions_of(self, field: Any, elements: Space | None = None) -> Conditions:
        """Return the conditions of a solved problem, also for other elements."""
        return conditions_of(elements or field.elements, self, field.symmetry, anchored=True)

    def energy_on(self, mesh: MeshTri, order: int | None = None) -> PlaneEnergy:
        order = checked_order(self.order if order is None else order)
        check_plane_mesh(mesh, curved=order > 1)
        symmetry = AXISYMMETRIC if self.axisymmetric else PLANAR
        sides = {name: curve.project for name, curve in (self.sides or {}).items()}
        size = partial(exact_area, sides=sides) if order > EQUIDISTANT else area
        material = coefficients(mesh, self.materials, self.ampere_turns, size)
        elements = Space(mesh, order, material.nonlinear, self.axisymmetric, sides)
        return PlaneEnergy.of(elements, symmetry, material, conditions_of(elements, self, symmetry))

    def curves(self, mesh: MeshTri) -> dict[str, Arc]:
        """Return the arcs on which a rotating body ends, if its torque is the goal.

        Parameters
        ----------
        mesh
            The mesh of the problem.

        Returns
        -------
        dict
            Boundary name to `Arc`, for arcs with too few nodes to be recognised as such. `kohonen_adapt.adapt` reads
            them.

        Raises
        ------
        ValueError
            If the mesh lacks the body.
        """
        arcs = bores(mesh, self.goal.body, self.goal.centre) if isinstance(self.goal, Torque) else {}
        paired = {name for pair in self.pairs for name in pair[:2]}
        return {name: arc for name, arc in arcs.items() if name not in paired}

    def _check_fixed(self) -> None:
        fixed_otherwise = self.open_boundary is not None or self.antiperiodic or self.axisymmetric
        has_potential = isinstance(self.potential, Mapping) and len(self.potential) > 0
        if not has_potential and not (fixed_otherwise and self.potential in (None, {})):
            raise ValueError(
                "potential must fix A on at least one boundary, for instance {'outer': 0.0}: "
                f"otherwise A is known only up to a constant; got {self.potential!r}."
            )

    def _check_sides(self) -> None:
        expected = "sides must map boundary names to curves with a method project"
        curves = checked_mapping(self.sides, expected).values()
        if not all(callable(getattr(curve, "project", None)) for curve in curves):
            raise ValueError(f"{expected}; got {self.sides!r}.")

    def _check_depth(self) -> None:
        if self.depth is None:
            return
        if self.axisymmetric:
            raise ValueError(f"an axisymmetric problem has no depth, its results are totals; got depth {self.depth!r}.")
        if not is_number(self.depth) or not 0.0 < self.depth < np.inf:
            raise ValueError(f"depth must be a finite number > 0 in metres, or None; got {self.depth!r}.")

    def _check_bound(self) -> None:
        unsupported = {
            "an axis": self.axisymmetric,
            "an open boundary": self.open_boundary is not None,
            "periodic sides": bool(self.periodic),
            "antiperiodic sides": bool(self.antiperiodic),
            "points": bool(self.points),
        }
        has = [name for name, present in unsupported.items() if present]
        if self.estimator == "equilibrated" and has:
            raise ValueError(
                f"estimator 'equilibrated' bounds the error of planar problems with potentials and natural conditions; "
                f"this one has {' and '.join(has)}: use 'residual' or 'recovery'."
            )

    def _checked_field(self) -> tuple[float, float]:
        value = self.applied_field
        if np.shape(value) != (2,) or not all(is_number(component) and np.isfinite(component) for component in value):
            raise ValueError(f"applied_field must be two finite numbers (H_x, H_y) in A/m; got {value!r}.")
        x, y = (float(component) for component in value)
        if self.axisymmetric and x != 0.0:
            raise ValueError(
                f"applied_field must be along the axis of an axisymmetric problem, (0, H_z); got {value!r}."
            )
        if self.open_boundary is None and (x, y) != (0.0, 0.0):
            raise ValueError(
                "applied_field requires an open_boundary; on another boundary prescribe its potential instead, "
                "mu0 (H_x y - H_y x), around an axis mu0 H_z r / 2."
            )
        return x, y


def checked_choices(problem: Any, dim: int, orders: range, estimators: Sequence[str]) -> int:
    """Check estimator, order and goal of a problem, and return the order."""
    estimator, order = problem.estimator, problem.order
    if estimator not in estimators:
        raise ValueError(f"estimator must be one of {', '.join(map(repr, estimators))}; got {estimator!r}.")
    if isinstance(order, AutoOrder) or str(order) == "auto":
        # Least time to an error: python -m benchmarks goal-orders, in space forces-in-space
        order = AutoOrder(2 if estimator == "residual" else 1)
    checked_order(order, orders, ", or 'auto'")
    if not isinstance(problem.curved, bool):
        raise ValueError(f"curved must be True or False; got {problem.curved!r}.")
    if order > 1 and estimator != "residual":
        raise ValueError(
            f"elements of order {order} have the estimator 'residual' only; got {estimator!r}. "
            "Set order=1 for other estimators."
        )
    if problem.goal is not None:
        check_goal(problem.goal, dim, estimator)
    return order


def checked_order(order: int, orders: range = ORDERS, alternative: str = "") -> int:
    if order not in orders or isinstance(order, bool):
        raise ValueError(
            f"order of the elements must be a whole number from 1 to {orders[-1]}{alternative}; got {order!r}."
        )
    return order


def check_plane_mesh(mesh: Any, curved: bool) -> None:
    try:
        check_mesh(mesh, curved=curved, space=False)
    except ValueError as error:
        if isinstance(mesh, TETRAHEDRON.mesh):
            raise ValueError(f"{error} Tetrahedra are for MagneticScalarPotential.") from None
        raise


def _checked_turns(value: Any, materials: Mapping[str, Material]) -> dict[str, float]:
    turns = checked_mapping(value, "ampere_turns must map subdomain names to amperes")
    for name, total in turns.items():
        if name not in materials:
            raise ValueError(
                f"ampere_turns has {name!r}, which is not among the materials: {listed(materials)}."
                f"{nearest_name(name, materials)}"
            )
        if not is_number(total) or not np.isfinite(total):
            raise ValueError(f"ampere_turns of {name!r} must be a finite number in A; got {total!r}.")
        if materials[name].current_density != 0.0:
            raise ValueError(
                f"the coil {name!r} has ampere_turns or a current density; got both, "
                f"{materials[name].current_density:g} A/m^2 of its material."
            )
    return {name: float(total) for name, total in turns.items()}


def _checked_pairs(name: str, value: Any) -> tuple[Pair, ...]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"{name} must hold pairs of names of boundaries, as [('left', 'right')]; got {value!r}.")
    checked = (checked_pair(pair, name) for pair in value)
    return tuple((first, second) if motion is None else (first, second, motion) for first, second, motion in checked)


def _checked_points(value: Any) -> dict[str, Floats]:
    given = checked_mapping(value, "points must map names to positions (x, y) in metres")
    points = {name: np.array(point) for name, point in given.items()}
    for name, point in points.items():
        if point.dtype.kind not in "iuf" or point.shape[:1] != (2,) or point.ndim > 2 or not np.isfinite(point).all():
            raise ValueError(
                f"points[{name!r}] must be a position (x, y) in metres, or several (2, n); got {point.tolist()!r}."
            )
    return {name: point.reshape(2, -1).astype(float) for name, point in points.items()}


@dataclass(frozen=True, eq=False)
class ArgumentsInSpace:
    materials: Mapping[str, Material]
    potential: Mapping[str, Value] | None = None
    applied_field: Any = None
    symmetry: Mapping[str, str] | None = None
    coils: Mapping[str, Coil] | None = field(default=None, kw_only=True)
    method: ClassVar[Newton] = Newton(solver=IN_SPACE)  # subclasses may override

    def __post_init__(self) -> None:
        check_materials(self.materials, 3)
        for name, material in self.materials.items():
            if material.current_density != 0.0:
                raise ValueError(
                    f"{name!r} has a current density, {material.current_density:g} A/m^2, which has no direction in "
                    "space: give the current as a Coil in coils, or its field as applied_field."
                )
        checked_field(self.applied_field)
        # Copies, so that later changes by the caller do not alter a solved problem.
        checked = {
            "materials": dict(self.materials),
            "potential": checked_mapping(self.potential, "potential must map names of boundaries to phi in A"),
            "symmetry": checked_symmetry(self.symmetry),
            "coils": checked_coils(self.coils),
        }
        vars(self).update(checked)

    @property
    def free_field(self) -> AppliedField | None:
        applied = checked_field(self.applied_field)
        return Sources(self.coils, applied) if self.coils else applied

    def given_on(self, mesh: MeshTet, order: int = 1) -> tuple[Coefficients, dict[str, Mirror]]:
        kinds = (MeshTet1, MeshTet2)[:order]
        if type(mesh) not in kinds:
            plane = " Plane meshes are for Magnetostatics." if len(getattr(mesh, "p", ())) == 2 else ""
            wanted, found = " or ".join(kind.__name__.removesuffix("1") for kind in kinds), type(mesh).__name__
            straight = f" Set order=2 for curved edges, or k{remedy_for(mesh, True)[1:]}" * (found == "MeshTet2")
            raise ValueError(f"mesh must be a skfem.{wanted}; got {found}.{plane}{straight}")
        check_mesh(mesh)
        mesh = corners_of(mesh)
        number_facets(mesh)
        planes = {name: mirror_of(mesh, name, kind) for name, kind in (self.symmetry or {}).items()}
        material = coefficients(mesh, self.materials)
        if self.coils:
            check_placement(mesh, permeable(material) | material.coercivity.any(axis=0), self.coils, planes)
        return material, planes

    def conditions(self, drive: Drive, mirrors: Mapping[str, Mirror]) -> Conditions:
        """Return the conditions on u, the reduced potential, in iron the total one.

        A connected part without a given value has a first node that is neither fixed nor free, because u is determined
        there up to a constant only.
        """
        elements, potential = drive.elements, self.potential or {}
        mesh = elements.corners
        for name in potential:
            surface(mesh, name, "potential")
        fixed, values = fixed_values(elements, potential, {})
        for name, mirror in mirrors.items():
            _check_field(drive, name, mirror)
            if mirror.kind == "normal":
                rows = np.unique(elements.on_facets(mirror.facets))
                fixed[rows], values[rows] = True, 0.0
        part = connected_components_of(mesh.nvertices, np.hstack([mesh.t[k : k + 2] for k in range(3)]).T)
        number, first = np.unique(part, return_index=True)
        held = fixed.copy()
        held[first[~np.isin(number, part[fixed[: part.size]])]] = True
        return Conditions(fixed, np.where(held, values + drive.potential, 0.0), np.flatnonzero(~held))

    def conditions_of(self, field: SolidField) -> Conditions:
        if "conditions" not in field.kept:
            field.kept["conditions"] = self.conditions(field.drive, field.planes)
        return field.kept["conditions"]


def solved(start: SolidKind, unknown: Floats, steps: Steps = ()) -> SolidKind:
    result = replace(start, unknown=unknown, newton=steps)
    refuse_unconverged(result)
    return result


def _check_field(drive: Drive, name: str, mirror: Mirror) -> None:
    if drive.function is None:
        return
    mesh = drive.elements.corners
    field = field_at(drive.function, mesh.p[:, np.unique(mesh.facets[:, mirror.facets])])
    across = np.outer(mirror.normal, mirror.normal @ field)
    wrong = magnitude(across if mirror.kind == "parallel" else field - across).max()
    if wrong > ASYMMETRY * magnitude(field).max():
        direction = "across" if mirror.kind == "parallel" else "along"
        raise ValueError(
            f"the flux is {mirror.kind} to the plane of symmetry {name!r}, but the applied_field has up to "
            f"{wrong:.3g} A/m {direction} it. Give the field of the whole coils, images included, or another symmetry."
        )
