"""Compile every kernel now, for benchmarks and for containers."""

import numpy as np
from skfem import MeshTri

from .locate import interpolate
from .relocation import relocate
from .schedule import Schedule, Stage
from .som import KohonenMap

__all__ = ["warmup"]


def warmup() -> None:
    """Compile every kernel now, or load it from numba's cache.

    Otherwise the first call of `relocate`, `adapt`, `KohonenMap` or `interpolate` does that, which takes some seconds
    once per installation; the caches are then found on disk. The small meshes relocated here are thrown away.
    """
    mesh = MeshTri().refined(2)
    brief = Schedule((Stage(2, 1, 0.3),), sweeps=1)
    for topology in ("flip", "fixed"):
        relocate(mesh, np.arange(1.0, mesh.nelements + 1.0), topology=topology, schedule=brief)
    relocate(MeshTri().refined(3), lambda x: 1.0 + x[0])
    KohonenMap(mesh).search(np.array([0.3, 0.4]), 0)
    interpolate(mesh, mesh.p[0], mesh.p)
