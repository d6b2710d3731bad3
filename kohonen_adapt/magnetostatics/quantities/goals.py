"""Goals of mesh adaptation."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.quantities.bodies import Names, elements_in
from kohonen_adapt.magnetostatics.quantities.coil_quantities import OfCoil
from kohonen_adapt.magnetostatics.quantities.forces import OUT_OF_PAGE, OfBody, checked_point, parts_along
from kohonen_adapt.magnetostatics.quantities.goal import POINT, SIZES, Goal, VectorGoal, unit_vector
from kohonen_adapt.magnetostatics.quantities.linkage import checked_circuit, turn_length, turns_density

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
    body: Any
    _along: Any  # vector of a force, or axis and centre of a torque
    _vanishing: Any  # message without a component

    def _place(self, field: Any) -> list[OfBody | OfCoil]:
        self.check_dimension(len(field.mesh.p))
        vector, centre = self._along
        parts = parts_along(field, self.body, np.array(vector), centre if centre is None else np.array(centre))
        if all(part.vanishes for part in parts):
            raise ValueError(self._vanishing)
        return parts

    def __call__(self, field: Any) -> float:
        """Return the component in N/m, of a torque in N m/m.

        With `depth`, axisymmetric, and in space in N or N m.
        """
        return float(sum(part.value() for part in self._place(field)))

    def derivative(self, field: Any) -> tuple[Floats, Floats]:
        return np.zeros(field.mesh.t.shape[1]), np.sum([part.load() for part in self._place(field)], axis=0)


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

    @property
    def _along(self) -> tuple[tuple[float, ...], None]:
        return self.direction, None

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

    @property
    def _along(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return self.axis or OUT_OF_PAGE, self.centre

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
        weight = np.where(inside[field.elements.element], at.field_strength, 0.0)
        return np.zeros(inside.size), field.load_of(weight)
