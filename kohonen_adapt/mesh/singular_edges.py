"""Edges of tetrahedra along which a solution is singular, and their corners.

Across an edge a solution is that of a problem in the plane, whose sectors lie between the facets around the edge that
are on the boundary or between materials. `corners` has the same for nodes of triangles.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask
from kohonen_adapt.mesh.cells import centroids_of, crossed, normals
from kohonen_adapt.mesh.corners import Joints, Materials, are_smooth, interfaces_of, joints_of, meetings
from kohonen_adapt.mesh.curved import corners_of, offsets_of_sides
from kohonen_adapt.mesh.elements.exponents import exponents
from kohonen_adapt.mesh.host import edges_between
from kohonen_adapt.mesh.measures import unit_vectors
from kohonen_adapt.mesh.names import connected_components_of

__all__ = ["SHARP", "singular_edges"]

SHARP = np.deg2rad(35.0)  # turn from which a surface of facets has an edge, and a line a corner; round ones turn less
RIGHT = 0.5 * np.pi
STEPS = 360  # of a right angle: angles are whole numbers of steps, and exponents are then right to 0.2 %
UNIT, NOTHING = 1e-4, 4.0  # fluxes are whole numbers of units, relative to the largest; sum of rounding errors in units


class Surface(NamedTuple):
    # Facets on the boundary and between materials, each with three edges.
    mesh: MeshTet  # without curved edges
    facets: Ints  # (f,)
    prescribed: Mask  # (f,)
    edge: Ints  # (3, f)
    along: Floats  # (3, nedges): unit vectors along all edges of the mesh
    direction: Floats  # (3, 3, f): unit vectors across the edges, from their middles into the facets


def singular_edges(mesh: MeshTet, materials: Materials) -> IntsPair:
    # Return the edges, (2, k), and the corners, (n,). As in the plane edges count with an exponent below 2 other than
    # 1, or with a flux that makes the gradient infinite, and with them the whole line.
    surface, joints = surface_of(mesh, materials)
    edge, level = surface.edge, (joints.meeting == 2) & (joints.turn < SHARP)
    smooth = level & joints.joined
    # A natural facet in the angle of two boundaries with prescribed values may have no free node.
    in_angle = (level != joints.joined)[edge].all(axis=0) & (level[edge].sum(axis=0) == 1)
    by_chance = surface.prescribed & in_angle
    smooth[edge[:, by_chance]] |= level[edge[:, by_chance]]
    surface = surface._replace(prescribed=surface.prescribed & ~by_chance)
    turn, ends = np.zeros(surface.mesh.nvertices), surface.mesh.edges
    np.maximum.at(turn, ends, np.tile(np.where(smooth, joints.turn, 0.0), (2, 1)))
    edges, around = facets_around(surface, materials, ~smooth, turn)
    singular = np.array([is_singular(tuple(map(tuple, facets.tolist()))) for facets in around], bool)
    line = lines_of(surface, edges)
    found = edges[np.isin(line, line[singular])]
    return ends[:, found].astype(np.int64), corners_between(surface, found)


def surface_of(mesh: MeshTet, materials: Materials) -> tuple[Surface, Joints]:
    offset, mesh = offsets_of_sides(mesh), corners_of(mesh)
    facets, prescribed, kind = interfaces_of(mesh, materials)
    start, end = mesh.p[:, mesh.edges].swapaxes(0, 1)
    along, nodes, before = unit_vectors(end - start), mesh.facets[:, facets], [2, 0, 1]
    edge = edges_between(mesh, nodes, nodes[before])
    # derivative of the map of a facet towards the corner opposite to an edge, at the middle of the edge
    middle = 0.5 * (mesh.p[:, nodes] + mesh.p[:, nodes[before]]) + 4.0 * offset[:, edge]
    inward = mesh.p[:, nodes[[1, 2, 0]]] - middle + 2.0 * offset[:, edge].sum(axis=1, keepdims=True)
    direction = unit_vectors(inward - along[:, edge] * np.sum(along[:, edge] * inward, axis=0))
    joints = joints_of(edge.ravel(), direction.reshape(3, -1), np.tile(kind, 3), along.shape[1])
    return Surface(mesh, facets, prescribed, edge, along, direction), joints


def facets_around(surface: Surface, materials: Materials, chosen: Mask, turn: Floats) -> tuple[Ints, list[Floats]]:
    # Return edges, (k,), and the facets around each, (5, n), counter-clockwise: angle in steps, whether values
    # are prescribed, and of the element ahead the coefficient, -1 outside, and the flux along and across the axis. The
    # axis is the last facet, with nothing ahead, or all round the first.
    mesh, (side, facet) = surface.mesh, np.nonzero(chosen[surface.edge])
    edge, elements = surface.edge[side, facet], mesh.f2t[:, surface.facets[facet]]
    inside = centroids_of(mesh, elements[0]) - mesh.p[:, mesh.edges[0, edge]]
    across = crossed(surface.along[:, edge], surface.direction[:, side, facet])
    ahead = np.where(np.sum(across * inside, axis=0) > 0.0, *elements)
    order = np.lexsort((facet, ahead >= 0, edge))
    side, facet, ahead = side[order], facet[order], ahead[order]
    edges, first, row = np.unique(edge[order], return_index=True, return_inverse=True)
    direction = surface.direction[:, side, facet]
    axes = direction[:, first[row]], across[:, order[first[row]]]
    x, y = (np.sum(axis * direction, axis=0) for axis in axes)
    # Facets of a round surface are off its tangents by less than they turn. Where all angles could be right ones, as
    # beside a plane of symmetry, they are.
    angle, doubt = np.arctan2(y, x) / RIGHT, turn[mesh.facets[:, surface.facets[facet]]].max(axis=0) / RIGHT
    off = np.abs(angle - np.round(angle)) > np.maximum(doubt, doubt[first[row]])
    angle = np.where(np.bincount(row, off)[row] > 0.0, angle, np.round(angle))
    steps, flux = np.round(angle * STEPS) % (4 * STEPS), np.asarray(materials.flux)
    steps = np.where((steps == 0.0) & (ahead < 0), 4 * STEPS, steps)
    unit = UNIT * (np.abs(flux).max() or 1.0)
    columns = [steps, surface.prescribed[facet], np.where(ahead < 0, -1.0, materials.coefficient[ahead])]
    columns += [np.round(np.sum(axis * flux[:, ahead], axis=0) / unit) for axis in axes]
    return edges, np.split(np.stack(columns)[:, np.lexsort((steps, row))], first, axis=1)[1:]


@lru_cache(10_000)
def is_singular(facets: tuple[tuple[float, ...], ...]) -> bool:
    # with the facets around an edge
    steps, prescribed, coefficient, *flux = np.append(facets, [[4 * STEPS], [-1], [-1], [0], [0]], axis=1)
    last = int(np.argmin(coefficient))
    bound, closed = steps[: last + 1] * RIGHT / STEPS, prescribed[last] < 0.0
    conditions = None if closed else (bool(prescribed[0]), bool(prescribed[last]))
    found = exponents(np.maximum(np.diff(bound), RIGHT / STEPS), coefficient[:last], conditions)
    # Functions with the exponent 1, cosine or sine, must have no part in the flux out of the sectors.
    x, y = np.cos(bound), np.sin(bound)
    out = np.sum(np.diff([[-x * y, x * x], [-y * y, x * y]]) * np.stack(flux)[:, :last], axis=(1, 2))
    resonant = np.abs(out if closed else out[int(prescribed[last])]).max() > NOTHING
    return bool(found.size and resonant) or not are_smooth(found)


def meetings_of(surface: Surface, edges: Ints) -> tuple[Ints, Floats, Ints, Mask]:
    # Return the nodes at the ends of edges, (2 k,), and the directions from there, (3, 2 k), of every node the number
    # of edges, and whether two edges are in line.
    ends = surface.mesh.edges[:, edges].ravel()
    direction = np.concatenate([surface.along[:, edges], -surface.along[:, edges]], axis=1)
    meeting, total = meetings(ends, direction, surface.mesh.nvertices)
    return ends, direction, meeting, (meeting == 2) & (total < 2.0 * np.sin(0.5 * SHARP))


def lines_of(surface: Surface, edges: Ints) -> Ints:
    ends, _, _, straight = meetings_of(surface, edges)
    order = np.argsort(ends, kind="stable")
    pairs = order[straight[ends[order]]].reshape(-1, 2) % max(edges.size, 1)
    return connected_components_of(edges.size, pairs)


def corners_between(surface: Surface, edges: Ints) -> Ints:
    # Nodes at which edges meet at an angle, or end. The mirror image of an edge across a plane boundary continues the
    # edge, which does not end there.
    mesh, (ends, direction, meeting, straight) = surface.mesh, meetings_of(surface, edges)
    edge_at = np.zeros((3, mesh.nvertices))
    edge_at[:, ends] = direction
    nodes, outer = mesh.facets[:, surface.facets], mesh.f2t[1, surface.facets] < 0
    normal = unit_vectors(normals(mesh.p.T, nodes.T).T)[:, None]
    cosine, largest = np.abs(np.sum(normal * edge_at[:, nodes], axis=0)), 0.5 * SHARP
    mirror = np.select([cosine < np.sin(largest), outer & (cosine > np.cos(largest))], [0.0, 1.0], -np.inf)
    mirrored = (meeting == 1) & (np.bincount(nodes.ravel(), mirror.ravel(), mesh.nvertices) > 0.0)
    return np.flatnonzero((meeting > 0) & ~mirrored & ~straight)
