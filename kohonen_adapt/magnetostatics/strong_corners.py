"""Corners at which a field is singular, with errors and layers of elements.

A field ``r^l s(angle)`` has the energy ``r^2l`` around its corner. With a small exponent l much of the energy is in the
elements at the corner. What these miss changes the field everywhere, although neither jumps nor averages of H show it.
"""

from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.singular_layers import FACTOR, RESOLVED, sizes_at, with_layers_at
from kohonen_adapt.magnetostatics.arguments import Arguments
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.solution import unknown_of
from kohonen_adapt.mesh.cells import width_of
from kohonen_adapt.mesh.corners import Materials, corner_exponents
from kohonen_adapt.mesh.elements.exponents import STRONG
from kohonen_adapt.problem.singular_nodes import materials_with

__all__ = ["layer_counts", "layered", "materials_of", "strong_corners", "with_strong_corners"]

LEFT = 0.02  # fraction of the squared error at a corner after enough layers
ROOM = 10.0  # least size of elements in layers, as a multiple of `RESOLVED`


def strong_corners(problem: Arguments, field: Field) -> tuple[Ints, Floats]:
    return corner_exponents(field.mesh, materials_of(problem, field), STRONG)


def layer_counts(mesh: MeshTri, nodes: Ints, exponent: Floats) -> Ints:
    # Return the number of layers at each node that leave the fraction `LEFT` of the squared error there.
    # The numbers are less where coordinates do not resolve the elements, down to 0.
    enough = np.ceil(np.log(LEFT) / (2.0 * exponent * np.log(FACTOR)))
    smallest = ROOM * RESOLVED * np.hypot(*mesh.p[:, nodes]) / sizes_at(mesh)[nodes]
    most = np.log(np.maximum(smallest, np.finfo(float).tiny)) / np.log(FACTOR)
    return np.floor(np.clip(most, 0.0, enough)).astype(np.int64)


def layered(problem: Arguments, mesh: MeshTri, nodes: Ints, counts: Ints) -> tuple[MeshTri, int]:
    total = 0
    for count in np.unique(counts[counts > 0]):
        mesh, having = with_layers_at(mesh, nodes[counts == count], int(count), problem.pairs)
        total += having.size
    return mesh, total


def materials_of(problem: Any, field: Field | SolidField) -> Materials:
    coefficients, in_space = field.coefficients, isinstance(field, SolidField)
    coefficient = 1.0 / coefficients.reluctivity if in_space else coefficients.reluctivity
    flux, kind = coefficients.remanence if in_space else coefficients.flux, coefficients.material_index
    law = np.where(coefficients.nonlinear, kind, -1)
    # A magnet that varies has no jump at its elements, and in the plane no constant.
    constant, fixed = None if coefficients.varying_magnets else flux, problem.conditions_of(field).fixed
    found = materials_with(field.elements.corners, coefficient, law, kind, constant, fixed, field.order)
    return found._replace(flux=flux) if in_space else found


def with_strong_corners(problem: Arguments, field: Field, indicators: Floats) -> Floats:
    nodes, exponent = strong_corners(problem, field)
    if not nodes.size:
        return indicators
    squared = squared_error(problem, field, nodes, exponent)
    at = np.isin(field.mesh.t, nodes).any(axis=0)
    own, others = np.sum(indicators[at] ** 2), np.sum(indicators[~at] ** 2)
    if squared <= own + others:
        return indicators
    share = indicators[at] ** 2 / own if own > 0.0 else 1.0 / at.sum()
    result = indicators.copy()
    result[at] = np.sqrt((squared - others) * share)
    return result


def squared_error(problem: Arguments, field: Field, nodes: Ints, exponent: Floats) -> float:
    # The functional falls by half of the squared error from the field to the solution of one order more on layers. The
    # squared error at a corner falls like ``factor^(2 l layers)``, so that the fall by layers determines the rest. At a
    # corner with elements too small for layers, the whole field is assumed to be ``r^l s(angle)``: elements of relative
    # size h with u = 0 in place of the field increase the energy by the factor ``2 h^2l / (1 - h^2l)``.
    mesh, order = field.mesh, field.order + 1
    counts, here = layer_counts(mesh, nodes, exponent), problem.energy_on(mesh, field.order)

    def level_on(mesh: MeshTri) -> float:
        energy = problem.energy_on(mesh, order)
        return energy.value(unknown_of(problem, energy, field)[0])[0]

    level = level_on(layered(problem, mesh, nodes, counts)[0])
    squared = 2.0 * (here.value(field.unknown)[0] - level)
    left = np.max(FACTOR ** (2.0 * exponent * counts), where=counts > 0, initial=0.0)
    if left > LEFT:
        squared += 2.0 * left / (1.0 - left) * (level_on(mesh) - level)
    if np.any(counts == 0):
        sizes = sizes_at(mesh)[nodes] / width_of(mesh)
        part = np.max(sizes ** (2.0 * exponent), where=counts == 0, initial=0.0)
        density = here.vector(field.unknown)
        squared += 2.0 * part / (1.0 - part) * here.products(field.unknown, density, density).sum()
    return float(squared)
