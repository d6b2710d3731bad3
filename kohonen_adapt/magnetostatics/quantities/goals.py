"""Goals of mesh adaptation, with their interface.

A further goal is a class with `Goal`'s two methods, as `flux_density_at.FluxDensityAt` is. Nothing else needs a change.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair
from kohonen_adapt.magnetostatics.quantities.coil_quantities import OfCoil
from kohonen_adapt.magnetostatics.quantities.forces import OUT_OF_PAGE, OfBody, checked_point, parts_along
from kohonen_adapt.magnetostatics.quantities.linkage import Circuit, checked_circuit, turn_length, turns_density
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.names import Names, elements_in

__all__ = [
    "POINT",
    "SIZES",
    "FluxLinkage",
    "Force",
    "Goal",
    "StoredEnergy",
    "Torque",
    "VectorGoal",
    "check_goal",
    "check_goal_on",
    "unit_vector",
]

VECTOR, POINT = "vector (x, y), in space (x, y, z)", "point (x, y), in space (x, y, z), in m"
SIZES = (2, 3)


@runtime_checkable
class Goal(Protocol):
    """Number J of a field with its derivative, for the argument `goal` of a problem.

    `Magnetostatics` and, in space, `MagneticScalarPotential` take goals. A change w of ``field.unknown`` (planar of A,
    axisymmetric of r A, in space of the scalar potential) changes J by ``int source w + flux . grad w`` over the plane
    of the mesh, or its volume.

    Tables, files and reports show values with the string ``unit`` of a goal, if the goal has one.
    """

    def __call__(self, field: Any) -> float:
        """Return J of a field.

        `Magnetostatics.goal_error` also evaluates J of fields of up to three orders more.
        """

    def derivative(self, field: Any) -> FloatsPair:
        """Return `source` (nelements,) and `flux` (d, nelements) at a field.

        Both are constant in every element. If B varies within elements (order 2 and 3, around an axis, and in space
        with an applied field or magnets that vary), the flux may be at the quadrature points of
        ``field.at_quadrature``, (d, npoints).
        """


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


def check_goal_on(goal: Goal | None, field: Any) -> None:
    # before the solve
    if isinstance(goal, VectorGoal | FluxLinkage):
        goal._place(field)


class VectorGoal(Goal):
    vector: ClassVar[str]  # name of an attribute with as many components as the field has dimensions

    @property
    def dimension(self) -> int:
        return len(getattr(self, self.vector))

    def check_dimension(self, dim: int) -> None:
        if self.dimension != dim:
            kind = "(x, y, z) in space" if dim == 3 else "(x, y) in the plane"
            raise ValueError(f"a {type(self).__name__} must have vectors {kind} as a goal; got {self}.")

    @abstractmethod
    def _place(self, field: Any) -> Any:
        """Return the data of the value at a field, or raise a ValueError."""


def unit_vector(name: str, value: tuple[float, ...]) -> tuple[float, ...]:
    along = checked_point(name, value, VECTOR, SIZES)
    if not along.any():
        raise ValueError(f"{name} must not be zero; got {value!r}.")
    return tuple((along / magnitude(along)).tolist())


class _ComponentGoal(VectorGoal):
    body: Any
    _along: Any  # vector of a force, or axis and centre of a torque
    _vanishing: Any  # message without a component

    def _place(self, field: Any) -> list[OfBody | OfCoil]:
        self.check_dimension(field.elements.dim)
        parts = parts_along(field, self.body, *self._along)
        if all(part.vanishes for part in parts):
            raise ValueError(self._vanishing)
        return parts

    def __call__(self, field: Any) -> float:
        """Return the component in N/m, of a torque in N m/m.

        With `depth`, axisymmetric, and in space in N or N m.
        """
        return float(sum(part.value() for part in self._place(field)))

    def derivative(self, field: Any) -> FloatsPair:
        return np.zeros_like(field.volume), np.sum([part.load() for part in self._place(field)], axis=0)


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
        vars(self)["direction"] = unit_vector("direction of Force", self.direction)

    @property
    def _along(self) -> tuple[Floats, None]:
        return np.array(self.direction), None

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
        vars(self)["centre"] = tuple(centre.tolist())
        if (self.axis is None) != (len(self.centre) == 2):
            raise ValueError(
                "Torque takes a centre (x, y) in the plane, and in space a centre (x, y, z) and an axis (x, y, z); got "
                f"the centre {self.centre} and the axis {self.axis!r}."
            )
        if self.axis is not None:
            vars(self)["axis"] = unit_vector("axis of Torque", self.axis)

    @property
    def _along(self) -> FloatsPair:
        return np.array(self.axis or OUT_OF_PAGE), np.array(self.centre)

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

    circuit: Circuit
    unit: ClassVar[str] = "Wb"

    def __post_init__(self) -> None:
        vars(self)["circuit"] = checked_circuit(self.circuit)

    def __call__(self, field: Any) -> float:
        """Return the linkage in Wb/m, with `depth`, axisymmetric and in space in Wb."""
        return float(sum(field.flux_linkage(name, turns) for name, turns in self.circuit.items()))

    def _place(self, field: Any) -> list[OfCoil]:
        return [OfCoil(field, name) for name in self.circuit]

    def derivative(self, field: Any) -> FloatsPair:
        if field.elements.dim == 2:
            return turn_length(field) * turns_density(field, self.circuit), np.zeros_like(field.elements.points)
        loads = [turns * coil.load() for turns, coil in zip(self.circuit.values(), self._place(field), strict=True)]
        return np.zeros_like(field.volume), np.sum(loads, axis=0)


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

    def derivative(self, field: Any) -> FloatsPair:
        inside = elements_in(field.mesh, self.part)
        if inside.all():
            raise ValueError(
                f"StoredEnergy needs a part of the mesh; {self.part!r} is all of it. For the whole energy omit the "
                "goal: the indicators then estimate its error."
            )
        weight = np.where(inside[field.elements.element], field.at_quadrature.field_strength, 0.0)
        return np.zeros_like(field.volume), field.load_of(weight)
