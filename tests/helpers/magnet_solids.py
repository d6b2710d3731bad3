"""Meshes of balls and blocks in air, and the field of a dipole, for magnets in space."""

from itertools import pairwise

import numpy as np
from skfem import MeshTet


def nested_balls(cells, rim=2.0):
    """A ball of radius 1 in a ball of air: a cube with its shells blown up, so many cells deep each."""
    t = np.linspace(-1.0, 1.0, 4 * cells + 1)
    cube = MeshTet.init_tensor(t, t, t)
    shell, length = np.abs(cube.p).max(axis=0), np.linalg.norm(cube.p, axis=0)
    radius = np.where(shell < 0.5, 2.0 * shell, rim ** (2.0 * shell - 1.0))
    mesh = MeshTet(cube.p / np.where(length > 0.0, length, 1.0) * radius, cube.t)
    inside = shell[cube.t].max(axis=0) <= 0.5
    mesh = mesh.with_subdomains({"ball": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})
    return mesh.with_boundaries({"outer": lambda x: np.linalg.norm(x, axis=0) > 0.5})


def blocks(axes, parts):
    """A box of cells along three axes, with blocks in it, ((x, y, z), (x, y, z)) each, and air around them."""
    mesh = MeshTet.init_tensor(*axes)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    regions = {name: np.all([(m > a) & (m < b) for m, a, b in zip(middle, *ends, strict=True)], axis=0)
               for name, ends in parts.items()}  # fmt: skip
    regions["air"] = ~np.any([np.zeros(mesh.nelements, dtype=bool), *regions.values()], axis=0)
    mesh = mesh.with_subdomains({name: np.flatnonzero(where) for name, where in regions.items()})
    ends = {f"{'xyz'[k]}{sign}": (k, at) for k in range(3) for sign, at in (("-", axes[k][0]), ("+", axes[k][-1]))}
    sides = {name: (lambda x, k=k, at=at: np.abs(x[k] - at) < 1e-9) for name, (k, at) in ends.items()}
    return mesh.with_boundaries({"outer": lambda x: np.full(x.shape[1], True), **sides})


def graded(marks, step, far, layers):
    """Coordinates: even steps between marks, growing ones to some distance beyond the outermost."""
    inner = [np.linspace(a, b, max(1, round((b - a) / step)) + 1)[:-1] for a, b in pairwise(marks)]
    beyond = step * (np.geomspace(1.0, 1.0 + far / step, layers + 1)[1:] - 1.0)
    return np.concatenate([marks[0] - beyond[::-1], *inner, marks[-1:], marks[-1] + beyond])


def dipole(x, strength):
    """Potential and field strength of ``strength z / r^3`` at points."""
    r, z = np.linalg.norm(x, axis=0), x[2]
    field = strength * 3.0 * z * x / r**5
    field[2] -= strength / r**3
    return strength * z / r**3, field
