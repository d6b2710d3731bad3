"""Planes of symmetry, and the conditions on a scalar potential in space."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import listed
from kohonen_adapt.magnetostatics.equations.applied_field import Drive, field_at
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, Conditions, Value, fixed_values
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.names import named_sets

__all__ = ["Mirror", "checked_symmetry", "conditions_in_space", "mirrors_of", "surface"]

KINDS = ("parallel", "normal")  # direction of the flux at a plane of symmetry
FLAT = 1e-6  # distance at which nodes are on a plane, relative to the size of the mesh
ASYMMETRY = 0.01  # allowed asymmetric part of the applied field on a plane, relative to the largest


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


def conditions_in_space(drive: Drive, potential: Mapping[str, Value], mirrors: Mapping[str, Mirror]) -> Conditions:
    """Return the conditions on u, the reduced potential, in iron the total one.

    A connected part without a given value has a first node that is neither fixed nor free, because u is determined
    there up to a constant only.
    """
    elements, mesh = drive.elements, drive.elements.mesh
    for name in potential:
        surface(mesh, name, "potential")
    fixed, values = fixed_values(elements, Boundaries(potential))
    for name, mirror in mirrors.items():
        _check_field(drive, name, mirror)
        if mirror.kind == "normal":
            rows = np.unique(elements.on_facets(mirror.facets))
            fixed[rows], values[rows] = True, 0.0
    held, nnodes = fixed.copy(), mesh.p.shape[1]
    held[:nnodes] |= _first_of_floating(mesh, fixed[:nnodes])
    return Conditions(fixed, np.where(held, values + drive.potential, 0.0), np.flatnonzero(~held))


def _check_field(drive: Drive, name: str, mirror: Mirror) -> None:
    if drive.function is None:
        return
    mesh = drive.elements.mesh
    field = field_at(drive.function, mesh.p[:, np.unique(mesh.facets[:, mirror.facets])])
    across = np.outer(mirror.normal, mirror.normal @ field)
    wrong = magnitude(across if mirror.kind == "parallel" else field - across).max()
    if wrong > ASYMMETRY * magnitude(field).max():
        direction = "across" if mirror.kind == "parallel" else "along"
        raise ValueError(
            f"the flux is {mirror.kind} to the plane of symmetry {name!r}, but the applied_field has up to "
            f"{wrong:.3g} A/m {direction} it. Give the field of the whole coils, images included, or another symmetry."
        )


def _first_of_floating(mesh: MeshTet, fixed: Mask) -> Mask:
    nnodes, (a, b, c, d) = fixed.size, mesh.t
    edges = np.concatenate((a, b, c)), np.concatenate((b, c, d))
    _, part = connected_components(coo_array((np.ones(edges[0].size), edges), shape=(nnodes,) * 2), directed=False)
    number, first = np.unique(part, return_index=True)
    chosen = np.zeros(nnodes, dtype=bool)
    chosen[first[~np.isin(number, part[fixed])]] = True
    return chosen


def checked_symmetry(value: Any) -> dict[str, str]:
    if value is not None and not isinstance(value, Mapping):
        raise ValueError(f"symmetry must map names of boundaries to 'parallel' or 'normal'; got {value!r}.")
    for name, kind in (value or {}).items():
        if kind not in KINDS:
            raise ValueError(
                f"symmetry of {name!r} must be 'parallel' or 'normal', what the flux is to the plane; got {kind!r}."
            )
    return dict(value or {})
