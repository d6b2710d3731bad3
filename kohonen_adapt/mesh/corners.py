"""Corners of boundaries and interfaces, and the exponents of solutions there."""

from typing import NamedTuple

import numpy as np
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask, grouped
from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.cells import determinants
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.elements.exponents import exponents
from kohonen_adapt.mesh.elements.unknowns import Unknowns
from kohonen_adapt.mesh.host import number_facets, numbered
from kohonen_adapt.mesh.measures import magnitude

__all__ = [
    "STRAIGHT",
    "Interfaces",
    "Joints",
    "Materials",
    "are_smooth",
    "corner_exponents",
    "fixed_parts",
    "interfaces_of",
    "joints_of",
    "meetings",
    "singular_nodes",
]

STRAIGHT = np.deg2rad(10.0)  # turn of an interface or boundary up to which a node is smooth; chords of arcs turn less
TURN = 0.5  # least exponent where a line turns
WHOLE = 0.01  # largest distance of an exponent of a polynomial from 1


class Materials(NamedTuple):
    coefficient: Floats  # (m,); with a law its value at zero
    kind: Ints  # (m,): number of the material, equal for equal constants
    flux: Floats | None  # (d, m); None if the flux varies within materials
    fixed: Mask  # (nnodes,): nodes with prescribed values
    prescribed: Mask  # (nfacets,): facets with prescribed values


def fixed_parts(mesh: Mesh, fixed: Mask, order: int) -> tuple[Mask, Mask]:
    number_facets(mesh)
    of_facets = Unknowns(mesh, order).on_facets()
    return fixed[: mesh.nvertices], fixed[of_facets].all(axis=0) & (mesh.f2t[1] < 0)


class Interfaces(NamedTuple):
    facets: Ints  # (f,): on the boundary, or between materials
    prescribed: Mask  # (f,): True on a boundary with prescribed values
    kind: Ints  # (f,): equal for the same materials on both sides and the same condition


def singular_nodes(mesh: MeshTri, materials: Materials) -> Ints:
    # Corners count with an exponent below 2 other than 1, or a jump of the flux. Pairs of boundaries are treated as
    # natural conditions.
    shape = Blended(mesh)
    lines = interfaces_of(shape.corners, materials)
    around = elements_around(shape, candidates(shape, lines))
    found = [node for node, (element, k) in around.items() if is_singular(shape, materials, element, k)]
    fixed = np.flatnonzero(materials.fixed)
    inside = np.setdiff1d(fixed, shape.corners.facets[:, shape.corners.f2t[1] < 0])
    points = inside if inside.size < fixed.size else inside[:0]
    return np.union1d(found, points).astype(np.int64)


def interfaces_of(mesh: Mesh, materials: Materials) -> Interfaces:
    number_facets(mesh)
    first, second = mesh.f2t
    left, right = materials.kind[first], np.where(second >= 0, materials.kind[second], -1)
    facets = np.flatnonzero(left != right)
    sides, prescribed = np.sort(np.stack([left, right]), axis=0)[:, facets], materials.prescribed[facets]
    kind = numbered(np.stack([*sides, prescribed]))
    return Interfaces(facets, prescribed, kind)


def candidates(shape: Blended, lines: Interfaces, turn: float = STRAIGHT) -> Ints:
    # Return the nodes at which lines meet, end, turn by more than an angle or change their kind.
    ends = shape.corners.facets[:, lines.facets]
    _, tangents = shape.facet_points(lines.facets, np.eye(2))
    direction = np.concatenate([tangents[:, 0, :, 0], -tangents[:, 0, :, 1]], axis=1)
    direction /= np.hypot(*direction)
    joints = joints_of(ends.ravel(), direction, np.tile(lines.kind, 2), shape.p.shape[1])
    return np.flatnonzero((joints.meeting > 0) & ~(joints.joined & (joints.turn <= turn)))


class Joints(NamedTuple):
    meeting: Ints  # (n,): number of parts that meet
    turn: Floats  # (n,): angle between two parts in radians, 0 in line
    low: Ints  # (n,): least and ...
    high: Ints  # (n,): ... largest kind of the parts

    @property
    def joined(self) -> Mask:
        # two parts of one kind
        return (self.meeting == 2) & (self.low == self.high)


def joints_of(place: Ints, direction: Floats, kind: Ints, count: int) -> Joints:
    # `place`, (n,) below `count`, is the node or edge at which each part ends, with unit vectors into the parts and
    # their kinds.
    meeting, total = meetings(place, direction, count)
    low, high = np.full(count, kind.max(initial=0) + 1), np.full(count, -1)
    np.minimum.at(low, place, kind)
    np.maximum.at(high, place, kind)
    return Joints(meeting, 2.0 * np.arcsin(np.minimum(0.5 * total, 1.0)), low, high)


def meetings(place: Ints, direction: Floats, count: int) -> tuple[Ints, Floats]:
    # Number of parts at every place, and length of the sum of their directions, 2 sin(turn / 2) for two parts.
    total = magnitude(np.array([np.bincount(place, part, count) for part in direction]))
    return np.bincount(place, minlength=count), total


def corner_exponents(
    mesh: MeshTri, materials: Materials, below: float = 1.0 - WHOLE, among: Mask | None = None
) -> tuple[Ints, Floats]:
    # Return the nodes with an exponent `below` a number, by default where the gradient is infinite, and the least
    # exponent of each. A mask `among` restricts the nodes.
    shape = Blended(mesh)
    # Where a line only turns, between two materials or on the boundary of one, exponents are 1/2 and more.
    turn = STRAIGHT if below > TURN else np.pi
    nodes = candidates(shape, interfaces_of(shape.corners, materials), turn)
    nodes = nodes if among is None else nodes[among[nodes]]
    around = elements_around(shape, nodes)
    found = {node: exponents_at(shape, materials, element, k) for node, (element, k) in around.items()}
    least = {node: each[0] for node, each in found.items() if each.size and each[0] < below}
    return np.array(list(least), np.int64), np.array(list(least.values()))


def elements_around(shape: Blended, nodes: Ints) -> dict[int, IntsPair]:
    # Return the elements at each node and its numbers in them.
    element, k = np.nonzero(np.isin(shape.t.T, nodes))
    node = shape.t[k, element]
    return {int(node[rows[0]]): (element[rows], k[rows]) for rows in grouped(node)}


def is_singular(shape: Blended, materials: Materials, element: Ints, k: Ints) -> bool:
    if np.ptp(materials.kind[element]) > 0 and jumps(materials, element):
        return True
    return not are_smooth(exponents_at(shape, materials, element, k))


def are_smooth(found: Floats) -> bool:
    return bool(np.all(np.abs(found - 1.0) <= WHOLE))


def exponents_at(shape: Blended, materials: Materials, element: Ints, k: Ints) -> Floats:
    # Return the exponents at the corners `k` of elements, which are one node.
    ends = np.array([AFTER, BEFORE])[:, k]  # (2, n): corners at the ends of both sides at the node
    sides = shape.p[:, shape.t[ends, element]] - shape.p[:, shape.t[k, element]][:, None]
    facet = shape.corners.t2f[AFTER][ends[::-1], element]
    clockwise = determinants(sides.swapaxes(0, 1)) < 0.0
    sides, facet = np.where(clockwise, sides[:, ::-1], sides), np.where(clockwise, facet[::-1], facet)
    begin, end = np.arctan2(sides[1], sides[0])
    angle, order = np.mod(end - begin, 2.0 * np.pi), np.argsort(begin)
    prescribed = None
    if np.any(shape.corners.f2t[1, facet] < 0):  # from the boundary on, counter-clockwise
        gap = np.mod(np.roll(begin[order], -1) - (begin + angle)[order], 2.0 * np.pi)
        order = np.roll(order, -1 - int(np.argmax(np.where(gap > 2.0 * np.pi - 1e-9, 0.0, gap))))
        first, last = materials.prescribed[facet[[0, 1], order[[0, -1]]]]
        prescribed = bool(first), bool(last)
    return exponents(angle[order], materials.coefficient[element[order]], prescribed)


def jumps(materials: Materials, element: Ints) -> bool:
    return materials.flux is None or bool(np.ptp(materials.flux[:, element], axis=1).any())
