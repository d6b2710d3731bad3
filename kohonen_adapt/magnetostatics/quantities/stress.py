"""Maxwell's stress in the air around a body, weighted by a decreasing function."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.system import IN_SPACE, Solver
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.bodies import Cut, air_elements
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.mesh.measures import area, hat_gradients

__all__ = ["Component", "component_change", "component_value", "stress_force", "weight_at_nodes", "weight_gradient"]


class Component(NamedTuple):
    """Component ``-int arm . T slope`` of an eggshell force or torque."""

    slope: Floats  # (d, npoints) in 1/m: gradient of the weight
    arm: Floats  # (d, npoints): direction of a force, or axis x (x - centre) in m of a torque, in the plane (-y, x)


def stress_force(field: MagneticField, slope: Floats, b: Floats) -> Floats:
    # ``-T slope`` times the volume of every quadrature point, (d, npoints), with Maxwell's stress tensor T of air for b
    normal, pressure = np.sum(b * slope, axis=0), 0.5 * np.sum(b**2, axis=0)
    return -field.point_volumes / VACUUM_PERMEABILITY * (b * normal - pressure * slope)


def component_change(component: Component, b: Floats) -> Floats:
    """Return the derivative of ``-arm . T slope`` by B, shape (d, npoints).

    ``-((B . slope) arm + (B . arm) slope - (arm . slope) B) / mu0``.
    """
    slope, arm = component
    normal, along, both = (np.sum(first * second, axis=0) for first, second in ((b, slope), (b, arm), (arm, slope)))
    return -(normal * arm + along * slope - both * b) / VACUUM_PERMEABILITY


def component_value(field: MagneticField, component: Component, b: Floats) -> float:
    # Return ``-int arm . T slope``, half the derivative applied to B.
    return 0.5 * float(np.sum(field.point_volumes * component_change(component, b) * b))


# Three weights: one layer of elements around the body / the solution of Laplace's equation / this weight.
# Magnet over iron, meshes of Gmsh, 3623 nodes (`benchmarks force`; F_x = 106.0 N/m):
#     mean of F_x in N/m               114.0 / 108.7 / 107.2        scatter  2.4 / 0.32 / 0.10
#     the same meshes adapted          106.0 / 106.0 / 106.0        scatter  0.031 / 0.012 / 0.014
# Two magnets on a regular grid, 5265 nodes: error of the force 1.2 / 3.1 / 1.1 %, rate of convergence - / 1.5 / 2.


def weight_at_nodes(field: MagneticField, inside: Mask, cut: Cut) -> Floats:
    """Return the weight at the nodes, (nnodes,).

    The weight falls smoothly between the levels 3/4 and 1/4 of the P1 solution of Laplace's equation in the air, which
    is 1 on the body, and 0 on all other materials and on the outer boundary except the cut. The exact force is the same
    for any weight with these boundary values. This weight uses the field at a distance from the corners of body and
    neighbours, where B is most accurate, and in many elements. The force converges by the square of the element size,
    also on uniform meshes.
    """
    mesh, air = field.elements.corners, air_elements(field) & ~inside
    values, is_fixed = np.zeros(mesh.p.shape[1]), ~_free_nodes(mesh, air, cut)
    values[cut.master[mesh.t[:, inside]]] = 1.0
    is_fixed[cut.master[is_fixed]] = True
    level = np.clip(2.0 * _laplace(mesh, air, cut.master, values, is_fixed) - 0.5, 0.0, 1.0)
    return level**2 * (3.0 - 2.0 * level)


def weight_gradient(field: MagneticField, inside: Mask, weight: Floats) -> Floats:
    # in air, at quadrature points, (d, npoints) in 1/m
    in_air = (air_elements(field) & ~inside)[field.elements.element]
    return np.where(in_air, field.elements.slope_of_corners(weight), 0.0)


def _free_nodes(mesh: Mesh, air: Mask, cut: Cut) -> Mask:
    free = np.ones(mesh.p.shape[1], dtype=bool)
    free[mesh.t[:, ~air]] = False
    free[mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), cut.facets)]] = False
    return free


def _laplace(mesh: Mesh, air: Mask, master: Ints, values: Floats, is_fixed: Mask) -> Floats:
    hats, size = hat_gradients(mesh)[:, :, air], area(mesh)[air]
    corner = master[mesh.t[:, air]]
    products = np.einsum("cik,cjk,k->ijk", hats, hats, size)
    row, column = (np.broadcast_to(part, products.shape).ravel() for part in (corner[:, None], corner[None, :]))
    matrix = coo_array((products.ravel(), (row, column)), shape=(values.size, values.size)).tocsr()
    solution, unknown = values.copy(), np.unique(master[~is_fixed[master]])
    if unknown.size:
        solver = IN_SPACE if len(mesh.p) == 3 else Solver()
        solution[unknown] = solver.solve(matrix[unknown][:, unknown].tocsc(), -(matrix @ values)[unknown])
    return solution[master]
