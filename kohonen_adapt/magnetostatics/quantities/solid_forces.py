"""Forces and torques on bodies and coils in space, and the flux through surfaces."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from skfem import MeshTet
from skfem.generic_utils import OrientedBoundary
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.coils.motion import Motion, images_of
from kohonen_adapt.magnetostatics.coils.rules import currents_of
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror, surface
from kohonen_adapt.magnetostatics.quantities.bodies import (
    Component,
    Cut,
    Names,
    air_elements,
    component_change,
    component_value,
    isolated_body,
    outer_facets,
    stress_force,
    weight_at_nodes,
)
from kohonen_adapt.magnetostatics.quantities.coil_quantities import OfCoil, is_coil
from kohonen_adapt.magnetostatics.quantities.local_solid import LocalSolid, Strength
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.curved import is_second_order

__all__ = ["flux_through", "oriented_surface", "parts_along", "total_force"]

DEGREE, CURVED_DEGREE = 2, 5  # of the quadrature of a flux
EDGEWISE = 0.1  # cosine between the normal of a facet and of its surface, below which the facet has no side


class LayerCurrents(NamedTuple):
    x: Floats  # (3, n) in m
    element: Ints  # (n,)
    moment: Floats  # (3, n) in A m

    def force(self, field: LocalSolid) -> Floats:
        return np.cross(self.moment, field.reaction_at(self.x, self.element), axis=0)


def layer_currents(field: LocalSolid, weight: Floats) -> LayerCurrents:
    mesh, images, points, moments = field.mesh, images_of(field.mesh, field.mirrors), [], []
    for coil in field.drive.sources.coils.values():
        x, moment = currents_of(coil.winding)
        x, moment = images.folded(x, coil.ampere_turns / len(images.sign) * moment)
        points.append(x)
        moments.append(moment)
    x, moment = np.concatenate(points, axis=1), np.concatenate(moments, axis=1)
    element = field.elements_at(x)
    rows = np.flatnonzero(element >= 0)
    x, moment, element = x[:, rows], moment[:, rows], element[rows]
    factor = np.sum(weight[mesh.t[:, element]] * field.elements.barycentric(x, element), axis=0)
    rows = np.flatnonzero(factor != 0.0)
    return LayerCurrents(x[:, rows], element[rows], factor[rows] * moment[:, rows])


@dataclass(frozen=True, eq=False)
class Shell:
    # Weight around a body, and the currents where the weight falls.
    # With ``f = J x B`` in the layer, the force on the body is ``-int T grad w - int w f``. The field of the currents
    # in free space makes no force on the body, so that both integrals leave out its part: T less the stress of this
    # field, and f without B of this field.

    field: LocalSolid
    inside: Mask
    cuts: list[Mirror]

    @classmethod
    def of(cls, field: LocalSolid, body: Names) -> "Shell":
        inside = isolated_body(field, body)
        key = ("shell", inside.tobytes())
        if key not in field.kept:
            field.kept[key] = cls(field, inside, _cuts(field.mesh, inside, field.mirrors))
        shell: Shell = field.kept[key]
        return shell

    @cached_property
    def _weight(self) -> Floats:
        nodes = np.arange(self.field.mesh.nvertices)
        facets = np.concatenate([np.zeros(0, dtype=np.int64), *(mirror.facets for mirror in self.cuts)])
        return weight_at_nodes(self.field, self.inside, Cut(facets, None, nodes))

    @cached_property
    def layer(self) -> Mask:
        # the elements of air where the weight falls
        falls = np.ptp(self._weight[self.field.mesh.t], axis=0) > 0.0
        return np.asarray(falls & air_elements(self.field) & ~self.inside)

    @cached_property
    def _points(self) -> tuple[Floats, Ints, Floats]:
        return self.field.points_in(self.layer)

    @property
    def volumes(self) -> Floats:
        return self._points[2]

    @cached_property
    def slope(self) -> Floats:
        x, element, _ = self._points
        return self.field.elements.slope_of_corners_at(self._weight, element, x)

    @cached_property
    def at(self) -> Strength:
        x, element, _ = self._points
        return self.field.at(x, element)

    @cached_property
    def free_flux_density(self) -> Floats:
        x, element, _ = self._points
        return self.at.flux_density - self.field.reaction_at(x, element)

    @cached_property
    def currents(self) -> LayerCurrents | None:
        return layer_currents(self.field, self._weight) if self.field.drive.sources.coils else None

    def force(self, centre: Floats | None) -> Floats:
        currents, x = self.currents, self.at.x
        parts = stress_force(self.volumes, self.slope, self.at.flux_density)
        if currents is not None:
            parts = parts - stress_force(self.volumes, self.slope, self.free_flux_density)
            parts, x = np.hstack((parts, -currents.force(self.field))), np.hstack((x, currents.x))
        if centre is not None:
            parts = np.cross(x - centre[:, None], parts, axis=0)
        return _uncancelled(self.cuts, np.sum(parts, axis=1), centre is not None)


@dataclass(frozen=True, eq=False)
class OfBody:
    shell: Shell
    motion: Motion

    @property
    def vanishes(self) -> bool:
        return not (self.motion.shift.any() or self.motion.spin.any())

    @property
    def _component(self) -> Component:
        return Component(self.shell.slope, self.motion.at(self.shell.at.x))

    def value(self) -> float:
        shell, currents = self.shell, self.shell.currents
        total = component_value(shell.volumes, self._component, shell.at.flux_density)
        if currents is None:
            return total
        total -= component_value(shell.volumes, self._component, shell.free_flux_density)
        return total - float(np.sum(currents.force(shell.field) * self.motion.at(currents.x)))

    def load(self) -> Floats:
        field, currents = self.shell.field, self.shell.currents
        weight = np.zeros(field.elements.points.shape)
        weight[:, self.shell.layer[field.elements.element]] = component_change(
            self._component, self.shell.at.flux_density
        )
        load = field.load_of(weight)
        if currents is None or not currents.x.size:
            return load
        along = np.cross(currents.moment, self.motion.at(currents.x), axis=0)
        return load + field.load_in(currents.element, currents.x, along)


def parts_along(field: LocalSolid, names: Names, vector: Floats, centre: Floats | None) -> list[OfBody | OfCoil]:
    # with a centre the torque about an axis
    coils, body = _split(field, names)
    found: list[OfBody | OfCoil] = [OfCoil(field, name, _motion(vector, centre)) for name in coils]
    if body:
        shell = Shell.of(field, body)
        along = _uncancelled(shell.cuts[::-1], vector, centre is not None)
        found.append(OfBody(shell, _motion(along, centre)))
    return found


def total_force(field: LocalSolid, names: Names, centre: Floats | None = None) -> Floats:
    coils, body = _split(field, names)
    total = Shell.of(field, body).force(centre) if body else np.zeros(3)
    for name in coils:
        total += [OfCoil(field, name, _motion(along, centre)).value() for along in np.eye(3)]
    return total


def _split(field: LocalSolid, names: Names) -> tuple[list[str], Names]:
    listed = [names] if isinstance(names, str) else list(names) if isinstance(names, Sequence) else []
    coils = [name for name in listed if is_coil(field, name)]
    return coils, [name for name in listed if name not in coils] if coils else names


def _motion(vector: Floats, centre: Floats | None) -> Motion:
    zero = np.zeros(3)
    return Motion(vector, zero, zero) if centre is None else Motion(zero, vector, centre)


def _uncancelled(cuts: Iterable[Mirror], vector: Floats, torque: bool) -> Floats:
    # Return the vector without the components that the images cancel.
    #
    # Images leave the components of a force along the planes, and of a torque the components normal to the planes.
    for mirror in cuts:
        across = mirror.normal * (mirror.normal @ vector)
        vector = across if torque else vector - across
    return vector


def _cuts(mesh: MeshTet, inside: Mask, mirrors: Iterable[Mirror]) -> list[Mirror]:
    body_facets = outer_facets(mesh, inside)
    cuts = [mirror for mirror in mirrors if np.isin(mirror.facets, body_facets).any()]
    elsewhere = np.setdiff1d(body_facets, np.concatenate([body_facets[:0], *(mirror.facets for mirror in cuts)]))
    if elsewhere.size:
        raise ValueError(
            f"the body lies on the outer boundary of the mesh with {elsewhere.size} facets that are on no plane of "
            "symmetry; the force on a part of a body can only be computed if planes of symmetry cut it. Name them in "
            "symmetry, or extend the mesh beyond the boundary."
        )
    return cuts


def flux_through(field: LocalSolid, name: str) -> float:
    mesh, total = field.mesh, 0.0
    facets, straight, sign = oriented_surface(mesh, name)
    first, second = mesh.f2t[:, facets]
    points, weights = get_quadrature(RefTri, CURVED_DEGREE if is_second_order(mesh) else DEGREE)
    for (s, t), weight in zip(points.T, weights, strict=True):
        x, normal = field.elements.facet_points(facets, np.array([1.0 - s - t, s, t]))
        normal *= 0.5 * weight * sign * np.sign(np.sum(normal * straight, axis=0))
        for element in (first, np.where(second < 0, first, second)):
            total += float(np.sum(field.at(x, element).flux_density * normal))
    return total


def oriented_surface(mesh: MeshTet, name: str) -> tuple[Ints, Floats, Floats]:
    """Return the facets of a surface, their normals, and the sign of their flux.

    The normals, (3, nfacets), point out of the first element and have the length of the area; the sign is 1 if the flux
    counts along the normal, else -1.
    """
    rows = surface(mesh, name, "flux")
    facets = np.asarray(rows)
    if not facets.size:
        raise ValueError(f"the surface {name!r} has no facets; name one that has.")
    first = mesh.f2t[0, facets]
    normal = 0.5 * normals(mesh.p.T, mesh.facets[:, facets].T).T
    outward = mesh.p[:, mesh.facets[0, facets]] - mesh.p[:, mesh.t[:, first]].mean(axis=1)
    normal *= np.sign(np.sum(normal * outward, axis=0))
    return facets, normal, _flux_sign(mesh, name, facets, normal)


def _flux_sign(mesh: MeshTet, name: str, facets: Ints, normal: Floats) -> Floats:
    rows = mesh.boundaries[name]
    if isinstance(rows, OrientedBoundary):
        return np.where(rows.ori == 0, 1.0, -1.0)
    outer = mesh.f2t[1, facets] < 0
    if outer.all():
        return np.ones(facets.size)
    size = np.linalg.norm(normal, axis=0)
    unit = normal / size
    mean_normal = np.linalg.eigh((unit * size) @ unit.T)[1][:, -1]
    mean_normal = mean_normal * np.sign(mean_normal[np.argmax(np.abs(mean_normal))])
    along = mean_normal @ unit
    if np.abs(along).min() < EDGEWISE:
        raise ValueError(
            f"the surface {name!r} inside the mesh turns too far to have one normal direction; orient it by a "
            "skfem.OrientedBoundary, or name parts of it."
        )
    return np.sign(along)
