"""Recycling by energy on tetrahedra, by exchanges of nodes."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Ints, Mask, sorted_below
from kohonen_adapt.kernels.numba.compilation import zeros
from kohonen_adapt.kernels.tetrahedron.arrays import Cavity, Offers, OpenTetrahedra, Quadratic, Queue, Trial
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES
from kohonen_adapt.kernels.tetrahedron.polish.exchange import (
    SCRATCH_ROWS,
    exchange,
    weigh_collapses,
    weigh_splits,
)
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.mesh.tetrahedralization import faces_of, faces_on
from kohonen_adapt.polishing.space.surface_values import EDGES_OF_FACES

__all__ = [
    "EXCHANGES",
    "MANY",
    "Function",
    "Plan",
    "edges_of_patches",
    "empty_offers",
    "exchanged",
    "nodes_of",
    "on_patches",
    "sample_of",
    "size_of",
    "weighed",
]

Function = tuple[Trial, Quadratic | None]  # at order 1 without coefficients of edges

FEW, PART = 1_000, 5_000  # nodes per thread at least, and per compiled call
SPLITS = 10_000  # edges per compiled call
SPARE = 4  # spare rows per node (inverse) at order 2
MORE = 2 * SCRATCH_ROWS  # further spare rows
FRACTION, SAMPLE, SEED = 7, 500, 0  # of nodes for the price of the first swaps (inverse), least number, random seed
# Most exchanges per recycling of a whole plan, by order. Later nodes undo the effect of more.
EXCHANGES = 1, 3
MANY = 0.02  # splits over nodes, below which an exchange is the last of its recycling

# Smallest gain of a split, relative to the cost of its collapse, at order 2 both per unknown. At order 1 gains are
# underestimated and costs overestimated, because both are computed without the sweeps and swaps that follow. With 1,
# exchanges end after one pass, and the error is 5 % higher.
MARGIN = 0.2, 1.2


class Plan(NamedTuple):
    offers: Offers
    edges: Ints  # by decreasing gain
    nodes: Ints  # by increasing cost
    price: float  # at which gains and costs are equal


def sample_of(nodes: Ints) -> Ints:
    return np.sort(np.random.default_rng(SEED).permutation(nodes)[: max(SAMPLE, len(nodes) // FRACTION)])


def empty_offers(mesh: OpenTetrahedra, is_open: Mask, removable: Mask, lone: Mask) -> Offers:
    rows = len(mesh.position)
    return zeros(Offers, (len(mesh.elements.node), 6), np.full(rows, np.inf), is_open, removable, lone, rows)


def margin_of(function: Function) -> float:
    return MARGIN[0 if function[1] is None else 1]


def weighed(mesh: OpenTetrahedra, function: Callable[[], Function], offers: Offers, nodes: Ints, floor: float) -> Plan:
    """Compute the gains and costs at nodes.

    `function` returns the function with scratch of its thread. Costs above the largest worthwhile one are not computed.
    Gains and costs depend on the current mesh alone, and therefore not on the number of threads.
    """
    count = len(nodes)
    rows = (len(mesh.position), len(mesh.elements.node))
    cuts = even_cuts(count, max(FEW, count // SCRATCH_ROWS))
    own = [mesh, *(mesh._replace(cavity=Cavity.of(*rows)) for _ in cuts[2:])]

    def weigh_edges(thread: int, first: int, last: int) -> None:
        spare = int(mesh.pool.free_nodes[mesh.pool.height[0] - 1 - thread])
        for v in range(first, last, PART):
            weigh_splits(own[thread], *function(), offers, spare, floor, nodes[v : min(v + PART, last)])

    shared(weigh_edges, cuts)
    most = float(offers.gain.max()) / min(1.0, margin_of(function()))

    def weigh_nodes(thread: int, first: int, last: int) -> None:
        for v in range(first, last, PART):
            weigh_collapses(own[thread], *function(), offers, most, floor, nodes[v : min(v + PART, last)])

    shared(weigh_nodes, cuts)
    edges, removed = sorted_below(-offers.gain.ravel(), 0.0), sorted_below(offers.cost, most)
    gains, costs = np.append(offers.gain.ravel()[edges], 0.0), np.append(offers.cost[removed], most)
    count = min(len(gains), len(costs))
    return Plan(offers, edges, removed, float(gains[np.argmax(gains[:count] <= costs[:count])]))


def exchanged(
    mesh: OpenTetrahedra, function: Function, queue: Queue, plan: Plan, added: int, floor: float
) -> tuple[int, float]:
    # `added` is the number of unknowns added so far. Returned are the number of splits and the decrease.
    offers, edges, nodes, _ = plan
    ends, gains = mesh.elements.node[edges[:, None] // 6, EDGES[edges % 6, :2]], offers.gain.ravel()[edges]
    state = np.array([added, 0])
    total, decrease = 0, 0.0
    for first in range(0, len(edges), SPLITS):
        rows = slice(first, first + SPLITS)
        lists = ends[rows], gains[rows], nodes, state
        splits, fall = exchange(mesh, *function, queue, offers, *lists, margin_of(function), floor)
        total, decrease = total + splits, decrease + fall
    return total, decrease


def on_patches(mesh: OpenTetrahedra, some: Mask) -> Mask:
    found, (e, k) = np.zeros(len(mesh.position), bool), faces_on(mesh.elements, some)
    found[faces_of(mesh.elements, e, k)] = True
    return found


def edges_of_patches(mesh: OpenTetrahedra, some: Mask) -> Mask:
    # edges of elements, (m, 6), also of elements without a face there
    node = mesh.elements.node
    count = len(mesh.position)
    used = np.flatnonzero(node[:, 0] >= 0)
    key = keys_of(ascending(node[used][:, EDGES[:, 0]], node[used][:, EDGES[:, 1]]), count)
    e, k = np.nonzero(np.append(some, False)[mesh.elements.patch[used]])
    found = np.zeros((len(node), 6), bool)
    found[used] = np.isin(key, key[e[:, None], EDGES_OF_FACES[k]])
    return found


def size_of(mesh: OpenTetrahedra) -> int:
    # By Euler's formula V - E + F - T is constant, and 2 F = 4 T + B with B outer faces, so V + E is 2 V + T + B / 2.
    used = mesh.elements.node[:, 0] >= 0
    outer = int(np.count_nonzero(mesh.elements.neighbour[used] < 0))
    return 2 * len(nodes_of(mesh)) + int(np.count_nonzero(used)) + outer // 2


def nodes_of(mesh: OpenTetrahedra) -> Ints:
    return np.flatnonzero(mesh.pool.anchor >= 0)
