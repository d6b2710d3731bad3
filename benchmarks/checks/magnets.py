"""Hold magnets and iron in space against exact fields: rates on uniform meshes, and what adapting them brings."""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from unittest.mock import patch

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.peers.mmg_space import mmg_in_space
from benchmarks.peers.space_remeshing import adapted, at_nodes
from benchmarks.problems.magnets_in_space import MU0, LoopAndBall, blocks, dipole, graded, nested_balls
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics import Force, MagneticScalarPotential, Material, SolidField, Torque

FORCE_TARGETS = {0.0022: 0.01, 0.0015: 0.003}  # step of the start, of 10^4 and 3 x 10^4 nodes, to the error allowed
BALL_TARGET = 0.5  # of Mmg's error
MAGNETISATION = 1e6
LOOP = (1.5, 1.0, 100.0)  # radius, height, current
PASSES = 6

AIR = Material()
POLES = {"a": (0.0, 0.0, 1.2), "b": (0.0, 0.5, 1.0)}
PLACES = {"a": ((-0.010, -0.010, -0.005), (0.010, 0.010, 0.005)), "b": ((-0.006, -0.010, 0.010), (0.014, 0.010, 0.020))}
MIDDLE = (0.004, 0.0, 0.015)  # of the second
MARKS = ([-0.010, -0.006, 0.010, 0.014], [-0.010, 0.010], [-0.005, 0.005, 0.010, 0.020])
POLES_IN_AIR = {name: Material(remanence=each) for name, each in POLES.items()} | {"air": AIR}
CUBOIDS = MagneticScalarPotential(POLES_IN_AIR, {"outer": 0.0}, order=1)
BALL = MagneticScalarPotential(
    {"ball": Material(remanence=(0.0, 0.0, MU0 * MAGNETISATION)), "air": AIR},
    {"outer": lambda x: dipole(x, MAGNETISATION / 3.0)[0]},
    order=1,
)
OVER_IRON = MagneticScalarPotential(
    {"magnet": Material(remanence=POLES["b"]), "air": AIR}, {"outer": 0.0}, symmetry={"z-": "normal"}, order=1
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors of uniform meshes with the rates between them; then adapted, in medians over seeds; then solvers."""
    cells = (2, 4) if quick else (2, 4, 6)  # of 1 cm: the gaps of 5 mm have whole numbers of them
    rows = [row for name, errors in exact_cases(cells) for row in with_rate(name, cells, errors)]
    tables = [aligned(["exact cases", "nodes", "error", "rate"], rows)]
    starts = list(FORCE_TARGETS)[: 1 if quick else None]
    header = ["adapted for", "nodes", "uniform", "the energy", "the goal", "and with its error", "target", "seconds"]
    tables.append(aligned(header, goals_adapted(starts)))
    header = ["adapted", "nodes", "uniform", "Mmg3d", "adapted", "of Mmg's", "target", "seconds"]
    tables.append(aligned(header, ball_adapted(3 if quick else 5, seeds)))
    tables.append(aligned(["solver", "nodes", "direct s", "multigrid s"], solvers(quick)))
    return "\n\n".join(tables)


def exact_cases(parts: Sequence[int]) -> list[tuple[str, list[tuple[int, float]]]]:
    """Name, and nodes and relative error of every size."""
    found: dict[str, list[tuple[int, float]]] = {}
    for cells in parts:
        for case in (magnetised_ball, loop_and_ball, two_cuboids, over_iron):
            for name, nodes, error in case(cells):
                found.setdefault(name, []).append((nodes, error))
    return list(found.items())


def with_rate(name: str, cells: Sequence[int], errors: Sequence[tuple[int, float]]) -> list[list[Cell]]:
    """A row for every size, the last with the power of the element size by which the error falls."""
    rate = np.log(errors[0][1] / errors[-1][1]) / np.log(cells[-1] / cells[0])
    return [[name, nodes, error, float(rate) if k else None] for k, (nodes, error) in enumerate(errors)]


def magnetised_ball(cells: int) -> list[tuple[str, int, float]]:
    """In the energy norm, and of the mean of B inside, 2/3 mu0 M."""
    field = BALL.solve(nested_balls(cells))
    inside, nodes = field.mesh.subdomains["ball"], field.mesh.nvertices
    mean = np.average(field.flux_density[2, inside], weights=field.elements.volumes[inside])
    share = abs(1.5 * mean / (MU0 * MAGNETISATION) - 1.0)
    return [("ball, energy norm", nodes, ball_error(field)), ("ball, B inside", nodes, float(share))]


def ball_error(field: SolidField) -> float:
    """Of the magnetised ball in the energy norm, relative: in each element against the field of its side."""
    corners = field.mesh.p[:, field.mesh.t]
    x = 0.2**0.5 * corners + (1.0 - 0.2**0.5) * corners.mean(axis=1, keepdims=True)
    exact = dipole(x.reshape(3, -1), MAGNETISATION / 3.0)[1].reshape(x.shape)
    exact[:, :, field.mesh.subdomains["ball"]] = np.array([0.0, 0.0, -MAGNETISATION / 3.0])[:, None, None]
    off = np.sum((field.field_strength[:, None] - exact) ** 2, axis=0).mean(axis=0)
    whole = np.sum(exact**2, axis=0).mean(axis=0)
    return float(np.sqrt(field.elements.volumes @ off / (field.elements.volumes @ whole)))


def cut_off(field: SolidField) -> float:
    """The same error of what lies between faces and the ball, where the field goes on from outside."""
    mesh, exact = field.mesh, 2.75 * 4.0 / 27.0 * np.pi * MAGNETISATION**2  # the integral of the squared field
    inside = np.isin(np.arange(mesh.nelements), mesh.subdomains["ball"])
    facets = np.flatnonzero((mesh.f2t[1] >= 0) & (inside[mesh.f2t[0]] != inside[mesh.f2t[1]]))
    air = np.where(inside[mesh.f2t[0, facets]], *mesh.f2t[::-1, facets])
    corners = mesh.p[:, mesh.facets[:, facets]]
    area = 0.5 * np.linalg.norm(np.cross(*(corners[:, k] - corners[:, 0] for k in (1, 2)), axis=0), axis=0)
    height = 1.0 - np.linalg.norm(0.5 * (corners + np.roll(corners, 1, axis=1)), axis=0).mean(axis=0)
    middle = corners.mean(axis=1) / np.linalg.norm(corners.mean(axis=1), axis=0)
    fields = np.array([[0.0], [0.0], [-MAGNETISATION / 3.0]]), dipole(middle, MAGNETISATION / 3.0)[1]
    wrong, counted = (np.sum((field.field_strength[:, air] - one) ** 2, axis=0) for one in fields)
    return float(np.sqrt(max(0.0, area * height @ (wrong - counted)) / exact))


def in_true_domain(field: SolidField) -> float:
    """Of the magnetised ball in the energy norm, relative, with what its faces cut off."""
    return float(np.hypot(ball_error(field), cut_off(field)))


def loop_and_ball(cells: int) -> list[tuple[str, int, float]]:
    """Force on a permeable ball below a loop of wire."""
    import magpylib

    radius, height, current = LOOP
    exact = LoopAndBall(radius, height, current, 1000.0)
    wire = magpylib.current.Circle(diameter=2.0 * radius, current=current, position=(0.0, 0.0, height))
    problem = MagneticScalarPotential(
        {"ball": Material(1000.0), "air": AIR}, {"outer": exact.reduced}, applied_field=wire
    )
    field = problem.solve(nested_balls(cells + 1, rim=4.0))
    error = abs(field.force("ball")[2] / exact.force() - 1.0)
    return [("loop over a ball, force", field.mesh.nvertices, float(error))]


def box_of(cells: int, far: float = 0.06) -> MeshTet:
    """The two cuboids in air, of edges of 1 cm in so many parts."""
    return cuboids(0.01 / cells, round(1.7 * cells), far)


def cuboids(step: float, layers: int, far: float) -> MeshTet:
    """The two cuboids in air up to a distance."""
    return blocks([graded(each, step, far, layers) for each in MARKS], PLACES)


def known() -> tuple[np.ndarray, np.ndarray, list[object]]:
    """Force and torque on the second cuboid by magpylib, and both as its objects."""
    import magpylib

    magnets = []
    for name, pole in POLES.items():
        low, high = np.array(PLACES[name])
        magnets.append(magpylib.magnet.Cuboid(dimension=high - low, polarization=pole, position=0.5 * (low + high)))
    force, torque = magpylib.getFT(*magnets, pivot=MIDDLE, meshing=20_000)
    return force, torque, magnets


def two_cuboids(cells: int) -> list[tuple[str, int, float]]:
    """B at points, force and torque."""
    import magpylib

    force, torque, magnets = known()
    field = CUBOIDS.solve(box_of(cells))
    x = np.random.default_rng(0).uniform([-0.02, -0.02, -0.015], [0.02, 0.02, 0.03], (500, 3))
    wanted = magpylib.getB(magnets, x, sumup=True).T, force, torque
    found = field.flux_density_at(x.T, recovered=True), field.force("b"), field.torque("b", MIDDLE)
    names = "cuboids, B at points", "cuboids, force", "cuboids, torque"
    return [(name, field.mesh.nvertices, off(*pair)) for name, *pair in zip(names, found, wanted, strict=True)]


def over_iron(cells: int) -> list[tuple[str, int, float]]:
    """Force on a cuboid magnet above iron of any permeability, which is that of its image."""
    mesh = above_plane(0.01 / cells, round(1.7 * cells), 0.06)
    found = OVER_IRON.solve(mesh).force("magnet")
    return [("magnet over iron, force", mesh.nvertices, off(found, force_of_image()))]


def above_plane(step: float, layers: int, far: float) -> MeshTet:
    """The magnet over iron, in air up to a distance."""
    wide, high = graded([-0.010, 0.010], step, far, layers), graded([0.0, 0.005, 0.015], step, far, layers)
    return blocks([wide, wide, high[high > -1e-12]], {"magnet": ((-0.010, -0.010, 0.005), (0.010, 0.010, 0.015))})


def force_of_image() -> np.ndarray:
    """Of the magnet over iron, by magpylib."""
    import magpylib

    size, middle = (0.020, 0.020, 0.010), np.array((0.0, 0.0, 0.010))
    pole = np.array(POLES["b"])
    magnet = magpylib.magnet.Cuboid(dimension=size, polarization=pole, position=middle)
    image = magpylib.magnet.Cuboid(
        dimension=size, polarization=pole * (-1.0, -1.0, 1.0), position=middle * (1.0, 1.0, -1.0)
    )
    return magpylib.getFT(image, magnet, pivot=(0.0, 0.0, 0.0), meshing=20_000)[0]


def off(found: np.ndarray, wanted: np.ndarray) -> float:
    """Relative error of vectors."""
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


def goals_adapted(steps: Sequence[float]) -> list[list[Cell]]:
    """Rows of `goal_adapted`: forces along z, and a torque along what it is."""
    force, torque, _ = known()
    size, rows = float(np.linalg.norm(torque)), list[list[Cell]]()
    for step in steps:
        mesh, target = cuboids(step, round(0.011 / step), 0.15), FORCE_TARGETS[step]
        rows.append(goal_adapted("force of cuboids", mesh, CUBOIDS, Force("b", (0.0, 0.0, 1.0)), force[2], target))
    axis = tuple((torque / size).tolist())
    mesh, goal = cuboids(0.0033, 3, 0.15), Torque("b", MIDDLE, axis)
    rows.append(goal_adapted("torque of cuboids", mesh, CUBOIDS, goal, size))
    mesh, goal = above_plane(0.0025, 4, 0.15), Force("magnet", (0.0, 0.0, 1.0))
    rows.append(goal_adapted("force on iron", mesh, OVER_IRON, goal, force_of_image()[2]))
    return rows


def goal_adapted(
    name: str,
    mesh: MeshTet,
    problem: MagneticScalarPotential,
    goal: Force | Torque,
    exact: float,
    target: float | None = None,
) -> list[Cell]:
    """Relative errors of a goal: uniform, adapted for the energy, for the goal, and with what `goal_error` adds there.

    Seeds have no part: on tetrahedra nothing of the default is random.
    """
    for_goal, began = replace(problem, goal=goal), time.process_time()
    field = ka.adapt(mesh, for_goal, passes=PASSES).solution
    seconds, better = time.process_time() - began, goal(field) + for_goal.goal_error(field)
    others = problem.solve(mesh), ka.adapt(mesh, problem, passes=PASSES).solution
    errors = [abs(value / exact - 1.0) for value in (*map(goal, (*others, field)), better)]
    return [name, mesh.nvertices, *errors, target, seconds]


def ball_adapted(cells: int, seeds: Sequence[int]) -> list[list[Cell]]:
    """The magnetised ball in the energy norm, beside Mmg's mesh, brought to the same number of nodes by N^(-1/3).

    In the true domain, and each side of the faces against its own field, which leaves out what faces cut off.
    """
    mesh, began = nested_balls(cells), time.process_time()
    found = [ka.adapt(mesh, BALL, passes=PASSES, seed=seed).solution for seed in seeds]
    seconds, uniform = (time.process_time() - began) / len(seeds), BALL.solve(mesh)
    other = adapted(BALL, mesh, sizes, mmg_in_space) if find_spec("mmgpy") else None
    rows: list[list[Cell]] = []
    for name, of in (("ball, energy norm", in_true_domain), ("ball, beside its faces", ball_error)):
        error, peer = float(np.median([of(field) for field in found])), None
        if other is not None:
            peer = of(BALL.solve(other)) * (other.nvertices / mesh.nvertices) ** (1 / 3)
        share = None if peer is None else error / peer
        rows.append([name, mesh.nvertices, of(uniform), peer, error, share, BALL_TARGET, seconds])
    return rows


def sizes(problem: MagneticScalarPotential, mesh: MeshTet, field: SolidField) -> np.ndarray:
    """1 / h^2 (nnodes,) up to a factor, from the density that `adapt` takes."""
    return at_nodes(mesh, ka.density_from_indicators(mesh, problem.indicators(mesh, field))) ** (2 / 3)


def solvers(quick: bool) -> list[list[Cell]]:
    """Seconds of a linear solution by factors and by multigrid, from the size at which that is taken."""
    return [timed(box_of(cells)) for cells in ((4,) if quick else (4, 6, 8))]


def timed(mesh: MeshTet) -> list[Cell]:
    """Nodes, and seconds from the mesh to the field by both."""
    with patch.dict(sys.modules, {"pyamg": None}):  # as where it is not installed
        slow = seconds_of_solution(mesh)
    return ["cuboids", mesh.nvertices, slow, seconds_of_solution(mesh)]


def seconds_of_solution(mesh: MeshTet) -> float:
    """How long a solution takes, the better of two: the first one imports what it is solved by."""
    found = []
    for _ in range(2):
        began = time.perf_counter()
        CUBOIDS.solve(mesh)
        found.append(time.perf_counter() - began)
    return min(found)
