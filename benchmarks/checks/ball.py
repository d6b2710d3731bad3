"""Hold order 2 in space against the field of a permeable ball: straight and curved edges, and what adapting brings."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementTetP2, MeshTet

import kohonen_adapt as ka
from benchmarks.problems.magnets_in_space import dipole, nested_balls
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material, SolidField

Array = NDArray[np.float64]

PERMEABILITY = 50.0
INSIDE, OUTSIDE = 3.0 / (PERMEABILITY + 2.0), (PERMEABILITY - 1.0) / (PERMEABILITY + 2.0)
DEGREE = 9  # of the quadrature of the error
PASSES = 4


def applied(x: Array) -> Array:
    """Potential around a permeable ball of radius 1 in a field of 1 A/m along z."""
    return -x[2] + OUTSIDE * dipole(x, 1.0)[0]


PROBLEM = MagneticScalarPotential({"ball": Material(PERMEABILITY), "air": Material()}, {"outer": applied}, order=2)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Relative errors of H over the true domain, and the power of the element size."""
    cells = (2, 3, 4) if quick else (2, 3, 4, 6)
    errors, rows = [], list[list[Cell]]()
    for count in cells:
        mesh = nested_balls(count)
        fields = [PROBLEM.solve(each) for each in (mesh, curved(mesh))]
        errors.append([error_of(field) for field in fields])
        rows.append([mesh.nvertices, fields[0].unknown.size, *errors[-1]])
    rates = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
    rows.append(["fitted rate", "", *rates.tolist()])
    tables = [aligned(["ball, nodes", "unknowns", "straight edges", "curved edges"], rows)]
    header = ["adapted", "unknowns", "error", "estimate", "seconds"]
    return "\n\n".join([*tables, aligned(header, adapted(nested_balls(2 if quick else 3), seeds[0]))])


def curved(mesh: MeshTet) -> MeshTet:
    return ka.adapt(mesh, PROBLEM, passes=0).mesh


def adapted(mesh: MeshTet, seed: int) -> list[list[Cell]]:
    rows = list[list[Cell]]()
    for sides in (False, True):
        for polish in (False, True):
            problem, start = replace(PROBLEM, curved=sides), time.process_time()
            result = ka.adapt(mesh, problem, passes=PASSES, polish=polish, seed=seed)
            seconds = time.process_time() - start
            name = f"{'curved' if sides else 'straight'}, {'polished' if polish else 'by density'}"
            error = error_of(problem.solve(result.mesh))
            rows.append(
                [
                    name,
                    result.best.unknowns,
                    error,
                    result.best.estimate / (result.best.energy_norm or 1.0),
                    round(seconds, 1),
                ]
            )
    return rows


def error_of(field: SolidField) -> float:
    """Of H in the mean square, against the exact field on the side of the ball where a point is."""
    basis = Basis(field.mesh, ElementTetP2(), intorder=DEGREE)
    x, slope = basis.global_coordinates().value, basis.interpolate(field.unknown).grad
    shape = x.shape
    x = x.reshape(3, -1)
    inside = np.linalg.norm(x, axis=0) < 1.0
    exact = OUTSIDE * dipole(x, 1.0)[1] + np.array([[0.0], [0.0], [1.0]])
    exact[:, inside] = np.array([[0.0], [0.0], [INSIDE]])
    exact = exact.reshape(shape)
    off, whole = (np.sum(np.sum(part**2, axis=0) * basis.dx) for part in (slope + exact, exact))
    return float(np.sqrt(off / whole))
