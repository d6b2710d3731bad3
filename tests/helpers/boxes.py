"""Boxes of tetrahedra as compiled loops take them, and a slow check of all that such arrays promise."""

from collections import defaultdict
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation
from skfem import MeshTet

from kohonen_adapt import Cylinder, Rules, Sphere
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.kernels.tetrahedron.arrays import CIRCLE, CYLINDER, INSIDE, ON_PATCH, ON_RIDGE, PLANE, Queue
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


def opened(position, node, region=None, named=None, density=None):
    """The arrays of a box with room for 6 nodes more, with a patch of the faces whose middles are `named`."""
    mesh = MeshTet(position.T, node.T)
    if region is not None:
        mesh = mesh.with_subdomains({"region": np.flatnonzero(region)})
    if named is not None:
        middles = mesh.p[:, mesh.facets].mean(axis=1).T
        mesh = mesh.with_boundaries({"named": np.flatnonzero([named(middle) for middle in middles])})
    return opened_mesh(mesh, None if density is None else density(position))


def opened_mesh(mesh, density=None, **rules):
    wanted = np.ones(mesh.nvertices) if density is None else density
    return OpenSolid.of(MovableSolid.of(mesh, Rules(**rules)), wanted, mesh.nvertices + 6).mesh


def ball(cells):
    """A ball about the origin with the radius 1: the cube with its shells bent to spheres."""
    position, node = jittered((cells,) * 3, 0.0, 0)
    x = 2.0 * position - 1.0
    squares = x**2
    u, v = np.roll(squares, 1, axis=1), np.roll(squares, 2, axis=1)
    mesh = MeshTet((x * np.sqrt(1.0 - u / 2.0 - v / 2.0 + u * v / 3.0)).T, node.T)
    mesh = mesh.with_boundaries({"side": mesh.boundary_facets()})
    return opened_mesh(mesh, surfaces={"side": Sphere((0, 0, 0), 1.0)})


def drum(cells, ridges=CIRCLE):
    """A cylinder with the radius 1 about the z axis, from 0 to 1, and its two ends."""
    position, node = jittered((cells, cells, 2), 0.0, 0)
    x = 2.0 * position[:, :2] - 1.0
    bent = x * np.sqrt(1.0 - x[:, ::-1] ** 2 / 2.0)
    mesh = MeshTet(np.vstack([bent.T, position[:, 2]]), node.T)
    mesh = mesh.with_boundaries({"side": lambda x: np.abs(x[2] - 0.5) < 0.5})
    opened = opened_mesh(mesh, surfaces={"side": Cylinder((0, 0, 0), (0, 0, 1), 1.0)})
    opened.surfaces.ridge_shape[:] = ridges
    return opened


def edges_on_patches(node, patch):
    """By edge, which patches the constrained faces at it are of."""
    found = defaultdict(dict)
    for e, k in np.argwhere(patch >= 0):
        face = tuple(sorted(node[e, FACES[k]].tolist()))
        for edge in combinations(face, 2):
            found[edge][face] = int(patch[e, k])
    return {edge: sorted(faces.values()) for edge, faces in found.items()}


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
