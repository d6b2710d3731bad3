"""Time how a mesh with many outlines is made a map."""

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.helmholtz import square_mesh
from benchmarks.table import aligned

LIMIT = 5.0  # seconds


def report(seeds: Sequence[int], quick: bool) -> str:
    """A square of chequered cells, which meet in fours, and one with a disc in every cell."""
    cells, squares = (10, 16) if quick else (100, 10)
    meshes = [("chequered", chequered(cells, squares), 2 * cells * (cells + 1))]
    cells, squares = (8, 16) if quick else (62, 16)
    meshes.append(("discs", with_discs(cells, squares), cells**2 + 4))
    header = ["outlines", "N", "drawn", "seconds to make a map", "limit", ""]
    return aligned(header, [[name, *_cost(mesh, chains)] for name, mesh, chains in meshes])


def chequered(cells: int, squares: int) -> MeshTri:
    """Cells of two materials in turn, so many squares wide."""
    mesh = square_mesh(cells * squares)
    column, row = np.floor(cells * mesh.p[:, mesh.t].mean(axis=1)).astype(int)
    return MeshTri(mesh.p, mesh.t, None, _by_number((column + row) % 2))


def with_discs(cells: int, squares: int) -> MeshTri:
    """A disc in every cell, half as wide: squares around the middle of a cell are drawn in to circles."""
    mesh = square_mesh(cells * squares)
    cell = np.minimum(np.floor(cells * mesh.p), cells - 1)
    x = 2.0 * (cells * mesh.p - cell) - 1.0
    reach = np.abs(x).max(axis=0)
    pull = np.clip(2.0 * (1.0 - reach), 0.0, 1.0)  # 1 up to the circle, 0 on the cell's sides
    length = np.where(reach > 0.0, np.hypot(*x), 1.0)
    x *= 1.0 + pull * (np.where(reach > 0.0, reach, 1.0) / length - 1.0)
    middle = np.abs(2.0 * np.mod(cells * mesh.p[:, mesh.t].mean(axis=1), 1.0) - 1.0)
    inside = np.all(middle < 0.5, axis=0)
    return MeshTri((cell + 0.5 * (x + 1.0)) / cells, mesh.t, None, _by_number(inside.astype(int)))


def _by_number(number: NDArray[np.integer]) -> dict[str, NDArray[np.integer]]:
    return {"first": np.flatnonzero(number == 0), "second": np.flatnonzero(number == 1)}


def _cost(mesh: MeshTri, drawn: int) -> list:
    """Nodes, outlines that were drawn, seconds; once before for the compiler."""
    for _ in range(2):
        start = time.perf_counter()
        ka.KohonenMap(mesh)
        seconds = time.perf_counter() - start
    return [mesh.p.shape[1], drawn, seconds, LIMIT, "met" if seconds <= LIMIT else "missed"]
