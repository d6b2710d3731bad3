"""Time how quickly points are found in triangles and in tetrahedra."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshTet, MeshTri

import kohonen_adapt as ka
from benchmarks.table import aligned

POINTS = 10**6
SIZES, FEW = (10**4, 10**5, 10**6), (10**3, 10**4)  # nodes
Floats = NDArray[np.float64]


def report(seeds: Sequence[int], quick: bool) -> str:
    """Return seconds until a mesh with nodes shaken is ready, and for random points, a tenth of them outside.

    A mesh is ready when it is taken apart, known not to lie on itself, and its grid is laid.

    The last column is what barycentric coordinates are below zero at most in the elements that were found.
    """
    builds: dict[str, Callable[[int], Mesh]] = {"triangles": squares, "tetrahedra": cubes}
    rows = [_row(name, build(size)) for name, build in builds.items() for size in (FEW if quick else SIZES)]
    header = ["location", "N", "elements", "s to be ready", f"us per point of {POINTS}", "found", "outside by"]
    return aligned(header, rows)


def squares(nodes: int) -> MeshTri:
    """The unit square with about so many nodes."""
    ticks = np.linspace(0.0, 1.0, round(nodes ** (1 / 2)))
    return shaken(MeshTri.init_tensor(ticks, ticks), 0.2 / len(ticks))


def cubes(nodes: int) -> MeshTet:
    """The unit cube with about so many nodes."""
    ticks = np.linspace(0.0, 1.0, round(nodes ** (1 / 3)))
    return shaken(MeshTet.init_tensor(ticks, ticks, ticks), 0.15 / len(ticks))


def shaken(mesh: Mesh, reach: float) -> Mesh:
    """The mesh with nodes moved that are not on the faces of the unit cube."""
    shift = np.random.default_rng(0).uniform(-reach, reach, mesh.p.shape)
    return type(mesh)(mesh.p + np.where(np.any((mesh.p < 1e-9) | (mesh.p > 1 - 1e-9), axis=0), 0.0, shift), mesh.t)


def _row(name: str, mesh: Mesh) -> list[Any]:
    share = 0.9 ** (1.0 / len(mesh.p))  # of each side: nine tenths of the points are inside
    points = 0.5 + np.random.default_rng(1).uniform(-0.5, 0.5, (POINTS, len(mesh.p))) / share
    few, many = points[:1].T, points.T
    ka.find_elements(mesh, few)  # for the compiler
    start = time.perf_counter()
    ka.find_elements(mesh, few)
    ready = time.perf_counter()
    found = ka.find_elements(mesh, many)
    done = time.perf_counter()
    inside = found >= 0
    local = mesh.mapping().invF(many[:, inside, None], tind=found[inside])
    outside_by = max(0.0, -float(min(local.min(), 1.0 - local.sum(axis=0).max())))
    seconds = ready - start, done - ready - (ready - start)
    return [name, mesh.p.shape[1], mesh.nelements, *seconds, np.mean(inside), outside_by]
