"""Fix a scalar potential on surfaces, and check the planes of symmetry that a mesh of tetrahedra ends at."""

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
from kohonen_adapt.magnetostatics.materials.coefficients import magnitude
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.names import named_sets

__all__ = ["Mirror", "checked_symmetry", "conditions_in_space", "mirrors_of", "surface"]

KINDS = ("parallel", "normal")  # what the flux is to a plane of symmetry
FLAT = 1e-6  # of the size of the mesh: nodes this near to a plane are on it
ASKANCE = 0.01  # of the largest applied field on a plane: what it may have that the symmetry forbids


class Mirror(NamedTuple):
    """A plane of symmetry."""

    kind: str
    facets: Ints  # of the mesh, all that it has there
    normal: Floats  # (3,), a unit vector out of the mesh


def mirrors_of(mesh: MeshTet, symmetry: Mapping[str, str]) -> dict[str, Mirror]:
    """The planes of symmetry by name; refused where a name is of no plane that closes the mesh there."""
    number_facets(mesh)
    return {name: Mirror(kind, *_plane_of(mesh, name)) for name, kind in symmetry.items()}


def _plane_of(mesh: MeshTet, name: str) -> tuple[Ints, Floats]:
    """The facets of a plane and its outward normal."""
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
    there = outer[np.all(np.abs(height[mesh.facets[:, outer]] - middle) <= FLAT * size, axis=0)]
    missing = np.setdiff1d(there, facets)
    if missing.size:
        raise ValueError(
            f"the symmetry at {name!r} is not closed: {missing.size} of the {there.size} facets that the mesh has in "
            "this plane are not of that name. Give all of them the name, or take it out of symmetry."
        )
    return facets, normal


def surface(mesh: MeshTet, name: str, argument: str) -> Ints:
    """The facets of a name; refused if it is no surface."""
    boundaries = named_sets(mesh.boundaries)
    if name not in boundaries:
        volume = name in named_sets(mesh.subdomains)
        hint = " It is a subdomain, a volume: name the facets around it." if volume else ""
        raise ValueError(
            f"{argument} has {name!r}, which is no surface of the mesh; its boundaries are {listed(boundaries)}.{hint}"
        )
    return boundaries[name]


def conditions_in_space(drive: Drive, potential: Mapping[str, Value], mirrors: Mapping[str, Mirror]) -> Conditions:
    """The conditions on u, which is the reduced potential, and in iron the total one.

    Where nothing is given in a connected part, its first node is not free though nothing is fixed there: u is known up
    to a constant.
    """
    elements, mesh = drive.elements, drive.elements.mesh
    for name in potential:
        surface(mesh, name, "potential")
    fixed, values = fixed_values(elements, Boundaries(potential))
    for name, mirror in mirrors.items():
        _check_field(drive, name, mirror)
        if mirror.kind == "normal":
            nodes = np.unique(mesh.facets[:, mirror.facets])
            fixed[nodes], values[nodes] = True, 0.0
    held = fixed | _first_of_loose(mesh, fixed)
    return Conditions(fixed, np.where(held, values + drive.potential, 0.0), np.flatnonzero(~held))


def _check_field(drive: Drive, name: str, mirror: Mirror) -> None:
    """Refuse an applied field that is not as the symmetry has it: of coils without their images."""
    if drive.function is None:
        return
    mesh = drive.elements.mesh
    field = field_at(drive.function, mesh.p[:, np.unique(mesh.facets[:, mirror.facets])])
    across = np.outer(mirror.normal, mirror.normal @ field)
    wrong = magnitude(across if mirror.kind == "parallel" else field - across).max()
    if wrong > ASKANCE * magnitude(field).max():
        other = "across" if mirror.kind == "parallel" else "along"
        raise ValueError(
            f"the flux is {mirror.kind} to the plane of symmetry {name!r}, but the applied_field has up to "
            f"{wrong:.3g} A/m {other} it. Give the field of the whole coils, images included, or another symmetry."
        )


def _first_of_loose(mesh: MeshTet, fixed: Mask) -> Mask:
    """The first node of every connected part of the mesh without a given value, (nnodes,)."""
    nnodes, (a, b, c, d) = fixed.size, mesh.t
    ways = np.concatenate((a, b, c)), np.concatenate((b, c, d))
    _, part = connected_components(coo_array((np.ones(ways[0].size), ways), shape=(nnodes,) * 2), directed=False)
    number, first = np.unique(part, return_index=True)
    chosen = np.zeros(nnodes, dtype=bool)
    chosen[first[~np.isin(number, part[fixed])]] = True
    return chosen


def checked_symmetry(given: Any) -> dict[str, str]:
    """The argument as a dict of its own."""
    if given is not None and not isinstance(given, Mapping):
        raise ValueError(f"symmetry must map names of boundaries to 'parallel' or 'normal'; got {given!r}.")
    for name, kind in (given or {}).items():
        if kind not in KINDS:
            raise ValueError(
                f"symmetry of {name!r} must be 'parallel' or 'normal', what the flux is to the plane; got {kind!r}."
            )
    return dict(given or {})
