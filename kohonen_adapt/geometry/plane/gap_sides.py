"""Detection of the two sides of a thin subdomain, by rays cast from its boundary.

Rays from the curve segments around the subdomain find segments that face each other. Segments are nodes of a graph with
relations "same side" and "opposite side".
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, triu
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.chains import parameters_of, signed_distances
from kohonen_adapt.kernels.triangle.arrays import Constraints, Elements
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Views", "components", "facing_sides", "views_across"]


class Views(NamedTuple):
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


RAYS = (8, 2_000)  # minimum number of rays from a curve segment, and approximate number of all rays together
FAR = 3.0  # maximum distance of opposite segments, relative to the median
UNSURE = 0.5  # largest weight of contradicting segments, relative to the sides


class Hits(NamedTuple):
    start: Ints  # the segment on which the ray starts
    end: Ints  # the segment that the ray hits
    weight: Floats  # length that the ray represents divided by the ray's own, less if the hit is oblique


def facing_sides(triangulation: Triangulation, constraints: Constraints, inside: Mask) -> Iterator[tuple[Ints, Ints]]:
    elements = triangulation.elements
    across = elements.neighbour
    own = inside[elements.region]
    e, k = np.nonzero(own[:, None] & ((across < 0) | ~own[across]))
    nodes = np.stack(elements.ends(e, k), axis=1)
    chains, chain = np.unique(elements.chain[e, k], return_inverse=True)
    hits = cast_rays(triangulation, constraints, inside, e, k, chains)
    side = sides_of(hits, ends_of(chain, nodes), len(chains))
    for pair in np.unique(side[side >= 0] // 2):
        one, other = (np.unique(nodes[side[chain] == 2 * pair + which]) for which in (0, 1))
        if len(one) and len(other):
            yield one, other


def components(a: Ints, b: Ints, count: int) -> Ints:
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def ends_of(chain: Ints, nodes: Ints) -> Ints:
    rows = np.unique(np.stack([np.repeat(chain, 2), nodes.ravel()], axis=1), axis=0)
    return rows[np.bincount(rows[:, 1])[rows[:, 1]] > 1]


def cast_rays(
    triangulation: Triangulation, constraints: Constraints, inside: Mask, e: Ints, k: Ints, chains: Ints
) -> Hits:
    length = constraints.chains.length
    least, most = RAYS
    rays = least + np.round(most * length[chains] / length[chains].sum())
    step = np.ones(len(length))
    step[chains] = length[chains] / rays
    views = views_across(triangulation, constraints, inside, e, k, step)
    hit = views.nearness < np.inf
    start, end, nearness = views.start[hit], views.end[hit], views.nearness[hit]
    weight = step[start] * nearness
    near = nearness * FAR >= weighted_median(nearness, weight)
    return Hits(np.searchsorted(chains, start[near]), np.searchsorted(chains, end[near]), weight[near])


def weighted_median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def sides_of(hits: Hits, ends: Ints, count: int) -> Ints:
    """Return the side of every curve segment of a part, -1 for none, (count,).

    Sides 2 i and 2 i + 1 face each other. Segments that see each other lie on opposite sides, and segments that meet in
    a node lie on the same side. If both cannot hold, as at the ends of a gap or at the walls of a slot, the larger
    weight decides. The remaining segments belong to the side that they touch; segments between two sides are the ends
    of a gap.
    """
    sides = OppositeSides(count)
    weight = relate_facing(sides, hits, adjacent_segments(ends), count)
    group = np.array([sides.side(chain) // 2 for chain in range(count)])
    weights = np.bincount(group, weight, count)
    accepted = np.zeros(count, dtype=bool)
    for number in np.argsort(-weights, kind="stable"):
        enough = UNSURE * np.bincount(group, accepted, count).astype(bool) @ weights
        if not weights[number]:
            break
        more = accepted | (group == number)
        tried = sides.copy()
        if all(tried.relate(a, b, False) for a, b in adjacent_segments(ends[more[ends[:, 0]]])):
            sides, accepted = tried, more
        elif weights[number] > enough:
            return np.full(count, -1)
    return fill_between(sides, accepted, ends)


def relate_facing(sides: "OppositeSides", hits: Hits, corners: Ints, count: int) -> Floats:
    seen = coo_array((hits.weight, (hits.start, hits.end)), shape=(count, count)).tocsr()
    facing, weight = triu(seen.minimum(seen.T)).tocoo(), np.zeros(count)
    apart = ~np.isin(facing.row.astype(np.int64) * count + facing.col, np.sort(corners, axis=1) @ [count, 1])
    order = np.flatnonzero(apart)[np.argsort(-facing.data[apart], kind="stable")]
    for a, b, mutual in zip(facing.row[order], facing.col[order], facing.data[order], strict=True):
        if mutual and sides.relate(a, b, True):
            weight[a] += mutual
    return weight


def fill_between(sides: "OppositeSides", accepted: Mask, ends: Ints) -> Ints:
    remaining = remaining_sets(ends, accepted)
    for _, around in remaining:
        sides.join(around)
    side = np.where(accepted, [sides.side(chain) for chain in range(len(accepted))], -1)
    for members, around in remaining:
        found = np.unique(side[around])
        side[members] = found[0] if len(found) == 1 else -1
    return side


def adjacent_segments(ends: Ints) -> Ints:
    ends = ends[np.argsort(ends[:, 1], kind="stable")]
    same = ends[1:, 1] == ends[:-1, 1]
    return np.stack([ends[:-1, 0][same], ends[1:, 0][same]], axis=1)


def remaining_sets(ends: Ints, accepted: Mask) -> list[tuple[list[int], list[int]]]:
    is_accepted = accepted[ends[:, 0]]
    links = adjacent_segments(ends[~np.isin(ends[:, 1], ends[is_accepted, 1])])
    label = components(links[:, 0], links[:, 1], len(accepted))
    others: dict[int, list[int]] = {}
    for chain, node in ends[is_accepted].tolist():
        others.setdefault(node, []).append(chain)
    remaining: dict[int, tuple[set[int], set[int]]] = {}
    for chain, node in ends[~is_accepted].tolist():
        members, around = remaining.setdefault(label[chain], (set(), set()))
        members.add(chain)
        around.update(others.get(node, ()))
    return [(sorted(members), sorted(around)) for members, around in remaining.values()]


class OppositeSides:
    """Union-find structure of segments on the same or on opposite sides."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))
        self._opposite = [False] * count  # True if opposite to the parent
        self._size = [1] * count

    def copy(self) -> "OppositeSides":
        other = OppositeSides(0)
        other._parent, other._opposite, other._size = self._parent.copy(), self._opposite.copy(), self._size.copy()
        return other

    def _root(self, chain: int) -> tuple[int, bool]:
        opposite = False
        while self._parent[chain] != chain:
            opposite ^= self._opposite[chain]
            chain = self._parent[chain]
        return chain, opposite

    def side(self, chain: int) -> int:
        root, opposite = self._root(chain)
        return 2 * root + opposite

    def relate(self, a: int, b: int, opposite: bool) -> bool:
        (a, of_a), (b, of_b) = self._root(a), self._root(b)
        if a == b:
            return of_a ^ of_b == opposite
        if self._size[a] < self._size[b]:
            a, b = b, a
        self._parent[b], self._opposite[b] = a, of_a ^ of_b ^ opposite
        self._size[a] += self._size[b]
        return True

    def join(self, chains: list[int]) -> None:
        found = {self.side(chain) for chain in chains}
        if not any(side ^ 1 in found for side in found):
            for chain in chains[1:]:
                self.relate(chains[0], chain, False)
