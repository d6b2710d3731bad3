"""Planes of symmetry in space."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.names import named_sets

__all__ = ["Mirror", "checked_symmetry", "mirrors_of", "surface"]

KINDS = ("parallel", "normal")  # direction of the flux at a plane of symmetry
FLAT = 1e-6  # distance at which nodes are on a plane, relative to the size of the mesh


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
