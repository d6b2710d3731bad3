"""A round magnet beside the centre of a round hole in iron, whose energy is known.

The magnet, magnetised along y, has permeability 1. Its potential is that in free space, and what its image adds.
Circles and their meshes are those about one centre, moved by ``z -> (z + SHIFT) / (1 + SHIFT z)``.
"""

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from helpers.curved_meshes import with_midsides
from helpers.meshes import disk
from helpers.sheets import MU0
from kohonen_adapt.magnetostatics import Magnetostatics, Material

SHIFT, SIZE = 0.3, 0.4
CENTRE = SHIFT * (1 - SIZE**2) / (1 - (SHIFT * SIZE) ** 2)
RADIUS = SIZE * (1 - SHIFT**2) / (1 - (SHIFT * SIZE) ** 2)
CURVES = {"rim": ka.Arc((CENTRE, 0.0), RADIUS), "outer": ka.Arc((0.0, 0.0), 1.0)}
CENTRED_CURVES = {"rim": ka.Arc((0.0, 0.0), SIZE), "outer": ka.Arc((0.0, 0.0), 1.0)}
CENTRED_SQUARED_NORM = 0.5 * np.pi * SIZE**2 * (1 - SIZE**2) / MU0
SQUARED_NORM = 0.5 * np.pi * RADIUS**2 * (1 - RADIUS**2 / (1 - CENTRE**2) ** 2) / MU0


def magnet_mesh(rings):
    """Nodes on rings, two fifths of them in the magnet."""
    plain = disk(rings, 1.0)
    ring = np.round(rings * np.hypot(*plain.p)).astype(int)
    z = np.exp(0.1j) * (plain.p[0] + 1j * plain.p[1])
    z = (z + SHIFT) / (1 + SHIFT * z)
    magnet, ends = round(SIZE * rings), ring[plain.facets]
    inside = ring[plain.t].max(axis=0) <= magnet
    circles = {name: np.flatnonzero(np.all(ends == k, axis=0)) for name, k in (("rim", magnet), ("outer", rings))}
    mesh = MeshTri(np.stack((z.real, z.imag)), plain.t).with_boundaries(circles)
    return mesh.with_subdomains({"magnet": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})


def curved_magnet_mesh(rings):
    return with_midsides(magnet_mesh(rings), _on_circles)


def _on_circles(mesh, facets):
    middles = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    for name, arc in CURVES.items():
        way = middles[:, mesh.boundaries[name]] - np.reshape(arc.centre, (2, 1))
        middles[:, mesh.boundaries[name]] = np.reshape(arc.centre, (2, 1)) + arc.radius * way / np.hypot(*way)
    return middles


def magnet_problem(order, curved=True):
    materials = {"magnet": Material(remanence=(0.0, 1.0)), "air": Material()}
    return Magnetostatics(materials, {"outer": 0.0}, order=order, curved=curved)


def magnet_error(field):
    """Relative to the energy norm, by what its square lacks; on chords the slivers count, too."""
    return float(np.sqrt(abs(1.0 - field.squared_norm / SQUARED_NORM)))


def crowded_magnet_mesh(close):
    """Six facets about the origin and nodes at `close` radii: below 1.155 arcs cross straight sides."""
    turn = np.exp(2j * np.pi / 6 * np.arange(6))
    magnet, air = [[6, k, (k + 1) % 6] for k in range(6)], []
    for k in range(6):
        rim, next_rim, inner, next_inner = k, (k + 1) % 6, 7 + k, 7 + (k + 1) % 6
        outer = 13 + (2 * k + np.arange(4)) % 12
        air += [[rim, inner, next_rim], [next_rim, inner, outer[2]], [next_rim, outer[2], next_inner]]
        air += [[inner, outer[1], outer[2]], [next_inner, outer[2], outer[3]]]
    half = np.exp(1j * np.pi / 6)
    z = np.concatenate([SIZE * turn, [0.0], close * SIZE * half * turn, np.exp(1j * np.pi / 6 * np.arange(12))])
    mesh = MeshTri(np.stack([z.real, z.imag]), np.array(magnet + air).T)
    mesh = mesh.with_subdomains({"magnet": np.arange(6), "air": np.arange(6, mesh.t.shape[1])})
    return mesh.with_boundaries({"rim": np.flatnonzero((mesh.facets < 6).all(axis=0)), "outer": mesh.boundary_facets()})
