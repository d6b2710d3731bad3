"""Bodies in air, and Maxwell's stress around them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.curves import Arc
from kohonen_adapt.magnetostatics.equations.system import IN_SPACE, Solver
from kohonen_adapt.magnetostatics.materials.coefficients import subdomains_at
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.mesh.measures import area, hat_gradients
from kohonen_adapt.mesh.names import named, named_sets

__all__ = [
    "Component",
    "Cut",
    "Names",
    "air_elements",
    "bores",
    "component_change",
    "component_value",
    "elements_in",
    "isolated_body",
    "mirror_cut",
    "outer_facets",
    "sector_cut",
    "stress_force",
    "weight_at_nodes",
    "weight_gradient",
]

AIR_TOLERANCE = 1e-6  # of the relative permeability; real air has 1.0000004
NEAR = 1e-9  # tolerance of lengths, relative to the size of the mesh
BORE_FACETS = (2, 4, 10)  # number of facets of a bore taken as an arc: minimum, maximum, and maximum of a circle
ROUND = 1e-3  # allowed difference of the radii of the ends of a facet on a circle, relative to its length

Names = str | Sequence[str]


def elements_in(mesh: Mesh, names: Names) -> Mask:
    inside = np.zeros(mesh.t.shape[1], dtype=bool)
    for name in _name_list(names):
        inside[named(mesh.subdomains, name, "subdomain")] = True
    if not inside.any():
        raise ValueError(f"subdomain {_joined_names(names)} has no elements; name one that has.")
    return inside


def air_elements(field: MagneticField) -> Mask:
    coefficients = field.coefficients
    plain = np.abs(coefficients.reluctivity * VACUUM_PERMEABILITY - 1.0) < AIR_TOLERANCE
    return plain & ~coefficients.nonlinear & (field.current_in_shells == 0.0) & ~field.remanence.any(axis=0)


def isolated_body(field: MagneticField, names: Names) -> Mask:
    mesh, inside = field.elements.corners, elements_in(field.mesh, names)
    in_body = np.zeros(mesh.p.shape[1], dtype=bool)
    in_body[mesh.t[:, inside]] = True
    around = in_body[mesh.t].any(axis=0) & ~inside
    if not around.any():
        raise ValueError(
            f"subdomain {_joined_names(names)} has no other elements around it; a force requires air around the body."
        )
    solid = np.flatnonzero(around & ~air_elements(field))
    current = field.current_in_shells
    if solid.size and len(mesh.p) == 3 and current[solid].any():
        driven = solid[current[solid] != 0.0][:1]
        raise ValueError(
            f"subdomain {_joined_names(names)} touches {subdomains_at(mesh, driven)} where the current of the "
            "applied_field runs, and the force is computed from the field in air without current: give the coil in "
            "coils, or mesh the coil as a volume of air of its own, with air between it and the body."
        )
    if solid.size:
        raise ValueError(
            f"subdomain {_joined_names(names)} touches {subdomains_at(mesh, solid[:1])}, which is not air "
            "(permeability 1, no current, no remanence), and the force is computed from the field in the air around: "
            "leave air between them, or compute the force on both together."
        )
    return inside


def _name_list(names: Names) -> list[str]:
    listed = [names] if isinstance(names, str) else list(names) if isinstance(names, Sequence) else []
    if not listed or not all(isinstance(name, str) for name in listed):
        raise ValueError(f"a body is the name of a subdomain or a sequence of names; got {names!r}.")
    return listed


def _joined_names(names: Names) -> str:
    return " + ".join(repr(name) for name in _name_list(names))


class Cut(NamedTuple):
    facets: Ints  # along the cut, of the body and its neighbours
    direction: Floats | None  # unit vector (2,) of a mirror plane; None for a sector and without a cut
    master: Ints  # (nnodes,): node of which a node is the image, or the node itself


def mirror_cut(mesh: MeshTri, inside: Mask) -> Cut:
    body_facets, master = outer_facets(mesh, inside), np.arange(mesh.p.shape[1])
    if not body_facets.size:
        return Cut(body_facets, None, master)
    edge = _edges(mesh, body_facets)
    direction = edge[:, np.argmax(np.hypot(*edge))] / np.hypot(*edge).max()
    tolerance = NEAR * np.ptp(mesh.p, axis=1).max()
    if np.any(np.abs(_cross(direction, edge)) > tolerance):
        raise ValueError(
            "the body lies on the outer boundary along lines of several directions; the force on a part of it can only "
            "be computed if a mirror plane cuts it. Extend the mesh beyond the boundary."
        )
    outer = mesh.boundary_facets()
    height = _cross(direction, mesh.p)[mesh.facets[:, outer]]
    level = np.unique(_cross(direction, mesh.p)[mesh.facets[0, body_facets]])
    along = np.any(np.all(np.abs(height[:, :, None] - level) < tolerance, axis=0), axis=1)
    return Cut(outer[along], direction, master)


def sector_cut(mesh: MeshTri, inside: Mask, centre: Floats) -> Cut:
    """Return the two sides of a periodic sector that cut the body.

    The body may end on circles about the centre, because a constant A makes no torque there.

    Raises
    ------
    ValueError
        If the body lies on other parts of the outer boundary, or the nodes of the sides have different radii.
    """
    body_facets, master = outer_facets(mesh, inside), np.arange(mesh.p.shape[1])
    radial, tolerance = mesh.p - centre[:, None], NEAR * np.ptp(mesh.p, axis=1).max()
    radius = np.hypot(*radial)[mesh.facets[:, body_facets]]
    body_facets = body_facets[np.abs(radius[0] - radius[1]) > ROUND * np.hypot(*_edges(mesh, body_facets))]
    if not body_facets.size:
        return Cut(body_facets, None, master)
    outer = mesh.boundary_facets()
    rays = _rays(radial[:, mesh.facets[:, body_facets]].mean(axis=1))
    sides = [outer[np.all(_on_ray(ray, radial[:, mesh.facets[:, outer]], tolerance), axis=0)] for ray in rays]
    if len(sides) != 2 or not np.isin(body_facets, np.concatenate(sides)).all():
        raise ValueError(
            "the body lies on the outer boundary elsewhere than on circles about the centre and on two straight sides "
            "through it; the torque on a part of a body can only be computed for a periodic sector. Extend the mesh."
            + _arc_remedy(mesh, body_facets, centre)
        )
    first_side, second_side = (_by_radius(mesh.facets[:, side], radial) for side in sides)
    if first_side.size != second_side.size or np.any(
        np.abs(np.hypot(*radial[:, first_side]) - np.hypot(*radial[:, second_side])) > 1e3 * tolerance
    ):
        raise ValueError(
            "the two sides through the centre that cut the body have no nodes at the same radii; the torque on a part "
            "of it can only be computed for a periodic sector, with sides that are images of each other."
        )
    master[second_side] = first_side
    return Cut(np.concatenate(sides), None, master)


def bores(mesh: MeshTri, names: Names, centre: ArrayLike) -> dict[str, Arc]:
    """Return the boundaries that are arcs because a body that turns ends there.

    Only boundaries with too few nodes to be recognised as arcs are returned.
    """
    middle_point, found = np.asarray(centre, dtype=float), {}
    outer = outer_facets(mesh, elements_in(mesh, names))
    radius = np.hypot(*(mesh.p - middle_point[:, None]))
    for name, rows in named_sets(mesh.boundaries).items():
        facets, nodes = np.unique(rows), np.unique(mesh.facets[:, rows])
        is_coarse = BORE_FACETS[0] <= len(facets) <= BORE_FACETS[1 + (len(nodes) == len(facets))]
        if is_coarse and np.isin(facets, outer).all() and np.ptp(radius[nodes]) <= NEAR * radius.max():
            found[name] = Arc((float(middle_point[0]), float(middle_point[1])), float(radius[nodes].mean()))
    return found


def _arc_remedy(mesh: MeshTri, facets: Ints, centre: Floats) -> str:
    found, radius = [], np.hypot(*(mesh.p - centre[:, None]))
    for name, rows in sorted(named_sets(mesh.boundaries).items()):
        node_radius = radius[np.unique(mesh.facets[:, rows])]
        on_circle = node_radius > (1.0 - NEAR) * node_radius.max(initial=0.0)
        # Four nodes on a circle may be the corners of a rectangle.
        if np.isin(rows, facets).any() and on_circle.sum() > 4 and node_radius.min() > 0.5 * node_radius.max():
            at = ", ".join(f"{coordinate:.9g}" for coordinate in centre)
            found.append(f'"{name}": ka.Arc(({at}), {node_radius.max():.9g})')
    if not found:
        return ""
    return f" If nodes have left an arc with too few nodes to be recognised, adapt with curves={{{', '.join(found)}}}."


def outer_facets(mesh: Mesh, inside: Mask) -> Ints:
    outer = mesh.boundary_facets()
    return outer[inside[mesh.f2t[0, outer]]]


def _edges(mesh: MeshTri, facets: Ints) -> Floats:
    start, end = mesh.p[:, mesh.facets[:, facets]].swapaxes(0, 1)
    return end - start


def _cross(direction: Floats, x: Floats) -> Floats:
    return direction[0] * x[1] - direction[1] * x[0]


def _rays(x: Floats) -> list[Floats]:
    units = x / np.hypot(*x)
    rays: list[Floats] = []
    for unit in units.T:
        if all(np.hypot(*(unit - ray)) > 1e-6 for ray in rays):
            rays.append(unit)
            if len(rays) > 2:
                break
    return rays


def _on_ray(ray: Floats, x: Floats, tolerance: float) -> Mask:
    return (np.abs(_cross(ray, x)) < tolerance) & (np.tensordot(ray, x, 1) > -tolerance)


def _by_radius(facets: Ints, radial: Floats) -> Ints:
    nodes = np.unique(facets)
    return nodes[np.argsort(np.hypot(*radial[:, nodes]))]


class Component(NamedTuple):
    """Component ``-int arm . T slope`` of an eggshell force or torque."""

    slope: Floats  # (d, npoints) in 1/m: gradient of the weight
    arm: Floats  # (d, npoints): direction of a force, or axis x (x - centre) in m of a torque, in the plane (-y, x)


def stress_force(volumes: Floats, slope: Floats, b: Floats) -> Floats:
    # ``-T slope`` times the volume of every point, (d, npoints), with Maxwell's stress tensor T of air for b
    normal, pressure = np.sum(b * slope, axis=0), 0.5 * np.sum(b**2, axis=0)
    return -volumes / VACUUM_PERMEABILITY * (b * normal - pressure * slope)


def component_change(component: Component, b: Floats) -> Floats:
    """Return the derivative of ``-arm . T slope`` by B, shape (d, npoints).

    ``-((B . slope) arm + (B . arm) slope - (arm . slope) B) / mu0``.
    """
    slope, arm = component
    normal, along, both = (np.sum(first * second, axis=0) for first, second in ((b, slope), (b, arm), (arm, slope)))
    return -(normal * arm + along * slope - both * b) / VACUUM_PERMEABILITY


def component_value(volumes: Floats, component: Component, b: Floats) -> float:
    # Return ``-int arm . T slope``, half the derivative applied to B.
    return 0.5 * float(np.sum(volumes * component_change(component, b) * b))


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
