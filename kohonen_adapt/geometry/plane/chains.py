"""Tables of the curve segments on which nodes slide, and their parameters.

A curve segment (`chain`) is a part of a boundary or interface between two corners: a line, an arc or a cubic spline.
The parameter of a point is its arc length from the beginning of the segment, approximately so on splines.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy  # loads `scipy.interpolate` at its first use

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.geometry.plane.curves import NEAR, Arc, Curve, Curves, Line, projected, size_of
from kohonen_adapt.geometry.plane.cutting import Circle, Points, angles, as_complex, as_rows
from kohonen_adapt.geometry.plane.polylines import BY_MIDSIDES, Polylines, Segments, nodes_of
from kohonen_adapt.geometry.plane.recognition import angles_of, fewest_facets
from kohonen_adapt.kernels.numba.compilation import interpreted
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
    Chains,
    Constraints,
)
from kohonen_adapt.kernels.triangle.chains import look_up, nearest_parameter
from kohonen_adapt.log import logger

__all__ = [
    "chains_of",
    "circles_of",
    "find_parameters",
    "on_chains",
    "on_lines_and_arcs",
    "pair_chains",
    "parameters_of",
    "points_on",
    "signed_distances",
    "spans_of",
    "wrapped",
]

MAX_TURN = np.deg2rad(30.0)  # maximum turn of the tangent along a facet
LONGEST = 1.5  # maximum facet of a coarse arc that is user-defined or has midside nodes, relative to the mean facet
SAMPLES = (8, 512)  # samples of a curve per facet, at first and at most
POSITION, DERIVATIVE = slice(AT_X, AT_Y + 1), slice(RATE_X, RATE_Y + 1)  # columns of knots
SPANS = 4  # spans of a table between a corner node and a midside node
MOST_SHIFT = (
    0.25  # maximum offset of a midside node along the chord, relative to the chord: a larger offset inverts the element
)
FINE = 1e-10  # maximum distance of a spline from its curve, relative to the size of the curve


def on_lines_and_arcs(curve: Ints, curves: Curves) -> Mask:
    smooth = np.array([*(isinstance(shape, Arc | Line) for shape in curves.values()), False])
    return smooth[np.maximum(curve, -1)]


def chains_of(position: Floats, polylines: Polylines, segments: Segments, curves: Curves, offset: Floats) -> Chains:
    count, z = len(segments.first), as_complex(position)
    longest, even = facet_lengths(z, polylines.node, segments)
    start, end = (position[polylines.node[slots]] for slots in (segments.first, segments.last))
    table = Chains.of(count)
    table.reach[:] = table.merged[:] = table.even[:] = np.inf
    table.closed[:] = segments.closed
    set_lines(table, np.arange(count), start, end)
    set_arcs(table, segments, angles_of(z, polylines.node, segments), longest)
    knots = [table.knot] * count
    for p in np.flatnonzero((segments.curve != -1) & ~segments.is_round).tolist():
        nodes, closed = nodes_of(position, polylines.node, segments, p), bool(segments.closed[p])
        if segments.curve[p] == BY_MIDSIDES:
            rows = polylines.facet[segments.first[p] : segments.last[p]]
            knots[p] = knots_through(nodes, offset[rows], closed)
        else:
            name, shape = list(curves.items())[segments.curve[p]]
            if isinstance(shape, Line):
                set_lines(table, [p], *projected(shape, nodes[[0, -1]], name)[:, None])
                continue
            knots[p] = spline_knots(shape, nodes, closed, name)
        set_spline(table, p, knots[p], longest[p])
    curved = table.shape != STRAIGHT
    table.even[curved] = even[curved]
    log_arcs(table, segments)
    row = np.append(0, np.cumsum([len(rows) for rows in knots])).astype(np.int32)
    return table._replace(row=row, knot=np.concatenate([table.knot, *knots]))


def facet_lengths(z: Points, node: Ints, segments: Segments) -> FloatsPair:
    """Return the longest facet and the equivalent facet length of every segment.

    A chord of length l cuts the area ``l^3 / (12 r)`` off a circle of radius r. Equal facets that cut off as much as
    the facets of a segment have the equivalent length sqrt(sum l^3 / sum l).
    """
    length = np.abs(z[node[segments.slots + 1]] - z[node[segments.slots]])
    of_slot = segments.of_slot
    longest = np.maximum.reduceat(length, np.cumsum(segments.facets) - segments.facets)
    return longest, np.sqrt(np.bincount(of_slot, length**3) / np.bincount(of_slot, length))


def set_lines(table: Chains, rows: Ints | list[int], start: Floats, end: Floats) -> None:
    chord = end - start
    length = np.sqrt(np.sum(chord**2, axis=1))
    with np.errstate(invalid="ignore"):  # the chord of a closed segment is 0; its direction is set later
        table.direction[rows] = chord / length[:, None]
    table.origin[rows] = start
    table.length[rows] = length


def set_arcs(table: Chains, segments: Segments, angle: Floats, longest: Floats) -> None:
    # not a number for segments that are no arcs
    centre, radius = segments.circle[:, :2], segments.circle[:, 2]
    out = table.origin - centre
    sense = np.sign(angle)
    out /= np.sqrt(np.sum(out**2, axis=1))[:, None]
    full = np.where(segments.closed, 2.0 * np.pi, np.abs(angle))
    coarse = np.clip(LONGEST * full / segments.facets, MAX_TURN, 0.5 * np.pi)
    # arcs defined by the user or by midside nodes need not be recognised again
    own = full / fewest_facets(segments.facets)
    widest = np.where(np.isnan(segments.widest), own, segments.widest)
    reach = chord_of(radius, np.where(segments.curve != -1, coarse, np.minimum(MAX_TURN, widest)))
    is_round = segments.is_round
    table.shape[is_round] = ROUND
    for array, values in (
        (table.origin, centre + radius[:, None] * out),
        (table.direction, sense[:, None] * np.stack([-out[:, 1], out[:, 0]], axis=1)),
        (table.curvature, sense / radius),
        (table.length, radius * full),
        (table.reach, reach),
        (table.merged, chord_of(radius, np.minimum(0.5 * MAX_TURN, widest))),
        # at least twice the sagitta
        (table.sagitta, np.maximum(reach, longest) ** 2 / (4.0 * radius) + NEAR * radius),
    ):
        array[is_round] = values[is_round]


def chord_of(radius: Any, angle: Any) -> Any:
    return 2.0 * radius * np.sin(0.5 * angle)


def set_spline(table: Chains, p: int, knots: Floats, longest: float) -> None:
    position = knots[:, POSITION]
    rate = as_complex(knots[:, DERIVATIVE])
    table.shape[p] = TABLED
    table.origin[p] = position[0]
    table.length[p] = knots[-1, AT]
    table.direction[p] = knots[0, DERIVATIVE] / np.sqrt(np.sum(knots[0, DERIVATIVE] ** 2))
    curvature = np.max(np.abs(angles(rate)) / np.diff(knots[:, AT]))
    radius = 1.0 / curvature if curvature > 0.0 else np.inf
    reach = max(longest, chord_of(radius, MAX_TURN))
    sagitta = min(longest, reach * (reach / (4.0 * radius))) if radius < np.inf else 0.0
    table.reach[p] = reach
    table.merged[p] = 0.5 * reach
    table.sagitta[p] = sagitta + NEAR * size_of(position)


def spline_knots(curve: Curve, nodes: Floats, closed: bool, name: str) -> Floats:
    # The columns (k, 5) are parameter, point and derivative. The number of interpolation points on each facet is
    # doubled until the spline is within `FINE` of the curve, or `SAMPLES` is reached.
    samples, most = SAMPLES
    found = project_facets(curve, nodes, np.arange(samples) / samples, name)
    end = found[0, :1] if closed else projected(curve, nodes[-1:], name)
    while True:
        points = np.concatenate([found.reshape(-1, 2), end])
        steps = np.sqrt(np.sum(np.diff(points, axis=0) ** 2, axis=1))
        if not np.all(steps > 0.0):
            raise ValueError(
                f"project of the curve of boundary {name!r} must tell its points apart; it has a corner. "
                "Name what is on either side of it apart."
            )
        parameter = np.append(0.0, np.cumsum(steps))
        spline = scipy.interpolate.CubicSpline(parameter, points, bc_type="periodic" if closed else "not-a-knot")
        middle = spline(0.5 * (parameter[1:] + parameter[:-1]))
        distance = np.max(np.abs(projected(curve, middle, name) - middle))
        if distance <= FINE * size_of(nodes) or 2 * samples > most:
            return np.column_stack([parameter, points, spline(parameter, 1)])
        samples *= 2
        between = project_facets(curve, nodes, np.arange(1, samples, 2) / samples, name)
        found = np.stack([found, between], axis=2).reshape(len(found), samples, 2)


def project_facets(curve: Curve, nodes: Floats, fraction: Floats, name: str) -> Floats:
    points = nodes[:-1, None] + fraction[:, None] * np.diff(nodes, axis=0)[:, None]
    return projected(curve, points.reshape(-1, 2), name).reshape(points.shape)


def knots_through(nodes: Floats, offset: Floats, closed: bool) -> Floats:
    """Return knots (s, 5) of a cubic spline through corner and midside nodes.

    The parameter is the chord length, shifted inside every facet by a smooth function so that the midside node has the
    mean parameter of the two corners, where `offsets_on_curves` places midside nodes.
    """
    points = np.empty((2 * len(nodes) - 1, 2))
    points[::2], points[1::2] = nodes, 0.5 * (nodes[:-1] + nodes[1:]) + offset
    if closed:
        points[-1] = points[0]
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    spline = scipy.interpolate.CubicSpline(length, points, bc_type="periodic" if closed else "not-a-knot")
    start, middle, end = (rows[:, None] for rows in (length[:-1:2], length[1::2], length[2::2]))
    fraction = np.arange(2 * SPANS) / SPANS
    along = np.where(fraction <= 1.0, start + fraction * (middle - start), middle + (fraction - 1.0) * (end - middle))
    local, most = (along - start) / (end - start), MOST_SHIFT * (end - start)
    shift = np.clip(0.5 * (start + end) - middle, -most, most) / bump((middle - start) / (end - start))[0]
    value, slope = bump(local)
    parameter, rate = along + shift * value, 1.0 + shift * slope / (end - start)
    return np.vstack(
        [
            np.column_stack([parameter.ravel(), spline(along.ravel()), spline(along.ravel(), 1) / rate.reshape(-1, 1)]),
            np.concatenate([length[-1:], points[-1], spline(length[-1], 1)]),
        ]
    )


def bump(fraction: Floats) -> FloatsPair:
    """Return b(s) = 16 s^2 (1 - s)^2 and its derivative, s from 0 to 1."""
    rest = 1.0 - fraction
    return 16.0 * (fraction * rest) ** 2, 32.0 * fraction * rest * (rest - fraction)


def log_arcs(table: Chains, segments: Segments) -> None:
    for p in np.flatnonzero((table.shape == ROUND) & (segments.curve < 0)):
        x, y, radius = segments.circle[p]
        count = segments.facets[p] + (0 if table.closed[p] else 1)
        kind = "a circle" if table.closed[p] else f"an arc of {np.rad2deg(table.length[p] / radius):.4g} degrees"
        logger.debug("recognised %s of radius %.6g about (%.6g, %.6g), %d nodes", kind, radius, x, y, count)


def pair_chains(table: Chains, mate: Ints, motion: Ints, motions: Floats) -> None:
    table.paired[:] = mate >= 0
    first = np.flatnonzero((mate >= 0) & (motion % 2 == 0))
    image, step = mate[first], motions[motion[first]]
    turn, shift = step[:, :, :2], step[:, :, 2]
    table.origin[image] = np.einsum("cij,cj->ci", turn, table.origin[first]) + shift
    table.direction[image] = np.einsum("cij,cj->ci", turn, table.direction[first])
    for array in (table.length, table.curvature, table.reach, table.merged, table.sagitta, table.even):
        array[image] = array[first]
    table.curvature[image] *= np.sign(np.linalg.det(turn))  # a reflection changes the sign of the curvature


def on_chains(chain: Ints, chains: Mask) -> Mask:
    return (chain >= 0) & chains[chain]


def find_parameters(position: Floats, constraints: Constraints, node: Ints, segments: Segments) -> None:
    chains = constraints.chains
    nearest = interpreted(nearest_parameter)
    slides = constraints.kind == SLIDING
    chain = np.where(slides, constraints.own_chain, -1)
    straight = np.flatnonzero(on_chains(chain, chains.shape == STRAIGHT))
    own = chain[straight]
    along = np.sum((position[straight] - chains.origin[own]) * chains.direction[own], axis=1)
    constraints.parameter[straight] = np.clip(along, 0.0, chains.length[own])
    for c in np.flatnonzero(chains.shape != STRAIGHT).tolist():
        nodes = node[segments.first[c] : segments.last[c]]
        near = 0.0
        for v in nodes[slides[nodes]].tolist():
            near = constraints.parameter[v] = nearest(chains, c, position[v], near)


def parameters_of(position: Floats, constraints: Constraints, chain: Ints, node: Ints) -> Floats:
    """Return the parameters of nodes on curve segments, shape (k,).

    A node that does not slide on the segment is the nearer of its two ends.
    """
    chains = constraints.chains
    slides = (constraints.kind[node] == SLIDING) & (constraints.chain[node, OWN] == chain)
    start, end = (np.sum((position[node] - point[chain]) ** 2, axis=1) for point in (chains.origin, ends_of(chains)))
    return np.where(slides, constraints.parameter[node], np.where(end < start, chains.length[chain], 0.0))


def ends_of(chains: Chains) -> Floats:
    half = 0.5 * chains.curvature * chains.length
    chord = chains.length * np.sinc(half / np.pi) * np.exp(1j * half) * as_complex(chains.direction)
    end = chains.origin + as_rows(chord)
    is_tabled = chains.shape == TABLED
    end[is_tabled] = chains.knot[chains.row[1:][is_tabled] - 1, POSITION]
    return end


def circles_of(chains: Chains) -> Circle:
    """Return the circles of curve segments, infinite for straight ones."""
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = as_complex(chains.origin) + 1j * as_complex(chains.direction) / chains.curvature
        return Circle(centre, 1.0 / np.abs(chains.curvature))


def spans_of(position: Floats, constraints: Constraints, chain: Ints, ends: Sequence[Ints]) -> FloatsPair:
    """Return the parameters of first nodes, and the signed distances to second ones.

    `ends` are nodes (k,) at both ends of parts of curve segments.
    """
    start, end = (parameters_of(position, constraints, chain, node) for node in ends)
    return start, signed_distances(constraints.chains, chain, start, end)


def signed_distances(chains: Chains, chain: Ints, start: Floats, end: Floats) -> Floats:
    distance = end - start
    length = chains.length[chain]
    wraps = chains.closed[chain] & (np.abs(distance) > 0.5 * length)
    return np.where(wraps, distance - np.copysign(length, distance), distance)


def wrapped(chains: Chains, chain: Ints, parameter: Floats) -> Floats:
    # within the segments, on open ones the nearest
    length = chains.length[chain]
    inside = np.clip(parameter, 0.0, length)
    return np.where(chains.closed[chain], parameter - np.floor(parameter / length) * length, inside)


def points_on(constraints: Constraints, chain: Ints, parameter: Floats) -> Floats:
    parameter = wrapped(constraints.chains, chain, parameter)
    along = constraints._replace(chain=np.stack([chain, chain], axis=1).astype(np.int32), parameter=parameter)
    points = np.empty((len(chain), 2))
    look_up(along, np.arange(len(chain)), points)
    return points
