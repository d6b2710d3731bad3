"""Meshes with periodic boundaries, and how far these are from one another's images."""

import numpy as np
from scipy.spatial import KDTree
from skfem import MeshTri

from helpers.meshes import square

CENTRE = np.array([[2.0], [1.0]])


def sector(n, angle, inner=0.4, power=1.0):
    """A sector of a ring about `CENTRE`, its straight sides named; their nodes are even at a power of 1."""
    unit = square(n)
    radius, turn = inner + (1.0 - inner) * unit.p[0] ** power, angle * unit.p[1] + 0.3
    mesh = MeshTri(CENTRE + radius * np.stack([np.cos(turn), np.sin(turn)]), unit.t)
    return mesh.with_boundaries(
        {"first": unit.facets_satisfying(lambda x: x[1] == 0), "last": unit.facets_satisfying(lambda x: x[1] == 1)}
    )


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def turned(angle):
    """The rotation of points about `CENTRE`."""
    return lambda x: rotation(angle) @ (x - CENTRE) + CENTRE


def nodes_of(mesh, name):
    return np.unique(mesh.facets[:, np.asarray(mesh.boundaries[name])])


def mismatch(mesh, one, other, motion):
    """How far the moved nodes of one boundary are from those of the other; each is to have one of its own."""
    nodes, others = nodes_of(mesh, one), nodes_of(mesh, other)
    off, partner = KDTree(mesh.p[:, others].T).query(motion(mesh.p[:, nodes]).T)
    assert len(nodes) == len(others) == len(np.unique(partner))
    return off.max()
