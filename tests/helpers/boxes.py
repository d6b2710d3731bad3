"""Boxes of tetrahedra as compiled loops take them, and a slow check of all that such arrays promise."""

from collections import defaultdict
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation
from skfem import MeshTet

from kohonen_adapt.kernels.arrays import Pool
from kohonen_adapt.kernels.tetrahedron.arrays import (
    CIRCLE,
    CYLINDER,
    HELD,
    INSIDE,
    LINE,
    ON_PATCH,
    ON_RIDGE,
    PLANE,
    SPHERE,
    Cavity,
    Freedom,
    OpenTetrahedra,
    Origins,
    Queue,
    Surfaces,
    Tetrahedra,
)
from kohonen_adapt.kernels.tetrahedron.swap import enter_worse, swap_waiting
from kohonen_adapt.mesh.shapes import packed

FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


def volumes(position, node):
    a, b, c, d = (position[node[:, k]] for k in range(4))
    return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6.0


def qualities(position, node):
    corners = position[node]
    squares = sum(((corners[:, i] - corners[:, j]) ** 2).sum(axis=1) for i, j in combinations(range(4), 2))
    volume = volumes(position, node)
    return np.sign(volume) * 12.0 * (3.0 * np.abs(volume)) ** (2 / 3) / squares


def jittered(cells, amount, seed):
    """Points and positive tetrahedra of the unit cube cut into `cells`, nodes off their places as far as they may."""
    mesh = MeshTet.init_tensor(*(np.linspace(0.0, 1.0, k + 1) for k in cells))
    position, node = np.ascontiguousarray(mesh.p.T), np.ascontiguousarray(mesh.t.T, dtype=np.int32)
    turned = volumes(position, node) < 0
    node[turned, 2], node[turned, 3] = node[turned, 3], node[turned, 2].copy()
    rng = np.random.default_rng(seed)
    free = (position > 0) & (position < 1) & (position != 0.5)  # planes at a half may be between regions
    steps = np.where(free, rng.uniform(-amount, amount, position.shape) / np.array(cells), 0.0)
    for v in np.flatnonzero(free.any(axis=1)):
        around = node[(node == v).any(axis=1)]
        before = position[v].copy()
        position[v] += steps[v]
        if qualities(position, around).min() < 0.005:
            position[v] = before
    return position, node


def random_shapes(count, ratio, seed):
    """Shapes (count, 6) of random directions, of edges of this ratio."""
    turns = Rotation.random(count, random_state=seed).as_matrix()
    values = np.array([1.0, 1.0, ratio**2]) / ratio ** (2 / 3)
    return packed(np.einsum("nij,j,nkj->nik", turns, values, turns))


def neighbours(node):
    beside, sides = np.full(node.shape, -1, dtype=np.int32), {}
    for e, row in enumerate(node):
        for k in range(4):
            face = tuple(sorted(row[FACES[k]]))
            if face in sides:
                other, j = sides.pop(face)
                beside[e, k], beside[other, j] = other, e
            else:
                sides[face] = e, k
    return beside


def opened(position, node, region=None, named=None, density=None):
    """A box with all its planes as patches, those inside by what `named` says of middles of faces, with room."""
    region = np.zeros(len(node), dtype=np.int32) if region is None else region.astype(np.int32)
    beside = neighbours(node)
    patch, planes = patches_of(position, node, beside, region, named)
    number, place, meets, lines = freedoms(position, node, patch, len(planes))
    n, m, rows, room = len(position), len(node), len(position) + 8, 2 * len(node) + 8192
    surfaces = Surfaces(
        np.full(len(planes), PLANE, dtype=np.int8),
        *(np.array([row[k] for row in planes]) for k in range(2)),
        np.zeros(len(planes)),
        meets,
        np.full(len(meets), LINE, dtype=np.int8),
        *lines,
        np.zeros(len(meets)),
    )
    anchor = np.full(rows, -1, dtype=np.int32)
    anchor[node.ravel()] = np.repeat(np.arange(m), 4)
    free_nodes, free = np.zeros(rows, dtype=np.int32), np.zeros(room, dtype=np.int32)
    free_nodes[: rows - n], free[: room - m] = np.arange(rows - 1, n - 1, -1), np.arange(room - 1, m - 1, -1)

    def padded(array, count, value):
        return np.concatenate([array, np.full((count - len(array), *array.shape[1:]), value, dtype=array.dtype)])

    fineness = np.ones(rows) if density is None else padded(np.cbrt(density(position)), rows, 1.0)
    old = padded(np.arange(n, dtype=np.int32), rows, -1)
    return OpenTetrahedra(
        padded(position, rows, 0.0),
        Tetrahedra(*(padded(array, room, -1) for array in (node, beside, region, patch))),
        surfaces,
        Freedom(padded(number, rows, HELD), padded(place, rows, -1), np.zeros(rows, dtype=bool)),
        Pool(anchor, free_nodes, free, np.array([rows - n, room - m])),
        Origins(fineness, old, anchor.copy(), np.zeros(rows, dtype=bool), np.zeros(len(planes))),
        Cavity.of(rows, room),
    )


def patches_of(position, node, beside, region, named):
    """Numbers of patches by face, and the point and normal of each."""
    patch, planes, seen = np.full(node.shape, -1, dtype=np.int32), [], {}
    for e, k in np.argwhere(np.ones(node.shape, dtype=bool)):
        other, corners = beside[e, k], position[node[e, FACES[k]]]
        inner = other >= 0 and region[other] == region[e]
        if inner and not (named is not None and named(corners.mean(axis=0))):
            continue
        axis = int(np.argmin(np.ptp(corners, axis=0)))
        pair = tuple(sorted({region[e], region[other]})) if other >= 0 else (region[e],)
        key = axis, round(corners[0, axis], 9), pair
        if key not in seen:
            seen[key] = len(planes)
            planes.append((corners[0], np.eye(3)[axis]))
        patch[e, k] = seen[key]
    return patch, planes


def edges_on_patches(node, patch):
    """By edge, which patches the constrained faces at it are of."""
    found = defaultdict(dict)
    for e, k in np.argwhere(patch >= 0):
        face = tuple(sorted(node[e, FACES[k]].tolist()))
        for edge in combinations(face, 2):
            found[edge][face] = int(patch[e, k])
    return {edge: sorted(faces.values()) for edge, faces in found.items()}


def freedoms(position, node, patch, patches):
    """What every node may do, and the ridges: the patches that meet, and their lines."""
    ridges, at_node = {}, defaultdict(list)
    for (a, b), faces in edges_on_patches(node, patch).items():
        if len(faces) == 2 and faces[0] == faces[1]:
            continue
        way = position[b] - position[a]
        axis = int(np.argmax(np.abs(way)))
        key = tuple(sorted(set(faces))), axis, *np.delete(position[a], axis).round(9)
        r = ridges.setdefault(key, (len(ridges), position[a], np.eye(3)[axis]))[0]
        at_node[a].append(r)
        at_node[b].append(r)
    number, place = np.full(len(position), INSIDE, dtype=np.int8), np.full(len(position), -1, dtype=np.int32)
    for e, k in np.argwhere(patch >= 0):
        number[node[e, FACES[k]]], place[node[e, FACES[k]]] = ON_PATCH, patch[e, k]
    for v, there in at_node.items():
        slides = len(there) == 2 and there[0] == there[1]
        number[v], place[v] = (ON_RIDGE, there[0]) if slides else (HELD, -1)
    meets = np.full((len(ridges), 4), -1, dtype=np.int32)
    for (sets, *_), (r, *_) in ridges.items():
        meets[r, : len(sets)] = sets
    lines = (np.array([row[k] for row in ridges.values()]).reshape(-1, 3) for k in (1, 2))
    return number, place, meets, lines


def check(mesh, floor=0.0):
    """All that arrays of tetrahedra promise, the slow way; the volume by region and the area by patch."""
    rows = np.flatnonzero(mesh.elements.node[:, 0] >= 0)
    node, beside = mesh.elements.node[rows], mesh.elements.neighbour[rows]
    assert qualities(mesh.position, node).min() >= floor * (1 - 1e-9)
    assert volumes(mesh.position, node).min() > 0
    sides = defaultdict(list)
    for e, row in zip(rows, node, strict=True):
        for k in range(4):
            sides[tuple(sorted(row[FACES[k]].tolist()))].append((e, k))
    areas, by_region = defaultdict(float), defaultdict(float)
    for face, there in sides.items():
        (e, k), *others = there
        assert len(others) <= 1
        p = mesh.elements.patch[e, k]
        if others:
            ((other, j),) = others
            assert mesh.elements.neighbour[e, k] == other and mesh.elements.neighbour[other, j] == e
            assert mesh.elements.patch[other, j] == p
            assert p >= 0 or mesh.elements.region[e] == mesh.elements.region[other]
        else:
            assert mesh.elements.neighbour[e, k] == -1 and p >= 0
        if p >= 0:
            a, b, c = mesh.position[list(face)]
            normal = np.cross(b - a, c - a)
            assert np.abs(off_surface(mesh.surfaces, p, np.array([a, b, c]))).max() < 1e-12
            areas[int(p)] += np.sqrt(normal @ normal) / 2.0
    for e, volume in zip(rows, volumes(mesh.position, node), strict=True):
        by_region[int(mesh.elements.region[e])] += volume
    used = np.unique(node)
    assert np.array_equal(np.flatnonzero(mesh.pool.anchor >= 0), used)
    assert (mesh.elements.node[mesh.pool.anchor[used]] == used[:, None]).any(axis=1).all()
    free = mesh.pool.height
    assert len(set(mesh.pool.free_elements[: free[1]].tolist())) == len(mesh.elements.node) - len(rows) == free[1]
    assert len(set(mesh.pool.free_nodes[: free[0]].tolist())) == len(mesh.pool.anchor) - len(used) == free[0]
    check_freedom(mesh, node, rows)
    assert beside.min() >= -1
    return len(used), dict(by_region), dict(areas)


def off_surface(surfaces, p, points):
    """Distance of points from a plane, a sphere or a cylinder."""
    ways, axis = points - surfaces.origin[p], surfaces.axis[p]
    if surfaces.shape[p] == PLANE:
        return ways @ axis
    along = np.outer(ways @ axis, axis) if surfaces.shape[p] == CYLINDER else 0.0
    return np.linalg.norm(ways - along, axis=1) - surfaces.size[p]


def ball(cells):
    """A ball about the origin with the radius 1: the cube with its shells bent to spheres."""
    position, node = jittered((cells,) * 3, 0.0, 0)
    x = 2.0 * position - 1.0
    squares = x**2
    u, v = np.roll(squares, 1, axis=1), np.roll(squares, 2, axis=1)
    mesh = opened(x * np.sqrt(1.0 - u / 2.0 - v / 2.0 + u * v / 3.0), node)
    shape = np.array([SPHERE], dtype=np.int8)
    none, lines = np.empty(0), np.empty((0, 3))
    surfaces = Surfaces(
        shape, np.zeros((1, 3)), np.eye(3)[:1], np.ones(1), np.empty((0, 4), dtype=np.int32),
        np.empty(0, dtype=np.int8), lines, lines, none,
    )  # fmt: skip
    outside = mesh.freedom.number < INSIDE
    outside[len(position) :] = False
    mesh.elements.patch[mesh.elements.patch >= 0] = 0
    mesh.freedom.number[outside], mesh.freedom.place[outside] = ON_PATCH, 0
    return mesh._replace(surfaces=surfaces, origins=mesh.origins._replace(sagitta=np.zeros(1)))


def drum(cells, ridges=CIRCLE):
    """A cylinder with the radius 1 about the z axis, from 0 to 1, and its two ends."""
    position, node = jittered((cells, cells, 2), 0.0, 0)
    x = 2.0 * position[:, :2] - 1.0
    bent = x * np.sqrt(1.0 - x[:, ::-1] ** 2 / 2.0)
    mesh = opened(np.column_stack([bent, position[:, 2]]), node)
    z = mesh.position[:, 2]
    rows = np.flatnonzero(mesh.elements.node[:, 0] >= 0)
    for e, k in np.argwhere(mesh.elements.patch[rows] >= 0):
        height = z[mesh.elements.node[rows[e], FACES[k]]]
        mesh.elements.patch[rows[e], k] = 0 if (height == 0).all() else 1 if (height == 1).all() else 2
    surfaces = Surfaces(
        np.array([PLANE, PLANE, CYLINDER], dtype=np.int8), np.array([[0, 0, 0], [0, 0, 1.0], [0, 0, 0]]),
        np.tile([0.0, 0.0, 1.0], (3, 1)), np.array([0.0, 0.0, 1.0]),
        np.array([[0, 2, -1, -1], [1, 2, -1, -1]], dtype=np.int32), np.full(2, ridges, dtype=np.int8),
        np.array([[0, 0, 0], [0, 0, 1.0]]), np.tile([0.0, 0.0, 1.0], (2, 1)), np.ones(2),
    )  # fmt: skip
    n = len(position)
    side, end = (np.abs(x) == 1.0).any(axis=1), (z[:n] == 0.0) | (z[:n] == 1.0)
    number, place = mesh.freedom.number[:n], mesh.freedom.place[:n]
    number[:], place[:] = INSIDE, -1
    number[side | end], place[side | end] = ON_PATCH, np.where(side, 2, z[:n])[side | end]
    number[side & end], place[side & end] = ON_RIDGE, z[:n][side & end]
    return mesh._replace(surfaces=surfaces, origins=mesh.origins._replace(sagitta=np.zeros(3)))


def check_freedom(mesh, node, rows):
    """Every node is where the faces and edges at it say that it is."""
    compact = edges_on_patches(node, mesh.elements.patch[rows])
    patches, ridges = defaultdict(set), defaultdict(int)
    for (a, b), faces in compact.items():
        for v in (a, b):
            patches[v].update(faces)
            ridges[v] += not (len(faces) == 2 and faces[0] == faces[1])
    for v in np.unique(node):
        number, place = mesh.freedom.number[v], mesh.freedom.place[v]
        if number == INSIDE:
            assert not patches[v] and place == -1
        if number == ON_PATCH:
            assert patches[v] == {place} and ridges[v] == 0
        if number == ON_RIDGE:
            meets = mesh.surfaces.meets[place]
            assert patches[v] >= set(meets[meets >= 0].tolist()) and ridges[v] == 2


def triangulations(i, k):
    """All of the polygon of nodes i to k, as lists of triangles."""
    if k - i < 2:
        return [[]]
    parts = [(one, other, j) for j in range(i + 1, k) for one in triangulations(i, j) for other in triangulations(j, k)]
    return [[*one, *other, (i, j, k)] for one, other, j in parts]


def ringed(count):
    """A mesh whose cavity is a ring of nodes around an edge, between nodes `count` and `count + 1`."""
    rng = np.random.default_rng(count)
    angles = np.sort(rng.uniform(0.0, 2 * np.pi, count)) if count > 5 else np.arange(count) * 2 * np.pi / count
    ring = np.column_stack([np.cos(angles), np.sin(angles), rng.uniform(-0.1, 0.1, count)])
    mesh = opened(*jittered((1, 1, 1), 0.0, 0))
    mesh.cavity.ring[0, :count] = np.arange(count)
    mesh.cavity.shell[:] = 0  # of the region of new elements
    return mesh._replace(position=np.vstack([ring, [[0.05, 0.0, -1.0], [0.0, 0.1, 1.2]]]))


def within_rings(count):
    """All triangulations of a ring as elements with both ends of its edge."""
    for triangles in triangulations(0, count - 1):
        yield np.array([t for i, j, k in triangles for t in ((i, j, k, count + 1), (i, k, j, count))])


def qualities_of(mesh):
    return qualities(mesh.position, mesh.elements.node[mesh.elements.node[:, 0] >= 0])


def swaps(mesh, below=1.0, limit=1000):
    """Swap until no element waits, and return the number of swaps."""
    queue, total = Queue.of(len(mesh.elements.node)), 0
    enter_worse(mesh, queue, below**3)
    while queue.state[1]:
        total += swap_waiting(mesh, queue, below**3, 0.0, limit)
    assert not queue.waiting.any()
    return total
