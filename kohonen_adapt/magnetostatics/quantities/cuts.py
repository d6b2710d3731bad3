"""Planes of symmetry and sectors that cut a body at the outer boundary."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from skfem import MeshTet, MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.magnetostatics.quantities.bodies import outer_facets
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.mesh.cells import width_of
from kohonen_adapt.mesh.measures import unit_vectors
from kohonen_adapt.mesh.names import named_sets

__all__ = ["Cut", "cut_of", "mirror_cut", "sector_cut", "without_cancelled"]

NEAR = 1e-9  # tolerance of lengths, relative to the size of the mesh
SAME = 1e-6  # distance of equal unit vectors
ROUND = 1e-3  # allowed difference of the radii of the ends of a facet on a circle, relative to its length
RADIAL = (1.0, 0.0)  # the force around an axis is along the axis


class Cut(NamedTuple):
    facets: Ints  # along the cut, of the body and its neighbours
    normals: list[Floats]  # unit vectors (d,) across planes of symmetry
    master: Ints  # (nnodes,): node of which a node is the image, or the node itself


def cut_of(field: MagneticField, inside: Mask, centre: Floats | None) -> Cut:
    """Return the cut through a body, for its force or for its torque about a centre."""
    mesh = field.elements.corners
    if len(mesh.p) == 3:
        return plane_cut(mesh, inside, field.mirrors)
    if centre is not None:
        return sector_cut(mesh, inside, centre)
    cut = mirror_cut(mesh, inside)
    return cut._replace(normals=[*cut.normals, np.array(RADIAL)]) if field.axisymmetric else cut


def without_cancelled(cut: Cut, vector: Floats, torque: bool) -> Floats:
    # Images leave the components of a force along the planes, and of a torque the components normal to the planes.
    for normal in reversed(cut.normals):
        across = normal * (normal @ vector)
        vector = across if torque else vector - across
    return vector


def plane_cut(mesh: MeshTet, inside: Mask, mirrors: Iterable[Mirror]) -> Cut:
    body_facets = outer_facets(mesh, inside)
    cuts = [mirror for mirror in mirrors if np.isin(mirror.facets, body_facets).any()]
    facets = np.concatenate([body_facets[:0], *(mirror.facets for mirror in cuts)])
    elsewhere = np.setdiff1d(body_facets, facets)
    if elsewhere.size:
        raise ValueError(
            f"the body lies on the outer boundary of the mesh with {elsewhere.size} facets that are on no plane of "
            "symmetry; the force on a part of a body can only be computed if planes of symmetry cut it. Name them in "
            "symmetry, or extend the mesh beyond the boundary."
        )
    return Cut(facets, [mirror.normal for mirror in cuts], np.arange(mesh.nvertices))


def mirror_cut(mesh: MeshTri, inside: Mask) -> Cut:
    body_facets, master = outer_facets(mesh, inside), np.arange(mesh.nvertices)
    if not body_facets.size:
        return Cut(body_facets, [], master)
    edge, tolerance = _edges(mesh, body_facets), NEAR * width_of(mesh)
    along, up = edge[:, np.argmax(np.hypot(*edge))] / np.hypot(*edge).max()
    normal = np.array([-up, along])
    if np.any(np.abs(normal @ edge) > tolerance):
        raise ValueError(
            "the body lies on the outer boundary along lines of several directions; the force on a part of it can only "
            "be computed if a mirror plane cuts it. Extend the mesh beyond the boundary."
        )
    outer, height = mesh.boundary_facets(), normal @ mesh.p
    level = np.unique(height[mesh.facets[0, body_facets]])
    near = np.abs(height[mesh.facets[:, outer], None] - level) < tolerance
    return Cut(outer[near.all(axis=0).any(axis=1)], [normal], master)


def sector_cut(mesh: MeshTri, inside: Mask, centre: Floats) -> Cut:
    """Return the two sides of a periodic sector that cut the body.

    The body may end on circles about the centre, because a constant A makes no torque there.

    Raises
    ------
    ValueError
        If the body lies on other parts of the outer boundary, or the nodes of the sides have different radii.
    """
    body_facets, master = outer_facets(mesh, inside), np.arange(mesh.nvertices)
    radial, tolerance = mesh.p - centre[:, None], NEAR * width_of(mesh)
    radius = np.hypot(*radial)
    rise = np.ptp(radius[mesh.facets[:, body_facets]], axis=0)
    body_facets = body_facets[rise > ROUND * np.hypot(*_edges(mesh, body_facets))]
    if not body_facets.size:
        return Cut(body_facets, [], master)
    outer, sides = mesh.boundary_facets(), list[Ints]()
    directions = unit_vectors(radial[:, mesh.facets[:, body_facets]].mean(axis=1))
    while directions.size and len(sides) < 3:
        x, y = ray = directions[:, 0]
        on_ray = (np.abs(np.array([-y, x]) @ radial) < tolerance) & (ray @ radial > -tolerance)
        sides.append(outer[on_ray[mesh.facets[:, outer]].all(axis=0)])
        directions = directions[:, np.hypot(*(directions - ray[:, None])) > SAME]
    if len(sides) != 2 or not np.isin(body_facets, np.concatenate(sides)).all():
        raise ValueError(
            "the body lies on the outer boundary elsewhere than on circles about the centre and on two straight sides "
            "through it; the torque on a part of a body can only be computed for a periodic sector. Extend the mesh."
            + _arc_remedy(mesh, body_facets, centre, radius)
        )
    nodes = [np.unique(mesh.facets[:, side]) for side in sides]
    first, second = (each[np.argsort(radius[each])] for each in nodes)
    if first.size != second.size or np.any(np.abs(radius[first] - radius[second]) > 1e3 * tolerance):
        raise ValueError(
            "the two sides through the centre that cut the body have no nodes at the same radii; the torque on a part "
            "of it can only be computed for a periodic sector, with sides that are images of each other."
        )
    master[second] = first
    return Cut(np.concatenate(sides), [], master)


def _arc_remedy(mesh: MeshTri, facets: Ints, centre: Floats, radius: Floats) -> str:
    found = []
    for name, rows in sorted(named_sets(mesh.boundaries).items()):
        node_radius = radius[np.unique(mesh.facets[:, rows])]
        on_circle = node_radius > (1.0 - NEAR) * node_radius.max(initial=0.0)
        # Four nodes on a circle may be the corners of a rectangle.
        if np.isin(rows, facets).any() and on_circle.sum() > 4 and node_radius.min() > 0.5 * node_radius.max():
            x, y = centre
            found.append(f'"{name}": ka.Arc(({x:.9g}, {y:.9g}), {node_radius.max():.9g})')
    if not found:
        return ""
    return f" If nodes have left an arc with too few nodes to be recognised, adapt with curves={{{', '.join(found)}}}."


def _edges(mesh: MeshTri, facets: Ints) -> Floats:
    start, end = mesh.p[:, mesh.facets[:, facets]].swapaxes(0, 1)
    return end - start
