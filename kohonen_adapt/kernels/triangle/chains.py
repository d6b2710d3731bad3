"""Positions and parameters of nodes on the curve segments of a geometry.

A node on a segment moves by its parameter and is placed at the position of the parameter, so the node cannot
drift. The parameter is the arc length on straight segments and on circular arcs, and the parameter of the table on
tabled segments. The code calls a segment a chain.
"""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import BY_QUALITY, BY_REACH, MOVED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.triangle.arrays import (
    AT,
    AT_X,
    AT_Y,
    OWN,
    RATE_X,
    RATE_Y,
    ROUND,
    SLIDING,
    STRAIGHT,
    TABLED,
)
from kohonen_adapt.kernels.triangle.guard import may_move
from kohonen_adapt.kernels.vectors import (
    combined,
    cross,
    divided,
    dot,
    minus,
    plus_times,
    put,
    squared_distance,
    turned,
    weighted,
    xy,
)

BISECTIONS = 45  # of a span between knots, one bit of the nearest point each


@inner_kernel
def rotated(a, angle):
    return weighted(math.cos(angle), a, math.sin(angle), turned(a))


@inner_kernel
def point_at(chains, c, parameter):
    if chains.shape[c] == STRAIGHT:
        return plus_times(xy(chains.origin, c), parameter, xy(chains.direction, c))
    if chains.shape[c] == ROUND:
        # along a chord from the origin, exact for any radius
        half = 0.5 * chains.curvature[c] * parameter
        chord = 2.0 * math.sin(half) / chains.curvature[c]
        return plus_times(xy(chains.origin, c), chord, rotated(xy(chains.direction, c), half))
    k = knot_before(chains, c, parameter)
    return on_span(chains.knot, k, span_fraction(chains.knot, k, parameter))[0]


@inner_kernel
def tangent_at(chains, c, parameter):
    if chains.shape[c] == ROUND:
        return rotated(xy(chains.direction, c), chains.curvature[c] * parameter)
    if chains.shape[c] == TABLED:
        k = knot_before(chains, c, parameter)
        x, y = on_span(chains.knot, k, span_fraction(chains.knot, k, parameter))[1]
        return divided((x, y), math.hypot(x, y))
    return xy(chains.direction, c)


@inner_kernel
def nearest_parameter(chains, c, x, near):
    """Return the parameter of the point of segment `c` nearest to x.

    The search on a tabled segment begins at the parameter `near`.
    """
    if chains.shape[c] == TABLED:
        return nearest_on_table(chains, c, x, near)
    offset, tangent = minus(x, xy(chains.origin, c)), xy(chains.direction, c)
    length = chains.length[c]
    along = dot(offset, tangent)
    if chains.shape[c] == STRAIGHT:
        return min(length, max(0.0, along))
    curvature = chains.curvature[c]
    angle = math.atan2(curvature * along, 1.0 - curvature * cross(tangent, offset))
    parameter, turn = angle / curvature, 2.0 * math.pi / abs(curvature)
    if chains.closed[c]:
        return parameter + turn if parameter < 0.0 else parameter
    if parameter < 0.0:
        parameter = 0.0 if -parameter <= turn + parameter - length else parameter + turn
    elif parameter > length and parameter - length > turn - parameter:
        parameter = 0.0
    return min(length, parameter)


@inner_kernel
def parameter_of(position, constraints, c, v):
    if constraints.kind[v] == SLIDING and constraints.chain[v, OWN] == c:
        return constraints.parameter[v]
    x = xy(position, v)
    chains = constraints.chains
    if squared_to_parameter(chains, c, chains.length[c], x) < squared_to_parameter(chains, c, 0.0, x):
        return chains.length[c]
    return 0.0


@inner_kernel
def distance_to_chain(chains, c, x, near):
    parameter = nearest_parameter(chains, c, x, near)
    return squared_to_parameter(chains, c, parameter, x), parameter


@inner_kernel
def signed_distance(chains, c, start, end):
    distance = end - start
    if chains.closed[c]:
        if distance > 0.5 * chains.length[c]:
            distance -= chains.length[c]
        elif distance < -0.5 * chains.length[c]:
            distance += chains.length[c]
    return distance


@inner_kernel
def advanced_parameter(chains, c, start, distance):
    parameter = start + distance
    if chains.closed[c]:
        if parameter < 0.0:
            parameter += chains.length[c]
        elif parameter >= chains.length[c]:
            parameter -= chains.length[c]
    return parameter


@inner_kernel
def midpoint_on_chain(position, constraints, c, a, b):
    chains = constraints.chains
    start, end = parameter_of(position, constraints, c, a), parameter_of(position, constraints, c, b)
    parameter = advanced_parameter(chains, c, start, 0.5 * signed_distance(chains, c, start, end))
    return point_at(chains, c, parameter), parameter


@inner_kernel
def within_reach(mesh, c, v, x):
    """Return True if node `v` at x makes no facet too long.

    A facet is too long if longer than the reach of segment `c` and longer than before.
    """
    position, elements, star = mesh.position, mesh.elements, mesh.star
    reach = mesh.constraints.chains.reach[c]
    if reach == np.inf:
        return True
    for k in rows_of(star, v):
        e = star.element[k]
        for j in range(3):
            if elements.chain[e, j] != c or elements.node[e, j] == v:
                continue
            other = star.ahead[k] + star.behind[k] - elements.node[e, j]
            squared = squared_distance(position, other, x)
            if squared > reach * reach and squared > squared_distance(position, other, xy(position, v)):
                return False
    return True


@inner_kernel
def knot_before(chains, c, parameter):
    low = chains.row[c]
    high = chains.row[c + 1] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if chains.knot[middle, AT] <= parameter:
            low = middle
        else:
            high = middle
    return low


@inner_kernel
def span_fraction(knot, k, parameter):
    return (parameter - knot[k, AT]) / (knot[k + 1, AT] - knot[k, AT])


@inner_kernel
def on_span(knot, k, fraction):
    """Return position and derivative of the cubic Hermite polynomial of span `k`.

    Both are at `fraction` of the span from knot k to k + 1. The derivative is by the fraction.
    """
    width, r = knot[k + 1, AT] - knot[k, AT], 1.0 - fraction
    h0, h1 = r * r * (1.0 + 2.0 * fraction), fraction * fraction * (1.0 + 2.0 * r)
    g0, g1 = width * fraction * r * r, -width * fraction * fraction * r
    d = 6.0 * fraction * r
    e0, e1 = width * r * (1.0 - 3.0 * fraction), width * fraction * (3.0 * fraction - 2.0)
    start, end = (knot[k, AT_X], knot[k, AT_Y]), (knot[k + 1, AT_X], knot[k + 1, AT_Y])
    at_start, at_end = (knot[k, RATE_X], knot[k, RATE_Y]), (knot[k + 1, RATE_X], knot[k + 1, RATE_Y])
    x = plus_times(combined(h0, start, h1, end, g0, at_start), g1, at_end)
    return x, combined(d, minus(end, start), e0, at_start, e1, at_end)


@inner_kernel
def nearest_on_table(chains, c, x, near):
    knot = chains.knot
    k = knot_before(chains, c, near)
    best = np.inf
    distance = squared_to_knot(knot, k, x)
    for direction in (1, -1):
        while distance < best:
            best = distance
            other = next_knot(chains, c, k, direction)
            distance = squared_to_knot(knot, other, x)
            if distance < best:
                k = other
        distance, best = best, np.inf
    before = next_knot(chains, c, k, -1)
    parameter = nearest_in_span(knot, min(k, chains.row[c + 1] - 2), x)
    other = nearest_in_span(knot, before, x)
    if squared_to_parameter(chains, c, other, x) < squared_to_parameter(chains, c, parameter, x):
        return other
    return parameter


@inner_kernel
def next_knot(chains, c, k, direction):
    first = chains.row[c]
    last = chains.row[c + 1] - 1
    k += direction
    if chains.closed[c]:
        return last - 1 if k < first else (first if k >= last else k)
    return max(first, min(last, k))


@inner_kernel
def squared_to_knot(knot, k, x):
    offset = minus(x, (knot[k, AT_X], knot[k, AT_Y]))
    return dot(offset, offset)


@inner_kernel
def squared_to_parameter(chains, c, parameter, x):
    offset = minus(x, point_at(chains, c, parameter))
    return dot(offset, offset)


@inner_kernel
def nearest_in_span(knot, k, x):
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        fraction = 0.5 * (low + high)
        there, tangent = on_span(knot, k, fraction)
        if dot(minus(x, there), tangent) > 0.0:
            low = fraction
        else:
            high = fraction
    return knot[k, AT] + 0.5 * (low + high) * (knot[k + 1, AT] - knot[k, AT])


@kernel
def look_up(constraints, nodes, out):
    for i in range(nodes.shape[0]):
        v = nodes[i]
        chain = constraints.chain[v, OWN]
        put(out, i, point_at(constraints.chains, chain, constraints.parameter[v]))


@inner_kernel
def slide(mesh, v, parameter, floor):
    position, constraints = mesh.position, mesh.constraints
    chain = constraints.chain[v, OWN]
    x = point_at(constraints.chains, chain, parameter)
    if not within_reach(mesh, chain, v, x):
        return BY_REACH
    if not may_move(position, mesh.star, constraints.metric, v, x, floor):
        return BY_QUALITY
    put(position, v, x)
    constraints.parameter[v] = parameter
    return MOVED


@inner_kernel
def slide_pair(mesh, v, parameter, floor):
    position, constraints = mesh.position, mesh.constraints
    w = constraints.periodic.partner[v]
    before = xy(position, v)
    start = constraints.parameter[v]
    # The star of the partner depends on the node where the mesh is a single element wide, so the node moves first.
    cause = slide(mesh, v, parameter, floor)
    if cause != MOVED:
        return cause
    x = point_at(constraints.chains, constraints.chain[w, OWN], parameter)
    if not may_move(position, mesh.star, constraints.metric, w, x, floor):
        put(position, v, before)
        constraints.parameter[v] = start
        return BY_QUALITY
    put(position, w, x)
    constraints.parameter[w] = parameter
    return MOVED
