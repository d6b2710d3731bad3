"""Compare this package on tetrahedra with refinement and remeshers at equal numbers of nodes."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg
from skfem import MeshTet, condense

import kohonen_adapt as ka
from benchmarks.peers import wheels
from benchmarks.peers.gmsh_space import gmsh_in_space
from benchmarks.peers.mmg_space import mmg_in_space
from benchmarks.peers.space_remeshing import adapted, curvatures, sizes, volumes
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET, Solid, jacobi
from benchmarks.table import aligned

CASES = (
    (EDGE, 6, 0.46), (FICHERA, 5, 0.49), (MAGNET, 4, 0.66), (CUBE, 10, 0.49),
    (EDGE, 10, 0.44), (FICHERA, 8, 0.47), (MAGNET, 8, 0.66), (CUBE, 16, 0.48),
)  # cells per unit, and the share of Mmg3d's error that time is counted to  # fmt: skip
QUICK = 4
MMG = "Mmg3d"  # whose error is the unit
BULK = 0.5  # of the squared estimate: what refinement marks, after Doerfler
FLOORS = (0.2, 0.1)
PASSES = 3
CLOSE = 1e-8  # relative residual at which iterations are counted
HEADER = (
    "of Mmg3d's", "error", "N", "lost", "least angle", "greatest", "CPU s", "CG Jacobi", "CG SA", "evolution",
)  # fmt: skip


class Found(NamedTuple):
    """A mesh, and the processor time of all that led to it, solutions included."""

    mesh: MeshTet
    seconds: float


class Described(NamedTuple):
    """A row of the table, from the second figure on."""

    error: float
    nodes: int
    lost: str
    least: float
    greatest: float
    seconds: float
    jacobi: float
    aggregation: float | None = None
    evolution: float | None = None


Method = Callable[[Solid, MeshTet, int], MeshTet]


def report(seeds: Sequence[int], quick: bool) -> str:
    """A table for every problem: errors at the same N by N^(-1/3), of Mmg's, and what each mesh is like."""
    missing = [line for wheel in ("mmgpy", "gmsh", "pyamg") if (line := wheels.missing(wheel))]
    ka.adapt(EDGE.mesh(2), EDGE, passes=2)  # compiles all that is needed
    return "\n\n".join([*(table(*case, seeds) for case in CASES[: QUICK if quick else None]), *missing])


def table(problem: Solid, cells: int, share: float, seeds: Sequence[int]) -> str:
    """All methods on one problem, and how long this package takes to a share of Mmg3d's error."""
    start = problem.mesh(cells)
    found = {"uniform": [Found(start, 0.0)], "refined by scikit-fem": [refined(problem, start.nvertices)]}
    for name, method in methods().items():
        ours = name.startswith("this")
        found[name] = [timed(method, problem, start, seed) for seed in (seeds if ours else seeds[:1])]
    rows = {name: described(problem, start, runs) for name, runs in found.items()}
    shares = {name: row.error / rows[MMG].error if MMG in rows else None for name, row in rows.items()}
    compared = aligned(
        [f"{problem.name}, N = {start.nvertices}", *HEADER], [[name, shares[name], *row] for name, row in rows.items()]
    )
    return f"{compared}\n\n{to_share(problem, start, share, rows[MMG], seeds)}" if MMG in rows else compared


def to_share(problem: Solid, start: MeshTet, share: float, mmg: Described, seeds: Sequence[int]) -> str:
    """The fewest passes of this package that come to a share of the error of Mmg3d, and their processor time."""
    for passes in range(1, PASSES + 1):
        runs = [timed(partial(adapted_in, passes, FLOORS[0]), problem, start, seed) for seed in seeds]
        error = float(np.median([problem.error(run.mesh, problem.solve(run.mesh)) for run in runs]))
        if error <= share * mmg.error:
            break
    seconds = float(np.median([run.seconds for run in runs]))
    header = [f"to {share} of Mmg3d's", "passes", "error", "wanted", "CPU s", "Mmg3d's", "ratio"]
    row = [problem.name, passes, error, share * mmg.error, seconds, mmg.seconds, seconds / mmg.seconds]
    return aligned(header, [row])


def methods() -> dict[str, Method]:
    """Those that there are wheels for, and ours."""
    found: dict[str, Method] = {}
    if not wheels.missing("mmgpy"):
        found[MMG] = lambda problem, start, _: adapted(problem, start, sizes, mmg_in_space)
        found["Mmg3d, anisotropic"] = lambda problem, start, _: adapted(problem, start, curvatures, mmg_in_space)
    if not wheels.missing("gmsh"):
        found["Gmsh"] = lambda problem, start, _: adapted(problem, start, sizes, gmsh_in_space)
    for floor in FLOORS:
        found[f"this package, floor {floor}"] = partial(adapted_in, PASSES, floor)
    return found


def adapted_in(passes: int, floor: float, problem: Solid, start: MeshTet, seed: int) -> MeshTet:
    """What this package makes of the start in so many passes."""
    return ka.adapt(start, problem, passes=passes, min_quality=floor, seed=seed).mesh


def timed(method: Method, problem: Solid, start: MeshTet, seed: int) -> Found:
    """What a method makes of the start."""
    began = time.process_time()
    mesh = method(problem, start, seed)
    problem.solve(mesh)
    return Found(mesh, time.process_time() - began)


def refined(problem: Solid, nodes: int) -> Found:
    """scikit-fem's adaptive refinement of the coarsest mesh, where it comes nearest to a number of nodes.

    It keeps the numbers of facets, which are those of others then: names are asked of the problem again for every
    solution, and the mesh is handed over as scikit-fem left it.
    """
    began, mesh, meshes = time.process_time(), problem.coarsest(), list[Found]()
    while True:
        named = problem.named(mesh)
        eta = problem.indicators(named, problem.solve(named)) ** 2
        meshes.append(Found(mesh, time.process_time() - began))
        if mesh.nvertices >= nodes:
            return min(meshes, key=lambda found: abs(np.log(found.mesh.nvertices / nodes)))
        order = np.argsort(-eta)
        last = np.searchsorted(np.cumsum(eta[order]), BULK * eta.sum())
        mesh = mesh.refined(np.sort(order[: last + 1]))


def described(problem: Solid, start: MeshTet, runs: list[Found]) -> Described:
    """Medians over runs, but the extreme angles of all of them; names are lost that have another size than before."""
    meshes = [problem.named(run.mesh) for run in runs]
    nodes = np.array([mesh.nvertices for mesh in meshes])
    errors = [problem.error(mesh, problem.solve(mesh)) for mesh in meshes] * (nodes / start.nvertices) ** (1 / 3)
    lost = {name for run in runs for name in lost_names(start, run.mesh)}
    angles = np.array([dihedral_angles(mesh) for mesh in meshes])
    iterations = [counted_iterations(problem, mesh) for mesh in meshes]
    return Described(
        error=float(np.median(errors)),
        nodes=int(np.median(nodes)),
        lost=", ".join(sorted(lost)) or "none",
        least=float(angles[:, 0].min()),
        greatest=float(angles[:, 1].max()),
        **{name: float(np.median([counts[name] for counts in iterations])) for name in iterations[0]},
        seconds=float(np.median([run.seconds for run in runs])),
    )


def lost_names(before: MeshTet, after: MeshTet) -> list[str]:
    """Names that are not there afterwards or have another volume or area."""
    then, now = extents(before), extents(after)
    return [name for name, size in then.items() if not np.isclose(size, now.get(name, np.nan), rtol=1e-9)]


def extents(mesh: MeshTet) -> dict[str, float]:
    """Volume of every subdomain and area of every boundary."""
    a, b, c = mesh.p[:, mesh.facets].transpose(1, 0, 2)
    areas, size = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0), volumes(mesh)
    return {name: size[rows].sum() for name, rows in (mesh.subdomains or {}).items()} | {
        name: areas[np.asarray(rows)].sum() for name, rows in (mesh.boundaries or {}).items()
    }


def dihedral_angles(mesh: MeshTet) -> tuple[float, float]:
    """The least and the greatest, in degrees."""
    x, faces = mesh.p[:, mesh.t], ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
    normals = np.array([np.cross(x[:, j] - x[:, i], x[:, k] - x[:, i], axis=0) for i, j, k in faces])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosine = np.array([-np.sum(normals[i] * normals[j], axis=0) for i, j in combinations(range(4), 2)])
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return float(angle.min()), float(angle.max())


def counted_iterations(problem: Solid, mesh: MeshTet) -> dict[str, int]:
    """Steps of conjugate gradients with Jacobi's preconditioner, and where pyamg is there with smoothed aggregation, as
    it comes and by its measure of strength for what is stretched.
    """
    stiffness, load, u, fixed = problem.system(mesh)
    matrix, right, *_ = condense(stiffness, load, x=u, D=fixed)
    found = {"jacobi": steps_of_cg(matrix, right, jacobi(matrix))}
    if wheels.missing("pyamg"):
        return found
    from pyamg import smoothed_aggregation_solver

    for name, strength in (("aggregation", "symmetric"), ("evolution", "evolution")):
        levels = smoothed_aggregation_solver(matrix.tocsr(), strength=strength)
        found[name] = steps_of_cg(matrix, right, levels.aspreconditioner())
    return found


def steps_of_cg(matrix: Any, right: np.ndarray, preconditioner: LinearOperator) -> int:
    """How many there are until the residual is small."""
    steps = list[None]()
    cg(matrix, right, rtol=CLOSE, M=preconditioner, callback=lambda _: steps.append(None))
    return len(steps)
