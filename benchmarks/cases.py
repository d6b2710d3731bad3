"""Every comparison that is made: start mesh, problem, figures, how to refine, and the targets."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from skfem import MeshTri

from benchmarks import ring
from benchmarks.helmholtz import Helmholtz, square_mesh
from benchmarks.l_shape import LShape, l_shaped_mesh
from benchmarks.poisson_l import PoissonL
from benchmarks.ring import Ring
from benchmarks.square_magnet import SquareMagnet, magnet_mesh

PROBLEMS = ("L", "H", "R", "M", "F")

Figures = dict[str, float]


@dataclass(frozen=True)
class Case:
    """One problem on one start mesh. The first figure is the error that ratios compare; `judged` has the targets.

    Where `density` is given nothing is solved on the way: the mesh is relocated `passes` times with that callable.
    `coarse` and `squared` describe the baseline of scikit-fem's refinement: its start mesh, and whether
    `adaptive_theta` gets squared indicators, as in example 22, or the indicators themselves.
    """

    title: str
    start: Callable[[], MeshTri]
    problem: Any
    figures: Callable[[MeshTri, Any], Figures]
    judged: str
    coarse: Callable[[], MeshTri]
    squared: bool
    targets: dict[str, float] = field(default_factory=dict)
    passes: int = 3
    density: Callable[[np.ndarray], np.ndarray] | None = None


def cases(letter: str, quick: bool = False) -> list[Case]:
    """The comparisons of problem L, H, R, M or F; `quick` leaves only those that take seconds."""
    return {"L": _laplace, "H": _helmholtz, "R": _ring, "M": _magnet, "F": _poisson}[letter](quick)


def _laplace(quick: bool) -> list[Case]:
    targets = {16: {"fixed": 1.26, "flip": 0.85}, 32: {"fixed": 1.26, "flip": 0.84}}
    problem = LShape()
    return [
        Case(
            title=f"L: Laplace on the L-shape, {n} squares per unit; E = |u - u_h|_1",
            start=lambda n=n: l_shaped_mesh(n),
            problem=problem,
            figures=lambda mesh, solution: _with_rates(mesh, problem.error(mesh, solution)),
            judged="E sqrt(N)",
            coarse=lambda: l_shaped_mesh(2),
            squared=False,
            targets=targets.get(n, {}),
        )
        for n in ((8, 16) if quick else (8, 16, 32, 64))
    ]


def _helmholtz(quick: bool) -> list[Case]:
    problem = Helmholtz()
    return [
        Case(
            title="H: Helmholtz with a Gaussian bump, 20 x 20 squares",
            start=lambda: square_mesh(20),
            problem=problem,
            figures=lambda mesh, solution: {"L2 error": problem.error(mesh, solution)},
            judged="L2 error",
            coarse=lambda: square_mesh(8),
            squared=True,
            targets={"fixed": 0.0030, "flip": 0.0016},
        )
    ]


def _ring(quick: bool) -> list[Case]:
    return [
        Case(
            title="R: ring monitor, 20 x 20 squares; spread of the monitor mass per element",
            start=lambda: square_mesh(20),
            problem=Ring(),
            figures=lambda mesh, solution: ring.figures(mesh),
            judged="cv nodal",
            coarse=lambda: square_mesh(8),
            squared=False,
            targets={"fixed": 0.47, "flip": 0.32},
            passes=4,
            density=ring.monitor,
        )
    ]


def _magnet(quick: bool) -> list[Case]:
    targets = {(20, False): 16.0, (40, False): 8.1, (20, True): 12.1, (40, True): 6.3}
    return [_one_magnet(n, iron, targets[n, iron]) for iron in (False, True) for n in ((20,) if quick else (20, 40))]


def _one_magnet(n: int, iron: bool, target: float) -> Case:
    problem = SquareMagnet(iron)
    return Case(
        title=f"M: square magnet, mu_r = {1000 if iron else 1}, {n} x {n} squares",
        start=lambda: magnet_mesh(n, iron),
        problem=problem,
        figures=lambda mesh, solution: {"error %": 100 * problem.error(mesh, solution)},
        judged="error %",
        coarse=lambda: magnet_mesh(20, iron),
        squared=True,
        targets={"flip": target},
    )


def _poisson(quick: bool) -> list[Case]:
    problem = PoissonL()
    return [
        Case(
            title=f"F: example 22, -lap u = 1 on the L-shape, {n} squares per unit; E = |u - u_h|_1",
            start=lambda n=n: l_shaped_mesh(n),
            problem=problem,
            figures=lambda mesh, solution: _with_rates(mesh, problem.error(mesh, solution)),
            judged="E sqrt(N)",
            coarse=lambda: l_shaped_mesh(2),
            squared=True,
        )
        for n in ((8,) if quick else (8, 16, 32))
    ]


def _with_rates(mesh: MeshTri, error: float) -> Figures:
    """The error, and times sqrt(N) and sqrt(T / 2): the second does not reward a mesh for few boundary nodes."""
    nodes, elements = mesh.p.shape[1], mesh.t.shape[1]
    return {"E": error, "E sqrt(N)": error * nodes**0.5, "E sqrt(T/2)": error * (elements / 2) ** 0.5}
