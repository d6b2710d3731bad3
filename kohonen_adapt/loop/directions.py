"""Directions of elements in a pass, from the solution."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.mesh.shapes import density_and_shape, tensors_of_elements
from kohonen_adapt.problem.protocol import CheckedProblem
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.density import equidistributing
from kohonen_adapt.som.hessian_metric import gain_of_shapes, hessian_shapes, indicators_of_shapes, metric_of_shapes

# Error with directions over that with round elements, above which directions are left out, by dimension. In the plane
# layers, H and F have .13 to .9; a C-core, a motor and magnets have .91 to 1, and their meshes with directions are not
# better. Tetrahedra gain more than the model promises on coarse meshes: .87 for .95 on a cube.
WORTHWHILE = {TRIANGLE.dim: 0.9, TETRAHEDRON.dim: 1.0}


def wanted_of(
    problem: CheckedProblem, record: Pass, solution: Any, ritz: Ritz | None, anisotropic: bool | str
) -> tuple[Pass, ArrayLike]:
    """Return a pass with the indicators of elements of its shapes, and its density.

    The density has the shape (nelements,), or is tensors (nelements, d, d) where elements have directions.
    """
    mesh, order, norm = record.mesh, problem.order, problem.norm
    # With a goal the errors of two solutions are multiplied, which no sum of curvatures describes.
    has_goal = record.goal is not None or (ritz is not None and ritz.dual is not None)
    wants = anisotropic is True or (anisotropic == "auto" and not has_goal)
    shapes = None  # if the values at the nodes are not known
    if wants and problem.has("metric"):
        tensors = tensors_of_elements(
            problem.metric(mesh, solution), mesh.nelements, mesh.dim(), "metric of the problem"
        )
        shapes = density_and_shape(tensors)[1]
    elif wants and (functions := functions_of(problem, mesh, solution, ritz)):
        shapes = hessian_shapes(mesh, functions, order, norm)
    if shapes is None and anisotropic is True:
        raise ValueError(
            "anisotropic=True needs a method `metric` of the problem, or a solution that is an array of the values at "
            f"the unknowns; got {type(solution).__name__}. Give anisotropic='auto' or False instead."
        )
    if shapes is not None:
        indicators = indicators_of_shapes(mesh, record.indicators, shapes, order, norm)
        is_given = anisotropic is True or problem.has("metric")
        if is_given or gain_of_shapes(shapes, indicators, order, norm) < WORTHWHILE[mesh.dim()]:
            density = equidistributing(mesh, indicators, order, norm)
            return replace(record, indicators=indicators), metric_of_shapes(mesh, shapes, density)
    return record, equidistributing(mesh, record.indicators, order, norm)


def functions_of(problem: CheckedProblem, mesh: Mesh, solution: Any, ritz: Ritz | None) -> list[Floats]:
    # Values at the nodes of functions whose squared errors add up: the solution, or with a goal the terms of the
    # functional in `Ritz.dual`.
    n = mesh.nvertices
    if ritz is not None:
        own = np.asarray(ritz.values, float)[:n]
        if ritz.dual is None:
            return [own]
        weight = np.sqrt(ritz.share)
        return [weight * own, np.asarray(ritz.dual.values, float)[:n] / weight]
    values = getattr(solution, "potential", solution)
    if not isinstance(values, np.ndarray) or values.ndim != 1 or not np.isrealobj(values):
        return []
    if len(values) not in (n, count_unknowns(mesh, problem.order)):
        return []
    return [np.asarray(values[:n], float)]
