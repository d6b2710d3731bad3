"""Integrate forces and torques of a field in space around a body, and the flux through surfaces."""

from collections.abc import Iterable

import numpy as np
from skfem import MeshTet
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.mirrors import Mirror, surface
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.bodies import (
    Cut,
    Names,
    isolated_body,
    weight_gradient,
)
from kohonen_adapt.magnetostatics.quantities.local_solid import LocalSolid
from kohonen_adapt.mesh.cells import normals

__all__ = ["eggshell", "flux_through"]

EDGEWISE = 0.1  # cosine between a facet and the way through its surface, below which it has no side


def eggshell(field: LocalSolid, body: Names, centre: Floats | None = None) -> Floats:
    """Force (3,) on a body in N, or the torque about a centre in N m; see `SolidField.force`."""
    mesh, inside = field.mesh, isolated_body(field, body)
    cuts = _cuts(mesh, inside, field.mirrors)
    facets = np.concatenate([mirror.facets for mirror in cuts]) if cuts else np.zeros(0, dtype=np.int64)
    twin = np.arange(mesh.p.shape[1])
    slope, at = weight_gradient(field, inside, Cut(facets, None, twin)), field.at_quadrature
    b = at.flux_density
    normal, pressure = np.sum(b * slope, axis=0), 0.5 * np.sum(b**2, axis=0)
    pull = -field.point_volumes / VACUUM_PERMEABILITY * (b * normal - pressure * slope)
    if centre is not None:
        pull = np.cross(at.x - centre[:, None], pull, axis=0)
    total = np.sum(pull, axis=1)
    for mirror in cuts:  # what its image takes away: of a force the part across, of a torque the part along the plane
        across = mirror.normal * (mirror.normal @ total)
        total = total - across if centre is None else across
    return total


def _cuts(mesh: MeshTet, inside: Mask, mirrors: Iterable[Mirror]) -> list[Mirror]:
    """The planes of symmetry that cut the body; refused where it lies on the outer boundary elsewhere."""
    outer = mesh.boundary_facets()
    left, cuts = outer[inside[mesh.f2t[0, outer]]], []
    for mirror in mirrors:
        if np.isin(mirror.facets, left).any():
            cuts.append(mirror)
    elsewhere = np.setdiff1d(left, np.concatenate([left[:0], *(mirror.facets for mirror in cuts)]))
    if elsewhere.size:
        raise ValueError(
            f"the body lies on the outer boundary of the mesh with {elsewhere.size} facets that are on no plane of "
            "symmetry; the force on a part of a body can only be told where such planes cut it. Name them in "
            "symmetry, or model what is beyond the boundary."
        )
    return cuts


def flux_through(mesh: MeshTet, name: str, flux_density: Floats) -> float:
    """Flux through a surface of a flux density (3, nelements): the mean of both sides."""
    rows = surface(mesh, name, "flux")
    facets = np.asarray(rows)
    if not facets.size:
        raise ValueError(f"the surface {name!r} has no facets; name one that has.")
    one, other = mesh.f2t[:, facets]
    mean = 0.5 * (flux_density[:, one] + flux_density[:, np.where(other < 0, one, other)])
    out = 0.5 * normals(mesh.p.T, mesh.facets[:, facets].T).T
    away = mesh.p[:, mesh.facets[0, facets]] - mesh.p[:, mesh.t[:, one]].mean(axis=1)
    out *= np.sign(np.sum(out * away, axis=0))
    return float(np.sum(_sense(mesh, name, facets, out) * np.sum(mean * out, axis=0)))


def _sense(mesh: MeshTet, name: str, facets: Ints, out: Floats) -> Floats:
    """1 where the flux counts out of the first element of a facet, -1 where into it, (nfacets,)."""
    rows = mesh.boundaries[name]
    if isinstance(rows, OrientedBoundary):
        return np.where(rows.ori == 0, 1.0, -1.0)
    outer = mesh.f2t[1, facets] < 0
    if outer.all():
        return np.ones(facets.size)
    size = np.linalg.norm(out, axis=0)
    unit = out / size
    way = np.linalg.eigh((unit * size) @ unit.T)[1][:, -1]
    way = way * np.sign(way[np.argmax(np.abs(way))])
    along = way @ unit
    if np.abs(along).min() < EDGEWISE:
        raise ValueError(
            f"the surface {name!r} inside the mesh has no side from which all of it is seen; say which way its flux "
            "counts by a skfem.OrientedBoundary, or name parts of it."
        )
    return np.sign(along)
