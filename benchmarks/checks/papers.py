"""Compare with published mesh movers on their own problems."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.manufactured import Manufactured
from benchmarks.problems.published import COSINES, bump, cosines, gaussians
from benchmarks.table import Cell, markdown

COUNT = 96
SQUARES = (14, 20, 30)
ONE_AXIS = "Helmholtz, cos 2 pi y"
PUBLISHED = {  # mean and milliseconds on Gaussians, then error and seconds of the best row on the bump
    "Monge-Ampere of movement": ("12.7", None, None, "3780", "0.00596", "2.27"),
    "G-Adaptivity": ("21.0", None, None, "88", None, None),
}
UGM2N = {  # error reduction in % of Monge-Ampere, M2N, UM2N and UGM2N
    "Poisson, cos 2 pi x cos 2 pi y": (15.4, 0.9, 6.7, 14.6),
    "Poisson, sin 4 pi x sin 4 pi y": (9.8, -98, -2.2, 12.5),
    "Helmholtz, cos 2 pi y": (15.6, -11, 10.9, 14.1),
    "Helmholtz, cos 2 pi x cos 2 pi y": (13.5, -24, 5.6, 15.0),
    "Helmholtz, cos 4 pi x cos 2 pi y": (10.9, -352, -2.6, 14.1),
}


@dataclass(frozen=True)
class Mover:
    """Way to adapt a mesh at constant number of nodes."""

    name: str
    moved: Callable[[MeshTri, Manufactured], MeshTri]


def _once(pinned: bool) -> Callable[[MeshTri, Manufactured], MeshTri]:
    def moved(mesh: MeshTri, problem: Manufactured) -> MeshTri:
        density = ka.density_from_indicators(mesh, problem.indicators(mesh, problem.solve(mesh)), norm="L2")
        return ka.relocate(mesh, density, topology="fixed", pinned=_rim(mesh, pinned))

    return moved


def _passes(topology: str, pinned: bool = False, polish: bool = True) -> Callable[[MeshTri, Manufactured], MeshTri]:
    def moved(mesh: MeshTri, problem: Manufactured) -> MeshTri:
        return ka.adapt(mesh, problem, topology=topology, pinned=_rim(mesh, pinned), polish=polish).mesh

    return moved


def _rim(mesh: MeshTri, pinned: bool) -> np.ndarray:
    return mesh.boundary_nodes() if pinned else np.zeros(0, dtype=np.int64)


MOVERS = (
    Mover("fixed, relocated once", _once(False)),
    Mover("fixed, relocated once, boundary pinned", _once(True)),
    Mover("fixed, no polish", _passes("fixed", polish=False)),
    Mover("fixed", _passes("fixed")),
    Mover("fixed, boundary pinned", _passes("fixed", pinned=True)),
    Mover("flip", _passes("flip")),
    Mover("default, no polish", _passes("recycle", polish=False)),
    Mover("default", _passes("recycle")),
    Mover("default, boundary pinned", _passes("recycle", pinned=True)),
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Tables of the published problems with published and own figures; nothing depends on seeds."""
    squares = SQUARES[1:2] if quick else SQUARES
    return f"{_gaussians(range(8 if quick else COUNT))}\n\n{_cosines(squares)}"


def _gaussians(numbers: Sequence[int]) -> str:
    rows: list[list[Cell]] = [[f"{name}, published", *figures] for name, figures in PUBLISHED.items()]
    problems = [gaussians(number) for number in numbers]
    for mover in MOVERS:
        begin = time.process_time()
        meshes = [mover.moved(mesh, problem) for problem, mesh in problems]
        ms = 1000 * (time.process_time() - begin) / len(problems)
        gains = [_reduction(problem, mesh, moved) for (problem, mesh), moved in zip(problems, meshes, strict=True)]
        figures = [f"{np.mean(gains):.1f}", f"{np.std(gains):.1f}", f"{min(gains):.1f}", f"{ms:.0f}"]
        rows.append([mover.name, *figures, *_of_bump(mover)])
    header = [f"{len(problems)} Gaussians: ER %", "mean", "sd", "least", "ms", "bump: L2 error", "s"]
    return markdown(header, rows)


def _of_bump(mover: Mover) -> list[Cell]:
    problem, mesh = bump()
    begin = time.process_time()
    moved = mover.moved(mesh, problem)
    return [f"{_error(problem, moved):.5f}", f"{time.process_time() - begin:.2f}"]


def _cosines(squares: Sequence[int]) -> str:
    published = ["Monge-Ampere", "M2N", "UM2N", "UGM2N"]
    header = ["ER %", "N", *(f"{name}, published" for name in published), *(mover.name for mover in MOVERS)]
    rows = [row for name in COSINES for row in _cosine_rows(name, squares if name == ONE_AXIS else SQUARES[1:2])]
    return markdown(header, rows)


def _cosine_rows(name: str, squares: Sequence[int]) -> Iterator[list[Cell]]:
    for n in squares:
        problem, mesh = cosines(name, n)
        gains = [f"{_reduction(problem, mesh, mover.moved(mesh, problem)):.1f}" for mover in MOVERS]
        yield [name, mesh.nvertices, *map(str, UGM2N[name]), *gains]


def _reduction(problem: Manufactured, mesh: MeshTri, moved: MeshTri) -> float:
    return 100.0 * (1.0 - _error(problem, moved) / _error(problem, mesh))


def _error(problem: Manufactured, mesh: MeshTri) -> float:
    return problem.error(mesh, problem.solve(mesh))
