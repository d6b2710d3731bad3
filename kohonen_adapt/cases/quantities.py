"""The outputs of a case: forces, torques, flux linkages and energies by name, as functions of the field."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from kohonen_adapt.cases.kinds import Kind, checked, choice, labels, number, table, vector
from kohonen_adapt.magnetostatics import Field

__all__ = ["Quantity", "quantity"]


@dataclass(frozen=True)
class Quantity:
    """A function of a field, the unit of a total of it, and the subdomains that it asks for."""

    function: Callable[[Field], float]
    unit: str
    bodies: tuple[str, ...] = ()

    def __call__(self, field: Field) -> float:
        """Its value."""
        return float(self.function(field))


def _force(body: list[str], component: str) -> Quantity:
    return Quantity(lambda field: field.force(body)["xy".index(component)], "N", tuple(body))


def _torque(body: list[str], centre: tuple[float, float] = (0.0, 0.0)) -> Quantity:
    return Quantity(lambda field: field.torque(body, centre), "N m", tuple(body))


def _flux_linkage(coil: list[str], turns: float = 1.0) -> Quantity:
    return Quantity(lambda field: field.flux_linkage(coil, turns), "Wb", tuple(coil))


def _energy() -> Quantity:
    return Quantity(lambda field: field.energy, "J")


def _coenergy() -> Quantity:
    return Quantity(lambda field: field.coenergy, "J")


QUANTITIES: dict[str, tuple[Callable[..., Quantity], dict[str, Kind], tuple[str, ...]]] = {
    "force": (_force, {"body": labels, "component": choice("x", "y")}, ("body", "component")),
    "torque": (_torque, {"body": labels, "centre": vector}, ("body",)),
    "flux_linkage": (_flux_linkage, {"coil": labels, "turns": number()}, ("coil",)),
    "energy": (_energy, {}, ()),
    "coenergy": (_coenergy, {}, ()),
}
"""Name of a quantity to what makes it, what its arguments may be, and which must be there."""


def quantity(given: Any, place: str) -> Quantity:
    """What a table under ``outputs`` may hold.

    Raises
    ------
    ValueError
        If the quantity is not known, or an argument of it is not, is missing or wrong.
    """
    entries = table(given, place)
    name = choice(*QUANTITIES)(entries.pop("quantity", None), f"{place}.quantity")
    make, kinds, required = QUANTITIES[name]
    return make(**checked(entries, kinds, place, required))
