"""Cast rays inward from the chains around a part of a mesh, and see which chains they meet."""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import Constraints, Elements
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.parameters import parameters_of, ways_along

__all__ = ["Views", "views_across"]


class Views(NamedTuple):
    """The chains seen from points spread evenly over chains, a row for each point."""

    start: Ints  # (s,) the chain looked from
    end: Ints  # (s,) the chain seen
    nearness: Floats  # (s,) 1 by how far it is away, times the squared cosine of the angle at which it is met


def views_across(
    triangulation: Triangulation, constraints: Constraints, inside: Mask, element: Ints, corner: Ints, step: Floats
) -> Views:
    """Look inward from the edges opposite to corners, through the regions `inside` (r,).

    Points are `step` (c,) apart on their chain, half of that from its beginning: where nodes are on the chain makes no
    difference to them.
    """
    elements, position = triangulation.elements, triangulation.position
    (a, b), c = elements.ends(element, corner), elements.chain[element, corner]
    start, way = stretches(position, constraints, c, a, b)
    first, last = (np.ceil(end(start, start + way) / step[c] - 0.5).astype(int) for end in (np.minimum, np.maximum))
    edge = np.repeat(np.arange(len(c)), last - first)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(last - first) - last, last - first)
    share = ((number + 0.5) * step[c[edge]] - start[edge]) / way[edge]
    points = position[a[edge]] + share[:, None] * (position[b[edge]] - position[a[edge]])
    return Views(c[edge], *look(position, elements, inside, element[edge], corner[edge], points))


def stretches(position: Floats, constraints: Constraints, c: Ints, a: Ints, b: Ints) -> tuple[Floats, Floats]:
    """The parameters of nodes a on their chains, and the ways from there to their neighbours b.

    A corner in which a chain both begins and ends is taken for its beginning or its end, whichever is nearer.
    """
    start, end = (parameters_of(position, constraints, c, node) for node in (a, b))
    way = ways_along(constraints.chains, c, start, end)
    chord = np.sqrt(np.sum((position[b] - position[a]) ** 2, axis=1))
    wrong = np.abs(way) > 2.0 * chord
    way = np.where(wrong, way - np.copysign(constraints.chains.length[c], way), way)
    return np.where(wrong, end - way, start), way


def look(
    position: Floats, elements: Elements, inside: Mask, element: Ints, corner: Ints, points: Floats
) -> tuple[Ints, Floats]:
    """From points on the edges opposite to corners straight into their elements and on: chains met, and nearness."""
    e, k, going = element.copy(), corner.copy(), np.arange(len(element))
    a, b = elements.ends(e, k)
    dx, dy = position[a, 1] - position[b, 1], position[b, 0] - position[a, 0]
    while len(going):  # all rays at once, from element to element
        at, side = e[going], k[going]
        apex = position[elements.node[at, side]] - points[going]
        left = dx[going] * apex[:, 1] - dy[going] * apex[:, 0] > 0.0
        side = (side + np.where(left, 1, 2)) % 3
        across = elements.neighbour[at, side]
        on = (across >= 0) & inside[elements.region[across]]
        k[going] = side
        going, at, across = going[on], at[on], across[on]
        e[going], k[going] = across, np.argmax(elements.neighbour[across] == at[:, None], axis=1)
    p, q = elements.ends(e, k)
    (ux, uy), (vx, vy) = (position[q] - position[p]).T, (position[p] - points).T
    sine = dx * uy - dy * ux
    with np.errstate(divide="ignore", invalid="ignore"):
        share, cosine = (vx * uy - vy * ux) / sine, sine / (np.hypot(dx, dy) * np.hypot(ux, uy))
        return elements.chain[e, k], cosine * cosine / (share * np.hypot(dx, dy))
