"""Material coefficients of elements, with H and energy densities from B."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, FloatsPair, Int64s, Ints, Mask
from kohonen_adapt.checks import finite_values, listed
from kohonen_adapt.magnetostatics.materials.laws import Inverse, Law, Scaled, flux_density_of, reluctivities
from kohonen_adapt.magnetostatics.materials.material import Material, Vector
from kohonen_adapt.mesh.measures import area, inner_points, magnitude, unit_vectors
from kohonen_adapt.mesh.names import named, named_sets
from kohonen_adapt.problem.energy import Densities

__all__ = [
    "Coefficients",
    "NonlinearMaterial",
    "coefficients",
    "material_of_elements",
    "subdomains_at",
]


class NonlinearMaterial(NamedTuple):
    law: Law
    elements: Ints


class OfMaterial(NamedTuple):
    name: str
    material: Material
    elements: Ints


@dataclass(frozen=True)
class Coefficients:
    material_index: Ints  # (nelements,): index of the material in the mapping of materials
    reluctivity: Floats  # (nelements,) in m/H; of nonlinear material at B = 0
    remanence: Floats  # (d, nelements) in T
    coercivity: Floats  # (d, nelements) in A/m, in H = nu B - Hc
    current_density: Floats  # (nelements,) in A/m^2
    nonlinear_materials: tuple[NonlinearMaterial, ...] = ()  # the nonlinear materials
    varying_magnets: tuple[OfMaterial, ...] = ()  # magnets with means as remanence and coercivity

    @property
    def flux(self) -> Floats:
        """``(-Hc_y, Hc_x)`` of ``-div(nu grad A - flux) = J``, (2, nelements) in A/m."""
        return np.stack((-self.coercivity[1], self.coercivity[0]))

    @property
    def nonlinear(self) -> Mask:
        return self._in(self.nonlinear_materials)

    @property
    def of_its_own(self) -> Mask:
        """True in material that varies within elements, by its law or as a magnet."""
        return self._in((*self.nonlinear_materials, *self.varying_magnets))

    def _in(self, groups: Any) -> Mask:
        found = np.zeros(self.material_index.size, bool)
        for group in groups:
            found[group.elements] = True
        return found

    def at_points(self, element: Ints, x: Floats, means: bool = False) -> "Coefficients":
        names = ("material_index", "reluctivity", "remanence", "coercivity", "current_density")
        arrays = {name: getattr(self, name)[..., element] for name in names}
        groups: tuple[Any, Any] = self.nonlinear_materials, () if means else self.varying_magnets
        laws, magnets = (
            tuple(group._replace(elements=np.flatnonzero(self._belongs(element, group))) for group in kind)
            for kind in groups
        )
        if magnets:
            arrays["coercivity"] = self.coercivity_at(element, x)
        for _, material, rows in magnets:
            arrays["remanence"][:, rows] = _remanence_of(material, arrays["coercivity"][:, rows])
        return replace(self, **arrays, nonlinear_materials=laws, varying_magnets=magnets)

    def coercivity_at(self, element: Ints, x: Floats) -> Floats:
        found = self.coercivity[:, element]
        for magnet in self.varying_magnets:
            own = self._belongs(element, magnet)
            found[:, own] = _coercivity_of(magnet.material, x[:, own], magnet.name)
        return found

    def _belongs(self, element: Ints, group: Any) -> Mask:
        # A search in the many elements of a group takes longer.
        return np.isin(self.material_index[element], self.material_index[group.elements[:1]])

    def at_quadrature(self, element: Ints, x: Floats) -> "Coefficients":
        return self if element.size == self.material_index.size else self.at_points(element, x)

    def densities(
        self, weights: Floats | float = 1.0, factor: float = 1.0, distance: Floats | float = 1.0
    ) -> Densities:
        """Return the density ``int H dB`` without magnets as a function of B."""
        laws = [(Scaled(law, factor), rows) for law, rows in self.nonlinear_materials]
        return Densities(weights, factor * self.reluctivity, laws, distance)

    def coenergy_densities(self, weights: Floats | float = 1.0) -> Densities:
        """Return the density ``int B dH`` without magnets, as a function of H + Hc."""
        laws = [(Inverse(law), rows) for law, rows in self.nonlinear_materials]
        return Densities(weights, 1.0 / self.reluctivity, laws)

    def reluctivities(self, flux_density: Floats) -> FloatsPair:
        """Return secant |H + Hc| / |B| and differential d|H + Hc| / d|B|, in m/H."""
        return self.densities().secants(magnitude(flux_density))

    def permeabilities(self, strength: Floats) -> FloatsPair:
        """Return secant |B| / |H + Hc| and differential d|B| / d|H + Hc|, in H/m."""
        return self.coenergy_densities().secants(magnitude(strength + self.coercivity))

    def field_strength(self, flux_density: Floats) -> Floats:
        strength = self.reluctivity * (flux_density - self.remanence)
        for law, rows in self.nonlinear_materials:
            secant, _ = reluctivities(law, magnitude(flux_density[:, rows]))
            strength[:, rows] = secant * flux_density[:, rows] - self.coercivity[:, rows]
        return strength

    def present(self, materials: Mapping[str, Material]) -> tuple[list[Material], Ints, Ints]:
        used, first, index = np.unique(self.material_index, return_index=True, return_inverse=True)
        every = list(materials.values())
        return [every[k] for k in used], first, index

    def energy_density(self, flux_density: Floats) -> Floats:
        """Return ``int H . dB`` from the remanent state, >= 0, (nelements,) in J/m^3."""
        change = flux_density - self.remanence
        density = 0.5 * np.sum(self.reluctivity * change**2, axis=0)
        for law, rows in self.nonlinear_materials:
            now, rest = (law.energy(magnitude(b[:, rows])) for b in (flux_density, self.remanence))
            density[rows] = now - rest - np.sum(self.coercivity[:, rows] * change[:, rows], axis=0)
        return density


def coefficients(
    mesh: Mesh,
    materials: Mapping[str, Material],
    ampere_turns: Mapping[str, float] | None = None,
    size: Callable[[Mesh], Floats] = area,
) -> Coefficients:
    material_index = material_of_elements(mesh, materials)
    reluctivity, current_density = (
        np.array([getattr(material, name) for material in materials.values()])[material_index]
        for name in ("reluctivity", "current_density")
    )
    for name, total in (ampere_turns or {}).items():
        rows = mesh.subdomains[name]
        found = float(np.sum(size(mesh)[rows]))
        if found <= 0.0:
            raise ValueError(
                f"the coil {name!r} has no area in the mesh, so its ampere_turns cannot be applied; mesh the coil or "
                "remove it."
            )
        current_density[rows] = total / found
    remanence, coercivity = np.zeros((2, len(mesh.p), material_index.size))
    groups = [
        OfMaterial(name, material, np.flatnonzero(material_index == index))
        for index, (name, material) in enumerate(materials.items())
    ]
    for name, material, rows in groups:
        # The equations of order 1 depend on the mean coercivity of an element. Its value at the centroid is off the
        # mean by as much as the solution is in error.
        points = inner_points(mesh.p[:, mesh.t[:, rows]]) if material.turns else mesh.p[:, mesh.t[:1, rows]]
        values = [_coercivity_of(material, x, name) for x in points.swapaxes(0, 1)]
        coercivity[:, rows] = np.mean(values, axis=0)
        remanence[:, rows] = _remanence_of(material, coercivity[:, rows])
    nonlinear = tuple(NonlinearMaterial(each.bh, rows) for _, each, rows in groups if each.bh is not None)
    varying = tuple(group for group in groups if group.material.turns)
    return Coefficients(material_index, reluctivity, remanence, coercivity, current_density, nonlinear, varying)


def _coercivity_of(material: Material, x: Floats, name: str) -> Floats:
    if material.coercivity is not None:
        return _evaluated(f"coercivity of {name!r}", material.coercivity, x)
    remanence = _evaluated(f"remanence of {name!r}", material.remanence, x)
    if material.bh is None:
        return material.reluctivity * remanence
    return unit_vectors(remanence) * material.bh.field_strength(magnitude(remanence))


def _remanence_of(material: Material, coercivity: Floats) -> Floats:
    if material.coercivity is None and not material.turns:
        return _evaluated("remanence", material.remanence, coercivity)
    if material.bh is None:
        return coercivity / material.reluctivity
    return unit_vectors(coercivity) * flux_density_of(material.bh, magnitude(coercivity))


def _evaluated(name: str, value: Vector, x: Floats) -> Floats:
    if not callable(value):
        vector = np.array(value if any(value) else np.zeros(len(x)))
        return np.tile(vector[:, None], x.shape[1])
    return finite_values(name, value, x, x.shape)


def material_of_elements(mesh: Mesh, materials: Mapping[str, Material]) -> Int64s:
    material_index = np.full(mesh.nelements, -1)
    for index, name in enumerate(materials):
        elements = np.asarray(named(mesh.subdomains, name, "subdomain"))
        duplicated = elements[material_index[elements] >= 0]
        if duplicated.size:
            first_name = list(materials)[material_index[duplicated[0]]]
            raise ValueError(
                f"element {duplicated[0]} has two materials, {first_name!r} and {name!r}; give it exactly one."
            )
        material_index[elements] = index
    empty = np.flatnonzero(material_index < 0)
    if empty.size:
        inside = [name for name, elements in named_sets(mesh.subdomains).items() if empty[0] in elements]
        where = f"in subdomain {listed(inside)}" if inside else "in no subdomain"
        raise ValueError(
            f"every element needs a material; {empty.size} of {material_index.size} have none, "
            f"first element {empty[0]} ({where}). Add a material for their subdomain."
        )
    return material_index


def subdomains_at(mesh: Mesh, elements: Ints) -> str:
    sets = sorted(named_sets(mesh.subdomains).items())
    return " + ".join(repr(name) for name, rows in sets if np.isin(elements, rows).any())
