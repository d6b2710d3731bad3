"""Transport of nodes over many edge lengths to match a density.

All nodes move at once from where training points have too many winners to where they have too few. Elements are
grouped in clusters. With m_c the mass of the training points in cluster c over that of its share of the elements,
cluster c requires a net inflow of log m_c nodes per node. The flux between neighbours is the difference of a potential
times the length of their common boundary over their distance: Poisson's equation in finite volumes, with no flux across
boundaries and interfaces. Displacements that cause these fluxes are a smooth field, so that nodes do not overtake each
other.

This is the first step of Newton's method for the Monge-Ampere equation of optimal transport, as in Budd, Huang and
Russell, "Adaptivity with moving grids", Acta Numerica 18 (2009), for the empirical density from which a self-organizing
map learns.
"""

from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from kohonen_adapt.arrays import Floats, Int32s, Ints, Mask, counted
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.threads import LIGHT, even_cuts, shared
from kohonen_adapt.kernels.triangle.arrays import SLIDING, Constraints
from kohonen_adapt.kernels.triangle.geometry import FLAT
from kohonen_adapt.kernels.triangle.transport import (
    find_directions,
    mark_spoiled,
    move_to_neighbour_mean,
    move_with_clusters,
    propose_step,
    slow_down,
    smooth_moves,
    stop_nodes,
    sum_weights,
)
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.host import ascending
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.training_points import Draw

__all__ = ["FLOWS", "POINTS", "Transport"]

POINTS = 0.25  # number of training points per node and round, four per cluster
CLUSTER = 32  # number of elements in a cluster
SMOOTHING = 1 / 16  # smoothing sweeps over clusters, per node in a row
FLOWS = 5  # maximum number of flows: with more rounds, a flow replaces several
BOUND = 0.7  # limit of the logarithm of the mass per round, because the inflow is linear in the logarithm
STEPS = 4  # maximum number of steps of a round, with flips after each: a step stretches elements by less than a fifth
STEP = 1.0  # maximum displacement of a single step, relative to the distance of neighbours
MIDDLES = 2  # number of attempts to repair elements by moving nodes to the middle, before the flow is slowed down
ATTEMPTS = 12  # number of all attempts
SLOWER = 0.125  # change of speed from ring to ring around nodes at rest, relative to the distance of neighbours
LEAKAGE = 1e-9  # of every cluster, relative to the conductance around
NEAREST = 0.1  # minimum distance of centres, which may coincide in nested clusters, relative to the common edges


@dataclass
class Transport:
    """Movable mesh whose nodes are transported.

    Attributes
    ----------
    movable
        Mesh to be changed.
    cluster
        Cluster of every element, an interval of a space-filling curve through each region, shape (m,).
    """

    movable: MovableMesh
    cluster: Ints

    @classmethod
    def of(cls, movable: MovableMesh, rank: Ints) -> "Transport":
        return cls(movable, clusters_of(movable.triangulation, rank))

    def carry(self, shown: Draw, winners: Ints, rounds: int = 1) -> None:
        """Move the nodes to where the points `shown` found too few winners.

        One flow replaces `rounds` rounds of transport.
        """
        move = self.moves(self.flow(shown, winners, rounds))
        far = self._reach(move)
        steps = min(STEPS * (1 + rounds) // 2, max(1, ceil(far / STEP)))
        step = Step.of(self.movable.triangulation, self.movable.constraints)
        for _ in range(steps):
            self._take(step, move, 1.0 / steps, ceil(far / steps / SLOWER))
            self.movable.flip()

    def flow(self, shown: Draw, winners: Ints, rounds: int = 1) -> Floats:
        tri, cluster = self.movable.triangulation, self.cluster
        mass = np.empty(len(cluster))
        sum_weights(winners, shown.region, shown.weights, tri.elements, tri.star, mass)
        size = np.bincount(cluster).astype(np.float64)
        a, b, c = tri.elements.node.T
        sums = np.stack([np.bincount(cluster, x[a] + x[b] + x[c]) for x in tri.position.T.copy()], axis=1)
        centre = sums / (3.0 * size[:, None])
        row, column, length = self._crossings()
        direction = centre[column] - centre[row]
        conductance = length / np.maximum(np.hypot(*direction.T), NEAREST * length)
        links = symmetric(conductance, row, column, len(size))
        found = np.bincount(cluster, mass).astype(np.float64)
        height = potential(links, wanted_inflow(found, size, links, rounds * BOUND))
        carried = 0.5 * (conductance * (height[column] - height[row]))[:, None] * direction
        # flux across an edge covers half of the distance of the centres in each cluster
        flow = [np.bincount(row, x, len(size)) + np.bincount(column, x, len(size)) for x in carried.T]
        return self._smoothed(np.stack(flow, axis=1) / size[:, None], links)

    def _smoothed(self, flow: Floats, links: csr_array) -> Floats:
        """Return the flow without the errors of two-point fluxes between clusters.

        The flow is tangential on boundaries and interfaces. The errors are a fraction of the flow, whose length in
        edges increases with the number of nodes, and so does the number of smoothing sweeps.
        """
        mean = diags_array(1.0 / np.maximum(links.sum(axis=0), np.finfo(float).tiny)) @ links
        along, count = np.empty((len(flow), 3)), np.empty(len(flow))
        find_directions(self.movable.triangulation.elements.node, self.movable.constraints, self.cluster, count, along)
        xx, xy, yy = along.T
        for _ in range(int(SMOOTHING * np.sqrt(self.movable.nnodes))):
            x, y = (0.5 * (flow + mean @ flow)).T
            flow = np.stack([xx * x + xy * y, xy * x + yy * y], axis=1)
        return flow

    def _crossings(self) -> tuple[Ints, Ints, Floats]:
        tri, cluster = self.movable.triangulation, self.cluster
        elements = tri.elements
        e, k = np.nonzero((elements.neighbour > np.arange(len(cluster))[:, None]) & (elements.chain < 0))
        ends = ascending(cluster[e], cluster[elements.neighbour[e, k]])
        apart = ends[0] != ends[1]
        length = lengths(tri.position, *elements.ends(e[apart], k[apart]))
        both = coo_array((length, ends[:, apart]), shape=(len(cluster), len(cluster)))
        both.sum_duplicates()
        return *both.coords, both.data

    def moves(self, flow: Floats) -> Floats:
        star, constraints, n = self.movable.triangulation.star, self.movable.constraints, self.movable.nnodes
        cuts, moves = even_cuts(n, LIGHT), np.empty((2, n, 2))

        def smooth(thread: int, first: int, last: int) -> None:
            smooth_moves(star, constraints, moves[0], first, last, moves[1])

        shared(lambda _, *rows: move_with_clusters(star, constraints, self.cluster, flow, *rows, moves[0]), cuts)
        for _ in range(ceil(n**0.25)):  # smoothing removes jumps between clusters
            shared(smooth, cuts)
            moves = moves[::-1]
        return moves[0]

    def _reach(self, move: Floats) -> float:
        tri = self.movable.triangulation
        node = tri.elements.node
        doubled = np.bincount(node.ravel(), np.repeat(TRIANGLE.determinant(tri.position.T[:, node.T]), 3))
        size = np.sqrt(np.maximum(doubled / 6.0, FLAT**2))
        return float(np.quantile(np.hypot(*move.T) / size, 0.99))

    def _take(self, step: "Step", move: Floats, fraction: float, rings: int) -> None:
        tri, constraints = self.movable.triangulation, self.movable.constraints
        cuts = even_cuts(tri.nnodes, LIGHT)
        ends = (step.target, step.parameter)
        shared(lambda _, *rows: propose_step(tri.position, constraints, move, fraction, *rows, *ends), cuts)
        self._mend(step, rings)
        slides = np.flatnonzero(constraints.kind == SLIDING)
        slides = slides[np.any(step.target[slides] != tri.position[slides], axis=1)]
        constraints.parameter[slides] = step.parameter[slides]
        tri.position[:] = step.target

    def _mend(self, step: "Step", rings: int) -> None:
        """Change a step where elements would be spoiled.

        Nodes move to the middle of their neighbours, or by less, or not at all. A node that does not move may block its
        neighbours, and so on through the mesh: therefore this is the last resort.
        """
        tri, constraints = self.movable.triangulation, self.movable.constraints
        node = tri.elements.node
        step.ring[:] = min(rings, tri.nnodes)
        self._mark(step)
        for attempt in range(ATTEMPTS):
            if not step.spoiled.any():
                break
            if attempt < MIDDLES:
                move_to_neighbour_mean(step.target, step.parameter, node, tri.star, constraints, step.spoiled)
            else:
                scratch = step.spoiled, step.ring, step.queue
                slow_down(tri.position, step.target, step.parameter, node, tri.star, constraints, *scratch)
            self._mark(step)
        floor = self.movable.euclidean_floor
        stop_nodes(tri.position, step.target, node, tri.star, floor, step.spoiled, step.queue)
        while self._mark_too_long(step):
            stop_nodes(tri.position, step.target, node, tri.star, floor, step.spoiled, step.queue)

    def _mark(self, step: "Step") -> None:
        tri = self.movable.triangulation
        arrays = tri.position, step.target, tri.elements.node, self.movable.euclidean_floor
        cuts = even_cuts(len(tri.elements.node), LIGHT)
        shared(lambda thread, first, last: mark_spoiled(*arrays, first, last, step.spoiled), cuts)

    def _mark_too_long(self, step: "Step") -> bool:
        tri, reach = self.movable.triangulation, self.movable.constraints.chains.reach
        chain = tri.elements.chain
        e, k = np.nonzero(chain >= 0)
        limited = (reach[chain[e, k]] < np.inf) & ~step.spoiled[e]
        e, k = e[limited], k[limited]
        ends = tri.elements.ends(e, k)
        length = lengths(step.target, *ends)
        too_long = (length > reach[chain[e, k]]) & (length > lengths(tri.position, *ends))
        step.spoiled[e[too_long]] = True
        return bool(too_long.any())


class Step(NamedTuple):
    """Target and parameter of every node, elements that are spoiled, and scratch.

    An element is spoiled if its quality would fall below both the floor and its quality before.
    """

    target: Floats
    parameter: Floats
    spoiled: Mask
    ring: Int32s
    queue: Int32s

    @classmethod
    def of(cls, triangulation: Triangulation, constraints: Constraints) -> "Step":
        n = triangulation.nnodes
        m = len(triangulation.elements.node)
        return cls(
            np.empty((n, 2)),
            constraints.parameter.copy(),
            np.empty(m, bool),
            np.empty(n, np.int32),
            np.empty(max(n, m), np.int32),
        )


def lengths(position: Floats, a: Ints, b: Ints) -> Floats:
    return np.hypot(*(position[b] - position[a]).T)


def clusters_of(triangulation: Triangulation, rank: Ints) -> Ints:
    region, node = triangulation.elements.region, triangulation.elements.node
    order = np.argsort(rank[node[:, 0]], kind="stable")
    order = order[np.argsort(region[order], kind="stable")]
    count = np.bincount(region)
    clusters = np.maximum(1, np.round(count / CLUSTER).astype(np.int64))
    along = region[order]
    cluster = np.empty(len(order), np.int32)
    cluster[order] = (np.cumsum(clusters) - clusters)[along] + counted(count) * clusters[along] // count[along]
    return cluster


def wanted_inflow(mass: Floats, size: Floats, links: csr_array, bound: float = BOUND) -> Floats:
    """Return the inflow that every cluster requires, in elements, shape (c,).

    The sum is zero over clusters between which nodes can flow. `bound` limits the logarithm of the mass relative to the
    share of a cluster.
    """
    parts = connected_components(links, directed=False)[1]

    def mean(sums: Floats) -> Floats:
        return (np.bincount(parts, sums) / np.bincount(parts, size))[parts]

    wanted = size * mean(mass)
    fraction = np.divide(mass, wanted, out=np.ones_like(mass), where=wanted > 0.0)
    few = 0.5 / size  # half an element's share is added to every cluster, because a mass may be 0
    asked = np.clip(np.log((fraction + few) / (1.0 + few)), -bound, bound)
    return (asked - mean(asked * size)) * size


def potential(links: csr_array, inflow: Floats) -> Floats:
    """Return the potential of the flow between clusters, shape (c,).

    The potential solves Poisson's equation with conductances `links` and the inflow of every cluster.
    """
    total = links.sum(axis=0)
    total[total == 0.0] = 1.0
    # the potential is determined except for a constant, which a small leakage fixes
    matrix = csc_array(diags_array(total * (1.0 + LEAKAGE)) - links)
    options = {"SymmetricMode": True}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve(inflow)


def symmetric(values: Floats, row: Ints, column: Ints, count: int) -> csr_array:
    upper = coo_array((values, (row, column)), shape=(count, count)).tocsr()
    return upper + upper.T
