"""Meshes of blocks in air for magnets in space."""

from itertools import pairwise

import numpy as np
from skfem import MeshTet

MU0 = 4e-7 * np.pi


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
