"""Descent of a functional of order 2 on an open mesh of tetrahedra."""

from dataclasses import dataclass, field, replace
from threading import get_ident
from typing import ClassVar, Self

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask, padded, sorted_below
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.geometry.space.thread_parts import Parts
from kohonen_adapt.kernels.arrays import KernelMesh, Modes
from kohonen_adapt.kernels.tetrahedron.arrays import PLANE, Cavity, Offers, OpenTetrahedra, Quadratic, Queue, SolidBlock
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES
from kohonen_adapt.kernels.tetrahedron.polish.descend_order2 import descend_nodes_order2
from kohonen_adapt.kernels.tetrahedron.polish.exchange_order2 import (
    SCRATCH_ROWS,
    exchange_order2,
    weigh_collapses_order2,
    weigh_splits_order2,
)
from kohonen_adapt.kernels.tetrahedron.polish.swap_by_energy import enter_changed
from kohonen_adapt.kernels.tetrahedron.polish.swap_order2 import swap_downhill_order2
from kohonen_adapt.kernels.threads import Nodes, even_cuts, shared
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.polishing.space.curved_sides import CurvedEdges
from kohonen_adapt.polishing.space.descent import CHANGED, SpaceDescent, offers_of, on_patches, with_origins
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.polishing.space.surface_values import EDGES_OF_FACES

__all__ = ["QuadraticDescent"]

LOOKS = 10_000  # elements per compiled call, because Ctrl-C is handled between calls only
FEW, PART = 1_000, 5_000  # nodes per thread at least, and per compiled call
SPLITS = 10_000  # edges per compiled call
SPARE, MORE = 4, 2 * SCRATCH_ROWS  # spare rows per node (inverse), and further spare rows
FRACTION, SAMPLE, SEED = 7, 500, 0  # of nodes for the price of the first swaps (inverse), least number, random seed
# Most exchanges per recycling of a whole plan. Otherwise one is made, because later nodes undo the effect of more.
EXCHANGES = 3
MANY = 0.02  # splits over nodes, below which an exchange is the last of its recycling
MARGIN = 1.2  # smallest gain of a split per unknown, relative to the cost of its collapses


@dataclass(frozen=True)
class QuadraticDescent(SpaceDescent):
    """Descent of a functional of order 2 on an open mesh of tetrahedra.

    Attributes
    ----------
    modes
        Coefficients of the edges of all elements.
    size
        Number of unknowns at the start, up to a constant.
    curves
        Curved edges.
    blocks
        Scratch by thread.
    price
        Functional per unknown at which gains of splits and costs of collapses are equal, (1,). nan before gains are
        known.
    """

    modes: Modes
    size: int
    curves: CurvedEdges
    blocks: dict[int, SolidBlock] = field(default_factory=dict)
    price: Floats = field(default_factory=lambda: np.full(1, np.nan))

    sweeps_per_swap: ClassVar[int] = 2

    @classmethod
    def of(
        cls, movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction, recycled: Recycled
    ) -> "QuadraticDescent":
        if trial.modes is None:
            raise TypeError("a descent of order 2 requires coefficients of edges")
        spare = movable.nnodes + movable.nnodes // SPARE + MORE
        opened = with_origins(OpenSolid.of(movable, np.ones(movable.nnodes), spare, relief=1.0), recycled)
        nodes, elements = len(opened.mesh.position), len(opened.mesh.elements.node)
        modes = Modes(*(padded(array, elements, 0) for array in trial.modes))
        fixed, surface = padded(trial.fixed, nodes, False), trial.surface
        if len(surface):  # loads do no work if the values on their surfaces are given
            surface = padded(surface, nodes, 0.0)
            fixed |= on_patches(opened.mesh, functional.driven)
            modes.dirichlet[:] |= edges_of_patches(opened.mesh, functional.driven)
        own = functional.trial(padded(trial.values, nodes, 0.0), fixed, surface)
        rules, seen = (movable.polish_floor, movable.flips), np.zeros((elements, 2))
        common = movable, recycled, opened, functional, own, *rules, seen
        return cls(*common, modes, size_of(opened.mesh), CurvedEdges.of(movable, nodes))

    def copy(self) -> Self:
        modes, curves = Modes(*(array.copy() for array in self.modes)), self.curves.copy()
        return replace(super().copy(), modes=modes, curves=curves, blocks={}, price=self.price.copy())

    def value(self) -> float:
        mesh = self.opened.mesh
        return self.functional.value_on(
            mesh.position,
            mesh.elements,
            TrialFunction(self.trial.value, self.trial.fixed, self.modes, surface=self.trial.surface),
            self.curves,
        )

    def quadratic(self) -> Quadratic:
        thread = get_ident()
        block = self.blocks.get(thread) or self.blocks.setdefault(thread, self.curves.block())
        return Quadratic(self.trial, self.modes, self.functional.dirichlet[: self.functional.patches], block)

    def descend_nodes(self, thread: int, mesh: KernelMesh, nodes: Nodes) -> float:
        return float(descend_nodes_order2(mesh, self.quadratic(), nodes, self.floor**3))

    def swap(self, parts: Parts) -> float:
        if not self.swaps:
            return 0.0
        self.sample_source()
        mesh, queue, charge = self.opened.mesh, self.opened.queue, self.charge()
        free = (mesh.surfaces.shape == PLANE) & ~self.functional.held[: self.functional.patches]
        enter_changed(mesh, self.trial, queue, self.seen, CHANGED)

        def swap(part: OpenTetrahedra, own: Queue) -> float:
            parts = part, self.quadratic(), own, self.seen
            return float(swap_downhill_order2(*parts, free, charge, self.floor**3, LOOKS)[1])

        return parts.work_off(queue, swap)

    def charge(self) -> float:
        if np.isnan(self.price[0]):
            nodes = nodes_of(self.opened.mesh)
            sample = np.random.default_rng(SEED).permutation(nodes)[: max(SAMPLE, len(nodes) // FRACTION)]
            self.weigh(np.sort(sample))
        return float(self.price[0])

    def weigh(self, weighed: Ints) -> tuple[Offers, Ints, Ints]:
        # The price follows from the gains and costs at the weighed nodes.
        mesh, floor = self.opened.mesh, self.floor**3
        offers = offers_of(mesh, self.functional, self.trial)
        plane = (mesh.surfaces.shape == PLANE) & ~self.functional.held[: self.functional.patches]
        offers = offers._replace(open=plane, removable=offers.removable & ~self.curves.at_nodes(len(mesh.position)))
        count, rows = len(weighed), (len(mesh.position), len(mesh.elements.node))
        cuts = even_cuts(count, max(FEW, count // SCRATCH_ROWS))
        own = [mesh, *(mesh._replace(cavity=Cavity.of(*rows)) for _ in cuts[2:])]
        spare = mesh.pool.free_nodes[mesh.pool.height[0] - len(cuts) : mesh.pool.height[0]]

        def weigh_edges(thread: int, first: int, last: int) -> None:
            for v in range(first, last, PART):
                part = weighed[v : min(v + PART, last)]
                weigh_splits_order2(own[thread], self.quadratic(), offers, int(spare[thread]), floor, part)

        shared(weigh_edges, cuts)
        most = float(offers.gain.max())

        def weigh_nodes(thread: int, first: int, last: int) -> None:
            for v in range(first, last, PART):
                part = weighed[v : min(v + PART, last)]
                weigh_collapses_order2(own[thread], self.quadratic(), offers, most, floor, part)

        shared(weigh_nodes, cuts)
        edges, nodes = sorted_below(-offers.gain.ravel(), 0.0), sorted_below(offers.cost, most)
        gains, costs = np.append(offers.gain.ravel()[edges], 0.0), np.append(offers.cost[nodes], most)
        count = min(len(gains), len(costs))
        self.price[0] = gains[np.argmax(gains[:count] <= costs[:count])]
        return offers, edges, nodes

    def added(self) -> int:
        return size_of(self.opened.mesh) - self.size

    def recycle(self, whole: bool = True) -> tuple[int, float]:
        self.sample_source()
        mesh, total, decrease = self.opened.mesh, 0, 0.0
        for _ in range(EXCHANGES if whole else 1):
            before, (offers, edges, nodes) = total, self.weigh(nodes_of(mesh))
            ends = mesh.elements.node[edges[:, None] // 6, EDGES[edges % 6, :2]]
            gains, state = offers.gain.ravel()[edges], np.array([self.added(), 0])
            for first in range(0, len(edges), SPLITS):
                rows = slice(first, first + SPLITS)
                lists = ends[rows], gains[rows], nodes, state
                splits, _, fall = exchange_order2(mesh, self.quadratic(), offers, *lists, MARGIN, self.floor**3)
                total, decrease = total + splits, decrease + fall
            if total - before <= MANY * len(nodes_of(mesh)):
                break
        return total, decrease


def edges_of_patches(mesh: OpenTetrahedra, some: Mask) -> Mask:
    # edges of elements, (m, 6), also of elements without a face there
    node, count = mesh.elements.node, len(mesh.position)
    used = np.flatnonzero(node[:, 0] >= 0)
    key = keys_of(ascending(node[used][:, EDGES[:, 0]], node[used][:, EDGES[:, 1]]), count)
    e, k = np.nonzero(np.append(some, False)[mesh.elements.patch[used]])
    found = np.zeros((len(node), 6), dtype=np.bool_)
    found[used] = np.isin(key, key[e[:, None], EDGES_OF_FACES[k]])
    return found


def size_of(mesh: OpenTetrahedra) -> int:
    # By Euler's formula V - E + F - T is constant, and 2 F = 4 T + B with B outer faces, so V + E is 2 V + T + B / 2.
    used = mesh.elements.node[:, 0] >= 0
    outer = int(np.count_nonzero(mesh.elements.neighbour[used] < 0))
    return 2 * len(nodes_of(mesh)) + int(np.count_nonzero(used)) + outer // 2


def nodes_of(mesh: OpenTetrahedra) -> Ints:
    return np.flatnonzero(mesh.pool.anchor >= 0)
