"""Compare what relocating tetrahedra brings with Mmg3d at equal nodes, and measure spread and processor time."""

import time
from collections.abc import Sequence
from importlib.util import find_spec

import numba
import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.peers.mmg_remesh import mmg_remesh
from benchmarks.peers.remeshing import equidistributing, remeshed_meshes, volumes
from benchmarks.problems.solids import BUMP, EDGE, FICHERA, MAGNET, Solid, middles
from benchmarks.table import markdown

Cells = int | tuple[int, int, int]
CASES: tuple[tuple[Solid, Cells], ...] = (
    (BUMP, 10), (EDGE, 6), (FICHERA, 5), (MAGNET, 4), (EDGE, 10), (FICHERA, 8), (MAGNET, (4, 4, 12)),
)  # cells per unit  # fmt: skip
QUICK = 4
PASSES = 4
LOOPS = 5  # of Mmg
SPREAD, MICROSECONDS = 0.35, 150.0  # targets, with "recycle"
SIDES = (20, 55, 100)  # cells along the cube: 9261, 175 616 and 1 030 301 nodes


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors at equal nodes; then spread of mass; microseconds of all processors per node. Nothing depends on seeds."""
    for topology in ("recycle", "fixed"):  # compiles all that is needed
        ka.relocate(BUMP.mesh(2), shell, topology=topology)
    cases = CASES[:QUICK] if quick else CASES
    header = [
        "space: 4 relocations",
        "N",
        "uniform",
        "Mmg3d",
        "recycle",
        "of Mmg's",
        "least quality",
        "mean",
        "us/node",
    ]
    errors = markdown(header, [compared(*case) for case in cases])
    header = [
        f"space: {numba.config.NUMBA_NUM_THREADS} threads",
        "N",
        "start",
        "spread",
        "limit",
        "CPU us/node",
        "limit",
    ]
    rows = [shared_out(side, topology) for side in SIDES[: 1 if quick else None] for topology in ("recycle", "flip")]
    return f"{errors}\n\n{markdown(header, [*rows, shared_out(SIDES[0], 'fixed')])}"


def compared(problem: Solid, cells: Cells) -> list[str | float | int | None]:
    """Errors of a problem on the uniform mesh, that of Mmg where it is installed, and ours."""
    start = problem.mesh(cells)
    mesh, seconds = start, 0.0
    u = problem.solve(mesh)
    uniform = problem.error(mesh, u)
    for _ in range(PASSES):
        density, began = problem.density(mesh, u), time.process_time()
        mesh = ka.relocate(mesh, density, topology="recycle")
        seconds += time.process_time() - began
        u = problem.solve(mesh)
    error = problem.error(mesh, u)
    peer = brought(problem, start) if find_spec("mmgpy") else None
    share, quality = None if peer is None else error / peer, ka.quality(mesh)
    cost = 1e6 * seconds / PASSES / mesh.nvertices
    return [problem.name, mesh.nvertices, uniform, peer, error, share, quality.min(), quality.mean(), cost]


def brought(problem: Solid, start: MeshTet) -> float:
    """The error of Mmg's mesh, brought to the number of nodes of the start by N^(-1/3)."""
    *_, (mesh, u) = remeshed_meshes(problem, start, [start.nvertices] * LOOPS, equidistributing, mmg_remesh)
    return problem.error(mesh, u) * float((mesh.nvertices / start.nvertices) ** (1 / 3))


def shell(x: np.ndarray) -> np.ndarray:
    """A ring in space: a sphere about the middle of the cube with twenty times the density of the rest."""
    return 1.0 + 20.0 / np.cosh(20.0 * (((x - 0.5) ** 2).sum(axis=0) - 0.16)) ** 2


def shared_out(side: int, topology: str) -> list[str | float | int | None]:
    """Coefficient of variation of the mass of elements before and after one relocation, and processor time."""
    mesh = MeshTet.init_tensor(*[np.linspace(0.0, 1.0, side + 1)] * 3)
    began = time.process_time()
    found = ka.relocate(mesh, shell(middles(mesh)), topology=topology)
    cost = 1e6 * (time.process_time() - began) / mesh.nvertices
    limits = (SPREAD, MICROSECONDS) if topology == "recycle" else (None, None)
    return [topology, mesh.nvertices, spread(mesh), spread(found), limits[0], cost, limits[1]]


def spread(mesh: MeshTet) -> float:
    """Coefficient of variation of the mass of elements, from the density at their nodes."""
    mass = volumes(mesh) * shell(mesh.p)[mesh.t].mean(axis=0)
    return float(mass.std() / mass.mean())
