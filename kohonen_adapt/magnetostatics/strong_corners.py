"""Corners at which a field is singular, and layers of elements there.

A field ``r^l s(angle)`` has the energy ``r^2l`` around its corner. With a small exponent l much of the energy is in the
elements at the corner. What these miss changes the field everywhere, although neither jumps nor averages of H show it.
"""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.singular_layers import FACTOR, RESOLVED, sizes_at, with_layers
from kohonen_adapt.magnetostatics.arguments import Arguments
from kohonen_adapt.magnetostatics.equations.conditions import conditions_of
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.mesh.corners import Materials, corner_exponents, fixed_parts
from kohonen_adapt.mesh.elements.exponents import STRONG

__all__ = ["layer_counts", "layered", "materials_of", "strong_corners"]

LEFT = 0.02  # fraction of the squared error at a corner after enough layers
ROOM = 10.0  # least size of elements in layers, as a multiple of `RESOLVED`


def strong_corners(problem: Arguments, field: Field) -> tuple[Ints, Floats]:
    nodes, exponent = corner_exponents(field.mesh, materials_of(problem, field))
    strong = exponent < STRONG
    return nodes[strong], exponent[strong]


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
        mesh, having = with_layers(mesh, nodes[counts == count], int(count), problem.pairs)
        total += having.size
    return mesh, total


def materials_of(problem: Arguments, field: Field) -> Materials:
    coefficients = field.coefficients
    conditions = conditions_of(field.elements, problem.boundaries, field.symmetry, anchored=True)
    flux = None if coefficients.varying_magnets else coefficients.flux
    values = coefficients.material_index[None] if flux is None else flux
    table = np.stack(
        [coefficients.reluctivity, np.where(coefficients.nonlinear, coefficients.material_index, -1), *values]
    )
    kind = np.unique(table, axis=1, return_inverse=True)[1].ravel()
    fixed = fixed_parts(field.elements.corners, conditions.fixed, field.order)
    return Materials(coefficients.reluctivity, kind, flux, *fixed)
