"""A mesh between circles, and Gmsh files of second order written by hand."""

import numpy as np
from skfem import MeshTri2

from helpers.meshes import circle, closed, shells, with_lines

RADII = {"inner": 0.5, "interface": 1.0, "outer": 1.5}


def annulus(count):
    """Two rings of `count` times two triangles around a hole: three circles and a straight spoke as boundaries."""
    mesh = shells([radius * circle(count) for radius in RADII.values()], 1)
    lines = {name: closed(np.arange(k * count, (k + 1) * count)) for k, name in enumerate(RADII)}
    core = np.any(mesh.t < count, axis=0)
    mesh = with_lines(mesh, lines | {"spoke": count * np.arange(3)})
    return mesh.with_subdomains({"core": np.flatnonzero(core), "shell": np.flatnonzero(~core)})


def on_circles(mesh, facets):
    """Middles of facets: on the circle through both ends where there is one around the origin, else in the middle."""
    ends = mesh.p[:, mesh.facets[:, facets]]
    middle, radius = ends.mean(axis=1), np.hypot(*ends)
    round_ = np.abs(radius[0] - radius[1]) < 1e-9
    return np.where(round_, middle * radius[0] / np.hypot(*middle), middle)


def curved_annulus(count):
    """`annulus` as a `MeshTri2` with all midside nodes on the circles."""
    return with_midsides(annulus(count), on_circles)


def with_midsides(mesh, place):
    """A `MeshTri2` with the midside nodes that `place(mesh, facets)` returns, and the names of the mesh."""
    midsides = place(mesh, np.arange(mesh.facets.shape[1]))
    return MeshTri2(np.hstack([mesh.p, midsides]), mesh.t, mesh.boundaries, mesh.subdomains)
