"""Planar and axisymmetric fields, and mirror planes in space."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import checked_mapping, listed
from kohonen_adapt.mesh.cells import facet_normals, width_of
from kohonen_adapt.mesh.measures import magnitude, unit_vectors
from kohonen_adapt.mesh.names import named_sets

__all__ = ["AXISYMMETRIC", "PLANAR", "Mirror", "Symmetry", "checked_symmetry", "mirror_of", "surface"]

AXIS = 1e-12  # distance at which nodes are on the axis, relative to the size of the mesh
ROUND = 1e-3  # allowed distance of the centre of an open boundary from the axis, relative to the size of the mesh

KINDS = ("parallel", "normal")  # direction of the flux at a plane of symmetry
FLAT = 1e-6  # distance at which nodes are on a plane, relative to the size of the mesh


@dataclass(frozen=True)
class Symmetry:
    """Planar or axisymmetric field.

    A planar field has u = A_z and ``B = (du/dy, -du/dx)``, and is per metre of depth. An axisymmetric one is in the
    half-plane x = r >= 0, y = z, with u = r A_phi and ``B = (-du/dz, du/dr) / r``. Results are totals then.
    """

    axis: bool
    extent: float  # factor of integrals over the plane: a metre of depth, or the angle around the axis

    def _radius(self, x: Floats) -> Floats | float:
        return x[0] if self.axis else 1.0

    def _turned(self, vectors: Floats) -> Floats:
        turned = np.stack((vectors[1], -vectors[0]))
        return -turned if self.axis else turned

    def unknown(self, x: Floats, potential: Floats) -> Floats:
        return self._radius(x) * potential

    def potential(self, x: Floats, unknown: Floats) -> Floats:
        radius = self._radius(x)
        return np.where(radius > 0.0, unknown / np.where(radius > 0.0, radius, 1.0), 0.0)

    def on_axis(self, x: Floats) -> Mask:
        if not self.axis:
            return np.zeros(x.shape[1], bool)
        tolerance = AXIS * np.max(np.ptp(x, axis=1))
        outside = np.flatnonzero(x[0] < -tolerance)
        if outside.size:
            raise ValueError(
                f"an axisymmetric mesh must lie at r = x >= 0; {outside.size} nodes do not, first node {outside[0]} "
                f"at r = {x[0, outside[0]]:g} m."
            )
        return x[0] <= tolerance

    def flux_density(self, x: Floats, gradient: Floats) -> Floats:
        return self._turned(gradient) / self._radius(x)

    def flux(self, field_strength: Floats) -> Floats:
        """Return ``nu' grad u - flux'`` of a field strength, and -flux' of -Hc."""
        return -self.extent * self._turned(field_strength)

    def reluctivity(self, x: Floats, reluctivity: Floats) -> Floats:
        return reluctivity * (self.extent / self._radius(x))

    def source(self, current_density: Floats) -> Floats:
        return self.extent * current_density

    def volume(self, x: Floats, area: Floats) -> Floats:
        return self.extent * self._radius(x) * area

    def uniform(self, x: Floats, centre: Floats, field: tuple[float, float]) -> tuple[Floats, int]:
        """Return ``u / mu0`` of a uniform field, and the dimension of the exterior.

        `field` is in A/m; u is 0 at the centre, around the axis on the axis.
        """
        if not self.axis:
            (along_x, along_y), (x0, y0) = field, x - centre[:, None]
            return along_x * y0 - along_y * x0, 2
        if abs(centre[0]) > ROUND * np.max(np.ptp(x, axis=1)):
            raise ValueError(
                f"the open boundary of an axisymmetric problem must have its centre on the axis; it is at r = "
                f"{centre[0]:.6g}, z = {centre[1]:.6g} m. Draw it as an arc about a point of the axis."
            )
        return 0.5 * field[1] * x[0] ** 2, 3


PLANAR, AXISYMMETRIC = Symmetry(axis=False, extent=1.0), Symmetry(axis=True, extent=2.0 * np.pi)


class Mirror(NamedTuple):
    kind: str
    facets: Ints  # all facets of the mesh in the plane
    normal: Floats  # (3,), unit vector out of the mesh
    level: float  # of the plane along the normal

    @property
    def sign(self) -> float:
        """Sign of B at an image relative to the reflected B."""
        return 1.0 if self.kind == "parallel" else -1.0

    @property
    def reflection(self) -> Floats:
        return np.eye(3) - 2.0 * np.outer(self.normal, self.normal)

    def image(self, x: Floats) -> Floats:
        return self.reflection @ x + 2.0 * self.level * self.normal[:, None]


def mirror_of(mesh: MeshTet, name: str, kind: str) -> Mirror:
    facets, tolerance = np.unique(surface(mesh, name, "symmetry")), FLAT * width_of(mesh)
    if facets.size == 0 or np.any(mesh.f2t[1, facets] >= 0):
        raise ValueError(f"the plane of symmetry {name!r} must be on the outer boundary of the mesh, all of it.")
    across = facet_normals(mesh, facets)
    normal = unit_vectors(across[:, np.argmax(magnitude(across))])
    height = normal @ mesh.p
    if height.mean() > height[mesh.facets[:, facets]].mean():
        normal, height = -normal, -height
    on_facets = height[mesh.facets[:, facets]]
    level = 0.5 * (on_facets.min() + on_facets.max())
    if np.ptp(on_facets) > tolerance or height.max() > level + tolerance:
        raise ValueError(
            f"the plane of symmetry {name!r} must be plane, with all of the mesh on one side; its nodes are up to "
            f"{np.ptp(on_facets):.3g} m and others up to {height.max() - level:.3g} m off it."
        )
    outer = mesh.boundary_facets()
    in_plane = outer[np.all(np.abs(height[mesh.facets[:, outer]] - level) <= tolerance, axis=0)]
    missing = np.setdiff1d(in_plane, facets)
    if missing.size:
        raise ValueError(
            f"the symmetry at {name!r} is not closed: {missing.size} of the {in_plane.size} facets that the mesh has "
            "in this plane do not have this name. Give all of them the name, or remove the name from symmetry."
        )
    return Mirror(kind, facets, normal, level)


def surface(mesh: MeshTet, name: str, argument: str) -> Ints:
    boundaries = named_sets(mesh.boundaries)
    if name not in boundaries:
        volume = name in named_sets(mesh.subdomains)
        remedy = " It is a subdomain, a volume: name the facets around it." if volume else ""
        raise ValueError(
            f"{argument} has {name!r}, which is no surface of the mesh; its boundaries are {listed(boundaries)}."
            f"{remedy}"
        )
    return boundaries[name]


def checked_symmetry(value: Any) -> dict[str, str]:
    planes = checked_mapping(value, "symmetry must map names of boundaries to 'parallel' or 'normal'")
    for name, kind in planes.items():
        if kind not in KINDS:
            raise ValueError(
                f"symmetry of {name!r} must be 'parallel' or 'normal', what the flux is to the plane; got {kind!r}."
            )
    return planes
