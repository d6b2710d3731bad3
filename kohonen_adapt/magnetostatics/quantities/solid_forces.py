"""Forces and torques on a body in space, and the flux through surfaces."""

from collections.abc import Iterable

import numpy as np
from skfem import MeshTet
from skfem.generic_utils import OrientedBoundary
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.mirrors import Mirror, surface
from kohonen_adapt.magnetostatics.quantities.bodies import Cut, Names, isolated_body, outer_facets
from kohonen_adapt.magnetostatics.quantities.local_solid import LocalSolid
from kohonen_adapt.magnetostatics.quantities.stress import Component, stress_force, weight_gradient
from kohonen_adapt.mesh.cells import normals

__all__ = ["eggshell", "flux_through", "force_component", "oriented_surface", "torque_component"]

DEGREE = 2  # of the quadrature of a flux
EDGEWISE = 0.1  # cosine between the normal of a facet and of its surface, below which the facet has no side


def eggshell(field: LocalSolid, body: Names, centre: Floats | None = None) -> Floats:
    """Return the force (3,) on a body in N, or the torque about `centre` in N m."""
    slope, cuts = _shell(field, body)
    parts = stress_force(field, slope)
    if centre is not None:
        parts = np.cross(field.at_quadrature.x - centre[:, None], parts, axis=0)
    return _uncancelled(cuts, np.sum(parts, axis=1), centre is not None)


def force_component(field: LocalSolid, body: Names, direction: Floats) -> Component:
    slope, cuts = _shell(field, body)
    return Component(slope, np.tile(_uncancelled(cuts[::-1], direction, False)[:, None], slope.shape[1]))


def torque_component(field: LocalSolid, body: Names, centre: Floats, axis: Floats) -> Component:
    slope, cuts = _shell(field, body)
    across = _uncancelled(cuts[::-1], axis, True)
    return Component(slope, np.cross(across, field.at_quadrature.x - centre[:, None], axisb=0).T)


def _shell(field: LocalSolid, body: Names) -> tuple[Floats, list[Mirror]]:
    mesh, inside = field.mesh, isolated_body(field, body)
    cuts = _cuts(mesh, inside, field.mirrors)
    facets = np.concatenate([mirror.facets for mirror in cuts]) if cuts else np.zeros(0, dtype=np.int64)
    return weight_gradient(field, inside, Cut(facets, None, np.arange(mesh.p.shape[1]))), cuts


def _uncancelled(cuts: Iterable[Mirror], vector: Floats, torque: bool) -> Floats:
    """Return the vector without the components that the images cancel.

    Images leave the components of a force along the planes, and of a torque the components normal to the planes.
    """
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
    mesh, (points, weights) = field.mesh, get_quadrature(RefTri, DEGREE)
    facets, normal, sign = oriented_surface(mesh, name)
    x = np.einsum("iq,cin->cqn", np.stack([1.0 - points.sum(axis=0), *points]), mesh.p[:, mesh.facets[:, facets]])
    first, second = mesh.f2t[:, facets]
    both, total = (first, np.where(second < 0, first, second)), np.zeros_like(normal)
    for element in both:
        density = field.at(x.reshape(3, -1), np.tile(element, weights.size)).flux_density.reshape(x.shape)
        total += np.einsum("cqn,q->cn", density, weights)  # the weights have the sum 1/2
    return float(np.sum(sign * np.sum(total * normal, axis=0)))


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
    """Return 1 where the flux counts out of the first element of a facet, else -1."""
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
