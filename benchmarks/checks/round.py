"""Time a round of `Magnetostatics`, beside one as scikit-fem users write it on the same meshes."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.checks.reference_round import seconds_per_round
from benchmarks.problems.square_magnet import IRON_PERMEABILITY, magnet_mesh
from benchmarks.table import aligned
from kohonen_adapt.magnetostatics import Magnetostatics, Material

TARGET = 4.0  # microseconds per node, at about 10^4 nodes
REPEATS = 5
_C_CORE = Path(__file__).parents[2] / "examples" / "c_core.msh"

PROBLEM = Magnetostatics(
    {
        "iron": Material(permeability=IRON_PERMEABILITY),
        "magnet": Material(permeability=1.05, remanence=(0.0, 1.2)),
        "air": Material(),
    },
    potential={"outer": 0.0},
    order=1,
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Microseconds per node of every step: the best of some runs, as the machine has other things to do."""
    meshes = {"M, 100 x 100 squares": _square_magnet(100), "C-core, refined twice": _c_core(2)}
    if not quick:
        meshes |= {"M, 320 x 320 squares": _square_magnet(320), "C-core, refined three times": _c_core(3)}
    rows = []
    for name, mesh in meshes.items():
        rows.append(_row(name, mesh))
        rows.append(_row("  after one relocation", _relocated(mesh, seeds[0])))
    header = ["round: microseconds per node of", "N", "facets", "solve", "estimate", "norm"]
    header += ["round", f"target {TARGET:g}", "plain round", "plain / ours"]
    return aligned(header, rows)


def _row(name: str, mesh: MeshTri) -> list[str | int | float | None]:
    """The steps of one mesh, as if it came from elsewhere: one that was just relocated knows its facets."""
    nodes, field = mesh.p.shape[1], PROBLEM.solve(mesh)
    fresh = iter([_without_facets(mesh) for _ in range(REPEATS)])
    solve, known, estimate, norm = (
        1e6 * _best(step) / nodes
        for step in (
            lambda: PROBLEM.solve(next(fresh)),
            lambda: PROBLEM.solve(mesh),
            lambda: PROBLEM.indicators(mesh, field),
            lambda: PROBLEM.energy_norm(mesh, replace(field)),  # a field keeps its flux density
        )
    )
    whole = solve + estimate + norm
    plain = 1e6 * min(seconds_per_round(mesh) for _ in range(REPEATS)) / nodes
    verdict = None if nodes > 2e4 else "met" if whole <= TARGET else "missed"
    return [name, nodes, solve - known, solve, estimate, norm, whole, verdict, plain, plain / whole]


def _best(run: Callable[[], object]) -> float:
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def _without_facets(mesh: MeshTri) -> MeshTri:
    return MeshTri(mesh.p.copy(), mesh.t.copy(), mesh.boundaries, mesh.subdomains)


def _square_magnet(n: int) -> MeshTri:
    mesh = magnet_mesh(n, iron=True)
    air = np.setdiff1d(np.arange(mesh.t.shape[1]), np.concatenate(list(mesh.subdomains.values())))
    return mesh.with_subdomains({"air": air}).with_boundaries({"outer": mesh.boundary_facets()})


def _c_core(refinements: int) -> MeshTri:
    return ka.read_mesh(_C_CORE, scale=1e-3).refined(refinements)


def _relocated(mesh: MeshTri, seed: int) -> MeshTri:
    indicators = PROBLEM.indicators(mesh, PROBLEM.solve(mesh))
    return ka.relocate(mesh, ka.density_from_indicators(mesh, indicators), seed=seed)
