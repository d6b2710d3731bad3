"""The materials of a problem as values per element of a mesh."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.magnetostatics.material import Material

__all__ = ["Coefficients", "coefficients", "named"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Coefficients:
    """Reluctivity (nelements,), remanence (2, nelements) and current density (nelements,), in m/H, T and A/m^2."""

    reluctivity: Floats
    remanence: Floats
    current_density: Floats

    @property
    def flux(self) -> Floats:
        """``nu (-Br_y, Br_x)``, (2, nelements) in A/m: what the magnets add to ``-div(nu grad A - flux) = J``."""
        return self.reluctivity * np.stack((-self.remanence[1], self.remanence[0]))


def coefficients(mesh: MeshTri, materials: Mapping[str, Material]) -> Coefficients:
    """Look up the one material of every element; subdomains that are not among the materials have no say."""
    filled = list(materials.values())
    number = _material_of_elements(mesh, materials)
    return Coefficients(
        np.array([material.reluctivity for material in filled])[number],
        np.array([material.remanence for material in filled])[number].T,
        np.array([material.current_density for material in filled])[number],
    )


def named(sets: Mapping[str, NDArray[np.int32]] | None, name: str, kind: str) -> NDArray[np.int32]:
    """The set of that name, or an error that lists the names there are."""
    if sets is None or name not in sets:
        has = ", ".join(repr(other) for other in sorted(sets or ())) or "none"
        raise ValueError(f"{kind} {name!r} is not in the mesh; it has {has}.")
    return sets[name]


def _material_of_elements(mesh: MeshTri, materials: Mapping[str, Material]) -> NDArray[np.int64]:
    number = np.full(mesh.t.shape[1], -1)
    for index, name in enumerate(materials):
        elements = np.asarray(named(mesh.subdomains, name, "subdomain"))
        taken = elements[number[elements] >= 0]
        if taken.size:
            other = list(materials)[number[taken[0]]]
            raise ValueError(f"element {taken[0]} has two materials, {other!r} and {name!r}; give it exactly one.")
        number[elements] = index
    _check_filled(mesh, number)
    return number


def _check_filled(mesh: MeshTri, number: NDArray[np.int64]) -> None:
    empty = np.flatnonzero(number < 0)
    if not empty.size:
        return
    inside = [repr(name) for name, elements in sorted((mesh.subdomains or {}).items()) if empty[0] in elements]
    where = f"in subdomain {', '.join(inside)}" if inside else "in no subdomain"
    raise ValueError(
        f"every element needs a material; {empty.size} of {number.size} have none, "
        f"first element {empty[0]} ({where}). Add a material for their subdomain."
    )
