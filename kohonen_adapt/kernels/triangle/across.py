"""Look across a part of the mesh, from its outline along the inward normal to where it ends."""

import math
from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.arrays import LENGTH
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import parameter_of, way_along
from kohonen_adapt.kernels.triangle.connectivity import corner_towards


class Views(NamedTuple):
    """The chains seen from points spread evenly over chains, a row for each point."""

    start: np.ndarray  # (s,) int32: the chain looked from
    end: np.ndarray  # (s,) int32: the chain seen, -1 where the way did not end
    nearness: np.ndarray  # (s,) 1 by how far it is away, times the squared cosine of the angle at which it is met


@kernel
def look_across(position, elements, constraints, inside, element, corner, step, views):
    """Look inward from the edges opposite to corners; returns the number of points looked from.

    `inside` (r,) says which regions are looked through. Points are `step` (c,) apart on their chain, half of
    that from its beginning: where nodes are on the chain makes no difference to them.
    """
    count = 0
    for i in range(element.shape[0]):
        e, k = element[i], corner[i]
        a, b = np.int64(elements.node[e, (k + 1) % 3]), np.int64(elements.node[e, (k + 2) % 3])
        c = np.int64(elements.chain[e, k])
        start, way = stretch(position, constraints, c, a, b)
        first = math.ceil(min(start, start + way) / step[c] - 0.5)
        last = math.ceil(max(start, start + way) / step[c] - 0.5)
        for j in range(first, last):
            share = ((j + 0.5) * step[c] - start) / way
            x = position[a, 0] + share * (position[b, 0] - position[a, 0])
            y = position[a, 1] + share * (position[b, 1] - position[a, 1])
            views.start[count] = c
            views.end[count], views.nearness[count] = look(position, elements, inside, e, k, x, y)
            count += 1
    return count


@inner_kernel
def stretch(position, constraints, c, a, b):
    """The parameter of node a on its chain, and the way from there to its neighbour b.

    A corner in which a chain both begins and ends is taken for its beginning or its end, whichever is nearer.
    """
    chains = constraints.chains
    start, end = parameter_of(position, constraints, c, a), parameter_of(position, constraints, c, b)
    way = way_along(chains, c, start, end)
    chord = math.hypot(position[b, 0] - position[a, 0], position[b, 1] - position[a, 1])
    if abs(way) > 2.0 * chord:
        way -= math.copysign(chains.place[c, LENGTH], way)
        start = end - way
    return start, way


@inner_kernel
def look(position, elements, inside, e, k, x, y):
    """From (x, y) on the edge opposite to corner k of e straight into e and on: the chain there, and its nearness."""
    node = elements.node
    a, b = node[e, (k + 1) % 3], node[e, (k + 2) % 3]
    dx, dy = position[a, 1] - position[b, 1], position[b, 0] - position[a, 0]
    length = math.hypot(dx, dy)
    for _ in range(node.shape[0]):
        apex = node[e, k]
        left = dx * (position[apex, 1] - y) - dy * (position[apex, 0] - x) > 0.0
        k = (k + 1) % 3 if left else (k + 2) % 3
        across = elements.neighbour[e, k]
        if across < 0 or not inside[elements.region[across]]:
            p, q = node[e, (k + 1) % 3], node[e, (k + 2) % 3]
            ux, uy = position[q, 0] - position[p, 0], position[q, 1] - position[p, 1]
            sine = dx * uy - dy * ux
            share = ((position[p, 0] - x) * uy - (position[p, 1] - y) * ux) / sine
            cosine = sine / (length * math.hypot(ux, uy))
            return elements.chain[e, k], cosine * cosine / (share * length)
        e, k = across, corner_towards(elements.neighbour, across, e)
    return -1, 0.0


@kernel
def lower_to_steps(edges, value):
    """Lower values (n,) until those of joined nodes differ by at most 1: to the least of value plus steps to there."""
    changed = True
    while changed:
        changed = False
        for i in range(edges.shape[0]):
            a, b = edges[i, 0], edges[i, 1]
            if value[a] > value[b] + 1:
                value[a], changed = value[b] + 1, True
            elif value[b] > value[a] + 1:
                value[b], changed = value[a] + 1, True
