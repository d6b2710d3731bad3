"""Flux linkage of coils in space, and the force and torque on coils."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import listed
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.coils.motion import Images, change_of_field, images_of
from kohonen_adapt.magnetostatics.coils.rules import currents_of, flux_rule
from kohonen_adapt.magnetostatics.equations.applied_field import Drive
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.given_field import AppliedField, Sources, field_at
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.mesh.motions import moved

__all__ = ["OfCoil", "ampere_turns", "ends_far", "is_coil"]

INVARIANT = 1e-3  # tolerance of equal fields of images, relative to the largest
NONE = 1e-6  # motion that images cancel, relative


@dataclass(frozen=True, eq=False)
class OfCoil:
    # Flux linkage of a coil per turn, or the force on the coil along a motion.
    # Both are integrals over magnetised material and a part in free space (reciprocity):
    # ``lambda = lambda_0 + int mu0 M . h``, with the field h of the coil per ampere-turn and ``mu0 M = B - mu0 H``. A
    # force is ``I d lambda`` by a motion of the coil. Planes of symmetry leave the part of the coil in the mesh.

    field: MagneticField
    name: str
    motion: Floats | None = None

    def __post_init__(self) -> None:
        if not self.field.far:
            raise ValueError(
                f"quantities of the coil {self.name!r} need the potential 0 on the far boundary, which is all of the "
                "outer boundary except planes of symmetry; give potential={'outer': 0.0} with the name of yours."
            )
        _ = self._meshed

    @cached_property
    def _coil(self) -> Coil:
        return coil_in(self.field, self.name)

    @property
    def _unit(self) -> Coil:
        return replace(self._coil, ampere_turns=1.0)

    @cached_property
    def _images(self) -> Images:
        return images_of(self.field.mesh, self.field.mirrors)

    @cached_property
    def _orbit(self) -> tuple[list[int], list[int]]:
        # images with the field of the coil itself, and one image of every coil in the orbit
        coil, images = self._coil, self._images
        x, every = coil.winding.samples[:, ::7], range(images.sign.size)
        fields = np.stack([images.pulled(coil.field_strength, x, g) for g in every])
        equal = np.abs(fields[:, None] - fields).max(axis=(2, 3)) <= INVARIANT * np.abs(fields[0]).max(initial=0.0)
        return [g for g in every if equal[0, g]], [g for g in every if not equal[g, :g].any()]

    @cached_property
    def _meshed(self) -> float:
        own, inside = len(self._orbit[0]), self._images.contain(currents_of(self._coil.winding).x)
        fraction = round(own * float(inside.mean())) / own
        if fraction == 0.0:
            raise ValueError(f"the coil {self.name!r} is beyond a plane of symmetry; name its image in the mesh.")
        return fraction

    @cached_property
    def _motion(self) -> Floats | None:
        # without the components that images cancel
        if self.motion is None:
            return None
        return np.mean([self._images.moved(self.motion, g) for g in self._orbit[0]], axis=0)

    @property
    def vanishes(self) -> bool:
        if self.motion is None or self._motion is None:
            return False
        left, whole = (np.abs(moved(motion, self._coil.path)).max() for motion in (self._motion, self.motion))
        return bool(left <= NONE * whole)

    def _weight_at(self, x: Floats) -> Floats:
        images, (own, orbit) = self._images, self._orbit
        field = self._unit.field_strength
        if self._motion is not None:
            field = partial(change_of_field, self._coil, self._motion)
        return self._meshed * len(own) * np.sum([images.pulled(field, x, g) for g in orbit], axis=0)

    def value(self) -> float:
        if self.vanishes:
            return 0.0
        x, magnetisation = self.field.magnetisation
        return self._meshed * self._in_free_space() + float(np.sum(magnetisation * self._weight_at(x)))

    def load(self) -> Floats:
        elements = self.field.elements
        weight, rows = np.zeros_like(elements.points), self.field.magnetised[elements.element]
        weight[:, rows] = self._weight_at(elements.points[:, rows])
        return self.field.load_of(weight) + VACUUM_PERMEABILITY * weight

    def _in_free_space(self) -> float:
        sources, (x, moment) = self.field.sources, currents_of(self._coil.winding)
        if self._motion is not None:
            rest = sources.without(self.name)
            if rest is None:  # a coil makes no force on itself
                return 0.0
            force = VACUUM_PERMEABILITY * self._coil.ampere_turns * np.cross(moment, field_at(rest, x), axis=0)
            return float(np.sum(force * moved(self._motion, x)))
        # The field of a smaller coil in the bore is not smooth there. Mutual inductances are equal, so that the rule of
        # the smaller coil serves.
        unit, larger = self._unit, dict(sources.coils)
        smaller = [larger.pop(name) for name, coil in sources.coils.items() if _extent(coil) < _extent(unit)]
        total = _flux(unit, Sources(larger, sources.applied))
        return VACUUM_PERMEABILITY * (
            total + sum(each.ampere_turns * _flux(each, unit.field_strength) for each in smaller)
        )


def _flux(coil: Coil, field: AppliedField) -> float:
    x, weight = flux_rule(coil.winding)
    return float(np.sum(weight * (coil.axis @ field_at(field, x))))


def _extent(coil: Coil) -> float:
    return float(np.linalg.norm(np.ptp(coil.path, axis=1)))


def coil_in(field: MagneticField, name: str) -> Coil:
    if not is_coil(field, name):
        raise ValueError(f"{name!r} is no coil of the problem; its coils are {listed(field.sources.coils)}.")
    return field.sources.coils[name]


def ampere_turns(field: MagneticField, name: str) -> float:
    current = coil_in(field, name).ampere_turns
    if current == 0.0:
        raise ValueError(f"the coil {name!r} carries no current, by which its linkage could be divided.")
    return current


def is_coil(field: MagneticField, name: Any) -> bool:
    return isinstance(name, str) and name in field.sources.coils


def ends_far(drive: Drive, conditions: Conditions, planes: Iterable[Mirror]) -> bool:
    mesh, zero = drive.elements.corners, conditions.fixed & (conditions.values == drive.potential)
    outer = mesh.boundary_facets()
    for plane in planes:
        outer = np.setdiff1d(outer, plane.facets)
    return bool(zero[mesh.facets[:, outer]].all())
