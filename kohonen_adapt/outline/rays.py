"""Rays cast inward from the curve segments around a part of a mesh."""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import Constraints, Elements
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.parameters import parameters_of, signed_distances

__all__ = ["Views", "views_across"]


class Views(NamedTuple):
    """Curve segments hit by rays, one row per ray."""

    start: Ints  # (s,) segment on which the ray starts
    end: Ints  # (s,) segment that the ray hits
    nearness: Floats  # (s,) squared cosine of the angle of incidence divided by the length of the ray


def views_across(
    triangulation: Triangulation, constraints: Constraints, inside: Mask, element: Ints, corner: Ints, step: Floats
) -> Views:
    """Cast rays inward from edges, through regions of the mask `inside` (r,).

    Rays start at intervals `step`, shape (c,), along every segment, and do not depend on the nodes of the segment.
    """
    elements, position = triangulation.elements, triangulation.position
    (a, b), c = elements.ends(element, corner), elements.chain[element, corner]
    start, distance = parameters_and_lengths(position, constraints, c, a, b)
    first, last = (
        np.ceil(end(start, start + distance) / step[c] - 0.5).astype(int) for end in (np.minimum, np.maximum)
    )
    edge = np.repeat(np.arange(len(c)), last - first)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(last - first) - last, last - first)
    fraction = ((number + 0.5) * step[c[edge]] - start[edge]) / distance[edge]
    points = position[a[edge]] + fraction[:, None] * (position[b[edge]] - position[a[edge]])
    return Views(c[edge], *trace_rays(position, elements, inside, element[edge], corner[edge], points))


def parameters_and_lengths(
    position: Floats, constraints: Constraints, c: Ints, a: Ints, b: Ints
) -> tuple[Floats, Floats]:
    start, end = (parameters_of(position, constraints, c, node) for node in (a, b))
    distance = signed_distances(constraints.chains, c, start, end)
    chord = np.sqrt(np.sum((position[b] - position[a]) ** 2, axis=1))
    wrong = np.abs(distance) > 2.0 * chord
    distance = np.where(wrong, distance - np.copysign(constraints.chains.length[c], distance), distance)
    return np.where(wrong, end - distance, start), distance


def trace_rays(
    position: Floats, elements: Elements, inside: Mask, element: Ints, corner: Ints, points: Floats
) -> tuple[Ints, Floats]:
    e, k, active = element.copy(), corner.copy(), np.arange(len(element))
    a, b = elements.ends(e, k)
    dx, dy = position[a, 1] - position[b, 1], position[b, 0] - position[a, 0]
    while len(active):
        at, side = e[active], k[active]
        apex = position[elements.node[at, side]] - points[active]
        left = dx[active] * apex[:, 1] - dy[active] * apex[:, 0] > 0.0
        side = (side + np.where(left, 1, 2)) % 3
        across = elements.neighbour[at, side]
        on = (across >= 0) & inside[elements.region[across]]
        k[active] = side
        active, at, across = active[on], at[on], across[on]
        e[active], k[active] = across, np.argmax(elements.neighbour[across] == at[:, None], axis=1)
    p, q = elements.ends(e, k)
    (ux, uy), (vx, vy) = (position[q] - position[p]).T, (position[p] - points).T
    sine = dx * uy - dy * ux
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction, cosine = (vx * uy - vy * ux) / sine, sine / (np.hypot(dx, dy) * np.hypot(ux, uy))
        return elements.chain[e, k], cosine * cosine / (fraction * np.hypot(dx, dy))
