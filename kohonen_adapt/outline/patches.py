"""Join constrained faces to patches: connected, on one surface, and alike in names and regions on both sides."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, PLANE, PROJECTED, SPHERE
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.outline.chains import curve_of_facets
from kohonen_adapt.outline.curves import check_near, projected
from kohonen_adapt.outline.faces import Faces, Seams
from kohonen_adapt.outline.polylines import CORNER
from kohonen_adapt.outline.recognition import TURN, Skin, rounds_among
from kohonen_adapt.outline.surfaces import (
    Cone,
    Cylinder,
    Plane,
    Sphere,
    Surface,
    on_cone,
    on_cylinder,
    on_plane,
    on_sphere,
)

__all__ = ["Patches", "joined", "on_their_patches", "patches_of"]

NOWHERE = (0.0, 0.0, 0.0)
STILL = 1e-15  # of the size of the mesh: nodes that projections move no farther are on all of their patches
ROUNDS = 100  # of projections; on two patches at right angles the first one does it


class Patches(NamedTuple):
    """The patches, a row each, and which of them every constrained face is part of."""

    of_face: Ints  # (f,)
    shape: NDArray[np.int8]  # (p,)
    origin: Floats  # (p, 3)
    axis: Floats  # (p, 3)
    size: Floats  # (p,)
    given: Ints  # (p,) which of the surfaces told for boundaries, -1 for none
    surfaces: dict[str, Surface]  # those, by name
    front: Ints  # (p,) the region on its front, -1 where both sides are in one
    names: dict[str, NDArray[np.int8]]  # per boundary name (p,): 0, UNORIENTED, LEFT (of its front) or RIGHT
    sheet: "Sheet"

    @property
    def moves(self) -> Mask:
        """Patches whose nodes may have to be put there: all but planes that the nodes themselves told, (p,)."""
        return (self.shape != PLANE) | (self.given >= 0)

    def project(self, patch: Ints, x: Floats) -> Floats:
        """The points of patches (k,) nearest to x, (k, 3)."""
        found, shape = x.copy(), self.shape[patch]
        for kind, put in ((PLANE, on_plane), (CYLINDER, on_cylinder), (CONE, on_cone), (SPHERE, on_sphere)):
            rows = np.flatnonzero(shape == kind)
            p = patch[rows]
            own = [self.origin[p], *[self.axis[p]] * (kind != SPHERE), *[self.size[p]] * (kind != PLANE)]
            found[rows] = put(x[rows], *own)
        for number, (name, surface) in enumerate(self.surfaces.items()):
            rows = np.flatnonzero((shape == PROJECTED) & (self.given[patch] == number))
            if len(rows):
                found[rows] = projected(surface, x[rows], name)
        return found


class Sheet(NamedTuple):
    """The faces, as they were, of patches with one region on both sides: what tells one side from the other."""

    tree: cKDTree  # of the middles of faces, and of their patches times `apart`
    back: Floats  # (s, 3) normals of those faces, away from the front
    apart: float

    @classmethod
    def of(cls, middles: Floats, patch: Ints, back: Floats, size: float) -> "Sheet":
        """Of faces of these patches, in a mesh of that size."""
        return cls(cKDTree(np.column_stack([middles, patch * (10.0 * size)])), back, 10.0 * size)

    def looks_back(self, middles: Floats, patch: Ints, out: Floats) -> Mask:
        """Whether faces of patches (k,) look away from the front by their normals, as the nearest face did."""
        nearest = self.tree.query(np.column_stack([middles, patch * self.apart]))[1]
        return np.einsum("ij,ij->i", out, self.back[nearest]) > 0.0


def patches_of(faces: Faces, seams: Seams, position: Floats, surfaces: Mapping[str, Surface]) -> Patches:
    """Join faces to patches, which are numbered in the order of their first faces.

    Refuses surfaces that nodes of their boundary are not on, and two for one face.
    """
    told = curve_of_facets(faces.sides, len(faces.element), surfaces, "surface")
    without_corner = np.array([*(isinstance(each, Plane | Sphere | Cylinder | Cone) for each in surfaces.values()), 0])
    one, other = told[seams.faces].T
    alike = seams.alike & (one == other)
    smooth = alike & ((seams.turn < CORNER) | without_corner.astype(bool)[one])
    group = joined(len(told), seams.faces[np.where(one >= 0, smooth, alike & (seams.turn <= TURN))])
    plain = smooth & (one < 0)
    skin = Skin(position, faces.nodes, seams.faces[plain], seams.turn[plain], group)
    rounds = rounds_among(skin, told < 0)
    for number, (part, _) in enumerate(rounds):
        group[part] = len(told) + number
    patch = ordered(group)
    first = np.unique(patch, return_index=True)[1]
    shape, origin, axis, size = planes_of(faces, patch, first, position)
    for part, each in rounds:
        p = patch[part[0]]
        shape[p], origin[p], axis[p], size[p] = each.shape, each.origin, each.axis, each.size
    for p in np.flatnonzero(told[first] >= 0).tolist():
        name, surface = list(surfaces.items())[told[first[p]]]
        check_near(position[np.unique(faces.nodes[patch == p])], surface, name)
        shape[p], origin[p], axis[p], size[p] = row_of(surface)
    front, names, sheet = sides_of(faces, seams, patch, first, position)
    return Patches(patch, shape, origin, axis, size, told[first], dict(surfaces), front, names, sheet)


def row_of(surface: Surface) -> tuple[int, tuple[float, ...], tuple[float, ...], float]:
    """Shape, origin, axis and size of a surface as loops take it."""
    if isinstance(surface, Plane):
        return PLANE, surface.point, surface.normal, 0.0
    if isinstance(surface, Sphere):
        return SPHERE, surface.centre, NOWHERE, surface.radius
    if isinstance(surface, Cylinder):
        return CYLINDER, surface.point, surface.axis, surface.radius
    if isinstance(surface, Cone):
        return CONE, surface.apex, surface.axis, surface.half_angle
    return PROJECTED, NOWHERE, NOWHERE, 0.0


def joined(count: int, pairs: Ints) -> Ints:
    """Number of the connected set of every one of `count` things, (count,), in the order of their first ones."""
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), tuple(pairs.T)), shape=(count, count))
    return ordered(connected_components(graph, directed=False)[1])


def ordered(label: Ints) -> Ints:
    """Labels numbered in the order in which they come first."""
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number]


def planes_of(
    faces: Faces, patch: Ints, first: Ints, position: Floats
) -> tuple[NDArray[np.int8], Floats, Floats, Floats]:
    """Shape, origin, axis and size of patches, were they all plane: a node, and the mean normal by area."""
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
    """The region on the front of every patch, how it carries each name, and what tells its sides apart.

    The front is the side on which the element of its first face is. Sides of faces go on into one another over seams.
    """
    region, behind = faces.regions[first].T
    front = np.where(region == behind, -1, region)
    names = {name: side[first] for name, side in faces.sides.items()}
    count, inside = len(patch), patch[seams.faces[:, 0]] == patch[seams.faces[:, 1]]
    (one, other), turned = seams.faces[inside].T, ~seams.opposite[inside]
    pairs = np.concatenate([np.stack([one + side * count, other + (side ^ turned) * count], axis=1) for side in (0, 1)])
    cover = joined(2 * count, pairs)
    rows = np.flatnonzero(front[patch] < 0)
    is_front = cover[rows] == cover[first[patch[rows]]]
    back = normals(position, faces.nodes[rows]) * np.where(is_front, 1.0, -1.0)[:, None]
    middles = position[faces.nodes[rows]].mean(axis=1)
    return front, names, Sheet.of(middles, patch[rows], back, float(np.ptp(position, axis=0).max()))


def on_their_patches(faces: Faces, patches: Patches, position: Floats) -> Floats:
    """Where nodes would be were each on all of its patches, (n, 3); those of plane ones alone are where they are."""
    count = len(patches.shape)
    there = np.unique(faces.nodes.ravel() * np.int64(count) + np.repeat(patches.of_face, 3))
    node, patch = np.divmod(there, max(count, 1))
    bound = np.zeros(len(position), dtype=bool)
    bound[node[patches.moves[patch]]] = True
    node, patch = node[bound[node]], patch[bound[node]]
    first = np.flatnonzero(np.diff(node, prepend=-1))
    rank = np.arange(len(node)) - np.repeat(first, np.diff(np.append(first, len(node))))
    rows = [rank == k for k in range(int(rank.max(initial=-1)) + 1)]
    return onto_all([(node[own], patch[own]) for own in rows], patches, position)


def onto_all(turns: Sequence[tuple[Ints, Ints]], patches: Patches, position: Floats) -> Floats:
    """Project nodes on one patch after the other, over and over, as `turns` of nodes and their patches say."""
    x, still = position.copy(), STILL * np.ptp(position, axis=0).max()
    for _ in range(ROUNDS):
        before = x.copy()
        for node, patch in turns:
            x[node] = patches.project(patch, x[node])
        if np.abs(x - before).max() <= still:
            break
    return x
