"""Structured meshes of magnetic devices: rectangles in a box, and rings, with the names their problems need."""

import numpy as np
from skfem import MeshTri

from helpers.meshes import disk_of


def everywhere(x):
    return np.ones(x.shape[1], dtype=bool)


def box(xs, ys, parts):
    """The box of these ticks with named rectangles (x0, x1, y0, y1), the rest "air" and its whole boundary "outer"."""
    mesh = MeshTri.init_tensor(xs, ys)
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    inside = {name: (x > x0) & (x < x1) & (y > y0) & (y < y1) for name, (x0, x1, y0, y1) in parts.items()}
    rest = ~np.any(list(inside.values()), axis=0)
    mesh = mesh.with_boundaries({"outer": everywhere}, boundaries_only=True)
    return mesh.with_subdomains({name: np.flatnonzero(mask) for name, mask in (inside | {"air": rest}).items()})


def disk(radii, parts):
    """A disk with 6 k nodes on the k-th of its circles; `parts`: name to the circle it reaches to, from the inside."""
    rings, mesh = len(radii), disk_of(radii)
    mesh = mesh.with_boundaries({"outer": everywhere}, boundaries_only=True)
    ring = np.repeat(np.arange(rings + 1), [1, *(6 * np.arange(1, rings + 1))])[mesh.t].max(axis=0)
    ends = [0, *parts.values()]
    names = zip(parts, ends, ends[1:], strict=False)
    return mesh.with_subdomains({n: np.flatnonzero((ring > a) & (ring <= b)) for n, a, b in names})


def sector(radii, angles, parts, pitch=2 * np.pi):
    """The sector of a ring; `parts`: name to (r0, r1, angle0, angle1), again after every pitch; "air" is the rest.

    Its boundaries are "bore", "outer", "right" and "left".
    """
    mesh = MeshTri.init_tensor(radii, angles)
    r, phi = mesh.p[:, mesh.t].mean(axis=1)
    phi = phi % pitch
    inside = {name: (r > a) & (r < b) & (phi > c) & (phi < d) for name, (a, b, c, d) in parts.items()}
    inside["air"] = ~np.any([np.zeros(len(r), dtype=bool), *inside.values()], axis=0)
    ends = {"bore": (0, radii[0]), "outer": (0, radii[-1]), "right": (1, angles[0]), "left": (1, angles[-1])}
    sides = {
        name: mesh.facets_satisfying(lambda x, k=k, v=v: np.abs(x[k] - v) < 1e-12) for name, (k, v) in ends.items()
    }
    p = mesh.p[0] * np.stack((np.cos(mesh.p[1]), np.sin(mesh.p[1])))
    mesh = MeshTri(p, mesh.t).with_boundaries(sides)
    return mesh.with_subdomains({name: np.flatnonzero(mask) for name, mask in inside.items()})


def sewn(p, t, subdomains):
    """A mesh of these elements whose nodes at the same place are one, its whole boundary "outer"."""
    _, first, number = np.unique(p.round(9), axis=1, return_index=True, return_inverse=True)
    mesh = MeshTri(np.ascontiguousarray(p[:, first]), number.ravel()[t])
    return mesh.with_boundaries({"outer": everywhere}, boundaries_only=True).with_subdomains(subdomains)


def equal_rings(number, radius):
    """Radii of so many circles about the origin, equally spaced."""
    return radius * np.arange(1, number + 1) / number
