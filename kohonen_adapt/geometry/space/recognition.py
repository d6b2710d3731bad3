"""Recognition of patches, the connected constrained faces on one surface.

All faces of a patch have the same names and regions on both sides.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from kohonen_adapt.arrays import Floats, Int8s, Ints, Mask, grouped
from kohonen_adapt.geometry.plane.curves import check_near, curve_of_facets
from kohonen_adapt.geometry.plane.cutting import CLOSE, TURN
from kohonen_adapt.geometry.plane.polylines import CORNER
from kohonen_adapt.geometry.space.patches import Faces, Patches, Seams, Shapes, Sheet
from kohonen_adapt.geometry.space.surface_fit import Round, are_coaxial, round_of
from kohonen_adapt.geometry.space.surfaces import Cone, Cylinder, NamedSurfaces, Plane, Sphere, Surface
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, PLANE, PROJECTED, SPHERE
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.names import connected_components_of, in_order

__all__ = ["Skin", "patches_of", "rounds_among"]

NOWHERE = (0.0, 0.0, 0.0)
KINDS = {Plane: PLANE, Sphere: SPHERE, Cylinder: CYLINDER, Cone: CONE}
SEEDS = (24, 96)  # number of faces around a seed to which a sphere or cylinder is fitted first
TRIES = 64  # maximum number of seeds in a connected set of faces
STEEPEST = np.radians(41.0)  # maximum turn between strips of a coarse cylinder: nine turn by 40 degrees
GROWTHS = 20  # maximum number of growth steps; growth ends when no face is added


Rounds = list[tuple[Ints, Round]]  # with their faces


def patches_of(faces: Faces, seams: Seams, position: Floats, surfaces: NamedSurfaces) -> Patches:
    user_defined = curve_of_facets(faces.sides, len(faces.element), surfaces, "surface")
    without_corner = np.array([*(isinstance(each, tuple(KINDS)) for each in surfaces.values()), False])
    one, other = user_defined[seams.faces].T
    same_label = seams.same_label & (one == other)
    smooth = same_label & ((seams.turn < CORNER) | without_corner[one])
    group = connected_components_of(
        len(user_defined), seams.faces[np.where(one >= 0, smooth, same_label & (seams.turn <= TURN))]
    )
    plain = same_label & (one < 0)
    skin = Skin.of(position, faces.nodes, seams, plain & smooth, group)
    steep = Skin.of(position, faces.nodes, seams, plain & (seams.turn < STEEPEST), group)
    rounds = with_steep_faces(skin, seams.faces[plain], rounds_among(skin, user_defined < 0))
    rounds = with_coaxial_prisms(steep, rounds, user_defined < 0)
    for number, (part, _) in enumerate(rounds):
        group[part] = len(user_defined) + number
    patch = in_order(group)
    first = np.unique(patch, return_index=True)[1]
    shapes = planes_of(faces, patch, first, position)
    for part, each in rounds:
        shapes.set(patch[part[0]], (each.shape, each.origin, each.axis, each.size))
    for p in np.flatnonzero(user_defined[first] >= 0).tolist():
        name, surface = list(surfaces.items())[user_defined[first[p]]]
        check_near(position[np.unique(faces.nodes[patch == p])], surface, name)
        shapes.set(p, row_of(surface))
    front, names, sheet = sides_of(faces, seams, patch, first, position)
    return Patches(patch, *shapes, user_defined[first], dict(surfaces), front, names, sheet)


def row_of(surface: Surface) -> tuple[int, tuple[float, ...], tuple[float, ...], float]:
    kind = next((kind for shape, kind in KINDS.items() if isinstance(surface, shape)), PROJECTED)
    if kind == PROJECTED:
        return kind, NOWHERE, NOWHERE, 0.0
    origin, *others = vars(surface).values()
    axis, size = [*others, 0.0][:2] if kind != SPHERE else (NOWHERE, *others)
    return kind, origin, axis, size


def planes_of(faces: Faces, patch: Ints, first: Ints, position: Floats) -> Shapes:
    across = normals(position, faces.nodes)
    largest = np.lexsort((-np.einsum("ij,ij->i", across, across), patch))
    reference = across[largest[np.flatnonzero(np.diff(patch[largest], prepend=-1))]]
    across *= np.sign(np.einsum("ij,ij->i", across, reference[patch]))[:, None]
    total = np.stack([np.bincount(patch, column) for column in across.T], axis=1)
    axis = total / np.linalg.norm(total, axis=1, keepdims=True)
    shape = np.full(len(first), PLANE, np.int8)
    return Shapes(shape, position[faces.nodes[first, 0]], axis, np.zeros(len(first)))


def sides_of(
    faces: Faces, seams: Seams, patch: Ints, first: Ints, position: Floats
) -> tuple[Ints, dict[str, Int8s], Sheet]:
    """Return the region in front of every patch, its names, and the `Sheet`.

    The front of a patch is the side on which the element of its first face lies. The sheet distinguishes front and back
    of patches with the same region on both sides.
    """
    region, behind = faces.regions[first].T
    front = np.where(region == behind, -1, region)
    names = {name: side[first] for name, side in faces.sides.items()}
    count = len(patch)
    inside = patch[seams.faces[:, 0]] == patch[seams.faces[:, 1]]
    (one, other), turned = seams.faces[inside].T, ~seams.opposite[inside]
    pairs = np.concatenate([np.stack([one + side * count, other + (side ^ turned) * count], axis=1) for side in (0, 1)])
    cover = connected_components_of(2 * count, pairs)
    rows = np.flatnonzero(front[patch] < 0)
    is_front = cover[rows] == cover[first[patch[rows]]]
    back = normals(position, faces.nodes[rows]) * np.where(is_front, 1.0, -1.0)[:, None]
    centroids = position[faces.nodes[rows]].mean(axis=1)
    return front, names, Sheet.of(centroids, patch[rows], back, float(np.ptp(position, axis=0).max()))


@dataclass(frozen=True)
class Skin:
    """Constrained faces, and the smooth seams between them.

    Attributes
    ----------
    position
        Positions of the nodes, shape (n, 3).
    nodes
        Nodes of the faces, shape (f, 3).
    pairs
        Faces on both sides of every seam, shape (j, 2).
    ends
        Nodes of every seam, shape (j, 2).
    turn
        Angle between the faces in radians, shape (j,).
    plane
        Index of the plane part to which each face belongs, shape (f,).
    """

    position: Floats
    nodes: Ints
    pairs: Ints
    ends: Ints
    turn: Floats
    plane: Ints

    @classmethod
    def of(cls, position: Floats, nodes: Ints, seams: Seams, smooth: Mask, plane: Ints) -> "Skin":
        return cls(position, nodes, seams.faces[smooth], seams.ends[smooth], seams.turn[smooth], plane)

    def sets(self, faces: Mask) -> list[Ints]:
        label = connected_components_of(len(self.nodes), self.pairs[faces[self.pairs].all(axis=1)])
        rows = np.flatnonzero(faces)
        parts = (rows[part] for part in grouped(label[rows]) if len(np.unique(self.plane[rows[part]])) > 1)
        return sorted(parts, key=lambda part: int(part[0]))

    def proper_planes(self, faces: Ints) -> Mask:
        """Return the mask (f,) of faces that lie in proper planes, among some faces.

        A proper plane has a node around which all faces are coplanar. The plane strips of a cylinder have none.
        """
        among = np.zeros(len(self.nodes), bool)
        among[faces] = True
        turning = np.zeros(len(self.position), bool)
        turning[self.ends[among[self.pairs].all(axis=1) & (self.turn > TURN)]] = True
        calm = among & ~turning[self.nodes].all(axis=1)
        proper = np.zeros(self.plane.max() + 1, bool)
        proper[self.plane[calm]] = True
        return among & proper[self.plane]


def rounds_among(skin: Skin, faces: Mask) -> Rounds:
    """Return the spheres and cylinders among faces (f,), each with its faces.

    A cylinder with fewer than ten nodes, or with nodes at fewer than six angles around the axis, is kept only if
    another cylinder has the same axis.
    """
    found = [each for part in skin.sets(faces) for each in rounds_of_set(skin, part)]

    def is_coaxial(each: Round) -> bool:
        return any(are_coaxial(each, other) for _, other in found if other is not each)

    return [(part, each) for part, each in found if not each.is_coarse or is_coaxial(each)]


def with_steep_faces(skin: Skin, pairs: Ints, rounds: Rounds) -> Rounds:
    # Single faces of coarse spheres turn by a corner or more, and join a sphere to which two neighbours belong. `pairs`
    # (j, 2) are the neighbours at all seams.
    free = np.bincount(skin.plane)[skin.plane] == 1
    found = Rounds()
    for part, _ in rounds:
        free[part] = False
    for part, each in rounds:
        inside = np.isin(np.arange(len(free)), part)
        joins = steep = free & near(skin, each) if each.shape == SPHERE else np.zeros_like(free)
        while joins.any():
            beside = np.bincount(pairs.ravel(), inside[pairs[:, ::-1]].ravel(), len(free))
            joins = steep & ~inside & (beside >= 2)
            inside |= joins
        free &= ~inside
        found.append((np.flatnonzero(inside), each))
    return found


def with_coaxial_prisms(steep: Skin, rounds: Rounds, faces: Mask) -> Rounds:
    # Cylinders of nine or ten strips turn by a corner or more, and are prisms unless another cylinder has their axis.
    free = faces.copy()
    for part, _ in rounds:
        free[part] = False
    found = [each for part in steep.sets(free) for each in rounds_of_set(steep, part)] if rounds else []
    return rounds + [(part, each) for part, each in found if any(are_coaxial(each, other) for _, other in rounds)]


def rounds_of_set(skin: Skin, part: Ints) -> Rounds:
    if whole := round_of(skin.position, skin.nodes[part]):
        return [(part, whole)]
    curved = skin.proper_planes(part)
    if not curved.any():
        return grown(skin, part)
    curved[part] ^= True
    found = []
    for rest in skin.sets(curved):
        whole = round_of(skin.position, skin.nodes[rest])
        found += [(rest, whole)] if whole else grown(skin, rest)
    return found


def grown(skin: Skin, part: Ints) -> Rounds:
    number = np.full(len(skin.nodes), -1)
    number[part] = np.arange(len(part))
    own = number[skin.pairs]
    local = replace(skin, nodes=skin.nodes[part], pairs=own[(own >= 0).all(axis=1)])
    free, untried, found = *np.ones((2, len(part)), bool), []
    for _ in range(TRIES):
        seeds = np.flatnonzero(free & untried)
        if not len(seeds):
            break
        seed = int(seeds[len(seeds) // 2])
        on, each = grown_from(local, seed, free)
        untried[seed] = False
        if each is not None:
            free[on] = False
            found.append((part[on], each))
    return found


def grown_from(skin: Skin, seed: int, free: Mask) -> tuple[Ints, Round | None]:
    pairs = skin.pairs[free[skin.pairs].all(axis=1)]
    one, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    graph = csr_array((np.ones(len(one), np.int8), (one, other)), shape=(len(free), len(free)))
    order = breadth_first_order(graph, seed, directed=False, return_predecessors=False)
    on, each = order, None
    for count in SEEDS:
        if each is None:
            on = np.sort(order[:count])
            each = round_of(skin.position, skin.nodes[on])
    for _ in range(GROWTHS):
        if each is None:
            break
        before = on
        on = reached(pairs, seed, free & near(skin, each))
        each = round_of(skin.position, skin.nodes[on]) if len(on) else None
        if np.array_equal(before, on):
            break
    return on, each


def near(skin: Skin, each: Round) -> Mask:
    corners = skin.position[skin.nodes]
    squared = np.sum((corners - np.roll(corners, 1, axis=1)) ** 2, axis=2).max(axis=1)
    distance = each.distance(corners.reshape(-1, 3)).reshape(-1, 3).max(axis=1)
    return distance <= CLOSE * squared / (8.0 * each.size)


def reached(pairs: Ints, seed: int, faces: Mask) -> Ints:
    label = connected_components_of(len(faces), pairs[faces[pairs].all(axis=1)])
    return np.flatnonzero(faces & (label == label[seed]) & faces[seed])
