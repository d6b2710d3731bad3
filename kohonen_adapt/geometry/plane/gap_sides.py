"""Detection of the two sides of a thin subdomain, by rays cast from its boundary.

Rays from the curve segments around the subdomain find segments that face each other. Segments are nodes of a graph with
relations "same side" and "opposite side".
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import coo_array, csr_array, triu

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask, counted, unique_pairs
from kohonen_adapt.geometry.plane.chains import spans_of
from kohonen_adapt.geometry.plane.cutting import Points, as_complex
from kohonen_adapt.kernels.triangle.arrays import Constraints, Elements
from kohonen_adapt.mesh.adjacency import across
from kohonen_adapt.mesh.names import connected_components_of
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["facing_sides", "views_across"]


def views_across(
    triangulation: Triangulation, constraints: Constraints, inside: Mask, element: Ints, corner: Ints, step: Floats
) -> tuple[Ints, Ints, Floats]:
    """Cast rays inward from edges, through regions of the mask `inside` (r,).

    Returned are the segments on which rays start, the segments that they hit, and the squared cosine of the angle of
    incidence divided by the length of the ray. Rays start at intervals `step`, shape (c,), along every segment, and do
    not depend on the nodes of the segment.
    """
    elements = triangulation.elements
    z = as_complex(triangulation.position)
    (a, b), c = elements.ends(element, corner), elements.chain[element, corner]
    start, distance = spans_of(triangulation.position, constraints, c, (a, b))
    wrong = np.abs(distance) > 2.0 * np.abs(z[b] - z[a])  # the way around, from the other end
    whole = np.where(wrong, np.copysign(constraints.chains.length[c], distance), 0.0)
    start, distance = start + whole, distance - whole
    ends = np.ceil(np.sort([start, start + distance], axis=0) / step[c] - 0.5).astype(int)
    count = ends[1] - ends[0]
    edge = np.repeat(np.arange(len(c)), count)
    at = (counted(count) + ends[0, edge] + 0.5) * step[c[edge]]
    points = z[a[edge]] + (at - start[edge]) / distance[edge] * (z[b] - z[a])[edge]
    return c[edge], *trace_rays(z, elements, inside, element[edge], corner[edge], points)


def trace_rays(
    z: Points, elements: Elements, inside: Mask, element: Ints, corner: Ints, points: Points
) -> tuple[Ints, Floats]:
    e, k, active = element.copy(), corner.copy(), np.arange(len(element))
    a, b = elements.ends(e, k)
    ray = 1j * (z[b] - z[a])
    while len(active):
        at, side = e[active], k[active]
        left = (ray[active].conj() * (z[elements.node[at, side]] - points[active])).imag > 0.0
        side = (side + np.where(left, 1, 2)) % 3
        k[active] = side
        on = np.append(inside, False)[np.append(elements.region, np.int32(-1))[elements.neighbour[at, side]]]
        active = active[on]
        e[active], k[active] = across(elements.neighbour, at[on], side[on])
    p, q = elements.ends(e, k)
    facet, out = z[q] - z[p], z[p] - points
    sine = (ray.conj() * facet).imag
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction, cosine = (out.conj() * facet).imag / sine, sine / (np.abs(ray) * np.abs(facet))
        return elements.chain[e, k], cosine * cosine / (fraction * np.abs(ray))


RAYS = (8, 2_000)  # minimum number of rays from a curve segment, and approximate number of all rays together
FAR = 3.0  # maximum distance of opposite segments, relative to the median
UNSURE = 0.5  # largest weight of contradicting segments, relative to the sides


def facing_sides(triangulation: Triangulation, constraints: Constraints, inside: Mask) -> Iterator[IntsPair]:
    elements = triangulation.elements
    own = np.append(inside[elements.region], False)
    e, k = np.nonzero(own[:-1, None] & ~own[elements.neighbour])
    nodes = np.stack(elements.ends(e, k), axis=1)
    chains, chain = np.unique(elements.chain[e, k], return_inverse=True)
    seen = seen_weights(triangulation, constraints, inside, e, k, chains)
    side = sides_of(seen, ends_of(chain, nodes), len(chains))
    for pair in np.unique(side[side >= 0] // 2):
        one, other = (np.unique(nodes[side[chain] == 2 * pair + which]) for which in (0, 1))
        if len(one) and len(other):
            yield one, other


def ends_of(chain: Ints, nodes: Ints) -> Ints:
    rows = np.stack(unique_pairs(np.repeat(chain, 2), nodes.ravel()), axis=1)
    return rows[np.bincount(rows[:, 1])[rows[:, 1]] > 1]


def seen_weights(
    triangulation: Triangulation, constraints: Constraints, inside: Mask, e: Ints, k: Ints, chains: Ints
) -> csr_array:
    """Return the weights with which `chains` see each other, (k, k).

    A ray has the length that it represents divided by its own as weight, less if the hit is oblique.
    """
    length = constraints.chains.length[chains]
    step = np.ones(len(constraints.chains.length))
    least, most = RAYS
    step[chains] = length / (least + np.round(most * length / length.sum()))
    start, end, nearness = views_across(triangulation, constraints, inside, e, k, step)
    hit = nearness < np.inf
    weight = step[start] * nearness
    hit[hit] = nearness[hit] * FAR >= weighted_median(nearness[hit], weight[hit])
    pairs = np.searchsorted(chains, start[hit]), np.searchsorted(chains, end[hit])
    return coo_array((weight[hit], pairs), shape=(len(chains), len(chains))).tocsr()


def weighted_median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def sides_of(seen: csr_array, ends: Ints, count: int) -> Ints:
    """Return the side of every curve segment of a part, -1 for none, (count,).

    Sides 2 i and 2 i + 1 face each other. Segments that see each other lie on opposite sides, and segments that meet in
    a node lie on the same side. If both cannot hold, as at the ends of a gap or at the walls of a slot, the larger
    weight decides. The remaining segments belong to the side that they touch; segments between two sides are the ends
    of a gap.
    """
    side, weight = facing(seen, adjacent_segments(ends), count)
    group = side // 2
    accepted = np.zeros(count, bool)
    weights = np.bincount(group, weight, count)
    for number in np.argsort(-weights, kind="stable")[: np.count_nonzero(weights)]:
        more = accepted | (group == number)
        tried: Ints | None = side
        for a, b in adjacent_segments(ends[more[ends[:, 0]]]):
            tried = tried if tried is None else related(tried, a, b, opposite=False)
        if tried is not None:
            side, accepted = tried, more
        elif weights[number] > UNSURE * weights[np.unique(group[accepted])].sum():
            return np.full(count, -1)
    return fill_between(side, accepted, ends)


def related(side: Ints, a: int, b: int, opposite: bool) -> Ints | None:
    """Return the sides after two segments are related, None if they contradict."""
    own = side[a]
    other = side[b] ^ opposite
    if own // 2 == other // 2:
        return side if own == other else None
    of_own, of_other = (side // 2 == each // 2 for each in (own, other))
    changed = of_other if of_own.sum() >= of_other.sum() else of_own
    return np.where(changed, side ^ own ^ other, side)


def facing(seen: csr_array, corners: Ints, count: int) -> tuple[Ints, Floats]:
    # sides of segments that see each other, and their weights
    mutual, weight = triu(seen.minimum(seen.T)).tocoo(), np.zeros(count)
    side: Ints = 2 * np.arange(count)
    apart = ~np.isin(mutual.row.astype(np.int64) * count + mutual.col, np.sort(corners, axis=1) @ [count, 1])
    order = np.flatnonzero(apart & (mutual.data > 0.0))
    for k in order[np.argsort(-mutual.data[order], kind="stable")]:
        a, b = mutual.row[k], mutual.col[k]
        found = related(side, a, b, opposite=True)
        if found is not None:
            side = found
            weight[a] += mutual.data[k]
    return side, weight


def fill_between(side: Ints, accepted: Mask, ends: Ints) -> Ints:
    remaining = remaining_sets(ends, accepted)
    for _, around in remaining:
        if not np.isin(side[around] ^ 1, side[around]).any():
            for chain in around[1:]:
                found = related(side, around[0], chain, opposite=False)
                side = side if found is None else found
    side = np.where(accepted, side, -1)
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
    label = connected_components_of(len(accepted), links)
    remaining: dict[int, tuple[set[int], set[int]]] = {}
    for chain, node in ends[~is_accepted].tolist():
        members, around = remaining.setdefault(label[chain], (set(), set()))
        members.add(chain)
        around.update(ends[is_accepted & (ends[:, 1] == node), 0].tolist())
    return [(sorted(members), sorted(around)) for members, around in remaining.values()]
