"""Chains: the pieces of outline that nodes slide on, and what nodes on them may do.

A node on a chain is moved in its parameter, and its position is looked up, so it cannot drift. The parameter is arc
length on straight chains and on arcs of circles; along a table it is what the table was made with.
"""

import math
from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel, kernel

FREE, SLIDING, HELD = 0, 1, 2  # what a node may do: move in the plane, along its chain, not at all
STRAIGHT, ROUND, TABLED = 0, 1, 2  # shapes of chains
JUNCTION = -2  # in place of a chain: the node is held where three of them meet
BISECTIONS = 45  # to the nearest point between two knots: that many bits


# Columns of the tables of chains. One table in place of an array for each halves what numba has to compile: every
# array handed to a kernel costs it as much as some lines of code.
LENGTH, CURVATURE, REACH, MERGED, BULGE = 4, 5, 6, 7, 8  # of `place`
SHAPE, CLOSED, PAIRED = 0, 1, 2  # of `flags`


class Chains(NamedTuple):
    """Where positions on every chain are looked up; a chain begins at its origin, in the direction given.

    Kernels see the tables, everybody else their columns by name.
    """

    place: np.ndarray  # (c, 9): origin, direction, length, curvature, reach, merged, bulge
    flags: np.ndarray  # (c, 3) int8: shape, closed, paired
    row: np.ndarray  # (c + 1,) int32: knots of chain c stand in rows row[c] to row[c + 1]
    knot: np.ndarray  # (k, 5) of TABLED ones: parameter, position, and its derivative by the parameter

    @property
    def shape(self) -> np.ndarray:
        """STRAIGHT, ROUND or TABLED, (c,)."""
        return self.flags[:, SHAPE]

    @property
    def origin(self) -> np.ndarray:
        """Where the parameter is 0, (c, 2)."""
        return self.place[:, 0:2]

    @property
    def direction(self) -> np.ndarray:
        """Unit vectors: the tangent at the origin, (c, 2)."""
        return self.place[:, 2:4]

    @property
    def length(self) -> np.ndarray:
        """The parameter goes from 0 to here, (c,)."""
        return self.place[:, LENGTH]

    @property
    def curvature(self) -> np.ndarray:
        """Of ROUND ones 1 / radius, positive if they run counter-clockwise, (c,)."""
        return self.place[:, CURVATURE]

    @property
    def closed(self) -> np.ndarray:
        """Whether it is a loop without a corner, on which the parameter begins anew at its end, (c,)."""
        return self.flags[:, CLOSED].view(np.bool_)

    @property
    def reach(self) -> np.ndarray:
        """The longest facet that may be made: longer ones would leave too much of a curve out, (c,)."""
        return self.place[:, REACH]

    @property
    def merged(self) -> np.ndarray:
        """The same of two facets that are to be one, (c,)."""
        return self.place[:, MERGED]

    @property
    def bulge(self) -> np.ndarray:
        """How far a curve may be from its facets, (c,)."""
        return self.place[:, BULGE]

    @property
    def paired(self) -> np.ndarray:
        """Whether its nodes have partners on another chain, at the same parameters, (c,)."""
        return self.flags[:, PAIRED].view(np.bool_)


class Twins(NamedTuple):
    """Nodes that are one because a boundary is another's periodic image, and how the mesh goes on there."""

    partner: np.ndarray  # (n,) int32: the other node, -1 for none
    motion: np.ndarray  # (n,) int32: the motion that carries the node to its partner, -1 likewise
    motions: np.ndarray  # (k, 2, 3): x -> A x + b as rows [A | b]
    region: np.ndarray  # (k, r) int32: the region in which a region goes on where a motion carries it, -1 for none


class Constraints(NamedTuple):
    """Where each node may go."""

    kind: np.ndarray  # (n,) int8: FREE, SLIDING or HELD
    chain: np.ndarray  # (n, 2) int32: its chain, or the two that meet in a corner; -1 for none, or JUNCTION
    parameter: np.ndarray  # (n,) where on its chain
    inner: np.ndarray  # (n,) bool: inside one region, so that every neighbour belongs to it
    chains: Chains
    twins: Twins


@inner_kernel
def point_at(chains, c, parameter):
    """The position that belongs to a parameter."""
    x, y = chains.place[c, 0], chains.place[c, 1]
    tx, ty = chains.place[c, 2], chains.place[c, 3]
    if chains.flags[c, SHAPE] == STRAIGHT:
        return x + parameter * tx, y + parameter * ty
    if chains.flags[c, SHAPE] == ROUND:
        # from the origin along a chord: exact however large the radius
        half = 0.5 * chains.place[c, CURVATURE] * parameter
        sine, cosine = math.sin(half), math.cos(half)
        chord = 2.0 * sine / chains.place[c, CURVATURE]
        return x + chord * (cosine * tx - sine * ty), y + chord * (sine * tx + cosine * ty)
    k = knot_before(chains, c, parameter)
    x, y, _, _ = on_span(chains.knot, k, span_share(chains.knot, k, parameter))
    return x, y


@inner_kernel
def tangent_at(chains, c, parameter):
    """The unit vector along the chain at a parameter."""
    tx, ty = chains.place[c, 2], chains.place[c, 3]
    if chains.flags[c, SHAPE] == ROUND:
        angle = chains.place[c, CURVATURE] * parameter
        sine, cosine = math.sin(angle), math.cos(angle)
        return cosine * tx - sine * ty, sine * tx + cosine * ty
    if chains.flags[c, SHAPE] == TABLED:
        k = knot_before(chains, c, parameter)
        _, _, tx, ty = on_span(chains.knot, k, span_share(chains.knot, k, parameter))
        length = math.hypot(tx, ty)
        return tx / length, ty / length
    return tx, ty


@inner_kernel
def nearest_parameter(chains, c, x, y, near):
    """The parameter of the point of chain c that nearest to (x, y); on a table from the parameter near on."""
    if chains.flags[c, SHAPE] == TABLED:
        return nearest_on_table(chains, c, x, y, near)
    ux, uy = x - chains.place[c, 0], y - chains.place[c, 1]
    tx, ty, length = chains.place[c, 2], chains.place[c, 3], chains.place[c, LENGTH]
    along = ux * tx + uy * ty
    if chains.flags[c, SHAPE] == STRAIGHT:
        return min(length, max(0.0, along))
    curvature = chains.place[c, CURVATURE]
    angle = math.atan2(curvature * along, 1.0 - curvature * (uy * tx - ux * ty))
    parameter, turn = angle / curvature, 2.0 * math.pi / abs(curvature)
    if chains.flags[c, CLOSED]:
        return parameter + turn if parameter < 0.0 else parameter
    if parameter < 0.0:
        parameter = 0.0 if -parameter <= turn + parameter - length else parameter + turn
    elif parameter > length and parameter - length > turn - parameter:
        parameter = 0.0
    return min(length, parameter)


@inner_kernel
def parameter_of(position, constraints, c, v):
    """The parameter of a node on chain c; one that does not slide there is at one of its ends."""
    if constraints.kind[v] == SLIDING and constraints.chain[v, 0] == c:
        return constraints.parameter[v]
    x, y, chains = position[v, 0], position[v, 1], constraints.chains
    if squared_to_parameter(chains, c, chains.place[c, LENGTH], x, y) < squared_to_parameter(chains, c, 0.0, x, y):
        return chains.place[c, LENGTH]
    return 0.0


@inner_kernel
def distance_to_chain(chains, c, x, y, near):
    """Squared distance from (x, y) to the chain's nearest point, and the parameter of that point."""
    parameter = nearest_parameter(chains, c, x, y, near)
    px, py = point_at(chains, c, parameter)
    return (x - px) * (x - px) + (y - py) * (y - py), parameter


@inner_kernel
def way_along(chains, c, start, end):
    """From one parameter to another; on a loop the shorter way round."""
    way = end - start
    if chains.flags[c, CLOSED]:
        if way > 0.5 * chains.place[c, LENGTH]:
            way -= chains.place[c, LENGTH]
        elif way < -0.5 * chains.place[c, LENGTH]:
            way += chains.place[c, LENGTH]
    return way


@inner_kernel
def gone_along(chains, c, start, way):
    """The parameter so far from another; a loop begins anew at its end."""
    parameter = start + way
    if chains.flags[c, CLOSED]:
        if parameter < 0.0:
            parameter += chains.place[c, LENGTH]
        elif parameter >= chains.place[c, LENGTH]:
            parameter -= chains.place[c, LENGTH]
    return parameter


@inner_kernel
def within_reach(position, elements, star, chains, c, v, x, y):
    """Whether node v at (x, y) on chain c makes no facet that is both longer than may be and longer than before."""
    reach = chains.place[c, REACH]
    if reach == np.inf:
        return True
    for k in range(star.start[v], star.start[v + 1]):
        e = star.element[k]
        for j in range(3):
            if elements.chain[e, j] != c or elements.node[e, j] == v:
                continue
            other = star.ahead[k] + star.behind[k] - elements.node[e, j]
            dx, dy = x - position[other, 0], y - position[other, 1]
            squared = dx * dx + dy * dy
            if squared > reach * reach:
                dx, dy = position[v, 0] - position[other, 0], position[v, 1] - position[other, 1]
                if squared > dx * dx + dy * dy:
                    return False
    return True


@inner_kernel
def knot_before(chains, c, parameter):
    """The last knot of a tabled chain, its end not counted, that is not beyond a parameter."""
    low, high = chains.row[c], chains.row[c + 1] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if chains.knot[middle, 0] <= parameter:
            low = middle
        else:
            high = middle
    return low


@inner_kernel
def span_share(knot, k, parameter):
    """Where between knots k and k + 1 a parameter lies, 0 to 1."""
    return (parameter - knot[k, 0]) / (knot[k + 1, 0] - knot[k, 0])


@inner_kernel
def on_span(knot, k, share):
    """Position between knots k and k + 1 and derivative by the share, of the cubic with the same at the knots."""
    width, r = knot[k + 1, 0] - knot[k, 0], 1.0 - share
    h0, h1 = r * r * (1.0 + 2.0 * share), share * share * (1.0 + 2.0 * r)
    g0, g1 = width * share * r * r, -width * share * share * r
    d = 6.0 * share * r
    e0, e1 = width * r * (1.0 - 3.0 * share), width * share * (3.0 * share - 2.0)
    x = h0 * knot[k, 1] + h1 * knot[k + 1, 1] + g0 * knot[k, 3] + g1 * knot[k + 1, 3]
    y = h0 * knot[k, 2] + h1 * knot[k + 1, 2] + g0 * knot[k, 4] + g1 * knot[k + 1, 4]
    dx = d * (knot[k + 1, 1] - knot[k, 1]) + e0 * knot[k, 3] + e1 * knot[k + 1, 3]
    dy = d * (knot[k + 1, 2] - knot[k, 2]) + e0 * knot[k, 4] + e1 * knot[k + 1, 4]
    return x, y, dx, dy


@inner_kernel
def nearest_on_table(chains, c, x, y, near):
    """From the knot before a parameter to ever nearer ones, and then within the spans on both sides of the last."""
    knot, k, best = chains.knot, knot_before(chains, c, near), np.inf
    distance = squared_to_knot(knot, k, x, y)
    for way in (1, -1):
        while distance < best:
            best = distance
            other = next_knot(chains, c, k, way)
            distance = squared_to_knot(knot, other, x, y)
            if distance < best:
                k = other
        distance, best = best, np.inf
    before = next_knot(chains, c, k, np.int64(-1))
    parameter = nearest_in_span(knot, min(k, chains.row[c + 1] - 2), x, y)
    other = nearest_in_span(knot, before, x, y)
    if squared_to_parameter(chains, c, other, x, y) < squared_to_parameter(chains, c, parameter, x, y):
        return other
    return parameter


@inner_kernel
def next_knot(chains, c, k, way):
    """The next knot of a chain that way; at its end that end, on a loop the first one again, which the last one is."""
    first, last = chains.row[c], chains.row[c + 1] - 1
    k += way
    if chains.flags[c, CLOSED]:
        return last - 1 if k < first else (first if k >= last else k)
    return max(first, min(last, k))


@inner_kernel
def squared_to_knot(knot, k, x, y):
    """Squared distance from (x, y) to a knot."""
    dx, dy = x - knot[k, 1], y - knot[k, 2]
    return dx * dx + dy * dy


@inner_kernel
def squared_to_parameter(chains, c, parameter, x, y):
    """Squared distance from (x, y) to the point of a chain at a parameter."""
    px, py = point_at(chains, c, parameter)
    return (x - px) * (x - px) + (y - py) * (y - py)


@inner_kernel
def nearest_in_span(knot, k, x, y):
    """The parameter between knots k and k + 1 where the way to (x, y) is square to the curve, or the nearer end."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        share = 0.5 * (low + high)
        px, py, dx, dy = on_span(knot, k, share)
        if (x - px) * dx + (y - py) * dy > 0.0:
            low = share
        else:
            high = share
    return knot[k, 0] + 0.5 * (low + high) * (knot[k + 1, 0] - knot[k, 0])


@kernel
def find_parameters(position, constraints, node, pieces):
    """The parameters of the nodes of every piece of outline, which is chain of its number, one after another."""
    chains = constraints.chains
    for c in range(pieces.shape[0]):
        near = 0.0
        for i in range(pieces[c, 0], pieces[c, 1]):
            v = node[i]
            if constraints.kind[v] == SLIDING:
                near = nearest_parameter(chains, c, position[v, 0], position[v, 1], near)
                constraints.parameter[v] = near


@kernel
def look_up(constraints, nodes, out):
    """Where sliding nodes are to be by their parameters, (k, 2)."""
    for i in range(nodes.shape[0]):
        v = nodes[i]
        chain = np.int64(constraints.chain[v, 0])
        out[i, 0], out[i, 1] = point_at(constraints.chains, chain, constraints.parameter[v])


@kernel
def mark_along(position, elements, constraints, element, corner, along):
    """Mark which edges opposite to corners run, counter-clockwise in their element, in the direction of their chain."""
    for i in range(element.shape[0]):
        e, k = element[i], corner[i]
        c = np.int64(elements.chain[e, k])
        start = parameter_of(position, constraints, c, np.int64(elements.node[e, (k + 1) % 3]))
        end = parameter_of(position, constraints, c, np.int64(elements.node[e, (k + 2) % 3]))
        along[i] = way_along(constraints.chains, c, start, end) > 0.0


@kernel
def farthest_from_facets(position, elements, constraints):
    """How far at most a curve is from its facets, looked at in the middle of each: the sagitta of an arc."""
    chains, farthest = constraints.chains, 0.0
    for e in range(elements.node.shape[0]):
        for k in range(3):
            c = np.int64(elements.chain[e, k])
            if c < 0 or chains.flags[c, SHAPE] == STRAIGHT:
                continue
            a, b = np.int64(elements.node[e, (k + 1) % 3]), np.int64(elements.node[e, (k + 2) % 3])
            start, end = parameter_of(position, constraints, c, a), parameter_of(position, constraints, c, b)
            x, y = point_at(chains, c, gone_along(chains, c, start, 0.5 * way_along(chains, c, start, end)))
            dx, dy = x - 0.5 * (position[a, 0] + position[b, 0]), y - 0.5 * (position[a, 1] + position[b, 1])
            farthest = max(farthest, math.sqrt(dx * dx + dy * dy))
    return farthest
