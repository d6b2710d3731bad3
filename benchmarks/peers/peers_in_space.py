"""Compare this package on tetrahedra with refinement and remeshers at equal numbers of unknowns, at orders 1 and 2."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg
from skfem import MeshTet, condense

import kohonen_adapt as ka
from benchmarks.peers import remeshing, wheels
from benchmarks.peers.gmsh_remesh import gmsh_remesh
from benchmarks.peers.lost_names import lost_names
from benchmarks.peers.mmg_remesh import mmg_remesh
from benchmarks.problems.geometry import solid as drawn
from benchmarks.problems.quadratic_solids import Quadratic
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET, Solid, jacobi
from benchmarks.table import markdown

BULK = 0.5  # of the squared estimate: what refinement marks, after Doerfler
FLOORS = (0.2, 0.1)
LOOPS = 5  # of a remesher
CLOSE = 1e-8  # relative residual at which iterations are counted
Solved = tuple[MeshTet, np.ndarray]
Method = Callable[[int], Solved]  # by seed
ERROR, SECONDS, LOST = "error at equal unknowns", "processor seconds", "names lost"
COUNTED = ("steps of CG, Jacobi", "steps of CG, SA", "steps of CG, evolution")  # at order 1
Figures = dict[str, float]


@dataclass(frozen=True)
class Contest:
    """A problem from so many cells per unit. Errors are scaled to so many unknowns, or to those of the start."""

    solid: Solid
    order: int
    cells: int
    scaled_to: int | None = None

    @property
    def problem(self) -> Solid | Quadratic:
        return self.solid if self.order == 1 else Quadratic(self.solid)

    @property
    def passes(self) -> int:
        """Of this package."""
        return 3 if self.order == 1 else 4

    @property
    def name(self) -> str:
        """In tables."""
        return f"{self.solid.name}, N = {self.unknowns()}"

    def start(self) -> MeshTet:
        """Uniform."""
        return self.solid.mesh(self.cells)

    def unknowns(self) -> int:
        """That errors are scaled to."""
        return self.scaled_to or self.start().nvertices

    def methods(self) -> dict[str, Method]:
        """Those that there are wheels for, and ours."""
        start = self.start()
        found: dict[str, Method] = {
            "uniform": lambda seed: (start, self.problem.solve(start)),
            "refined by scikit-fem": lambda seed: self.refined(),
        }
        if not wheels.missing("mmgpy"):
            found["Mmg3d"] = lambda seed: self.remeshed(remeshing.equidistributing, mmg_remesh)
        if not wheels.missing("mmgpy") and self.order == 1:
            found["Mmg3d, anisotropic"] = lambda seed: self.remeshed(remeshing.curvature_metric, mmg_remesh)
        if not wheels.missing("gmsh") and self.order == 1:
            remesh = partial(gmsh_remesh, partial(drawn, problem=self.solid))
            found["Gmsh"] = lambda seed: self.remeshed(remeshing.equidistributing, remesh)
        found["this package, graded"] = partial(self.adapted, self.passes, polish=False)
        for floor in FLOORS:
            found[f"this package, floor {floor}"] = partial(self.adapted, self.passes, min_quality=floor)
        return found

    def adapted(self, passes: int, seed: int, **options: Any) -> Solved:
        """What this package makes of the start in so many passes."""
        result = ka.adapt(self.start(), self.problem, passes=passes, seed=seed, **options)
        return result.mesh, result.solution

    def remeshed(self, metric_of: remeshing.MetricOf, remesh: remeshing.Remesh) -> Solved:
        """The end of the loop of a remesher."""
        start = self.start()
        *_, last = remeshing.remeshed_meshes(self.problem, start, [start.nvertices] * LOOPS, metric_of, remesh)
        return last

    def refined(self) -> Solved:
        """scikit-fem's adaptive refinement of the coarsest mesh, where it comes nearest to the number of unknowns.

        It keeps the numbers of facets, which are those of others then: names are asked of the problem again for every
        solution, and the mesh is handed over as scikit-fem left it.
        """
        mesh, meshes, unknowns = self.solid.coarsest(), list[Solved](), self.unknowns()
        while True:
            named = self.solid.named(mesh)
            u = self.problem.solve(named)
            meshes.append((mesh, u))
            if u.size >= unknowns:
                return min(meshes, key=lambda each: abs(np.log(each[1].size / unknowns)))
            eta = self.problem.indicators(named, u) ** 2
            order = np.argsort(-eta)
            last = np.searchsorted(np.cumsum(eta[order]), BULK * eta.sum())
            mesh = mesh.refined(np.sort(order[: last + 1]))

    def described(self, method: Method, seeds: Sequence[int]) -> Figures:
        """Medians over seeds; names are lost that have another size than before."""
        runs = [self.described_once(method, seed) for seed in seeds]
        return {name: float(np.median([run[name] for run in runs])) for name in runs[0]}

    def described_once(self, method: Method, seed: int) -> Figures:
        """A run: its error, names, shapes, processor time with all solves, and steps of conjugate gradients."""
        began = time.process_time()
        mesh, u = method(seed)
        seconds, named = time.process_time() - began, self.solid.named(mesh)
        error = self.problem.error(named, u) * (u.size / self.unknowns()) ** (self.order / 3)
        found = {ERROR: error, SECONDS: seconds, LOST: len(lost_names(self.start(), mesh))}
        found |= {"least quality": ka.quality(mesh).min(), "greatest dihedral angle": greatest_angle(mesh)}
        return found | (counted_iterations(self.solid, named) if self.order == 1 else {})


CONTESTS = (
    *(Contest(solid, 1, cells) for solid, cells in ((EDGE, 6), (FICHERA, 5), (MAGNET, 4), (CUBE, 10))),
    *(Contest(solid, 1, cells) for solid, cells in ((EDGE, 10), (FICHERA, 8), (MAGNET, 8), (CUBE, 16))),
    *(Contest(EDGE, 2, 8, 13_949), Contest(CUBE, 2, 12, 14_929), Contest(FICHERA, 2, 6, 13_565)),
    *(Contest(MAGNET, 2, 4, 9_997), Contest(EDGE, 2, 10, 26_447), Contest(CUBE, 2, 15, 28_447)),
)
QUICK = {1: 4, 2: 2}


def report(order: int, seeds: Sequence[int], quick: bool) -> str:
    """A table for every figure of the meshes at equal unknowns."""
    missing = [line for wheel in ("mmgpy", "gmsh", "pyamg") if (line := wheels.missing(wheel))]
    contests = [contest for contest in CONTESTS if contest.order == order][: QUICK[order] if quick else None]
    ka.adapt(EDGE.mesh(2), contests[0].problem, passes=2)  # compiles all that is needed
    found = {contest: compared(contest, seeds) for contest in contests}
    names = list(dict.fromkeys(name for methods in found.values() for name in methods))
    figures = dict.fromkeys(figure for methods in found.values() for row in methods.values() for figure in row)
    tables = [
        markdown(
            [figure, *names],
            [[each.name, *(rows.get(name, {}).get(figure) for name in names)] for each, rows in found.items()],
        )
        for figure in figures
    ]
    return "\n\n".join([*tables, *missing])


def compared(contest: Contest, seeds: Sequence[int]) -> dict[str, Figures]:
    """All methods on one problem."""
    return {
        name: contest.described(method, seeds if name.startswith("this") else seeds[:1])
        for name, method in contest.methods().items()
    }


def greatest_angle(mesh: MeshTet) -> float:
    """Between two faces, in degrees."""
    x, faces = mesh.p[:, mesh.t], ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
    normals = np.array([np.cross(x[:, j] - x[:, i], x[:, k] - x[:, i], axis=0) for i, j, k in faces])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosine = np.array([-np.sum(normals[i] * normals[j], axis=0) for i, j in combinations(range(4), 2)])
    return float(np.degrees(np.arccos(np.clip(cosine.min(), -1.0, 1.0))))


def counted_iterations(problem: Solid, mesh: MeshTet) -> dict[str, int]:
    """Steps of conjugate gradients with Jacobi's preconditioner, and where pyamg is there with smoothed aggregation, as
    it comes and by its measure of strength for what is stretched.
    """
    stiffness, load, u, fixed = problem.system(mesh)
    matrix, right, *_ = condense(stiffness, load, x=u, D=fixed)
    preconditioners = [jacobi(matrix)]
    if not wheels.missing("pyamg"):
        from pyamg import smoothed_aggregation_solver

        for strength in ("symmetric", "evolution"):
            preconditioners.append(smoothed_aggregation_solver(matrix.tocsr(), strength=strength).aspreconditioner())
    return {name: steps_of_cg(matrix, right, each) for name, each in zip(COUNTED, preconditioners, strict=False)}


def steps_of_cg(matrix: Any, right: np.ndarray, preconditioner: LinearOperator) -> int:
    """How many there are until the residual is small."""
    steps = list[None]()
    cg(matrix, right, rtol=CLOSE, M=preconditioner, callback=lambda _: steps.append(None))
    return len(steps)
