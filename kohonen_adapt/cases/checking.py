"""Mesh of a case, with the checks of `adapt` before any solve."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.cases.case import Case, error_in_plane, keys_of_space
from kohonen_adapt.cases.potentials import TabulatedPotential
from kohonen_adapt.cases.readers import locate_errors
from kohonen_adapt.cases.turning import turned_mesh
from kohonen_adapt.checks import nearest_name
from kohonen_adapt.io import HEADER, check_names_written
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR
from kohonen_adapt.magnetostatics.materials.coefficients import coefficients
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential
from kohonen_adapt.mesh.adjacency import connected_arrays
from kohonen_adapt.mesh.cells import TRIANGLE, cell_of
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.names import named_sets

__all__ = [
    "fitting_mesh",
]


def fitting_mesh(case: Case) -> MeshTri:
    """Read the mesh of a case, and run the checks of `adapt` without solving.

    Parameters
    ----------
    case
        The settings.

    Returns
    -------
    MeshTri
        The mesh in metres.

    Raises
    ------
    ValueError
        If the file is missing or damaged, names of the case are not in the mesh, an element has no material or two,
        conditions contradict one another, or an option, the goal or an output does not fit the mesh.
    OSError
        If the file cannot be read.
    """
    _check_file(case.mesh_file)
    with locate_errors("mesh"):
        drawn = case.drawn
        check_names_written(drawn)  # the results have the names of the mesh
        _ = case.groups  # read now, because the results need the groups after a long run
    in_plane = cell_of(drawn) is TRIANGLE
    problem = case.base_problem
    if in_plane and isinstance(problem, MagneticScalarPotential):
        given = {key: value for key, value in vars(problem).items() if value}
        raise error_in_plane(keys_of_space(given), "the mesh is one of triangles")
    if case.bracket and in_plane:
        raise ValueError("bracket: for meshes of tetrahedra only, but the mesh is one of triangles. Remove the key.")
    mesh = turned_mesh(drawn, case.turn, case.pairs)
    if len(case.pins(mesh)) < len(case.pins(drawn)):
        raise ValueError("turn must not move groups of points; the mesh file has some in a turned subdomain.")
    with locate_errors("mesh"):
        connected_arrays(mesh)  # before the check of the problem, whose message would concern the potential
    _check_names(case, mesh)
    case.problem.check(corners_of(mesh))  # curved sides may invert elements, which `adapt` repairs
    if case.bracket and isinstance(case.problem, MagneticScalarPotential):
        with locate_errors("bracket"):
            case.problem.vector_potential.check(mesh)
    blank = _zero_field(case.problem, mesh)
    if case.goal is not None:
        if case.adapt.get("rtol") is not None:
            raise ValueError(
                "adapt.rtol is relative to the energy norm, which does not measure a goal; give goal_rtol, the allowed "
                "error of the goal as a fraction of its value, instead."
            )
        with locate_errors("goal"):
            case.goal.derivative(blank)
    for name, each in case.outputs.items():
        with locate_errors(f"outputs.{name}"):
            each(blank)
    with locate_errors("adapt"), suppress(_ChecksDone):
        adapt(mesh, _CheckOnly(case.problem), outputs=case.labelled_outputs, **case.options(mesh))
    return mesh


def _check_file(path: Path) -> None:
    if path.is_file() or (path / HEADER).is_file():
        return
    beside = [file.name for file in path.parent.iterdir()] if path.parent.is_dir() else []
    near = nearest_name(path.name, beside)
    raise ValueError(f"mesh must be the path of a mesh file, relative to the case; there is no file '{path}'.{near}")


def _check_names(case: Case, mesh: MeshTri) -> None:
    problem = case.problem
    points = getattr(problem, "points", None) or {}
    given = problem.potential or {}
    if not named_sets(mesh.boundaries) and given.keys() - points.keys():
        raise ValueError(
            "potential must name a boundary, but no boundary of the mesh file has a name: write "
            'rim = "outer" above all tables to name the whole rim, or give its lines a physical group.'
        )
    for value in given.values():
        if isinstance(value, TabulatedPotential):
            value.check(mesh)


def _zero_field(problem: Magnetostatics | MagneticScalarPotential, mesh: MeshTri) -> Field | SolidField:
    if isinstance(problem, MagneticScalarPotential):
        return problem.functional_on(mesh)[1]
    given = coefficients(mesh, problem.materials, problem.ampere_turns)
    symmetry = AXISYMMETRIC if problem.axisymmetric else PLANAR
    return Field(mesh, np.zeros(mesh.nvertices), given, symmetry, problem.depth)


class _ChecksDone(Exception):
    """Exception that ends `adapt` at its first solve, after all checks."""


class _CheckOnly:
    def __init__(self, problem: Magnetostatics | MagneticScalarPotential) -> None:
        self._problem = problem

    def __getattr__(self, name: str) -> Any:
        return getattr(self._problem, name)

    def aimed_at(self, output: object) -> "_CheckOnly":
        return self

    def solve(self, mesh: MeshTri, *, order: int | None = None) -> Any:
        raise _ChecksDone
