"""Planar and axisymmetric fields, and mirror planes in space."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import listed
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.names import named_sets

__all__ = ["AXISYMMETRIC", "PLANAR", "Mirror", "Symmetry", "checked_symmetry", "mirrors_of", "surface"]

AXIS = 1e-12  # distance at which nodes are on the axis, relative to the size of the mesh
ROUND = 1e-3  # allowed distance of the centre of an open boundary from the axis, relative to the size of the mesh

KINDS = ("parallel", "normal")  # direction of the flux at a plane of symmetry
FLAT = 1e-6  # distance at which nodes are on a plane, relative to the size of the mesh


class Planar:
    """Planar field with u = A_z and ``B = (dA/dy, -dA/dx)``, per metre of depth."""

    extent = 1.0  # factor of integrals over the plane: a metre of depth, or the angle around the axis

    def unknown(self, x: Floats, potential: Floats) -> Floats:
        return potential

    def potential(self, x: Floats, unknown: Floats) -> Floats:
        return unknown

    def on_axis(self, x: Floats) -> Mask:
        return np.zeros(x.shape[1], dtype=bool)

    def flux_density(self, x: Floats, gradient: Floats) -> Floats:
        return np.stack((gradient[1], -gradient[0]))

    def flux(self, field_strength: Floats) -> Floats:
        """Return ``nu' grad u - flux'`` of a field strength, and -flux' of -Hc."""
        return np.stack((-field_strength[1], field_strength[0]))

    def reluctivity(self, x: Floats, reluctivity: Floats) -> Floats:
        return reluctivity

    def source(self, current_density: Floats) -> Floats:
        return current_density

    def volume(self, x: Floats, area: Floats) -> Floats:
        return area

    def uniform(self, x: Floats, centre: Floats, field: tuple[float, float]) -> tuple[Floats, int]:
        """Return ``u / mu0`` of a uniform field, and the dimension of the exterior.

        `field` is in A/m; u is 0 at the centre.
        """
        (along_x, along_y), (x0, y0) = field, x - centre[:, None]
        return along_x * y0 - along_y * x0, 2


class Axisymmetric:
    """Axisymmetric field with u = r A_phi in the half-plane x = r >= 0, y = z.

    ``B_r = -(du/dz) / r`` and ``B_z = (du/dr) / r``; results are totals. Methods are as in `Planar`.
    """

    extent = 2.0 * np.pi

    def unknown(self, x: Floats, potential: Floats) -> Floats:
        return x[0] * potential

    def potential(self, x: Floats, unknown: Floats) -> Floats:
        off_axis = x[0] > 0.0
        return np.where(off_axis, unknown / np.where(off_axis, x[0], 1.0), 0.0)

    def on_axis(self, x: Floats) -> Mask:
        tolerance = AXIS * np.max(np.ptp(x, axis=1))
        outside = np.flatnonzero(x[0] < -tolerance)
        if outside.size:
            raise ValueError(
                f"an axisymmetric mesh must lie at r = x >= 0; {outside.size} nodes do not, first node {outside[0]} "
                f"at r = {x[0, outside[0]]:g} m."
            )
        return x[0] <= tolerance

    def flux_density(self, x: Floats, gradient: Floats) -> Floats:
        return np.stack((-gradient[1], gradient[0])) / x[0]

    def flux(self, field_strength: Floats) -> Floats:
        return self.extent * np.stack((field_strength[1], -field_strength[0]))

    def reluctivity(self, x: Floats, reluctivity: Floats) -> Floats:
        return reluctivity * (self.extent / x[0])

    def source(self, current_density: Floats) -> Floats:
        return self.extent * current_density

    def volume(self, x: Floats, area: Floats) -> Floats:
        return self.extent * x[0] * area

    def uniform(self, x: Floats, centre: Floats, field: tuple[float, float]) -> tuple[Floats, int]:
        size = np.max(np.ptp(x, axis=1))
        if abs(centre[0]) > ROUND * size:
            raise ValueError(
                f"the open boundary of an axisymmetric problem must have its centre on the axis; it is at r = "
                f"{centre[0]:.6g}, z = {centre[1]:.6g} m. Draw it as an arc about a point of the axis."
            )
        return 0.5 * field[1] * x[0] ** 2, 3


Symmetry = Planar | Axisymmetric

PLANAR, AXISYMMETRIC = Planar(), Axisymmetric()


class Mirror(NamedTuple):
    kind: str
    facets: Ints  # all facets of the mesh in the plane
    normal: Floats  # (3,), unit vector out of the mesh


def mirrors_of(mesh: MeshTet, symmetry: Mapping[str, str]) -> dict[str, Mirror]:
    number_facets(mesh)
    return {name: Mirror(kind, *_plane_of(mesh, name)) for name, kind in symmetry.items()}


def _plane_of(mesh: MeshTet, name: str) -> tuple[Ints, Floats]:
    facets, size = np.unique(surface(mesh, name, "symmetry")), np.ptp(mesh.p, axis=1).max()
    if facets.size == 0 or np.any(mesh.f2t[1, facets] >= 0):
        raise ValueError(f"the plane of symmetry {name!r} must be on the outer boundary of the mesh, all of it.")
    across = normals(mesh.p.T, mesh.facets[:, facets].T)
    normal = across[np.argmax(magnitude(across.T))]
    normal = normal / np.linalg.norm(normal)
    height = normal @ mesh.p
    level = height[mesh.facets[:, facets]]
    middle = 0.5 * (level.min() + level.max())
    normal, height, middle = (-normal, -height, -middle) if height.mean() > middle else (normal, height, middle)
    if np.ptp(level) > FLAT * size or height.max() > middle + FLAT * size:
        raise ValueError(
            f"the plane of symmetry {name!r} must be plane, with all of the mesh on one side; its nodes are up to "
            f"{np.ptp(level):.3g} m and others up to {height.max() - middle:.3g} m off it."
        )
    outer = mesh.boundary_facets()
    in_plane = outer[np.all(np.abs(height[mesh.facets[:, outer]] - middle) <= FLAT * size, axis=0)]
    missing = np.setdiff1d(in_plane, facets)
    if missing.size:
        raise ValueError(
            f"the symmetry at {name!r} is not closed: {missing.size} of the {in_plane.size} facets that the mesh has "
            "in this plane do not have this name. Give all of them the name, or remove the name from symmetry."
        )
    return facets, normal


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
    if value is not None and not isinstance(value, Mapping):
        raise ValueError(f"symmetry must map names of boundaries to 'parallel' or 'normal'; got {value!r}.")
    for name, kind in (value or {}).items():
        if kind not in KINDS:
            raise ValueError(
                f"symmetry of {name!r} must be 'parallel' or 'normal', what the flux is to the plane; got {kind!r}."
            )
    return dict(value or {})
