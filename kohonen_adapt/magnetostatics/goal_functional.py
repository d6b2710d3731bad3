"""State the functional of a field, with that of the dual solution where the mesh is for a goal."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.estimators import residual
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries
from kohonen_adapt.magnetostatics.equations.newton import Newton
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.residual_by_points import dual_residual_by_points, residual_by_points
from kohonen_adapt.magnetostatics.solution import Dual, at_points, functional_of, tangent_solution
from kohonen_adapt.problem.protocol import NotOffered
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["functional_for"]

SAME = 1e-9  # of the largest derivative, or of what adds up to the goal: as near are numbers that are the same


def functional_for(
    field: Field, goal: Goal | None, boundaries: Boundaries, materials: Mapping[str, Material], newton: Newton
) -> Ritz:
    """The functional of a field, with that of the dual one where there is a goal.

    Raises
    ------
    NotOffered
        If it is of another form; with a goal for nonlinear material, an axis, and a derivative that changes inside
        regions.
    """
    ritz = functional_of(field, boundaries, materials)
    if goal is None:
        return ritz
    if field.axisymmetric:
        raise NotOffered("around an axis a goal has no energy to lower")
    if field.coefficients.pieces:
        raise NotOffered("with nonlinear material a goal has no energy to lower")
    source, load = at_points(field, goal.derivative(field))
    dual = dual_functional(field, ritz, source, load)
    values = tangent_solution(field, boundaries, field.elements.loads(source, load), newton)
    one, other = estimates_of(field, Dual(values, source, load))
    share = other / one if one * other > 0.0 else 1.0
    return replace(ritz, dual=replace(dual, values=values), share=share, comparable=compares(field, goal, source, load))


def dual_functional(field: Field, ritz: Ritz, source: Floats, load: Floats) -> Ritz:
    """The functional of the dual solution, whose load is the derivative of the goal, (nelements,) and (2, npoints).

    The derivative must be constant in every region. Forces, torques and energies have another one in every element:
    with their flux as a function of the place, averaged at the nodes, lowering both functionals was tried on two
    magnets and the actuator of the tests, 441 and 1353 nodes, against the map alone. The bound of a force's error, the
    product of both estimates, was 2 to 9 % larger, that of an energy 0.8 to 1.4 times what it was; the sum of what
    elements add to the error, which the map's density makes small, was 3 to 70 % larger.
    """
    own = np.asarray(ritz.region)
    region = np.unique(np.stack([own, source]), axis=1, return_inverse=True)[1].ravel()
    there = region[field.elements.element]
    first, point = (np.unique(number, return_index=True)[1] for number in (region, there))
    if np.any(np.abs(load - load[:, point][:, there]) > SAME * np.abs(load).max()):
        raise NotOffered("a goal such as this one (a force, a torque, the energy of a part) has no energy to lower")
    robin = {name: (kappa, 0.0) for name, (kappa, _) in ritz.robin.items()}
    tables = np.asarray(ritz.coefficient)[own[first]], source[first], load[:, point]
    return Ritz(
        np.zeros(np.size(ritz.values)), ritz.fixed, *tables, region, order=ritz.order, robin=robin, signs=ritz.signs
    )


def estimates_of(field: Field, dual: Dual) -> tuple[float, float]:
    """Multiples of the errors of a field and its dual in the energy norm, of which the ratio counts."""
    if field.order > 1:
        found = [residual_by_points(field, None), dual_residual_by_points(field, dual, None)]
    else:
        own = field.unknown, field.coefficients.current_density, field.coefficients.flux
        found = [residual(field.mesh, u, field.reluctivity, source=f, flux=g) for u, f, g in (own, dual)]
    one, other = (float(np.linalg.norm(each)) for each in found)
    return one, other


def compares(field: Field, goal: Goal, source: Floats, load: Floats) -> bool:
    """Whether values of the functional on different meshes may be compared.

    On curved sides not: what parabolas leave out of curves changes it by as much as a goal gains in a pass.
    """
    return not field.elements.shape.curved.any() and is_linear(field, goal, source, load)


def is_linear(field: Field, goal: Goal, source: Floats, load: Floats) -> bool:
    """Whether a goal is what its derivative makes of the field itself, as of linear ones (Euler's theorem)."""
    parts = field.unknown * field.elements.loads(source, load)
    return bool(abs(parts.sum() - goal(field)) <= SAME * np.abs(parts).sum())
