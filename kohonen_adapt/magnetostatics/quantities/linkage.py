"""Flux linkage of coils and circuits in the plane."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import is_number
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.mesh.names import Names, elements_in

__all__ = [
    "Circuit",
    "checked_circuit",
    "checked_turns",
    "turn_length",
    "turns_density",
]


Circuit = Mapping[str, float]


def turns_density(field: MagneticField, circuit: Circuit) -> Floats:
    """Return the turns per area of a circuit, shape (nelements,) in 1/m^2.

    `turn_length` times this density is the w whose ``int w field.unknown`` over the plane is the linkage.
    """
    density, size = np.zeros(field.mesh.nelements), field.elements.volumes
    for name, turns in circuit.items():
        inside = elements_in(field.mesh, name)
        density[inside] += turns / np.sum(size[inside])
    return density


def checked_circuit(circuit: Any) -> dict[str, float]:
    if not isinstance(circuit, Mapping) or not circuit:
        raise ValueError(f"circuit must map subdomains to turns, for instance {{'coil': 100}}; got {circuit!r}.")
    return {name: checked_turns(name, turns) for name, turns in circuit.items()}


def turn_length(field: MagneticField) -> float:
    """Return the length of a turn in m, divided by r around an axis."""
    return 2.0 * np.pi if field.axisymmetric else field.depth_factor


def checked_turns(coil: Names, turns: Any) -> float:
    if not (is_number(turns) and np.isfinite(turns) and turns != 0):
        raise ValueError(f"turns of {coil!r} must be a finite number other than 0; got {turns!r}.")
    return float(turns)
