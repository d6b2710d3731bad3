"""Descent of a functional of order 1 on tetrahedra, with swaps and recycling."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from kohonen_adapt.arrays import Floats, Mask, padded, sorted_below
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.geometry.space.thread_parts import Parts
from kohonen_adapt.kernels.arrays import KernelMesh
from kohonen_adapt.kernels.tetrahedron.arrays import (
    FOLLOWS,
    HELD,
    INSIDE,
    PLANE,
    Cavity,
    Constraints,
    Freedom,
    Offers,
    OpenTetrahedra,
    Queue,
    Trial,
)
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES, OPPOSITE
from kohonen_adapt.kernels.tetrahedron.polish.descend import descend_nodes
from kohonen_adapt.kernels.tetrahedron.polish.energy_recycle import exchange, weigh_collapses, weigh_splits
from kohonen_adapt.kernels.tetrahedron.polish.swap_by_energy import enter_changed, swap_downhill
from kohonen_adapt.kernels.threads import Nodes, even_cuts, shared
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.polish import SETTLED
from kohonen_adapt.polishing.space.applied_field import renew_field, start_field, with_loads_of_faces
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.polishing.space.surface_values import faces_on
from kohonen_adapt.problem.boundary_terms import applied_field

__all__ = ["SpaceDescent", "offers_of", "on_patches", "recycle_in_space", "swap_in_space", "with_origins"]

LOOKS = 50_000  # elements per compiled call, at most 0.5 s, because Ctrl-C is handled between calls only
FEW = 1_000  # nodes per thread at least
PART = 20_000  # nodes per compiled call
PAIRS = 20_000  # edges per compiled call
CHANGED = 0.1  # relative change of volume or energy after which an element is searched again

# Smallest gain of a split, relative to the cost of its collapse. Gains are underestimated and costs overestimated,
# because both are computed without the sweeps and swaps that follow. With 1, exchanges end after one pass, and the
# error is 5 % higher.
MARGIN = 0.2


def swap_in_space(
    opened: OpenSolid, parts: Parts, functional: SolidFunctional, trial: Trial, seen: Floats, floor: float
) -> float:
    """Swap while the functional decreases, and return the decrease.

    `seen` (m, 2) holds volume and energy of elements at their last search. Elements that have changed since are
    searched again. Edges on patches change only if the domain and the Dirichlet values stay the same.
    """
    mesh, queue = opened.mesh, opened.queue
    free = (mesh.surfaces.shape == PLANE) & ~functional.held[: functional.patches]
    enter_changed(mesh, trial, queue, seen, CHANGED)

    def swap(part: OpenTetrahedra, own: Queue) -> float:
        return float(swap_downhill(part, trial, own, seen, free, floor**3, LOOKS)[1])

    return parts.work_off(queue, swap)


def recycle_in_space(opened: OpenSolid, functional: SolidFunctional, trial: Trial, floor: float) -> tuple[int, float]:
    """Split edges and collapse nodes in pairs while the gain exceeds the cost.

    Returned are the number of pairs and the decrease of the functional, negative for an increase. New elements
    enter the queue of swaps.
    """
    mesh, offers = opened.mesh, offers_of(opened.mesh, functional, trial)
    most = compute_gains(mesh, trial, offers, floor**3)
    gain, node = offers.gain.ravel(), mesh.elements.node
    edges = sorted_below(-gain, -max(0.0, MARGIN * offers.cost.min(initial=0.0)))
    ends = node[edges[:, None] // 6, EDGES[edges % 6, :2]]
    nodes = sorted_below(offers.cost, most)
    pairs, decrease = 0, 0.0
    for i in range(0, len(edges), PAIRS):
        part = ends[i : i + PAIRS], gain[edges[i : i + PAIRS]]
        more, fall = exchange(mesh, trial, opened.queue, offers, *part, nodes, MARGIN, floor**3)
        pairs, decrease = pairs + more, decrease + fall
    return pairs, decrease


def offers_of(mesh: OpenTetrahedra, functional: SolidFunctional, trial: Trial) -> Offers:
    patches, rows = slice(functional.patches), len(mesh.position)
    removable = (functional.freedom(mesh.freedom, trial.fixed, trial.surface).number != HELD) & (mesh.pool.anchor >= 0)
    if len(trial.applied):
        removable &= trial.applied[:, FOLLOWS] == 0.0
    lone = trial.fixed & ~on_patches(mesh, functional.dirichlet[patches] | functional.driven)
    is_open = ~(functional.held | functional.dirichlet)[patches]
    gain, cost = np.zeros((len(mesh.elements.node), 6)), np.full(rows, np.inf)
    return Offers(gain, cost, is_open, removable, lone, np.zeros(rows, dtype=np.bool_))


def on_patches(mesh: OpenTetrahedra, some: Mask) -> Mask:
    found, (e, k) = np.zeros(len(mesh.position), dtype=np.bool_), faces_on(mesh, some)
    found[mesh.elements.node[e[:, None], OPPOSITE[k]]] = True
    return found


def compute_gains(mesh: OpenTetrahedra, trial: Trial, offers: Offers, floor: float) -> float:
    """Compute all gains and costs, and return the largest worthwhile cost.

    Larger costs are not computed. Gains and costs depend on the current mesh alone, and therefore not on the
    number of threads.
    """
    cuts = even_cuts(len(mesh.position), FEW)
    rows = len(mesh.position), len(mesh.elements.node)
    own = [mesh, *(mesh._replace(cavity=Cavity.of(*rows)) for _ in cuts[2:])]

    def weigh_edges(thread: int, first: int, last: int) -> None:
        for v in range(first, last, PART):
            weigh_splits(own[thread], trial, offers, floor, v, min(v + PART, last))

    shared(weigh_edges, cuts)
    most = float(offers.gain.max()) / MARGIN

    def weigh_nodes(thread: int, first: int, last: int) -> None:
        for v in range(first, last, PART):
            weigh_collapses(own[thread], trial, offers, most, floor, v, min(v + PART, last))

    shared(weigh_nodes, cuts)
    return most


def with_origins(opened: OpenSolid, recycled: Recycled) -> OpenSolid:
    origins, n = opened.mesh.origins, len(recycled.old)
    origins.old[:n], origins.start_element[:n] = recycled.old, recycled.start_element
    return opened


@dataclass(frozen=True)
class SpaceDescent:
    """Descent of a functional on an open mesh of tetrahedra.

    Attributes
    ----------
    movable
        Mesh before the descent, which changes at the close.
    recycled
        Nodes recycled before.
    opened
        Mesh with spare rows, which changes.
    functional
        Functional to minimise.
    trial
        Function and functional for the kernels.
    floor
        Minimum quality. Elements below may not get worse.
    swaps
        True if elements may be swapped.
    seen
        Volume and energy of elements at their last search for swaps, (rows, 2).
    pairs
        Number of recycled nodes.
    """

    movable: MovableSolid
    recycled: Recycled
    opened: OpenSolid
    functional: SolidFunctional
    trial: Trial
    floor: float
    swaps: bool
    seen: Floats
    pairs: int = field(default=0, kw_only=True)

    sweeps_per_swap: ClassVar[int] = 1

    @classmethod
    def of(
        cls, movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction, recycled: Recycled
    ) -> "SpaceDescent":
        opened = with_origins(OpenSolid.of(movable, np.ones(movable.nnodes), relief=1.0), recycled)
        rows = len(opened.mesh.position)
        surface = padded(trial.surface, rows, 0.0) if len(trial.surface) else trial.surface
        own = functional.trial(padded(trial.values, rows, 0.0), padded(trial.fixed, rows, False), surface)
        seen, applied = np.zeros((len(opened.mesh.elements.node), 2)), applied_field(functional.ritz.surface)
        if len(own.applied) and applied is not None:
            start_field(opened.mesh, own, applied)
        return cls(movable, recycled, opened, functional, own, movable.polish_floor, movable.flips, seen)

    def copy(self) -> Self:
        names = ("value", "fixed", "surface", "applied")
        trial = self.trial._replace(**{name: getattr(self.trial, name).copy() for name in names})
        return replace(self, opened=self.opened.copy(), trial=trial, seen=self.seen.copy())

    def descend(self, sweeps: int, swap_first: bool) -> float:
        freedom = self.functional.freedom(self.opened.mesh.freedom, self.trial.fixed, self.trial.surface)
        parts = self.opened.parts()
        gain = self.swap(parts) if swap_first else 0.0
        for k in range(sweeps):
            gain += self.sweep(parts, freedom)
            if (k + 1) % self.sweeps_per_swap == 0 or k + 1 == sweeps:
                gain += self.swap(parts)
        self.renew_field()
        return gain

    def descend_checked(self, sweeps: int, swap_first: bool) -> tuple[Self, float]:
        """Return the descent after some sweeps, and the decrease of the functional.

        If the functional is approximate and has not decreased, the state before the sweeps is returned.
        """
        if not self.functional.is_approximate:
            return self, self.descend(sweeps, swap_first)
        if self.functional.has_varying_source and sweeps > 1:
            descent, decrease = self.descend_checked(1, swap_first)
            descent, more = descent.descend_checked(sweeps - 1, swap_first) if decrease > 0.0 else (descent, 0.0)
            return descent, decrease + more
        before = self.copy()
        self.descend(sweeps, swap_first)
        decrease = before.value() - self.value()
        return (self, decrease) if decrease > 0.0 else (before, 0.0)

    def recycle_checked(self, sweeps: int, swap_first: bool, whole: bool) -> tuple[Self, float, bool]:
        # A recycling may raise the functional, since sweeps and swaps lower the functional afterwards.
        before = self.copy()
        pairs, decrease = self.recycle(whole)
        decrease += self.descend(sweeps, swap_first)
        if self.functional.is_approximate:
            decrease = before.value() - self.value()
        if decrease < 0.0:
            return before, 0.0, False
        return replace(self, pairs=self.pairs + pairs), decrease, pairs > SETTLED * self.movable.nnodes

    def further(self, whole: bool) -> int:
        return 0

    def close(self) -> Recycled:
        # Recycled meshes are numbered along a space-filling curve. At order 2 not as many nodes are removed as added.
        nodes, origins, recycled = self.movable.nnodes, self.opened.mesh.origins, self.recycled
        rows = self.opened.write_back(self.movable, renumbered=self.pairs > 0)
        collapses = recycled.collapses + self.pairs + nodes - len(rows)
        ancestry = {"old": origins.old[rows], "start_element": origins.start_element[rows]}
        return replace(recycled, splits=recycled.splits + self.pairs, collapses=collapses, **ancestry)

    def value(self) -> float:
        surface = with_loads_of_faces(self.opened.mesh, self.trial)
        function = TrialFunction(self.trial.value, self.trial.fixed, None, surface=surface)
        return self.functional.value_on(self.opened.mesh.position, self.opened.mesh.elements, function)

    def swap(self, parts: Parts) -> float:
        if not self.swaps:
            return 0.0
        self.sample_source()
        return swap_in_space(self.opened, parts, self.functional, self.trial, self.seen, self.floor)

    def recycle(self, whole: bool = True) -> tuple[int, float]:
        self.sample_source()
        return recycle_in_space(self.opened, self.functional, self.trial, self.floor)

    def sample_source(self) -> None:
        self.functional.sample_source(self.opened.mesh.position, self.opened.mesh.elements, self.trial)

    def renew_field(self) -> None:
        applied = applied_field(self.functional.ritz.surface)
        if len(self.trial.applied) and applied is not None:
            renew_field(self.opened.mesh, self.trial, applied)

    def sweep(self, parts: Parts, freedom: Freedom) -> float:
        mesh, star = self.opened.mesh, self.opened.star()
        self.sample_source()
        constraints = Constraints(freedom, mesh.surfaces, freedom.number == INSIDE)
        arrays = KernelMesh(mesh.position, mesh.elements, star, constraints)

        def task(thread: int, nodes: Nodes) -> float:
            return self.descend_nodes(thread, arrays, nodes)

        return parts.sweep(star, task)

    def descend_nodes(self, thread: int, mesh: KernelMesh, nodes: Nodes) -> float:
        return float(descend_nodes(mesh, self.trial, nodes, self.floor**3))
