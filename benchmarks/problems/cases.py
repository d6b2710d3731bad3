"""List every comparison that is made: start mesh, problem, figures, how to refine, and the targets."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from skfem import MeshTri

from benchmarks.problems import geometry, ring
from benchmarks.problems.c_core import CCore, c_core_mesh
from benchmarks.problems.helmholtz import Helmholtz, square_mesh
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.problems.poisson_l import PoissonL
from benchmarks.problems.ring import Ring
from benchmarks.problems.square_magnet import SquareMagnet, magnet_mesh
from benchmarks.problems.variants import FIXED, FLIP, LOOSE, VARIANTS, WITHOUT_POLISH, Variant

PROBLEMS = ("L", "H", "R", "M", "C", "F")

RELOCATIONS = 4

Figures = dict[str, float]


@dataclass(frozen=True)
class Case:
    """One problem on one start mesh. The first figure is the error that ratios compare; `judged` has the targets.

    `name` tells it from others in a table. The error falls like N^-`rate` where nodes are well placed. `geometry` is
    the domain for a mesh generator. Where `density` is given nothing is solved on the way: the mesh is relocated
    `RELOCATIONS` times with that callable. `coarse` and `squared` describe the baseline of scikit-fem's refinement: its
    start mesh, and whether `adaptive_theta` gets squared indicators, as in example 22, or the indicators themselves.
    """

    name: str
    title: str
    start: Callable[[], MeshTri]
    problem: Any
    figures: Callable[[MeshTri, Any], Figures]
    judged: str
    coarse: Callable[[], MeshTri]
    squared: bool
    geometry: Callable[[Any], float]
    targets: dict[str, float] = field(default_factory=dict)
    rate: float = 0.5
    variants: tuple[Variant, ...] = VARIANTS
    density: Callable[[np.ndarray], np.ndarray] | None = None


def cases(letter: str, quick: bool = False) -> list[Case]:
    """The comparisons of problem L, H, R, M, C or F; `quick` leaves only those that take seconds."""
    return {"L": _laplace, "H": _helmholtz, "R": _ring, "M": _magnet, "C": _c_core, "F": _poisson}[letter](quick)


def _laplace(quick: bool) -> list[Case]:
    targets = {
        16: {"fixed": 1.26, "flip": 0.83, "polish": 0.77, "recycle": 0.75},
        32: {"fixed": 1.26, "flip": 0.81, "polish": 0.755, "recycle": 0.732},
        64: {"flip": 0.80, "polish": 0.75, "recycle": 0.724},
    }
    problem = LShape()
    return [
        Case(
            name="L",
            title=f"L: Laplace on the L-shape, {n} squares per unit; E = |u - u_h|_1",
            start=lambda n=n: l_shaped_mesh(n),
            problem=problem,
            figures=lambda mesh, solution: _with_rates(mesh, problem.error(mesh, solution)),
            judged="E sqrt(N)",
            coarse=lambda: l_shaped_mesh(2),
            squared=False,
            geometry=geometry.l_shape,
            targets=targets.get(n, {}),
        )
        for n in ((8, 16) if quick else (8, 16, 32, 64))
    ]


def _helmholtz(quick: bool) -> list[Case]:
    problem = Helmholtz()
    return [
        Case(
            name="H",
            title="H: Helmholtz with a Gaussian bump, 20 x 20 squares",
            start=lambda: square_mesh(20),
            problem=problem,
            figures=lambda mesh, solution: {"L2 error": problem.error(mesh, solution)},
            judged="L2 error",
            coarse=lambda: square_mesh(8),
            squared=True,
            geometry=geometry.square,
            targets={"fixed": 0.0030, "flip": 0.0015, "recycle": 0.0015},
            rate=1.0,
            variants=WITHOUT_POLISH,
        )
    ]


def _ring(quick: bool) -> list[Case]:
    return [
        Case(
            name="R",
            title="R: ring monitor, 20 x 20 squares; spread of the monitor mass per element",
            start=lambda: square_mesh(20),
            problem=Ring(),
            figures=lambda mesh, solution: ring.figures(mesh),
            judged="cv nodal",
            coarse=lambda: square_mesh(8),
            squared=False,
            geometry=geometry.square,
            targets={"fixed": 0.47, "flip": 0.30},
            variants=(FIXED, FLIP),
            density=ring.monitor,
        )
    ]


def _magnet(quick: bool) -> list[Case]:
    targets = {
        (20, False): {"flip": 15.8, "polish": 13.7, "recycle": 10.8},
        (40, False): {"flip": 8.0, "polish": 6.65, "recycle": 5.4},
        (20, True): {"flip": 12.0, "polish": 9.85, "recycle": 8.25},
        (40, True): {"flip": 6.2, "polish": 4.85, "recycle": 4.12},
    }
    return [_one_magnet(n, iron, targets[n, iron]) for iron in (False, True) for n in ((20,) if quick else (20, 40))]


def _one_magnet(n: int, iron: bool, targets: dict[str, float]) -> Case:
    problem = SquareMagnet(iron)
    return Case(
        name=f"M, mu_r = {1000 if iron else 1}",
        title=f"M: square magnet, mu_r = {1000 if iron else 1}, {n} x {n} squares",
        start=lambda: magnet_mesh(n, iron),
        problem=problem,
        figures=lambda mesh, solution: {"error %": 100 * problem.error(mesh, solution)},
        judged="error %",
        coarse=lambda: magnet_mesh(20, iron),
        squared=True,
        geometry=lambda gmsh: geometry.magnet(gmsh, iron),
        targets=targets,
        variants=(*VARIANTS, LOOSE),
    )


def _c_core(quick: bool) -> list[Case]:
    problem = CCore()
    # half of the error of the uniform mesh
    targets = {"c_core.msh": {"polish": 4.128}, "c_core_fine.msh": {"polish": 2.779}}
    return [
        Case(
            name="C",
            title=f"C: C-core magnet, {name}",
            start=lambda name=name: c_core_mesh(name),
            problem=problem,
            figures=lambda mesh, solution: {"error %": 100 * problem.error(mesh, solution)},
            judged="error %",
            coarse=lambda: c_core_mesh("c_core_coarse.msh"),
            squared=True,
            geometry=geometry.c_core,
            targets=targets[name],
        )
        for name in (("c_core.msh",) if quick else ("c_core.msh", "c_core_fine.msh"))
    ]


def _poisson(quick: bool) -> list[Case]:
    targets = {16: {"flip": 0.0365, "polish": 0.034, "recycle": 0.032}}
    problem = PoissonL()
    return [
        Case(
            name="F",
            title=f"F: example 22, -lap u = 1 on the L-shape, {n} squares per unit; E = |u - u_h|_1",
            start=lambda n=n: l_shaped_mesh(n),
            problem=problem,
            figures=lambda mesh, solution: _with_rates(mesh, problem.error(mesh, solution)),
            judged="E",
            coarse=lambda: l_shaped_mesh(2),
            squared=True,
            geometry=geometry.l_shape,
            targets=targets.get(n, {}),
        )
        for n in ((8, 16) if quick else (8, 16, 32))
    ]


def _with_rates(mesh: MeshTri, error: float) -> Figures:
    """The error, and times sqrt(N) and sqrt(T / 2): the second does not reward a mesh for few boundary nodes."""
    nodes, elements = mesh.p.shape[1], mesh.t.shape[1]
    return {"E": error, "E sqrt(N)": error * nodes**0.5, "E sqrt(T/2)": error * (elements / 2) ** 0.5}
