"""Reference energies on boxes by hexahedra of high order in NGSolve.

The hexahedra are graded geometrically towards edges, where the solution is singular, so that the error falls faster
than any power of the number of unknowns (I. Babuska and B. Guo, Comput. Methods Appl. Mech. Engrg. 133 (1996) 319).
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.problems.solids import CUBE, FICHERA, MAGNET, TABLES, Solid
from benchmarks.table import aligned

FACTOR = 0.2  # between the sizes of neighbouring layers
# Layers and orders of each problem; the finest take 2 and 14 minutes of one processor.
RUNS = {"S": ((1, 4), (1, 6)), "F": ((2, 5), (3, 5), (3, 6), (3, 7)), "M": ((2, 4), (2, 5), (3, 4), (3, 5))}
QUICK = 2  # runs of each problem
MATERIALS = ("air", "iron", "magnet")  # in the order of `TABLES`
FACES = (((0, 4, 7, 3), (1, 2, 6, 5)), ((0, 1, 5, 4), (3, 7, 6, 2)), ((0, 3, 2, 1), (4, 5, 6, 7)))  # of each axis
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def report(seeds: Sequence[int], quick: bool) -> str:
    """Return computed energies beside the values that benchmarks take for exact."""
    try:
        import ngsolve  # noqa: F401
    except ImportError as error:
        return f"references: NGSolve cannot be imported ({error}); install the extra 'bench'."
    header = ["problem", "layers", "order", "unknowns", "energy", "taken for exact", "difference"]
    return aligned(header, [row for problem in (CUBE, FICHERA, MAGNET) for row in _rows(problem, quick)])


def _rows(problem: Solid, quick: bool) -> Iterator[list[Any]]:
    for layers, order in RUNS[problem.name][: QUICK if quick else None]:
        unknowns, energy = least_energy(problem, layers, order)
        figures = [f"{energy:.10f}", f"{problem.energy:.10f}", f"{energy / problem.energy - 1.0:.1e}"]
        yield [problem.name, layers, order, unknowns, *figures]


def graded(stops: np.ndarray, singular: np.ndarray, layers: int) -> np.ndarray:
    """Return coordinates with layers towards the singular stops."""
    found = [stops]
    for low, high in pairwise(stops):
        ends = [end for end in (low, high) if end in singular]
        reach = (high - low) / max(1, len(ends))
        for end in ends:
            towards = 1.0 if end == low else -1.0
            found.append(end + towards * reach * FACTOR ** np.arange(len(ends) == 1, layers + 1))
    return np.unique(np.round(np.concatenate(found), 14))


def grid(problem: Solid, layers: int) -> list[np.ndarray]:
    """Return the planes across each axis, graded towards the singular faces.

    These are the faces inside the body, or the outer faces if there are none.
    """
    parts = [box for box in (problem.notch, *problem.parts.values()) if box is not None]
    planes = []
    for axis in range(3):
        outer = np.array([problem.body.low[axis], problem.body.high[axis]])
        stops = np.unique([*outer, *(corner[axis] for box in parts for corner in box)])
        inner = np.setdiff1d(stops, outer)
        singular = inner if parts else outer
        planes.append(graded(stops if parts else np.array([outer[0], outer.mean(), outer[1]]), singular, layers))
    return planes


def hexahedral_mesh(problem: Solid, planes: Sequence[np.ndarray]) -> Any:
    """Return the boxes between planes as a mesh of NGSolve, with names."""
    import ngsolve
    from netgen.meshing import Element2D, Element3D, FaceDescriptor, Mesh, MeshPoint, Pnt

    middle = np.stack(np.meshgrid(*((x[1:] + x[:-1]) / 2 for x in planes), indexing="ij"))
    region = np.ones(middle.shape[1:], dtype=np.int64)
    for name, box in problem.parts.items():
        region[box.holds(middle)] = 1 + MATERIALS.index(name)
    if problem.notch is not None:
        region[problem.notch.holds(middle)] = 0
    padded = np.pad(region, 1)
    mesh, points = Mesh(dim=3), {}
    for number, name in enumerate(("given", "natural")):
        mesh.Add(FaceDescriptor(surfnr=number + 1, domin=1, bc=number + 1))
        mesh.SetBCName(number, name)
    for cell in np.argwhere(region):
        corners = []
        for index in map(tuple, cell + CORNERS):
            if index not in points:
                points[index] = mesh.Add(MeshPoint(Pnt(*(float(x[i]) for x, i in zip(planes, index, strict=True)))))
            corners.append(points[index])
        mesh.Add(Element3D(int(region[tuple(cell)]), corners))
        for axis, faces in enumerate(FACES):
            for side, face in enumerate(faces):
                beside = cell + 1
                beside[axis] += 2 * side - 1
                if padded[tuple(beside)] == 0:
                    at = middle[(slice(None), *cell)].copy()
                    at[axis] = planes[axis][cell[axis] + side]
                    given = bool(problem.given(at[:, None])[0])
                    mesh.Add(Element2D(1 if given else 2, [corners[k] for k in face]))
    for number, name in enumerate(MATERIALS):
        mesh.SetMaterial(number + 1, name)
    return ngsolve.Mesh(mesh)


def least_energy(problem: Solid, layers: int, order: int) -> tuple[int, float]:
    """Return the number of unknowns and the least functional ``-l(u) / 2``."""
    import ngsolve as ng
    from ngsolve.krylovspace import CGSolver

    mesh = hexahedral_mesh(problem, grid(problem, layers))
    space = ng.H1(mesh, order=order, dirichlet="given")
    u, v = space.TnT()
    coefficient = mesh.MaterialCF(dict(zip(MATERIALS, TABLES[0].tolist(), strict=True)))
    flux = mesh.MaterialCF(dict(zip(MATERIALS, map(tuple, TABLES[1].tolist()), strict=True)))
    form = ng.BilinearForm(coefficient * ng.grad(u) * ng.grad(v) * ng.dx, condense=True, symmetric=True)
    load = ng.LinearForm(problem.source * v * ng.dx + flux * ng.grad(v) * ng.dx)
    condition = ng.Preconditioner(form, "bddc")
    form.Assemble()
    load.Assemble()
    found, right = ng.GridFunction(space), load.vec.CreateVector()
    right.data = load.vec + form.harmonic_extension_trans * load.vec
    found.vec.data = CGSolver(form.mat, condition.mat, tol=1e-12, maxiter=2000) * right
    found.vec.data += form.harmonic_extension * found.vec
    found.vec.data += form.inner_solve * load.vec
    return space.ndof, -0.5 * float(ng.InnerProduct(load.vec, found.vec))
