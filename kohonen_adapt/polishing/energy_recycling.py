"""Recycling by energy, collapses at low cost paired with splits of larger gain."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask, padded
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import Surgery
from kohonen_adapt.kernels.arrays import HELD, Modes, Offers, OpenMesh, SurgeryScratch
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.kernels.triangle.polish.descend_higher import Descents
from kohonen_adapt.kernels.triangle.polish.energy_recycle import exchange, weigh_collapses, weigh_splits
from kohonen_adapt.kernels.triangle.polish.energy_recycle_higher import exchange_higher, weigh_higher
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.elements import min_per_thread, shapes_of
from kohonen_adapt.polishing.functional import Functional

__all__ = ["Exchange", "recycle_by_energy"]

PART = 5_000  # elements or nodes per compiled call, because Ctrl-C is handled between calls only


class Exchange(NamedTuple):
    """Result of recycling by energy."""

    trial: TrialFunction  # function on the new mesh
    recycled: Recycled  # including earlier recyclings
    decrease: float  # decrease of the functional
    offered: float  # sum of the gains of all splits, an estimate of the distance to the minimum


def recycle_by_energy(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, recycled: Recycled
) -> Exchange:
    """Split edges and collapse nodes in pairs while the gain exceeds the cost.

    Curve segments on which nodes are held keep their nodes.
    """
    n = movable.nnodes
    surgery = Surgery.on(movable, np.ones(n), n, recycled)
    mesh, offers = surgery.mesh, offers_of(movable, functional, trial.fixed, surgery.mesh)
    judge = make_judge(movable, functional, trial, mesh, offers)
    most = compute_gains(judge, offers)
    edges, nodes = sorted_below(-offers.gain.ravel(), 0.0), sorted_below(offers.cost, most)
    offered, (pairs, decrease) = float(offers.gain.sum()), judge.exchange(edges, nodes)
    if not pairs:
        return Exchange(trial, recycled, 0.0, offered)
    kept, used = surgery.write_back(movable)
    ancestry = {"old": mesh.origins.old[kept], "start_element": mesh.origins.start_element[kept]}
    recycled = replace(recycled, splits=recycled.splits + pairs, collapses=recycled.collapses + pairs, **ancestry)
    return Exchange(without_spare_rows(judge.trial, kept, used), recycled, decrease, offered)


def offers_of(movable: MovableMesh, functional: Functional, fixed: Mask, mesh: OpenMesh) -> Offers:
    n, m = movable.nnodes, len(movable.triangulation.elements.node)
    is_open = ~(functional.held | movable.constraints.chains.paired)
    if functional.ritz.order == 1:
        is_open &= ~functional.dirichlet
    removable = (functional.kinds(movable.outline, fixed) != HELD) & (movable.constraints.periodic.partner < 0)
    locked = np.zeros(len(mesh.elements.node), dtype=np.bool_)
    return Offers(np.empty((m, 3)), np.empty(n), np.empty(n, dtype=np.int32), is_open, removable, locked)


def with_spare_rows(trial: TrialFunction, nodes: int, elements: int) -> TrialFunction:
    dual = trial.dual and with_spare_rows(trial.dual, nodes, elements)
    modes = trial.modes and Modes(*(padded(array, elements, 0) for array in trial.modes))
    return TrialFunction(padded(trial.values, nodes, 0.0), padded(trial.fixed, nodes, False), modes, dual)


def without_spare_rows(trial: TrialFunction, kept: Ints, used: Ints) -> TrialFunction:
    dual = trial.dual and without_spare_rows(trial.dual, kept, used)
    modes = trial.modes and Modes(*(array[used] for array in trial.modes))
    return TrialFunction(trial.values[kept], trial.fixed[kept], modes, dual)


class _Linear:
    """Gains and costs at order 1."""

    def __init__(
        self, movable: MovableMesh, functional: Functional, trial: TrialFunction, mesh: OpenMesh, offers: Offers
    ) -> None:
        triangulation = movable.triangulation
        self.mesh, self.star, self.floor, self.offers = mesh, triangulation.star, movable.floor, offers
        self.few = min_per_thread(functional.ritz.order)
        self.trial = with_spare_rows(trial, len(mesh.position), len(mesh.elements.node))
        self.trials = functional.trials(triangulation, self.trial)

    def weigh_splits(self, thread: int, first: int, last: int) -> None:
        weigh_splits(self.mesh, self.trials, self.offers, self.floor, first, last)

    def weigh_collapses(self, thread: int, scratch: SurgeryScratch, most: float, first: int, last: int) -> None:
        mesh = self.mesh._replace(scratch=scratch)
        weigh_collapses(mesh, self.star, self.trials, self.offers, most, self.floor, first, last)

    def exchange(self, edges: Ints, nodes: Ints) -> tuple[int, float]:
        return exchange(self.mesh, self.trials, self.offers, edges, nodes, self.floor)


class _Higher(_Linear):
    """Gains and costs at order 2 and 3, and at order 1 around an axis."""

    def __init__(
        self, movable: MovableMesh, functional: Functional, trial: TrialFunction, mesh: OpenMesh, offers: Offers
    ) -> None:
        super().__init__(movable, functional, trial, mesh, offers)
        arrays, modes = (mesh.position, mesh.elements, self.star, mesh.constraints), self.trial.all_modes
        shapes = functional.reference, *shapes_of(functional.ritz, movable.midside_offsets(), len(mesh.elements.node))
        self.shared = arrays, self.trials, modes, shapes, int(np.diff(self.star.start).max())
        self.scratches = dict[int, Descents]()

    def _scratch(self, thread: int) -> Descents:
        if thread not in self.scratches:
            self.scratches[thread] = Descents.of(*self.shared)
        return self.scratches[thread]

    def weigh_splits(self, thread: int, first: int, last: int) -> None:
        weigh_higher(self.mesh, self._scratch(thread), self.offers, 0.0, self.floor, first, last, True)

    def weigh_collapses(self, thread: int, scratch: SurgeryScratch, most: float, first: int, last: int) -> None:
        mesh = self.mesh._replace(scratch=scratch)
        weigh_higher(mesh, self._scratch(thread), self.offers, most, self.floor, first, last, False)

    def exchange(self, edges: Ints, nodes: Ints) -> tuple[int, float]:
        pairs, decrease = exchange_higher(self.mesh, self._scratch(0), self.offers, edges, nodes, self.floor)
        return int(pairs), float(decrease)


def make_judge(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, mesh: OpenMesh, offers: Offers
) -> _Linear:
    judge = _Linear if trial.affine else _Higher
    return judge(movable, functional, trial, mesh, offers)


def compute_gains(judge: _Linear, offers: Offers) -> float:
    """Compute all gains and costs, and return the largest gain.

    Costs above the largest gain are not computed. Gains and costs depend on the current mesh alone, and therefore
    not on the number of threads.
    """
    mesh, cuts = judge.mesh, even_cuts(len(offers.cost), judge.few)
    own = [SurgeryScratch.of(len(mesh.position), len(mesh.elements.node)) for _ in cuts[1:]]

    def weigh_edges(thread: int, first: int, last: int) -> None:
        for e in range(first, last, PART):
            judge.weigh_splits(thread, e, min(e + PART, last))

    shared(weigh_edges, even_cuts(len(offers.gain), judge.few))
    most = float(offers.gain.max())

    def weigh_nodes(thread: int, first: int, last: int) -> None:
        for v in range(first, last, PART):
            judge.weigh_collapses(thread, own[thread], most, v, min(v + PART, last))

    shared(weigh_nodes, cuts)
    return most


def sorted_below(values: Floats, below: float) -> Ints:
    found = np.flatnonzero(values < below)
    return found[np.argsort(values[found], kind="stable")]
