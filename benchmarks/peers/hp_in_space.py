"""Compare orders 4 to 6 on tetrahedra with NGSolve's hp refinement at marked edges, and estimates with errors."""

import time
from collections.abc import Iterator, Sequence
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np

import kohonen_adapt as ka
from benchmarks.peers import wheels
from benchmarks.peers.contest import Call, Run, best_of, fewest_unknowns, quickest
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET, TABLES, Box, Solid
from benchmarks.problems.solids_by_order import BLOCK, ByOrder
from benchmarks.table import Cell, markdown
from kohonen_adapt.geometry.singular_layers import with_layers_at

SOLIDS = (FICHERA, EDGE, MAGNET, CUBE)
ERRORS = (1.0, 0.5, 0.2)  # % of the energy norm
SIZES, LEVELS, FACTORS, ORDERS = (2.0, 1.0), range(1, 4), (0.12, 0.2), range(3, 7)
MOST = 80_000  # unknowns
NODES = {"F": 120, "E": 80, "S": 80, "M": 400, "I": 150}  # of the meshes for estimates
TOLD_ORDERS = (4, 5, 6)
ON = 1e-9


def parts(quick: bool) -> Iterator[str]:
    """Yield all tables of one run."""
    ka.warmup(space=True)
    missing = wheels.missing("ngsolve")
    yield missing or against_hp(SOLIDS[: 2 if quick else None], ERRORS[: 1 if quick else None], quick)
    yield told(quick)


def against_hp(solids: Sequence[Solid], errors: Sequence[float], quick: bool) -> str:
    """Print times and unknowns to errors by `rtol` alone beside those of NGSolve's hp refinement."""
    header = ["", "error %", "NGSolve's hp", "s", "unknowns", "by rtol", "s", "unknowns", "told %", "error %"]
    header += ["time ratio", "of the fewest unknowns"]
    return markdown(header, [row for solid in solids for row in _rows(solid, errors, quick)])


def _rows(solid: Solid, errors: Sequence[float], quick: bool) -> Iterator[list[Cell]]:
    own = [partial(run_to, solid, error) for error in errors]
    sides: list[Sequence[Call]] = [list(theirs(solid, quick)), own]
    for side in sides:
        side[0]()  # warm
    hp, ours = best_of(sides, errors, 1 if quick else 3)
    for error, run in zip(errors, ours, strict=True):
        first, fewest = quickest(hp, error), fewest_unknowns(hp, error)
        row: list[Cell] = [solid.name, f"{error:g}"]
        row += [first.settings, f"{first.seconds:.3f}", first.unknowns] if first else [None] * 3
        settings, told_error = run.settings.split("|")
        row += [settings, f"{run.seconds:.3f}", run.unknowns, told_error, f"{run.error:.3g}"]
        ratio = f"{run.seconds / first.seconds:.2f}" if first else None
        yield [*row, ratio, f"{run.unknowns / fewest:.2f}" if fewest else None]


def run_to(solid: Solid, error: float) -> Run:
    """Run `adapt` to a tolerance in %."""
    problem, start = ByOrder(solid), solid.coarsest()
    begin = time.process_time()
    result = ka.adapt(start, problem, rtol=0.01 * error)
    seconds, best = time.process_time() - begin, result.best
    told_error = 100.0 * best.estimate / (best.energy_norm or np.inf)
    settings = f"p {best.order}, {result.mesh.nvertices} nodes|{told_error:.3g}"
    return Run(settings, best.unknowns, problem.error(result.solution), seconds)


def told(quick: bool) -> str:
    """Print estimate over error on meshes of two passes with layers, and the errors with most layers."""
    header = ["estimate over error", "nodes", "layers", *(f"p {order}" for order in TOLD_ORDERS), "error %"]
    rows = list[list[Cell]]()
    for solid in (*SOLIDS, BLOCK)[: 1 if quick else None]:
        name, nodes, layers, *ratios, errors = zip(*_told_rows(solid, (1,) if quick else range(4)), strict=True)
        rows.append([name[0], nodes[-1], *(", ".join(map(str, each)) for each in (layers, *ratios)), errors[-1]])
    return markdown(header, rows)


def _told_rows(solid: Solid, layers: Sequence[int]) -> Iterator[list[Cell]]:
    problem, start = ByOrder(solid), solid.mesh(2) if solid is BLOCK else solid.coarsest()
    base = ka.adapt(start, problem, passes=2, target_nodes=NODES[solid.name]).mesh
    edges, corners = problem.singular_edges(base)
    for count in layers if edges.size else (0,):
        mesh = with_layers_at(base, np.union1d(edges, corners), count, edges=edges)[0] if count else base
        solved = [problem.solve(mesh, order) for order in TOLD_ORDERS]
        errors = np.array([problem.error(each) for each in solved])
        estimates = [100.0 * np.linalg.norm(problem.indicators(mesh, each)) for each in solved]
        ratios = np.array(estimates) / np.sqrt(-2.0 * solid.energy) / errors
        texts = [f"{ratio:.2f}" for ratio in ratios], " ".join(f"{error:.2g}" for error in errors)
        yield [solid.name, mesh.nvertices, count, *texts[0], texts[1]]


def theirs(solid: Solid, quick: bool) -> Iterator[Call]:
    """All settings of NGSolve."""
    sizes, levels, factors = (SIZES[:1], LEVELS[:2], FACTORS[:1]) if quick else (SIZES, LEVELS, FACTORS)
    for settings in product(sizes, levels, factors, ORDERS[:4] if quick else ORDERS):
        yield partial(hp, solid, *settings)


def hp(solid: Solid, size: float, levels: int, factor: float, order: int) -> Run:
    """Refine at marked edges and corners and solve; meshing does not count."""
    import ngsolve as ng

    mesh = ng.Mesh(drawn(solid, size).Copy())
    begin = time.process_time()
    mesh.RefineHP(levels, factor)
    space = ng.H1(mesh, order=order, dirichlet="given")
    settings = f"size {size:g}, {levels} levels by {factor:g}, p {order}"
    if space.ndof > MOST:
        return Run(settings, space.ndof, np.inf, np.inf)
    u, v = space.TnT()
    nu = mesh.MaterialCF({"iron": TABLES[0][1]}, default=1.0)
    form = ng.BilinearForm(nu * ng.grad(u) * ng.grad(v) * ng.dx, symmetric=True, condense=True)
    load = ng.LinearForm(space)
    if solid.source:
        load += float(solid.source) * v * ng.dx
    if solid.magnet:
        load += ng.CF((0, 0, 1)) * ng.grad(v) * ng.dx("magnet")
    form.Assemble()
    load.Assemble()
    right, found = load.vec.CreateVector(), ng.GridFunction(space)
    right.data = load.vec
    right.data += form.harmonic_extension_trans * right
    found.vec.data = form.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky") * right
    found.vec.data += form.harmonic_extension * found.vec
    found.vec.data += form.inner_solve * right
    seconds = time.process_time() - begin
    value = -0.5 * ng.InnerProduct(load.vec, found.vec)
    return Run(settings, space.ndof, 100.0 * float(np.sqrt(max(0.0, 1.0 - value / solid.energy))), seconds)


@cache
def drawn(solid: Solid, size: float) -> Any:
    """Netgen's mesh with names, with singular edges and corners marked for hp refinement."""
    from netgen.occ import Box as Brick
    from netgen.occ import Glue, OCCGeometry, Pnt

    def brick(box: Box) -> Any:
        return Brick(Pnt(*box.low), Pnt(*box.high))

    body, inner = brick(solid.body), []
    if solid.notch:
        body -= brick(solid.notch)
    for name, box in solid.parts.items():
        part = brick(box)
        part.mat(name)
        body, inner = body - part, [*inner, part]
    body.mat("air")
    shape = Glue([body, *inner]) if inner else body
    edges, corners = singular_lines(solid)
    for face in shape.faces:
        at = np.array([[face.center.x], [face.center.y], [face.center.z]])
        face.name = "given" if solid.given(at)[0] else "natural"
    for edge in shape.edges:
        if on_lines(np.array([edge.center.x, edge.center.y, edge.center.z]), *edges):
            edge.hpref = 1
    for vertex in shape.vertices:
        if np.any(np.linalg.norm(corners.T - [vertex.p.x, vertex.p.y, vertex.p.z], axis=1) < ON):
            vertex.hpref = 1
    return OCCGeometry(shape).GenerateMesh(maxh=size)


def singular_lines(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """The ends of singular edges (2, 3, k) on the coarsest mesh, and the corners (3, n)."""
    mesh = solid.coarsest()
    edges, corners = ByOrder(solid).singular_edges(mesh)
    return mesh.p[:, edges].swapaxes(0, 1), mesh.p[:, corners]


def on_lines(x: np.ndarray, start: np.ndarray, end: np.ndarray) -> bool:
    """True if a point is on one of some lines."""
    along, off = end - start, x[:, None] - start
    share = np.sum(off * along, axis=0) / np.maximum(np.sum(along**2, axis=0), ON)
    near = np.linalg.norm(off - share * along, axis=0) < ON
    return bool(np.any(near & (share > -ON) & (share < 1.0 + ON)))
