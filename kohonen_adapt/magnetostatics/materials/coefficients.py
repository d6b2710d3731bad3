"""Material coefficients of elements, with H and energy densities from B."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import listed
from kohonen_adapt.magnetostatics.materials.laws import Inverse, Law, flux_density_of, reluctivities
from kohonen_adapt.magnetostatics.materials.material import Material, Vector
from kohonen_adapt.mesh.measures import area, inner_points, magnitude
from kohonen_adapt.mesh.names import named, named_sets

__all__ = [
    "Coefficients",
    "NonlinearMaterial",
    "coefficients",
    "coercivity_at",
    "material_of_elements",
    "subdomains_at",
]


@dataclass(frozen=True)
class NonlinearMaterial:
    law: Law
    elements: Ints


@dataclass(frozen=True)
class VaryingMagnet:
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
    varying_magnets: tuple[VaryingMagnet, ...] = ()  # magnets with means as remanence and coercivity

    @property
    def flux(self) -> Floats:
        """``(-Hc_y, Hc_x)`` of ``-div(nu grad A - flux) = J``, (2, nelements) in A/m."""
        return np.stack((-self.coercivity[1], self.coercivity[0]))

    @property
    def nonlinear(self) -> Mask:
        found = np.zeros(self.material_index.size, dtype=np.bool_)
        for group in self.nonlinear_materials:
            found[group.elements] = True
        return found

    def at_points(self, element: Ints, x: Floats) -> "Coefficients":
        names = ("material_index", "reluctivity", "remanence", "coercivity", "current_density")
        arrays = {name: getattr(self, name)[..., element] for name in names}
        nonlinear_materials = tuple(
            replace(group, elements=self._points_in(group.elements, element)) for group in self.nonlinear_materials
        )
        varying_magnets = tuple(
            replace(magnet, elements=self._points_in(magnet.elements, element)) for magnet in self.varying_magnets
        )
        for magnet in varying_magnets:
            rows, material = magnet.elements, magnet.material
            coercivity = _coercivity_of(material, x[:, rows], magnet.name)
            arrays["coercivity"][:, rows] = coercivity
            arrays["remanence"][:, rows] = _converted(material, coercivity, "coercivity")
        return replace(self, **arrays, nonlinear_materials=nonlinear_materials, varying_magnets=varying_magnets)

    def _points_in(self, elements: Ints, element: Ints) -> Ints:
        inside = np.zeros(self.material_index.size, dtype=bool)
        inside[elements] = True
        return np.flatnonzero(inside[element])

    def at_quadrature(self, element: Ints, x: Floats) -> "Coefficients":
        return self if element.size == self.material_index.size else self.at_points(element, x)

    def reluctivities(self, flux_density: Floats) -> tuple[Floats, Floats]:
        """Return secant |H + Hc| / |B| and differential d|H + Hc| / d|B|, in m/H."""
        if not self.nonlinear_materials:
            return self.reluctivity, self.reluctivity
        secant, differential = self.reluctivity.copy(), self.reluctivity.copy()
        for group in self.nonlinear_materials:
            rows = group.elements
            secant[rows], differential[rows] = reluctivities(group.law, magnitude(flux_density[:, rows]))
        return secant, differential

    def field_strength(self, flux_density: Floats) -> Floats:
        strength = self.reluctivity * (flux_density - self.remanence)
        for group in self.nonlinear_materials:
            rows = group.elements
            secant, _ = reluctivities(group.law, magnitude(flux_density[:, rows]))
            strength[:, rows] = secant * flux_density[:, rows] - self.coercivity[:, rows]
        return strength

    def present(self, materials: Mapping[str, Material]) -> tuple[dict[str, Material], Ints, Ints]:
        used, first, index = np.unique(self.material_index, return_index=True, return_inverse=True)
        return {name: material for k, (name, material) in enumerate(materials.items()) if k in used}, first, index

    def law_energy(self, b: Floats) -> Floats:
        """Return ``int_0^b H dB`` without magnets, shape (k, nelements) in J/m^3."""
        density = 0.5 * self.reluctivity * b**2
        for group in self.nonlinear_materials:
            density[:, group.elements] = group.law.energy(b[:, group.elements])
        return density

    def law_coenergy(self, h: Floats) -> Floats:
        """Return ``int_0^h B dH`` without magnets, shape (k, nelements) in J/m^3."""
        density = 0.5 * h**2 / self.reluctivity
        for group in self.nonlinear_materials:
            strength = h[:, group.elements].ravel()
            density[:, group.elements] = Inverse(group.law).energy(strength).reshape(len(h), -1)
        return density

    def permeabilities(self, strength: Floats) -> tuple[Floats, Floats]:
        """Return secant |B| / |H + Hc| and differential d|B| / d|H + Hc|, in H/m."""
        secant, differential = 1.0 / self.reluctivity, 1.0 / self.reluctivity
        for group in self.nonlinear_materials:
            rows = group.elements
            size = magnitude(strength[:, rows] + self.coercivity[:, rows])
            secant[rows], differential[rows] = Inverse(group.law).secants(size)
        return secant, differential

    def energy_density(self, flux_density: Floats) -> Floats:
        """Return ``int H . dB`` from the remanent state, >= 0, (nelements,) in J/m^3."""
        change = flux_density - self.remanence
        density = 0.5 * np.sum(self.reluctivity * change**2, axis=0)
        for group in self.nonlinear_materials:
            rows = group.elements
            now, rest = (group.law.energy(magnitude(b[:, rows])) for b in (flux_density, self.remanence))
            density[rows] = now - rest - np.sum(self.coercivity[:, rows] * change[:, rows], axis=0)
        return density


def coefficients(
    mesh: Mesh,
    materials: Mapping[str, Material],
    ampere_turns: Mapping[str, float] | None = None,
    size: Callable[[Mesh], Floats] = area,
) -> Coefficients:
    material_index, values = material_of_elements(mesh, materials), list(materials.values())
    reluctivity = np.array([material.reluctivity for material in values])[material_index]
    current_density = np.array([material.current_density for material in values])[material_index]
    for name, total in (ampere_turns or {}).items():
        current_density[mesh.subdomains[name]] = total / _area_of(mesh, name, size)
    remanence = np.array([_constant_remanence(material, len(mesh.p)) for material in values]).T[:, material_index]
    coercivity = reluctivity * remanence
    nonlinear_materials, varying_magnets = list[NonlinearMaterial](), list[VaryingMagnet]()
    for index, (name, material) in enumerate(materials.items()):
        if material.bh is not None or callable(material.remanence) or material.coercivity is not None:
            rows = np.flatnonzero(material_index == index)
            remanence[:, rows], coercivity[:, rows] = _remanence_and_coercivity(mesh, material, rows, name)
            if material.bh is not None:
                nonlinear_materials.append(NonlinearMaterial(material.bh, rows))
            if material.turns:
                varying_magnets.append(VaryingMagnet(name, material, rows))
    nonlinear, varying = tuple(nonlinear_materials), tuple(varying_magnets)
    return Coefficients(material_index, reluctivity, remanence, coercivity, current_density, nonlinear, varying)


def _constant_remanence(material: Material, dimension: int) -> Floats:
    remanence = material.remanence
    return np.zeros(dimension) if callable(remanence) or not any(remanence) else np.array(remanence)


def coercivity_at(materials: Mapping[str, Material], x: Floats, material_index: Ints) -> Floats:
    coercivity = np.zeros_like(x)
    for index, (name, material) in enumerate(materials.items()):
        rows = material_index == index
        coercivity[:, rows] = _coercivity_of(material, x[:, rows], name)
    return coercivity


def _remanence_and_coercivity(mesh: Mesh, material: Material, rows: Ints, name: str) -> tuple[Floats, Floats]:
    # The equations of order 1 depend on the mean coercivity of an element. Its value at the centroid is off the mean by
    # as much as the solution is in error.
    if material.turns:
        x = inner_points(mesh.p[:, mesh.t[:, rows]])
        coercivity = np.mean([_coercivity_of(material, x[:, k], name) for k in range(x.shape[1])], axis=0)
        return _converted(material, coercivity, "coercivity"), coercivity
    kind, value = _magnetisation(material)
    vector = _evaluated(f"{kind} of {name!r}", value, mesh.p[:, mesh.t[0, rows]])
    converted = _converted(material, vector, kind)
    return (vector, converted) if kind == "remanence" else (converted, vector)


def _magnetisation(material: Material) -> tuple[str, Vector]:
    if material.coercivity is None:
        return "remanence", material.remanence
    return "coercivity", material.coercivity


def _coercivity_of(material: Material, x: Floats, name: str) -> Floats:
    kind, value = _magnetisation(material)
    vector = _evaluated(f"{kind} of {name!r}", value, x)
    return _converted(material, vector, kind) if kind == "remanence" else vector


def _converted(material: Material, vector: Floats, kind: str) -> Floats:
    size = magnitude(vector)
    if material.bh is None:
        result = size * material.reluctivity if kind == "remanence" else size / material.reluctivity
    else:
        result = material.bh.field_strength(size) if kind == "remanence" else flux_density_of(material.bh, size)
    return vector / np.where(size > 0.0, size, 1.0) * result


def _evaluated(name: str, value: Vector, x: Floats) -> Floats:
    if not callable(value):
        vector = np.array(value if any(value) else np.zeros(len(x)))
        return np.tile(vector[:, None], x.shape[1])
    vector = np.asarray(value(x), dtype=float)
    if vector.shape != x.shape:
        raise ValueError(f"{name} must have shape ({len(x)}, n) = {x.shape}; got {vector.shape}.")
    bad = np.count_nonzero(~np.isfinite(vector).all(axis=0))
    if bad:
        raise ValueError(f"{name} must be finite; it is not in {bad} of its {x.shape[1]} elements.")
    return vector


def _area_of(mesh: Mesh, name: str, size: Callable[[Mesh], Floats]) -> float:
    total = float(np.sum(size(mesh)[mesh.subdomains[name]]))
    if total <= 0.0:
        raise ValueError(
            f"the coil {name!r} has no area in the mesh, so its ampere_turns cannot be applied; mesh the coil or "
            "remove it."
        )
    return total


def material_of_elements(mesh: Mesh, materials: Mapping[str, Material]) -> NDArray[np.int64]:
    material_index = np.full(mesh.t.shape[1], -1)
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
