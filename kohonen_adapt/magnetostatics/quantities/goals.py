"""State goals, single numbers of a field, with the derivatives by which meshes are adapted to them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.quantities.bodies import Names, elements_in
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.forces import (
    Component,
    checked_point,
    component_change,
    component_value,
    force_component,
    torque_component,
)
from kohonen_adapt.magnetostatics.quantities.linkage import checked_circuit, coil_linkage, turn_length, turns_density

__all__ = ["FluxLinkage", "Force", "Goal", "StoredEnergy", "Torque"]


@runtime_checkable
class Goal(Protocol):
    """A number J of a field, and how it changes with the field: for `Magnetostatics(goal=)`.

    A change w of ``field.unknown`` (planar of A, axisymmetric of r A) changes J by
    ``int source w + flux . grad w`` over the plane of the mesh.
    """

    def __call__(self, field: Field) -> float:
        """J of a field; `Magnetostatics.goal_error` asks for that of a `QuadraticField`, too."""

    def derivative(self, field: Field) -> tuple[Floats, Floats]:
        """`source` (nelements,) and `flux` (2, nelements) at a field, constant in every element.

        Around an axis, where B is not, the flux may be at the quadrature points, (2, npoints) as `Field.at_quadrature`.
        """


class _ComponentGoal:
    """A component of a force or torque as a goal."""

    _component: Callable[[Field], Component]

    def __call__(self, field: Field) -> float:
        """In N/m, of a torque in N m/m; with `depth`, and axisymmetric, in N or N m."""
        return component_value(field, self._component(field))

    def derivative(self, field: Field) -> tuple[Floats, Floats]:
        """See `Goal`."""
        return _of_flux_density(field, component_change(field, self._component(field)))


@dataclass(frozen=True)
class Force(_ComponentGoal):
    """Component of `Field.force` along a direction.

    Parameters
    ----------
    body
        As of `Field.force`.
    direction : (2,)
        Of any length but 0.

    Raises
    ------
    ValueError
        For a direction that is none; at a field as `Field.force`, and where the force has no component along it: across
        a mirror plane that cuts the body, and across an axis.

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
    direction: tuple[float, float]

    def __post_init__(self) -> None:
        along = checked_point("direction of Force", self.direction, "vector (x, y)")
        if not along.any():
            raise ValueError(f"direction of Force must not be zero; got {self.direction!r}.")
        object.__setattr__(self, "direction", tuple((along / np.hypot(*along)).tolist()))

    def _component(self, field: Field) -> Component:
        component = force_component(field, self.body, np.array(self.direction))
        if not component.arm.any():
            raise ValueError(
                f"the force on {self.body!r} has no component along {self.direction}: an axisymmetric one is along z, "
                "that on a body cut by a mirror plane along the plane. Give another direction."
            )
        return component


@dataclass(frozen=True)
class Torque(_ComponentGoal):
    """`Field.torque` on a body about a centre.

    Parameters
    ----------
    body, centre
        As of `Field.torque`.

    Raises
    ------
    ValueError
        For a centre that is none; at a field as `Field.torque`.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import Torque
    >>> goal = Torque("coil", centre=(0.5, 0.5))  # for `Magnetostatics(goal=)`, as in `Force`
    """

    body: Names
    centre: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", tuple(checked_point("centre of Torque", self.centre).tolist()))

    def _component(self, field: Field) -> Component:
        return torque_component(field, self.body, self.centre)


@dataclass(frozen=True)
class FluxLinkage:
    """Flux linkage of a circuit, the sum of `Field.flux_linkage` over its sides.

    Parameters
    ----------
    circuit
        Subdomain to turns for every side of a coil, negative where the conductor comes back.

    Raises
    ------
    ValueError
        If it is no such mapping; at a field as `Field.flux_linkage`.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import FluxLinkage
    >>> goal = FluxLinkage({"coil": 100, "return": -100})  # for `Magnetostatics(goal=)`, as in `Force`
    """

    circuit: Mapping[str, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "circuit", checked_circuit(self.circuit))

    def __call__(self, field: Field) -> float:
        """In Wb/m; with `depth`, and axisymmetric, in Wb."""
        return sum(coil_linkage(field, name, turns) for name, turns in self.circuit.items())

    def derivative(self, field: Field) -> tuple[Floats, Floats]:
        """See `Goal`."""
        source = turn_length(field) * turns_density(field, self.circuit)
        return source, np.zeros_like(field.elements.points)


@dataclass(frozen=True)
class StoredEnergy:
    """Energy stored in a part of the mesh since the remanent state, ``int of H . dB``.

    Parameters
    ----------
    part
        Name of a subdomain, or a sequence of names. Not the whole mesh: of its energy the error is what the indicators
        of a problem without a goal tell, and in the derivative, where the field is balanced, there is nothing of it.

    Raises
    ------
    ValueError
        At a field that lacks the names; for the derivative of the energy of all.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import StoredEnergy
    >>> goal = StoredEnergy("coil")  # for `Magnetostatics(goal=)`, as in `Force`
    """

    part: Names

    def __call__(self, field: Field) -> float:
        """In J/m; with `depth`, and axisymmetric, in J."""
        return float(np.sum((field.volume * field.energy_density)[elements_in(field.mesh, self.part)]))

    def derivative(self, field: Field) -> tuple[Floats, Floats]:
        """See `Goal`."""
        inside = elements_in(field.mesh, self.part)
        if inside.all():
            raise ValueError(
                f"StoredEnergy needs a part of the mesh; {self.part!r} is all of it. For the energy of all leave the "
                "goal out: what a problem has then are indicators of that."
            )
        at = field.at_quadrature
        return _of_flux_density(field, np.where(inside[at.element], at.field_strength, 0.0))


def _of_flux_density(field: Field, weight: Floats) -> tuple[Floats, Floats]:
    """The derivative of a goal that changes by ``int weight . dB`` over the volume, (2, npoints) in A/m."""
    total = weight * (1.0 if field.depth is None else field.depth)
    return np.zeros(field.mesh.t.shape[1]), field.symmetry.flux(total)
