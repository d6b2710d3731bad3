"""Meshes of tetrahedra, and surgery on them by hand, in plain Python."""

import numpy as np
from skfem import MeshTet
from skfem.generic_utils import OrientedBoundary


def box(nx=3, ny=None, nz=None):
    """The unit cube in so many cells along each axis, each of six tetrahedra."""
    return MeshTet.init_tensor(*(np.linspace(0, 1, n + 1) for n in (nx, ny or nx, nz or ny or nx)))


def halved_cube(cells, axis, seed=None):
    """The unit cube in two halves across an axis, its sides named, its nodes inside moved at random for a seed."""
    mesh = box(*cells)
    if seed is not None:
        rng, p = np.random.default_rng(seed), mesh.p.copy()
        shift = 0.15 * rng.uniform(-1, 1, p.shape) / np.array(cells)[:, None]
        p += np.where((p > 0) & (p < 1) & (p != 0.5), shift, 0.0)
        mesh = MeshTet(p, mesh.t)
    sides = {f"side{2 * d + k}": lambda x, d=d, k=k: x[d] == float(k) for d in range(3) for k in range(2)}
    halves = {"left": lambda x: x[axis] < 0.5, "right": lambda x: x[axis] > 0.5}
    return mesh.with_boundaries(sides).with_subdomains(halves)


def l_shape(n=2):
    """A cube of side 2 without the quarter of x and y above 1."""
    mesh = MeshTet.init_tensor(*[np.linspace(0, 2, 2 * n + 1)] * 3)
    return mesh.restrict(mesh.elements_satisfying(lambda x: (x[0] < 1) | (x[1] < 1)))


def two_regions(n=4):
    """A cube in two halves, with the wall between them and a part of the top named, the wall with a side."""
    mesh = box(n).with_subdomains({"low": lambda x: x[2] < 0.5, "high": lambda x: x[2] > 0.5})
    mesh = mesh.with_boundaries({"left": lambda x: x[0] == 0.0, "top": lambda x: x[2] == 1.0})
    wall = mesh.facets_around("low")
    inner = mesh.f2t[1, wall] >= 0
    wall = OrientedBoundary(np.asarray(wall)[inner], wall.ori[inner])
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    part = np.flatnonzero((middle[2] == 1.0) & (middle[0] < 0.5))
    return named(mesh, {**mesh.boundaries, "wall": wall, "part": part})


def cut(n=4):
    """A cube of one region with a named sheet half-way through it, whose faces look up."""
    mesh = box(n)
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    sheet = np.flatnonzero((np.abs(middle[2] - 0.5) < 1e-9) & (middle[0] < 0.5))
    below = mesh.p[2][mesh.t].mean(axis=0)[mesh.f2t[0, sheet]] < 0.5
    return named(mesh, {"sheet": OrientedBoundary(sheet, (~below).astype(np.int32))})


def named(mesh, boundaries):
    """The mesh with these boundaries, oriented ones as they are."""
    return MeshTet(mesh.p, mesh.t, _boundaries=boundaries, _subdomains=mesh.subdomains)


def volumes(mesh):
    """Signed volumes of the elements of a mesh."""
    a, b, c, d = mesh.p[:, mesh.t].transpose(1, 2, 0)
    return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6.0


def neighbours(node):
    """The element across the face opposite to every corner, by comparing sets."""
    found, at = np.full(node.shape, -1, dtype=np.int32), {}
    for e, row in enumerate(node.tolist()):
        for k in range(4):
            face = frozenset(row[:k] + row[k + 1 :])
            if row[0] >= 0 and face in at:
                other, j = at.pop(face)
                found[e, k], found[other, j] = other, e
            elif row[0] >= 0:
                at[face] = e, k
    return found


def extruded(flat, layers=2, height=1.0):
    """A plane mesh drawn along z, each prism in three tetrahedra."""
    n, corners = flat.p.shape[1], np.sort(flat.t, axis=0)
    p = np.hstack([np.vstack([flat.p, np.full(n, z)]) for z in np.linspace(0.0, height, layers + 1)])
    elements = []
    for layer in range(layers):
        low, high = corners + n * layer, corners + n * (layer + 1)
        elements += [np.vstack([low, high[2]]), np.vstack([low[:2], high[1:]]), np.vstack([low[:1], high])]
    return MeshTet(p, np.hstack(elements))


def ball(n=6, radius=1.0):
    """A ball about the origin: a cube with its shells blown up."""
    cube = box(n)
    x = 2.0 * cube.p - 1.0
    length = np.sqrt(np.sum(x**2, axis=0))
    scale = np.max(np.abs(x), axis=0) / np.where(length > 0.0, length, 1.0)
    return MeshTet(radius * x * scale, cube.t)
