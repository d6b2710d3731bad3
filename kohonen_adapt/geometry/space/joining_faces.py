"""Patches, the connected constrained faces on one surface.

All faces of a patch have the same names and regions on both sides.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.chains import curve_of_facets
from kohonen_adapt.geometry.plane.curves import check_near
from kohonen_adapt.geometry.plane.cutting import TURN
from kohonen_adapt.geometry.plane.polylines import CORNER
from kohonen_adapt.geometry.space.faces import Faces, Seams
from kohonen_adapt.geometry.space.patches import Patches, Sheet
from kohonen_adapt.geometry.space.recognition import Skin, rounds_among
from kohonen_adapt.geometry.space.surfaces import Cone, Cylinder, Plane, Sphere, Surface
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, PLANE, PROJECTED, SPHERE
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.names import connected_components_of, in_order

__all__ = ["patches_of"]

NOWHERE = (0.0, 0.0, 0.0)


def patches_of(faces: Faces, seams: Seams, position: Floats, surfaces: Mapping[str, Surface]) -> Patches:
    user_defined = curve_of_facets(faces.sides, len(faces.element), surfaces, "surface")
    without_corner = np.array([*(isinstance(each, Plane | Sphere | Cylinder | Cone) for each in surfaces.values()), 0])
    one, other = user_defined[seams.faces].T
    same_label = seams.same_label & (one == other)
    smooth = same_label & ((seams.turn < CORNER) | without_corner.astype(bool)[one])
    group = connected_components_of(
        len(user_defined), seams.faces[np.where(one >= 0, smooth, same_label & (seams.turn <= TURN))]
    )
    plain = smooth & (one < 0)
    skin = Skin(position, faces.nodes, seams.faces[plain], seams.turn[plain], group)
    rounds = rounds_among(skin, user_defined < 0)
    for number, (part, _) in enumerate(rounds):
        group[part] = len(user_defined) + number
    patch = in_order(group)
    first = np.unique(patch, return_index=True)[1]
    shape, origin, axis, size = planes_of(faces, patch, first, position)
    for part, each in rounds:
        p = patch[part[0]]
        shape[p], origin[p], axis[p], size[p] = each.shape, each.origin, each.axis, each.size
    for p in np.flatnonzero(user_defined[first] >= 0).tolist():
        name, surface = list(surfaces.items())[user_defined[first[p]]]
        check_near(position[np.unique(faces.nodes[patch == p])], surface, name)
        shape[p], origin[p], axis[p], size[p] = row_of(surface)
    front, names, sheet = sides_of(faces, seams, patch, first, position)
    return Patches(patch, shape, origin, axis, size, user_defined[first], dict(surfaces), front, names, sheet)


def row_of(surface: Surface) -> tuple[int, tuple[float, ...], tuple[float, ...], float]:
    if isinstance(surface, Plane):
        return PLANE, surface.point, surface.normal, 0.0
    if isinstance(surface, Sphere):
        return SPHERE, surface.centre, NOWHERE, surface.radius
    if isinstance(surface, Cylinder):
        return CYLINDER, surface.point, surface.axis, surface.radius
    if isinstance(surface, Cone):
        return CONE, surface.apex, surface.axis, surface.half_angle
    return PROJECTED, NOWHERE, NOWHERE, 0.0


def planes_of(
    faces: Faces, patch: Ints, first: Ints, position: Floats
) -> tuple[NDArray[np.int8], Floats, Floats, Floats]:
    across = normals(position, faces.nodes)
    largest = np.lexsort((-np.einsum("ij,ij->i", across, across), patch))
    reference = across[largest[np.flatnonzero(np.diff(patch[largest], prepend=-1))]]
    across *= np.sign(np.einsum("ij,ij->i", across, reference[patch]))[:, None]
    total = np.stack([np.bincount(patch, weights=column) for column in across.T], axis=1)
    axis = total / np.linalg.norm(total, axis=1, keepdims=True)
    return np.full(len(first), PLANE, dtype=np.int8), position[faces.nodes[first, 0]], axis, np.zeros(len(first))


def sides_of(
    faces: Faces, seams: Seams, patch: Ints, first: Ints, position: Floats
) -> tuple[Ints, dict[str, NDArray[np.int8]], Sheet]:
    """Return the region in front of every patch, its names, and the `Sheet`.

    The front of a patch is the side on which the element of its first face lies. The sheet distinguishes front and back
    of patches with the same region on both sides.
    """
    region, behind = faces.regions[first].T
    front = np.where(region == behind, -1, region)
    names = {name: side[first] for name, side in faces.sides.items()}
    count, inside = len(patch), patch[seams.faces[:, 0]] == patch[seams.faces[:, 1]]
    (one, other), turned = seams.faces[inside].T, ~seams.opposite[inside]
    pairs = np.concatenate([np.stack([one + side * count, other + (side ^ turned) * count], axis=1) for side in (0, 1)])
    cover = connected_components_of(2 * count, pairs)
    rows = np.flatnonzero(front[patch] < 0)
    is_front = cover[rows] == cover[first[patch[rows]]]
    back = normals(position, faces.nodes[rows]) * np.where(is_front, 1.0, -1.0)[:, None]
    centroids = position[faces.nodes[rows]].mean(axis=1)
    return front, names, Sheet.of(centroids, patch[rows], back, float(np.ptp(position, axis=0).max()))
