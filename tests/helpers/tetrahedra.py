"""Meshes of tetrahedra that the tests share: regular, bad, concave, with slits and holes."""

import numpy as np
from scipy.spatial import Delaunay
from skfem import MeshTet

from helpers.meshes import kept
from helpers.solids import box

REGULAR = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]])  # corners, edges of sqrt(2)


def lone(corners):
    """One tetrahedron, of corners (3, 4)."""
    return MeshTet(np.array(corners, dtype=float), np.arange(4)[:, None])


def middles(mesh):
    """Barycentres of the elements, (3, nelements)."""
    return mesh.p[:, mesh.t].mean(axis=1)


def sixfold(p, t):
    """Six times the signed volumes of elements."""
    return np.linalg.det((p[:, t[1:]] - p[:, t[:1]]).transpose(2, 1, 0))


def generic_cube(n, seed=0):
    """A Delaunay mesh of random points in the unit cube and of a grid on its faces, with slivers."""
    rng = np.random.default_rng(seed)
    surface = box(n)
    outer = surface.p[:, surface.boundary_nodes()]
    p = np.hstack([outer, rng.uniform(0.3 / n, 1 - 0.3 / n, (3, n**3))])
    t = Delaunay(p.T).simplices.T
    return MeshTet(p, np.ascontiguousarray(t[:, np.abs(sixfold(p, t)) > 1e-9]))


def thrown(mesh, seed=0, rounds=3, reach=0.8, worst=0.02):
    """The same mesh with its inner nodes thrown about: valid, with slivers."""
    rng, p, t = np.random.default_rng(seed), mesh.p.copy(), mesh.t
    sign, size = np.sign(sixfold(p, t)), np.cbrt(np.abs(sixfold(p, t)).mean())
    for v in rng.permutation(np.repeat(mesh.interior_nodes(), rounds)):
        before, around = p[:, v].copy(), np.flatnonzero((t == v).any(axis=0))
        p[:, v] += rng.uniform(-reach, reach, 3) * size
        if np.any(sign[around] * sixfold(p, t[:, around]) < worst * size**3):
            p[:, v] = before
    return MeshTet(p, t, mesh.boundaries, mesh.subdomains)


def fichera(n):
    """(-1, 1)^3 without its octant x, y, z > 0, in n cubes per unit."""
    mesh = box(2 * n).scaled(2.0).translated((-1.0, -1.0, -1.0))
    return kept(mesh, ~(middles(mesh) > 0).all(axis=0))


def hollow(n):
    """The unit cube without its middle 27th; n a multiple of 3."""
    mesh = box(n)
    return kept(mesh, (np.abs(middles(mesh) - 0.5) > 1 / 6).any(axis=0))


def comb(n):
    """Three plates on a back: deep gaps; n a multiple of 5."""
    mesh = box(n)
    x, y, _ = middles(mesh)
    return kept(mesh, (y < 0.2) | (np.floor(5 * x) % 2 == 0))


def slit(n, tip=0.6):
    """The unit cube cut along y = 1/2 from x = 0 to the tip: nodes are there twice; n even."""
    mesh = box(n)
    return cut_open(mesh, mesh.p[0] < tip - 1e-9)


def crack(n):
    """The unit cube cut along y = 1/2 in a square: the front of that slit runs all around it; n a multiple of 4."""
    mesh = box(n)
    return cut_open(mesh, (np.abs(mesh.p[[0, 2]] - 0.5) < 0.25 - 1e-9).all(axis=0))


def cut_open(mesh, there):
    """The unit cube with nodes doubled where it is to be cut along y = 1/2, for a bank each."""
    doubled = np.flatnonzero((np.abs(mesh.p[1] - 0.5) < 1e-9) & there)
    twin = np.arange(mesh.p.shape[1])
    twin[doubled] = mesh.p.shape[1] + np.arange(len(doubled))
    return MeshTet(np.hstack([mesh.p, mesh.p[:, doubled]]), np.where(middles(mesh)[1] > 0.5, twin[mesh.t], mesh.t))


def turned(mesh, seed):
    """The same mesh with other numbers, its elements starting at any corner and running either way round."""
    rng = np.random.default_rng(seed)
    number = rng.permutation(mesh.p.shape[1])
    position = np.empty_like(mesh.p)
    position[:, number] = mesh.p
    return type(mesh)(position, rng.permuted(number[mesh.t[:, rng.permutation(mesh.t.shape[1])]], axis=0), sort_t=False)
