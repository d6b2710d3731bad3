"""Flux linkage, current and inductances of a circuit."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import is_number
from kohonen_adapt.magnetostatics.quantities.bodies import Names, elements_in
from kohonen_adapt.magnetostatics.quantities.local_field import LocalField
from kohonen_adapt.mesh.measures import area

__all__ = [
    "apparent_inductance",
    "checked_circuit",
    "checked_turns",
    "circuit_current",
    "coil_linkage",
    "energy_inductance",
    "turn_length",
    "turns_density",
]

EQUAL = 0.05  # allowed deviation of the currents of sides from their mean; meshed areas are polygons


def coil_linkage(field: LocalField, coil: Names, turns: float) -> float:
    inside, count = elements_in(field.mesh, coil), checked_turns(coil, turns)
    size = area(field.mesh)[inside]
    # A is constant along a turn, of length 2 pi r or the depth.
    return count * turn_length(field) * float(np.sum(size * field.mean_unknown[inside]) / np.sum(size))


def turns_density(field: LocalField, circuit: Mapping[str, float]) -> Floats:
    """Return the turns per area of a circuit, shape (nelements,) in 1/m^2.

    `turn_length` times this density is the w whose ``int w field.unknown`` over the plane is the linkage.
    """
    density, size = np.zeros(field.mesh.t.shape[1]), area(field.mesh)
    for name, turns in circuit.items():
        inside = elements_in(field.mesh, name)
        density[inside] += turns / np.sum(size[inside])
    return density


def checked_circuit(circuit: Any) -> dict[str, float]:
    if not isinstance(circuit, Mapping) or not circuit:
        raise ValueError(f"circuit must map subdomains to turns, for instance {{'coil': 100}}; got {circuit!r}.")
    return {name: checked_turns(name, turns) for name, turns in circuit.items()}


def circuit_current(field: LocalField, circuit: Mapping[str, float]) -> float:
    """Return the current in the conductor of a circuit.

    Parameters
    ----------
    field
        A field.
    circuit
        Subdomain to turns for every side of a coil, negative for return sides: ``{"go": 100, "return": -100}``.

    Returns
    -------
    float
        In A: the total current of a side divided by its turns, averaged over the sides.

    Raises
    ------
    ValueError
        If a side has no turns or no current, or its current differs from the mean by more than 5 %, and for fields on
        tetrahedra.
    """
    if len(field.mesh.p) != 2:
        raise ValueError(
            "circuits are sides of coils on meshes of triangles. In space give the coil in coils and use "
            "field.flux_linkage(name, turns) or field.inductance(name, turns)."
        )
    total = area(field.mesh) * field.current_density
    sides = checked_circuit(circuit).items()
    currents = {name: float(np.sum(total[elements_in(field.mesh, name)])) / turns for name, turns in sides}
    values = np.array(list(currents.values()))
    mean = float(values.mean())
    if np.any(np.abs(values - mean) > EQUAL * abs(mean)) or mean == 0.0:
        found = ", ".join(f"{name!r} {value:.6g} A" for name, value in currents.items())
        raise ValueError(
            f"the sides of a circuit must carry one current; got {found}. Check the signs: turns are negative for "
            "return sides."
        )
    return mean


def apparent_inductance(field: LocalField, circuit: Mapping[str, float]) -> float:
    """Return the flux linkage of a circuit divided by its current.

    For linear material without magnets and other currents this is the inductance. Magnets and other circuits add flux
    to the linkage, and the result is then no inductance.

    Parameters
    ----------
    field, circuit
        As in `circuit_current`.

    Returns
    -------
    float
        In H per metre of depth; with `depth`, and axisymmetric, in H.

    Raises
    ------
    ValueError
        As in `circuit_current`.

    Examples
    --------
    >>> import skfem
    >>> import kohonen_adapt.magnetostatics as km
    >>> mesh = skfem.MeshTri().refined(4).with_defaults()
    >>> mesh = mesh.with_subdomains({"coil": lambda x: x[0] < 0.5, "air": lambda x: x[0] > 0.5})
    >>> materials = {"coil": km.Material(current_density=1e3), "air": km.Material()}
    >>> field = km.Magnetostatics(materials, potential={"left": 0.0, "right": 0.0}).solve(mesh)
    >>> round(km.circuit_current(field, {"coil": 10}), 6)  # 500 A in ten turns
    50.0
    >>> inductance = km.apparent_inductance(field, {"coil": 10})  # in H/m
    >>> abs(inductance / km.energy_inductance(field, {"coil": 10}) - 1.0) < 1e-9
    True
    """
    current = circuit_current(field, circuit)
    return sum(coil_linkage(field, name, turns) for name, turns in circuit.items()) / current


def energy_inductance(field: LocalField, circuit: Mapping[str, float]) -> float:
    """Return ``2 W / I^2`` of a circuit, with the stored energy W of the whole field.

    Requires linear material without magnets and without current in other circuits. With A = 0 on the boundary the
    result equals `apparent_inductance` up to rounding.

    Parameters
    ----------
    field, circuit
        As in `circuit_current`.

    Returns
    -------
    float
        As in `apparent_inductance`, whose example compares both.

    Raises
    ------
    ValueError
        As in `circuit_current`.
    """
    return 2.0 * field.energy / circuit_current(field, circuit) ** 2


def turn_length(field: LocalField) -> float:
    """Return the length of a turn in m, divided by r around an axis."""
    return 2.0 * np.pi if field.axisymmetric else 1.0 if field.depth is None else field.depth


def checked_turns(coil: Names, turns: Any) -> float:
    if not (is_number(turns) and np.isfinite(turns) and turns != 0):
        raise ValueError(f"turns of {coil!r} must be a finite number other than 0; got {turns!r}.")
    return float(turns)
