"""List the problems in the plane that methods are compared on: start meshes, domains, and how errors are told."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from skfem import MeshTri

from benchmarks.problems import geometry
from benchmarks.problems.c_core import CCore, c_core_mesh
from benchmarks.problems.helmholtz import Helmholtz, square_mesh
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.problems.poisson_l import PoissonL
from benchmarks.problems.square_magnet import SquareMagnet, magnet_mesh


@dataclass(frozen=True)
class Case:
    """One problem on one start mesh.

    `figure` is what its error is called, in units of 1 / `scale`; it falls like N^-`rate` where nodes are well placed.
    `geometry` is the domain for a mesh generator. `coarse` and `squared` describe the baseline of scikit-fem's
    refinement: its start mesh, and whether `adaptive_theta` gets squared indicators, as in example 22, or the
    indicators themselves.
    """

    name: str
    figure: str
    problem: Any
    start: Callable[[], MeshTri]
    coarse: Callable[[], MeshTri]
    geometry: Callable[[Any], float]
    squared: bool = True
    rate: float = 0.5
    scale: float = 1.0
    renamed: Callable[[MeshTri], MeshTri] = lambda mesh: mesh  # after a refinement that loses names

    def error(self, mesh: MeshTri, solution: Any) -> float:
        """Of a solution."""
        return self.scale * float(self.problem.error(mesh, solution))


PERCENT: Any = {"figure": "error %", "scale": 100.0}
E: Any = {"figure": "E", "coarse": partial(l_shaped_mesh, 2), "geometry": geometry.l_shape}
L: Any = {"name": "L", "problem": LShape(), "squared": False} | E
F: Any = {"name": "F", "problem": PoissonL()} | E
H = Case("H", "L2 error", Helmholtz(), partial(square_mesh, 20), partial(square_mesh, 8), geometry.square, rate=1.0)
C: Any = {
    "name": "C",
    "problem": CCore(),
    "coarse": partial(c_core_mesh, "c_core_coarse.msh"),
    "geometry": geometry.c_core,
} | PERCENT


def magnet(squares: int, iron: bool) -> Case:
    """M: a square magnet alone or over iron."""
    return Case(
        f"M, mu_r = {1000 if iron else 1}",
        problem=SquareMagnet(iron),
        start=partial(magnet_mesh, squares, iron),
        coarse=partial(magnet_mesh, 20, iron),
        geometry=partial(geometry.magnet, iron=iron),
        **PERCENT,
    )


CASES: dict[str, Sequence[Case]] = {
    "L": [Case(start=partial(l_shaped_mesh, squares), **L) for squares in (8, 16, 32, 64)],
    "H": [H],
    "M": [magnet(squares, iron) for iron in (False, True) for squares in (20, 40)],
    "C": [Case(start=partial(c_core_mesh, name), **C) for name in ("c_core.msh", "c_core_fine.msh")],
    "F": [Case(start=partial(l_shaped_mesh, squares), **F) for squares in (8, 16, 32)],
}
