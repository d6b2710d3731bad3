"""Errors of the energy at strong corners, for the indicators."""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.singular_layers import FACTOR, sizes_at
from kohonen_adapt.magnetostatics.arguments import Arguments
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.solution import unknown_of
from kohonen_adapt.magnetostatics.strong_corners import LEFT, layer_counts, layered, strong_corners

__all__ = ["with_strong_corners"]


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
        sizes = sizes_at(mesh)[nodes] / np.ptp(mesh.p, axis=1).max()
        part = np.max(sizes ** (2.0 * exponent), where=counts == 0, initial=0.0)
        density = here.vector(field.unknown)
        squared += 2.0 * part / (1.0 - part) * here.products(field.unknown, density, density).sum()
    return float(squared)
