"""Transport: nodes flow, all at once, from where training points have too many winners to where they have too few.

Clusters of elements exchange nodes like vessels exchange water. With m_c the mass of the training points in cluster c
over that of its share of the elements, the net inflow that cluster c asks for is log m_c nodes per node, and the flux
between neighbours is the difference of a potential times the length of their common outline over their distance:
Poisson's equation in finite volumes, with no flux across outlines. The moves that make up these fluxes are a smooth
field, so that nodes are carried many edge lengths far without one overtaking the other. That is the first step of
Newton's method for the Monge-Ampere equation of optimal transport, as in Budd, Huang and Russell, "Adaptivity with
moving grids", Acta Numerica 18 (2009), for the empirical density that a self-organizing map learns from.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import PAIRED, STRAIGHT, Constraints
from kohonen_adapt.kernels.threads import LIGHT, even_cuts, shared
from kohonen_adapt.kernels.triangle.transport import (
    find_crossings,
    find_directions,
    go_to_middle,
    hold_back,
    mark_spoiled,
    mark_too_long,
    measure_moves,
    move_with_clusters,
    share_out,
    slow_down,
    smooth_moves,
    step_ahead,
    take_step,
)
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.pairs import sliding_pairs
from kohonen_adapt.som.draw import Draw
from kohonen_adapt.som.poisson import potential

__all__ = ["FLOWS", "POINTS", "Transport"]

POINTS = 0.25  # training points per neuron and round: four in a cluster
CLUSTER = 32  # elements
SMOOTHING = 1 / 16  # sweeps over clusters, per node in a row
FLOWS = 5  # at most, however many rounds: each takes the place of as many as that leaves it
BOUND = 0.7  # of the logarithm of the mass, per round: what is asked for is linear in it
STEPS = 4  # at most for one round, and edges flip after each: elements are stretched by less than a fifth in one
STEP = 1.0  # of the distance of neighbours, below which no more steps are needed
MIDDLES = 2  # attempts to mend what a step spoils by going to the middle, before the flow is slowed down
ATTEMPTS = 12  # in all
SLOWER = 0.125  # of the distance of neighbours: the difference in speed from ring to ring around what stands still
NEAREST = 0.1  # of the edges between them: of two clusters, one around the other, the centres may coincide


@dataclass
class Transport:
    """A movable mesh whose nodes are carried.

    Attributes
    ----------
    movable
        What is carried.
    cluster
        The cluster of every element, (m,): stretches of a space-filling curve through each region.
    """

    movable: MovableMesh
    cluster: Ints

    @classmethod
    def of(cls, movable: MovableMesh, rank: Ints) -> "Transport":
        """Cut every region into clusters by the rank of nodes, (n,); elements keep theirs when edges flip."""
        return cls(movable, clusters_of(movable.triangulation, rank))

    @cached_property
    def constraints(self) -> Constraints:
        """Where nodes may go: as the mesh says, but that paired chains which are straight count as others do."""
        constraints = self.movable.constraints
        flags = constraints.chains.flags.copy()
        flags[constraints.chains.shape == STRAIGHT, PAIRED] = 0
        return constraints._replace(chains=constraints.chains._replace(flags=flags))

    @cached_property
    def pairs(self) -> tuple[Ints, Ints]:
        """Nodes of pairs on straight chains, which go along with one another, (k,) each; those on arcs stay."""
        node, partner = sliding_pairs(self.constraints)
        straight = (self.constraints.chains.shape == STRAIGHT)[self.constraints.own_chain[node]]
        return node[straight], partner[straight]

    def carry(self, shown: Draw, winners: Ints, rounds: int = 1) -> None:
        """Let the nodes flow to where these points found too few winners, as far as in that many rounds."""
        move = self.moves(self.flow(shown, winners, rounds))
        far = self._reach(move)
        steps = min(STEPS * (1 + rounds) // 2, max(1, ceil(far / STEP)))
        step = Step.of(self.movable.triangulation, self.constraints)
        for _ in range(steps):
            self._take(step, move, 1.0 / steps, ceil(far / steps / SLOWER))
            self.movable.flip()

    def flow(self, shown: Draw, winners: Ints, rounds: int = 1) -> Floats:
        """Mean displacement of the nodes of every cluster in that many rounds, (c, 2)."""
        tri, cluster = self.movable.triangulation, self.cluster
        mass = np.empty(len(cluster))
        share_out(winners, shown.region, shown.weights, tri.elements, tri.star, mass)
        size = np.bincount(cluster).astype(np.float64)
        a, b, c = tri.elements.node.T
        sums = np.stack([np.bincount(cluster, x[a] + x[b] + x[c]) for x in tri.position.T.copy()], axis=1)
        centre = sums / (3.0 * size[:, None])
        row, column, length = self._crossings()
        way = centre[column] - centre[row]
        conductance = length / np.maximum(np.hypot(*way.T), NEAREST * length)
        links = symmetric(conductance, row, column, len(size))
        found = np.bincount(cluster, weights=mass).astype(np.float64)
        height = potential(links, wanted_inflow(found, size, links, rounds * BOUND))
        carried = 0.5 * (conductance * (height[column] - height[row]))[:, None] * way
        # what crosses an edge has gone half of the way between the centres in either cluster
        flow = [np.bincount(row, x, len(size)) + np.bincount(column, x, len(size)) for x in carried.T]
        return self._smoothed(np.stack(flow, axis=1) / size[:, None], links)

    def _smoothed(self, flow: Floats, links: csr_array) -> Floats:
        """The flow without the errors that two-point fluxes make from cluster to cluster, along outlines on outlines.

        They are a share of the flow, and nodes go the farther, in edges, the more there are.
        """
        mean = diags_array(1.0 / np.maximum(links.sum(axis=0), np.finfo(float).tiny)) @ links
        along, count = np.empty((len(flow), 3)), np.empty(len(flow))
        find_directions(self.movable.triangulation.elements.node, self.constraints, self.cluster, count, along)
        xx, xy, yy = along.T
        for _ in range(int(SMOOTHING * np.sqrt(self.movable.nnodes))):
            x, y = (0.5 * (flow + mean @ flow)).T
            flow = np.stack([xx * x + xy * y, xy * x + yy * y], axis=1)
        return flow

    def _crossings(self) -> tuple[Ints, Ints, Floats]:
        """Pairs of clusters that share edges which nodes may cross, and the length of those edges."""
        tri, cluster = self.movable.triangulation, self.cluster
        most = 3 * len(cluster) // 2
        row, column, length = np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most)
        found = find_crossings(tri.position, tri.elements, cluster, row, column, length)
        low, high = np.minimum(row[:found], column[:found]), np.maximum(row[:found], column[:found])
        both = coo_array((length[:found], (low, high)), shape=(len(cluster), len(cluster)))
        both.sum_duplicates()
        return *both.coords, both.data

    def moves(self, flow: Floats) -> Floats:
        """The displacement of every node: that of the clusters around it, smoothed, along outlines on outlines."""
        star, constraints, n = self.movable.triangulation.star, self.constraints, self.movable.nnodes
        cuts, moves = even_cuts(n, LIGHT), np.empty((2, n, 2))

        def begin(thread: int, first: int, last: int) -> None:
            move_with_clusters(star, constraints, self.cluster, flow, first, last, moves[0])

        def smooth(thread: int, first: int, last: int) -> None:
            smooth_moves(star, constraints, moves[0], first, last, moves[1])

        shared(begin, cuts)
        for _ in range(ceil(n**0.25)):  # they smooth what jumps from cluster to cluster
            shared(smooth, cuts)
            moves = moves[::-1]
        return self._alike(moves[0])

    def _alike(self, move: Floats) -> Floats:
        """The moves, those of pairs the mean of both along their chains."""
        chains, own = self.constraints.chains, self.constraints.own_chain
        along = [chains.direction[own[nodes]] for nodes in self.pairs]
        far = sum(np.sum(t * move[nodes], axis=1) for t, nodes in zip(along, self.pairs, strict=True))
        for t, nodes in zip(along, self.pairs, strict=True):
            move[nodes] = 0.5 * far[:, None] * t
        return move

    def _reach(self, move: Floats) -> float:
        """How far nodes go, in distances of neighbours, all but one in a hundred."""
        tri, ratio = self.movable.triangulation, np.empty(self.movable.nnodes)

        def measure(thread: int, first: int, last: int) -> None:
            measure_moves(tri.position, tri.star, move, first, last, ratio)

        shared(measure, even_cuts(tri.nnodes, LIGHT))
        return float(np.quantile(ratio, 0.99))

    def _take(self, step: "Step", move: Floats, share: float, rings: int) -> None:
        """Let all nodes go a share of their moves, as far as that spoils no element."""
        tri, constraints = self.movable.triangulation, self.constraints
        nodes = even_cuts(tri.nnodes, LIGHT)

        def go(thread: int, first: int, last: int) -> None:
            step_ahead(tri.position, constraints, move, share, first, last, step.ahead, step.parameter)

        def take(thread: int, first: int, last: int) -> None:
            take_step(tri.position, constraints, step.ahead, step.parameter, first, last)

        shared(go, nodes)
        self._together(step)
        self._mend(step, rings)
        shared(take, nodes)

    def _mend(self, step: "Step", rings: int) -> None:
        """Change a step where it spoils elements: nodes go to the middle, or slower, or stay where they are.

        Who stays may hold the next one back, and so on through all of the mesh: that is the last resort.
        """
        tri, constraints, node = self.movable.triangulation, self.constraints, self.movable.triangulation.elements.node
        step.ring[:] = min(rings, tri.nnodes)
        self._mark(step)
        for attempt in range(ATTEMPTS):
            if not step.spoiled.any():
                break
            if attempt < MIDDLES:
                go_to_middle(step.ahead, step.parameter, node, tri.star, constraints, step.spoiled)
            else:
                room = step.spoiled, step.ring, step.queue
                slow_down(tri.position, step.ahead, step.parameter, node, tri.star, constraints, *room)
            self._together(step)
            self._mark(step)
        while True:
            hold_back(tri.position, step.ahead, node, tri.star, self.movable.floor, step.spoiled, step.queue)
            while mark_too_long(tri.position, step.ahead, tri.elements, constraints.chains, step.spoiled):
                hold_back(tri.position, step.ahead, node, tri.star, self.movable.floor, step.spoiled, step.queue)
            if not self._wait(step):
                break
            self._mark(step)  # who waits for a partner may be in the way of others

    def _mark(self, step: "Step") -> None:
        """Mark the elements that a step spoils."""
        tri = self.movable.triangulation
        arrays = tri.position, step.ahead, tri.elements.node, self.movable.floor
        cuts = even_cuts(len(tri.elements.node), LIGHT)
        shared(lambda thread, first, last: mark_spoiled(*arrays, first, last, step.spoiled), cuts)

    def _together(self, step: "Step") -> None:
        """Let nodes of pairs go to the mean of the places that both would go to."""
        if len(self.pairs[0]) == 0:
            return
        own, now = self.constraints.own_chain, self.constraints.parameter
        place = np.mean([np.where(self._stay(step, v), now[v], step.parameter[v]) for v in self.pairs], axis=0)
        for nodes in self.pairs:
            goes = place != now[nodes]
            step.parameter[nodes] = place
            step.ahead[nodes] = self.movable.triangulation.position[nodes]
            step.ahead[nodes[goes]] = self.movable.outline.points_on(own[nodes[goes]], place[goes])

    def _stay(self, step: "Step", nodes: Ints) -> Mask:
        """Which nodes are to stay where they are."""
        return np.all(step.ahead[nodes] == self.movable.triangulation.position[nodes], axis=1)

    def _wait(self, step: "Step") -> bool:
        """Let nodes of pairs stay whose partner does; returns whether there were such."""
        one, other = (self._stay(step, nodes) for nodes in self.pairs)
        for nodes in self.pairs:
            step.ahead[nodes[one != other]] = self.movable.triangulation.position[nodes[one != other]]
        return bool(np.any(one != other))


class Step(NamedTuple):
    """Where nodes are about to be, (n, 2), and at which parameter, (n,); elements that this spoils, (m,); scratch."""

    ahead: Floats
    parameter: Floats
    spoiled: Mask
    ring: NDArray[np.int32]
    queue: NDArray[np.int32]

    @classmethod
    def of(cls, triangulation: Triangulation, constraints: Constraints) -> "Step":
        """Room for steps, one after the other."""
        n, m = triangulation.nnodes, len(triangulation.elements.node)
        return cls(
            np.empty((n, 2)),
            constraints.parameter.copy(),
            np.empty(m, dtype=np.bool_),
            np.empty(n, dtype=np.int32),
            np.empty(max(n, m), dtype=np.int32),
        )


def clusters_of(triangulation: Triangulation, rank: Ints) -> Ints:
    """The cluster of every element, (m,) int32, by the rank of nodes along a space-filling curve, (n,)."""
    region, node = triangulation.elements.region, triangulation.elements.node
    order = np.argsort(rank[node[:, 0]], kind="stable")
    order = order[np.argsort(region[order], kind="stable")]
    count = np.bincount(region)
    clusters = np.maximum(1, np.round(count / CLUSTER).astype(np.int64))
    place = np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    along = region[order]
    cluster = np.empty(len(order), dtype=np.int32)
    cluster[order] = (np.cumsum(clusters) - clusters)[along] + place * clusters[along] // count[along]
    return cluster


def wanted_inflow(mass: Floats, size: Floats, links: csr_array, bound: float = BOUND) -> Floats:
    """The nodes that every cluster asks for, in elements; zero in sum wherever nodes can flow, (c,).

    `bound` is of the logarithm of what it has over its share.
    """
    parts = connected_components(links, directed=False)[1]
    mean = (np.bincount(parts, weights=mass) / np.bincount(parts, weights=size))[parts]
    share = np.divide(mass, size * mean, out=np.ones_like(mass), where=mean > 0.0)
    few = 0.5 / size  # half an element's share more in every cluster, for there may be none
    asked = np.clip(np.log((share + few) / (1.0 + few)), -bound, bound)
    return (asked - (np.bincount(parts, weights=asked * size) / np.bincount(parts, weights=size))[parts]) * size


def symmetric(values: Floats, row: Ints, column: Ints, count: int) -> csr_array:
    """A matrix with these entries, and the same below its diagonal."""
    upper = coo_array((values, (row, column)), shape=(count, count)).tocsr()
    return upper + upper.T
