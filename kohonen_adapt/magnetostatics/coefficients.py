"""The materials of a problem as values per material, and per element of a mesh."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.magnetostatics.material import Material

__all__ = ["Coefficients", "coefficients", "material_of_elements", "named", "of_materials"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Coefficients:
    """Reluctivity (n,), remanence (2, n) and current density (n,) of n materials or elements, in m/H, T and A/m^2."""

    reluctivity: Floats
    remanence: Floats
    current_density: Floats

    @property
    def flux(self) -> Floats:
        """``nu (-Br_y, Br_x)``, (2, n) in A/m: what the magnets add to ``-div(nu grad A - flux) = J``."""
        return self.reluctivity * np.stack((-self.remanence[1], self.remanence[0]))


def coefficients(mesh: MeshTri, materials: Mapping[str, Material]) -> Coefficients:
    """Per element, those of its one material; subdomains that are not among the materials have no say."""
    number = material_of_elements(mesh, materials)
    given = of_materials(materials)
    return Coefficients(given.reluctivity[number], given.remanence[:, number], given.current_density[number])


def of_materials(materials: Mapping[str, Material]) -> Coefficients:
    """Per material, in the order of the mapping."""
    filled = list(materials.values())
    return Coefficients(
        np.array([material.reluctivity for material in filled]),
        np.array([material.remanence for material in filled]).reshape(-1, 2).T,
        np.array([material.current_density for material in filled]),
    )


def named(sets: Mapping[str, NDArray[np.int32]] | None, name: str, kind: str) -> NDArray[np.int32]:
    """The set of that name, or an error that lists the names there are."""
    if sets is None or name not in sets:
        has = ", ".join(repr(other) for other in sorted(sets or ())) or "none"
        raise ValueError(f"{kind} {name!r} is not in the mesh; it has {has}.")
    return sets[name]


def material_of_elements(mesh: MeshTri, materials: Mapping[str, Material]) -> NDArray[np.int64]:
    """Place in the mapping of the one material of every element, (nelements,)."""
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
