"""Layers of elements across thin subdomains: their two sides, and levels of nodes that keep those apart.

Across a subdomain there are k layers if every way over its edges from one side to the other has k edges or more. Levels
certify it: 0 on one side, k on the other, and no edge joins nodes whose levels differ by more than 1. A node keeps its
level; what would make an edge against them is refused.
"""

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, triu
from scipy.sparse.csgraph import connected_components

from .kernels.across import Views, look_across, lower_to_steps
from .kernels.chains import Constraints
from .kernels.geometry import Elements
from .triangulation import Triangulation

__all__ = ["lay"]

LOOKS = (8, 2_000)  # at least from every chain, and about so many from all together
GLIMPSE = 0.1  # share of what either of two chains sees that is not yet facing each other
UNSURE = 0.5  # of the length by distance of the sides: what contradicts them with more may as well be them

Indices = NDArray[np.integer]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Looks(NamedTuple):
    """What the chains of a part see, a row for each point looked from."""

    start: Indices  # which of the chains
    end: Indices  # and which it sees
    weight: Floats  # length of the chain that the point stands for, by distance, less where it looks askance


@dataclass(frozen=True)
class Band:
    """Two sides of a subdomain that face each other.

    Attributes
    ----------
    name, number
        The subdomain, and how many layers it is to have.
    pairs
        (k, 2): the nodes of the edges of its part.
    sides
        The nodes on either side.
    """

    name: str
    number: int
    pairs: Indices
    sides: tuple[Indices, Indices]


def lay(triangulation: Triangulation, constraints: Constraints, layers: Mapping[str, int] | None) -> None:
    """Give the nodes of subdomains the levels that keep so many layers of elements across each, by name.

    Raises
    ------
    ValueError
        If `layers` is no mapping from names of subdomains to integers >= 1, a subdomain has no two sides or fewer
        layers than that, or subdomains touch so that no levels fit all.
    """
    wanted = checked(layers, triangulation.mesh.subdomains)
    bands: list[Band] = []
    for name, number in wanted.items():
        rows = np.asarray(triangulation.mesh.subdomains[name], dtype=np.int64)
        if not len(rows):
            raise ValueError(f"subdomain {name!r} has no elements, so it can have no layers.")
        for inside in parts_of(triangulation.elements, triangulation.region_of_input[rows]):
            bands += bands_of(triangulation, constraints, name, number, inside)
            triangulation.elements.layered[inside] = True
    if bands:
        for band in bands:
            check_number(triangulation.position, band)
        triangulation.elements.level[:] = levels_of(bands, triangulation.nnodes)


def checked(layers: Mapping[str, int] | None, subdomains: Mapping[str, Indices] | None) -> dict[str, int]:
    """How many layers each subdomain is to have."""
    if layers is None:
        return {}
    if not isinstance(layers, Mapping):
        raise ValueError(f"layers must map names of subdomains to numbers of layers; got {type(layers).__name__}.")
    names = [name for name in subdomains or {} if not name.startswith("gmsh:")]
    for name, number in layers.items():
        if name not in names:
            known = ", ".join(repr(known) for known in sorted(names)) or "none"
            raise ValueError(f"layers has {name!r}, which is no subdomain of the mesh; its subdomains are: {known}.")
        if not isinstance(number, int | np.integer) or isinstance(number, bool) or number < 1:
            raise ValueError(f"layers of subdomain {name!r} must be an integer >= 1; got {number!r}.")
    return {name: int(number) for name, number in layers.items()}


def parts_of(elements: Elements, regions: Indices) -> Iterator[Mask]:
    """The regions of every connected part of a subdomain, as masks (r,)."""
    inside = np.zeros(len(elements.layered), dtype=bool)
    inside[regions] = True
    e, k = np.nonzero(elements.neighbour >= 0)
    own, other = elements.region[e], elements.region[elements.neighbour[e, k]]
    both = inside[own] & inside[other]
    label = joined(own[both], other[both], len(inside))
    for part in np.unique(label[inside]):
        yield inside & (label == part)


def joined(a: Indices, b: Indices, count: int) -> Indices:
    """Number the sets of things that pairs join, (count,)."""
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def bands_of(
    triangulation: Triangulation, constraints: Constraints, name: str, number: int, inside: Mask
) -> Iterator[Band]:
    """The bands of one part of a subdomain; most have one.

    Raises
    ------
    ValueError
        If there is none.
    """
    elements = triangulation.elements
    across = elements.neighbour
    own = inside[elements.region]
    e, k = np.nonzero(own[:, None] & ((across < 0) | ~own[across]))
    nodes = np.stack([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]], axis=1)
    chains, chain = np.unique(elements.chain[e, k], return_inverse=True)
    looks = views_of(triangulation, constraints, inside, e, k, chains)
    ends = ends_of(chain, nodes)
    side = sides_of(looks, ends, len(chains))
    pairs = elements.node[own][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    found = False
    for first in np.unique(side[side >= 0] // 2):
        one, other = (np.unique(nodes[side[chain] == 2 * first + which]) for which in (0, 1))
        if len(one) and len(other):
            found = True
            yield Band(name, number, pairs, (one, other))
    if not found:
        raise ValueError(f"subdomain {name!r} has no two sides that face each other.")


def ends_of(chain: Indices, nodes: Indices) -> Indices:
    """The nodes in which chains meet: rows of a chain and a node of it, of the facets of these chains, (f, 2)."""
    rows = np.unique(np.stack([np.repeat(chain, 2), nodes.ravel()], axis=1), axis=0)
    return rows[np.bincount(rows[:, 1])[rows[:, 1]] > 1]


def views_of(
    triangulation: Triangulation, constraints: Constraints, inside: Mask, e: Indices, k: Indices, chains: Indices
) -> Looks:
    """What every one of the chains, to which the edges opposite to corners k of e belong, sees inward."""
    length = constraints.chains.length
    least, most = LOOKS
    looks = least + np.round(most * length[chains] / length[chains].sum())
    step = np.ones(len(length))
    step[chains] = length[chains] / looks
    rows = int(looks.sum()) + len(e)
    views = Views(np.empty(rows, dtype=np.int32), np.empty(rows, dtype=np.int32), np.empty(rows))
    count = look_across(triangulation.position, triangulation.elements, constraints, inside, e, k, step, views)
    start, end, nearness = (array[:count] for array in views)
    seen = (end >= 0) & (nearness < np.inf)
    start, end, nearness = start[seen], end[seen], nearness[seen]
    return Looks(np.searchsorted(chains, start), np.searchsorted(chains, end), step[start] * nearness)


def sides_of(looks: Looks, ends: Indices, count: int) -> Indices:
    """The side that every chain of a part is on, (count,): 2 i and 2 i + 1 face each other, -1 for none.

    Chains that see each other are on opposite sides, and those that touch are on the same one. Where both cannot be, as
    for the ends of a gap or the walls of a slot, the larger of their lengths by the distance decides. Runs of chains
    that are left belong to a side if they join nothing else; those that join two sides are the ends of gaps.
    """
    sides = Sides(count)
    weight = faced(sides, looks, count)
    group = np.array([sides.side(chain) // 2 for chain in range(count)])
    weights = np.bincount(group, weight, count)
    heard = np.zeros(count, dtype=bool)
    for number in np.argsort(-weights, kind="stable"):
        enough = UNSURE * np.bincount(group, heard, count).astype(bool) @ weights
        if not weights[number]:
            break
        more = heard | (group == number)
        tried = sides.copy()
        if all(tried.relate(a, b, False) for a, b in touching(ends[more[ends[:, 0]]])):
            sides, heard = tried, more
        elif weights[number] > enough:
            return np.full(count, -1)
    return with_runs(sides, heard, ends)


def faced(sides: "Sides", looks: Looks, count: int) -> Floats:
    """Relate chains that see each other, first the longest and nearest; returns what each adds, (count,)."""
    seen = coo_array((looks.weight, (looks.start, looks.end)), shape=(count, count)).tocsr()
    total, weight = seen.sum(axis=1), np.zeros(count)
    facing = triu(seen.minimum(seen.T)).tocoo()
    order = np.argsort(-facing.data, kind="stable")
    for a, b, mutual in zip(facing.row[order], facing.col[order], facing.data[order], strict=True):
        if mutual > GLIMPSE * min(total[a], total[b]) and sides.relate(a, b, True):
            weight[a] += mutual
    return weight


def with_runs(sides: "Sides", heard: Mask, ends: Indices) -> Indices:
    """The sides of the chains that were heard, and of the runs of others between chains of one side, (c,)."""
    runs = runs_between(ends, heard)
    for _, around in runs:
        sides.join(around)
    side = np.where(heard, [sides.side(chain) for chain in range(len(heard))], -1)
    for run, around in runs:
        found = np.unique(side[around])
        side[run] = found[0] if len(found) == 1 else -1
    return side


def touching(ends: Indices) -> Indices:
    """Pairs of chains that end at the same node, each with the next one there; rows of `ends` are chain and node."""
    ends = ends[np.argsort(ends[:, 1], kind="stable")]
    same = ends[1:, 1] == ends[:-1, 1]
    return np.stack([ends[:-1, 0][same], ends[1:, 0][same]], axis=1)


def runs_between(ends: Indices, heard: Mask) -> list[tuple[list[int], list[int]]]:
    """The chains that were not heard, in runs that only others part, each with those others it comes to."""
    is_heard = heard[ends[:, 0]]
    links = touching(ends[~np.isin(ends[:, 1], ends[is_heard, 1])])
    label = joined(links[:, 0], links[:, 1], len(heard))
    others: dict[int, list[int]] = {}
    for chain, node in ends[is_heard].tolist():
        others.setdefault(node, []).append(chain)
    runs: dict[int, tuple[set[int], set[int]]] = {}
    for chain, node in ends[~is_heard].tolist():
        run, around = runs.setdefault(label[chain], (set(), set()))
        run.add(chain)
        around.update(others.get(node, ()))
    return [(sorted(run), sorted(around)) for run, around in runs.values()]


class Sides:
    """Which chains are on the same side, and which on opposite ones; what contradicts that is not heard."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))
        self._opposite = [False] * count  # to the parent
        self._size = [1] * count

    def copy(self) -> "Sides":
        """What is known now."""
        other = Sides(0)
        other._parent, other._opposite, other._size = self._parent.copy(), self._opposite.copy(), self._size.copy()
        return other

    def _root(self, chain: int) -> tuple[int, bool]:
        """One chain for all that are related, and whether this one is opposite to it."""
        opposite = False
        while self._parent[chain] != chain:
            opposite ^= self._opposite[chain]
            chain = self._parent[chain]
        return chain, opposite

    def side(self, chain: int) -> int:
        """A number that is odd on one side and even on the opposite one."""
        root, opposite = self._root(chain)
        return 2 * root + opposite

    def relate(self, a: int, b: int, opposite: bool) -> bool:
        """Two chains are on opposite sides, or on the same one; returns whether that was heard."""
        (a, of_a), (b, of_b) = self._root(a), self._root(b)
        if a == b:
            return of_a ^ of_b == opposite
        if self._size[a] < self._size[b]:
            a, b = b, a
        self._parent[b], self._opposite[b] = a, of_a ^ of_b ^ opposite
        self._size[a] += self._size[b]
        return True

    def join(self, chains: list[int]) -> None:
        """What is between these is one side, unless some of them are opposite."""
        found = {self.side(chain) for chain in chains}
        if not any(side ^ 1 in found for side in found):
            for chain in chains[1:]:
                self.relate(chains[0], chain, False)


def check_number(position: Floats, band: Band) -> None:
    """Refuse a band with fewer layers than are to be kept."""
    steps = np.full(len(position), band.number)
    steps[band.sides[0]] = 0
    lower_to_steps(band.pairs, steps)
    least = band.sides[1][np.argmin(steps[band.sides[1]])]
    if steps[least] < band.number:
        x, y = position[least]
        plural = "" if steps[least] == 1 else "s"
        raise ValueError(
            f"subdomain {band.name!r} has {steps[least]} layer{plural} of elements between its sides near "
            f"({x:.6g}, {y:.6g}); layers asks for {band.number}: refine it there first."
        )


def levels_of(bands: list[Band], count: int) -> Indices:
    """Levels of the nodes: those of the sides, and between them as near to the middle as steps of 1 allow, (count,).

    Raises
    ------
    ValueError
        If bands touch so that no levels fit all.
    """
    level, known = levels_of_sides(bands, count)
    pairs = np.concatenate([band.pairs for band in bands])
    top = int(np.max(np.abs(level)))
    most, least, middle = np.where(known, level, top), np.where(known, -level, top), np.full(count, top)
    for band in bands:
        middle[np.concatenate([*band.sides, band.pairs.ravel()])] = (
            level[band.sides[0][0]] + level[band.sides[1][0]]
        ) // 2
    for value in (most, least, middle):
        lower_to_steps(pairs, value)
    if not np.array_equal(most[known], level[known]):
        raise contradiction(bands)
    return np.where(np.bincount(pairs.ravel(), minlength=count) > 0, np.minimum(most, np.maximum(-least, middle)), 0)


def levels_of_sides(bands: list[Band], count: int) -> tuple[Indices, Mask]:
    """Levels of the nodes on sides, and which nodes those are; sides that share nodes have the same level."""
    sides = [side for band in bands for side in band.sides]
    number = np.repeat(np.arange(len(sides)), [len(side) for side in sides])
    label = joined(number, len(sides) + np.concatenate(sides), len(sides) + count)
    ways: dict[int, list[tuple[int, int]]] = {}
    for i, band in enumerate(bands):
        a, b = label[2 * i], label[2 * i + 1]
        ways.setdefault(a, []).append((b, band.number))
        ways.setdefault(b, []).append((a, band.number))
    found: dict[int, int] = {}
    for start in ways:
        found.setdefault(start, 0)
        waiting = deque([start])
        while waiting:
            a = waiting.popleft()
            for b, step in ways[a]:
                if b not in found:
                    found[b] = found[a] + (step if found[a] <= 0 else -step)
                    waiting.append(b)
    if any(abs(found[label[2 * i]] - found[label[2 * i + 1]]) != band.number for i, band in enumerate(bands)):
        raise contradiction(bands)
    level, known = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=bool)
    for i, side in enumerate(sides):
        level[side], known[side] = found[label[i]], True
    return level, known


def contradiction(bands: list[Band]) -> ValueError:
    """The error where what is asked for in one place cannot be had in another."""
    names = ", ".join(sorted({repr(band.name) for band in bands}))
    return ValueError(f"subdomains with layers touch so that not all can have theirs ({names}); ask for fewer of them.")
