"""Goals of mesh adaptation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.quantities import forces
from kohonen_adapt.magnetostatics.quantities.bodies import (
    Component,
    Names,
    component_change,
    component_value,
    elements_in,
)
from kohonen_adapt.magnetostatics.quantities.coil_quantities import OfCoil
from kohonen_adapt.magnetostatics.quantities.forces import checked_point
from kohonen_adapt.magnetostatics.quantities.goal import POINT, SIZES, Goal, VectorGoal, unit_vector
from kohonen_adapt.magnetostatics.quantities.linkage import checked_circuit, turn_length, turns_density
from kohonen_adapt.magnetostatics.quantities.solid_forces import OfBody, parts_along

__all__ = [
    "FluxLinkage",
    "Force",
    "StoredEnergy",
    "Torque",
    "check_goal",
    "check_goal_on",
    "unit_of_goal",
]


def check_goal(goal: Any, dim: int, estimator: str) -> None:
    if estimator != "residual":
        raise ValueError(f"a goal has its own indicators; omit the estimator, got {estimator!r}.")
    if isinstance(goal, type) or not isinstance(goal, Goal):
        raise ValueError(
            "goal must be a Force, Torque, FluxLinkage, StoredEnergy, FluxDensityAt or another object with goal(field) "
            f"and goal.derivative(field), or None; got {goal!r}."
        )
    if isinstance(goal, VectorGoal):
        goal.check_dimension(dim)


def unit_of_goal(goal: Goal | None, per_metre: bool) -> str:
    unit = str(getattr(goal, "unit", ""))
    return f"{unit}/m" if per_metre and isinstance(goal, Force | Torque | FluxLinkage | StoredEnergy) else unit


def check_goal_on(goal: Goal | None, field: Any) -> None:
    # before the solve
    if isinstance(goal, VectorGoal):
        goal.check_on(field)
    elif isinstance(goal, FluxLinkage):
        _ = [OfCoil(field, name) for name in goal.circuit]


class _ComponentGoal(VectorGoal):
    # in the plane, and in space of bodies and coils
    _component: Callable[[Any], Component]
    _parts: Callable[[Any], list[OfBody | OfCoil]]
    _vanishing: Any  # message without a component

    def __call__(self, field: Any) -> float:
        """Return the component in N/m, of a torque in N m/m.

        With `depth`, axisymmetric, and in space in N or N m.
        """
        self.check_on(field)
        if self.dimension == 3:
            return float(sum(part.value() for part in self._parts(field)))
        return component_value(field.point_volumes, self._component(field), field.at_quadrature.flux_density)

    def derivative(self, field: Any) -> tuple[Floats, Floats]:
        self.check_on(field)
        if self.dimension == 3:
            return np.zeros(field.mesh.t.shape[1]), np.sum([part.load() for part in self._parts(field)], axis=0)
        return _of_flux_density(field, component_change(self._component(field), field.at_quadrature.flux_density))

    def _check_place(self, field: Any) -> None:
        vanishes = (
            all(part.vanishes for part in self._parts(field))
            if self.dimension == 3
            else not self._component(field).arm.any()
        )
        if vanishes:
            raise ValueError(self._vanishing)


@dataclass(frozen=True)
class Force(_ComponentGoal):
    """Component of `Field.force`, or of `SolidField.force`, along a direction.

    Parameters
    ----------
    body
        As in `Field.force`.
    direction : (2,), in space (3,)
        Vector of any nonzero length.

    Raises
    ------
    ValueError
        For a direction that is zero or no vector. At a field as in `Field.force`, and if the force has no component
        along the direction: across a mirror plane that cuts the body, and across an axis.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.magnetostatics import Force, Magnetostatics, Material
    >>> def inside(x):
    ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
    >>> mesh = skfem.MeshTri().refined(4).with_defaults()
    >>> mesh = mesh.with_subdomains({"coil": inside, "air": lambda x: ~inside(x)})
    >>> materials = {"coil": Material(current_density=1e3), "air": Material()}
    >>> goal = Force("coil", (1.0, 0.0))
    >>> problem = Magnetostatics(materials, potential={"left": 0.0, "right": 1.0}, goal=goal)
    >>> problem.indicators(mesh, problem.solve(mesh)).shape  # of what the elements add to the goal's error
    (512,)
    """

    body: Names
    direction: tuple[float, ...]
    unit: ClassVar[str] = "N"
    vector: ClassVar[str] = "direction"

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", unit_vector("direction of Force", self.direction))

    def _component(self, field: Any) -> Component:
        return forces.force_component(field, self.body, np.array(self.direction))

    def _parts(self, field: Any) -> list[OfBody | OfCoil]:
        return parts_along(field, self.body, np.array(self.direction), None)

    @property
    def _vanishing(self) -> str:
        return (
            f"the force on {self.body!r} has no component along {self.direction}: an axisymmetric force is along "
            "z, and the force on a body cut by a mirror plane is along the plane. Give another direction."
        )


@dataclass(frozen=True)
class Torque(_ComponentGoal):
    """Torque on a body about a centre, in space its component along an axis.

    See `Field.torque` and `SolidField.torque`.

    Parameters
    ----------
    body, centre
        As in `Field.torque`, in space as in `SolidField.torque` with the centre (3,).
    axis : (3,)
        Direction of the component, of any nonzero length. In space only.

    Raises
    ------
    ValueError
        For an invalid centre or axis. At a field as in `Field.torque`, and if the torque has no component along the
        axis: along a plane of symmetry that cuts the body.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import Torque
    >>> goal = Torque("coil", centre=(0.5, 0.5))  # for `Magnetostatics(goal=)`, as in `Force`
    """

    body: Names
    centre: tuple[float, ...] = (0.0, 0.0)
    axis: tuple[float, ...] | None = None
    unit: ClassVar[str] = "N m"
    vector: ClassVar[str] = "centre"

    def __post_init__(self) -> None:
        centre = checked_point("centre of Torque", self.centre, POINT, SIZES)
        object.__setattr__(self, "centre", tuple(centre.tolist()))
        if (self.axis is None) != (len(self.centre) == 2):
            raise ValueError(
                "Torque takes a centre (x, y) in the plane, and in space a centre (x, y, z) and an axis (x, y, z); got "
                f"the centre {self.centre} and the axis {self.axis!r}."
            )
        if self.axis is not None:
            object.__setattr__(self, "axis", unit_vector("axis of Torque", self.axis))

    def _component(self, field: Any) -> Component:
        return forces.torque_component(field, self.body, self.centre)

    def _parts(self, field: Any) -> list[OfBody | OfCoil]:
        return parts_along(field, self.body, np.array(self.axis), np.array(self.centre))

    @property
    def _vanishing(self) -> str:
        return (
            f"the torque on {self.body!r} has no component along {self.axis}: the torque on a body cut by a plane of "
            "symmetry is normal to the plane. Give another axis."
        )


@dataclass(frozen=True)
class FluxLinkage(Goal):
    """Flux linkage of a circuit, the sum of `Field.flux_linkage` over its sides.

    In space the sum of `SolidField.flux_linkage` over coils.

    Parameters
    ----------
    circuit
        Subdomain to turns for every side of a coil, negative for return sides. In space coil to turns.

    Raises
    ------
    ValueError
        If `circuit` is no such mapping. At a field as in `Field.flux_linkage` or `SolidField.flux_linkage`.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import FluxLinkage
    >>> goal = FluxLinkage({"coil": 100, "return": -100})  # for `Magnetostatics(goal=)`, as in `Force`
    """

    circuit: Mapping[str, float]
    unit: ClassVar[str] = "Wb"

    def __post_init__(self) -> None:
        object.__setattr__(self, "circuit", checked_circuit(self.circuit))

    def __call__(self, field: Any) -> float:
        """Return the linkage in Wb/m, with `depth`, axisymmetric and in space in Wb."""
        return float(sum(field.flux_linkage(name, turns) for name, turns in self.circuit.items()))

    def derivative(self, field: Any) -> tuple[Floats, Floats]:
        if len(field.mesh.p) == 3:
            loads = [turns * OfCoil(field, name).load() for name, turns in self.circuit.items()]
            return np.zeros(field.mesh.t.shape[1]), np.sum(loads, axis=0)
        source = turn_length(field) * turns_density(field, self.circuit)
        return source, np.zeros_like(field.elements.points)


@dataclass(frozen=True)
class StoredEnergy(Goal):
    """Energy ``int H . dB`` stored in a part of the mesh since the remanent state.

    Parameters
    ----------
    part
        Name of a subdomain, or a sequence of names. Not the whole mesh: the indicators of a problem without a goal
        estimate the error of the whole energy.

    Raises
    ------
    ValueError
        At a field that lacks the names; for the derivative if the part is the whole mesh.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import StoredEnergy
    >>> goal = StoredEnergy("coil")  # for `Magnetostatics(goal=)`, as in `Force`
    """

    part: Names
    unit: ClassVar[str] = "J"

    def __call__(self, field: Any) -> float:
        """Return the energy in J/m.

        With `depth`, axisymmetric, and in space in J.
        """
        return float(np.sum((field.volume * field.energy_density)[elements_in(field.mesh, self.part)]))

    def derivative(self, field: Any) -> tuple[Floats, Floats]:
        inside = elements_in(field.mesh, self.part)
        if inside.all():
            raise ValueError(
                f"StoredEnergy needs a part of the mesh; {self.part!r} is all of it. For the whole energy omit the "
                "goal: the indicators then estimate its error."
            )
        at = field.at_quadrature
        return _of_flux_density(field, np.where(inside[field.elements.element], at.field_strength, 0.0))


def _of_flux_density(field: Any, weight: Floats) -> tuple[Floats, Floats]:
    """Return the derivative of a goal that changes by ``int weight . dB``.

    `weight` has shape (d, npoints), in A/m.
    """
    return np.zeros(field.mesh.t.shape[1]), field.load_of(weight)
