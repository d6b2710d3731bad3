"""Where the outer boundary cuts a body: along a mirror plane, or along the two sides of a periodic sector."""

from typing import NamedTuple

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask

__all__ = ["Cut", "mirror_cut", "sector_cut"]

NEAR = 1e-9  # of the size of the mesh
ROUND = 1e-3  # of the length of a facet: how much its ends may differ in radius on a circle


class Cut(NamedTuple):
    """Facets of the outer boundary that are a cut, not an end, and what is known there.

    Attributes
    ----------
    facets
        Numbers of the facets along the cut, of the body and of what lies beside it.
    direction
        Of a mirror plane, a unit vector (2,); None of a sector, and where nothing is cut.
    twin
        (nnodes,): of each node the one that it is an image of, else itself.
    """

    facets: Ints
    direction: Floats | None
    twin: Ints


def mirror_cut(mesh: MeshTri, inside: Mask) -> Cut:
    """The lines of one direction along which the outer boundary cuts the body.

    Raises
    ------
    ValueError
        If they have several directions.
    """
    own, twin = _outer_facets(mesh, inside), np.arange(mesh.p.shape[1])
    if not own.size:
        return Cut(own, None, twin)
    edge = _edges(mesh, own)
    direction = edge[:, np.argmax(np.hypot(*edge))] / np.hypot(*edge).max()
    near = NEAR * np.ptp(mesh.p, axis=1).max()
    if np.any(np.abs(_cross(direction, edge)) > near):
        raise ValueError(
            "the body lies on the outer boundary along lines of several directions; the force on a part of it can only "
            "be told where it is cut by a mirror plane. Model what is beyond the boundary."
        )
    outer = mesh.boundary_facets()
    height = _cross(direction, mesh.p)[mesh.facets[:, outer]]
    level = np.unique(_cross(direction, mesh.p)[mesh.facets[0, own]])
    along = np.any(np.all(np.abs(height[:, :, None] - level) < near, axis=0), axis=1)
    return Cut(outer[along], direction, twin)


def sector_cut(mesh: MeshTri, inside: Mask, centre: Floats) -> Cut:
    """The two sides of a periodic sector about the centre, along which the outer boundary cuts the body.

    On circles about the centre the body may end at the outer boundary: where A is constant they have no torque.

    Raises
    ------
    ValueError
        If the body lies on the outer boundary elsewhere, or the sides do not have the same nodes.
    """
    own, twin = _outer_facets(mesh, inside), np.arange(mesh.p.shape[1])
    radial, near = mesh.p - centre[:, None], NEAR * np.ptp(mesh.p, axis=1).max()
    radius = np.hypot(*radial)[mesh.facets[:, own]]
    own = own[np.abs(radius[0] - radius[1]) > ROUND * np.hypot(*_edges(mesh, own))]
    if not own.size:
        return Cut(own, None, twin)
    outer = mesh.boundary_facets()
    rays = _rays(radial[:, mesh.facets[:, own]].mean(axis=1))
    sides = [outer[np.all(_on_ray(ray, radial[:, mesh.facets[:, outer]], near), axis=0)] for ray in rays]
    if len(sides) != 2 or not np.isin(own, np.concatenate(sides)).all():
        raise ValueError(
            "the body lies on the outer boundary elsewhere than on circles about the centre and on two straight sides "
            "through it; the torque on a part of a body can only be told of a periodic sector. Model what is beyond."
        )
    one, other = (_by_radius(mesh.facets[:, side], radial) for side in sides)
    if one.size != other.size or np.any(np.abs(np.hypot(*radial[:, one]) - np.hypot(*radial[:, other])) > 1e3 * near):
        raise ValueError(
            "the two sides through the centre that cut the body have no nodes at the same radii; the torque on a part "
            "of it can only be told of a periodic sector, whose sides are one another's image."
        )
    twin[other] = one
    return Cut(np.concatenate(sides), None, twin)


def _outer_facets(mesh: MeshTri, inside: Mask) -> Ints:
    outer = mesh.boundary_facets()
    return outer[inside[mesh.f2t[0, outer]]]


def _edges(mesh: MeshTri, facets: Ints) -> Floats:
    start, end = mesh.p[:, mesh.facets[:, facets]].swapaxes(0, 1)
    return end - start


def _cross(direction: Floats, x: Floats) -> Floats:
    return direction[0] * x[1] - direction[1] * x[0]


def _rays(x: Floats) -> list[Floats]:
    """The different directions of these points from the origin."""
    units = x / np.hypot(*x)
    rays: list[Floats] = []
    for unit in units.T:
        if all(np.hypot(*(unit - ray)) > 1e-6 for ray in rays):
            rays.append(unit)
            if len(rays) > 2:
                break
    return rays


def _on_ray(ray: Floats, x: Floats, near: float) -> Mask:
    """Which points (2, ...) are on the half-line from the origin."""
    return (np.abs(_cross(ray, x)) < near) & (np.tensordot(ray, x, 1) > -near)


def _by_radius(facets: Ints, radial: Floats) -> Ints:
    nodes = np.unique(facets)
    return nodes[np.argsort(np.hypot(*radial[:, nodes]))]
