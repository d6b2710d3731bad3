"""Rims of coarse cylinders, which turn by more than a corner of a polygon."""

import numpy as np
from scipy.spatial import Delaunay
from skfem import MeshTet

import kohonen_adapt as ka

SIDES = 10  # of the rims, which turn by 36 degrees


def coarse_cylinder():
    # of radius 1; every other ring is turned by half a side, so that its faces turn by less than a corner
    height = np.linspace(0.0, 1.0, 3)
    angle = 2.0 * np.pi * (np.arange(SIDES) + 0.5 * (np.arange(3) % 2)[:, None]) / SIDES
    rings = np.stack([np.cos(angle), np.sin(angle), np.broadcast_to(height[:, None], angle.shape)])
    axis = np.stack([np.zeros(3), np.zeros(3), height])
    p = np.hstack([rings.reshape(3, -1), axis])
    t = Delaunay(p.T).simplices.T
    edges = np.moveaxis(p[:, t[1:]] - p[:, t[:1]], 0, 1)
    return MeshTet(p, t[:, np.abs(np.linalg.det(edges.transpose(2, 0, 1))) > 1e-9])


class Uniform:
    def solve(self, mesh):
        return None

    def indicators(self, mesh, solution):
        return np.ones(mesh.nelements)


def test_new_nodes_of_a_rim_are_on_its_circle():
    mesh = ka.adapt(coarse_cylinder(), Uniform(), passes=2, target_nodes=400).mesh
    outside = mesh.facets[:, mesh.boundary_facets()]
    side = np.unique(outside[:, np.ptp(mesh.p[2, outside], axis=0) > 1e-9])
    rim = side[np.abs(mesh.p[2, side] - 0.5) > 0.5 - 1e-9]
    assert rim.size > 2 * SIDES
    assert np.allclose(np.hypot(*mesh.p[:2, side]), 1.0, rtol=0.0, atol=1e-9)
