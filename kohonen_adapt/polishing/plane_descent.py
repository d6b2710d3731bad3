"""Descent of the energy of triangles in parallel sweeps."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.ordering import along_curve, mark_interior, parts_along
from kohonen_adapt.kernels.threads import even_cuts, shared, shared_in_parts
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.curve_nodes import descend_curves
from kohonen_adapt.polishing.elements import UNKNOWNS
from kohonen_adapt.polishing.energy_recycling import Exchange, recycle_by_energy
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.loops import Loops
from kohonen_adapt.polishing.polish import SETTLED

__all__ = ["PlaneDescent", "sweep"]

# Further recyclings by order, each with the last number of sweeps, while the decrease exceeds PAYS times the gains of
# splits of all edges (an estimate of the distance to the minimum, for few and for many nodes that carry the distance).
# Error after two passes divided by the error after four, at order 3, with 0 / 3 / 6 / 10 further recyclings:
#     L, N = 2827       1.03   1.04   1.00   1.02
#     L, N = 11 059     1.06   1.02   1.01   1.01
#     C                 1.04   1.02   1.02   1.02
MORE = (0, 6, 6)
# The same after a shorter plan, while the mesh grows.
MORE_IN_GROWTH = (0, 1, 0)
PAYS = 0.01
RESAMPLE = 2  # sweeps between two samplings of a varying flux
# Sweeps between two samplings of a varying source. With 2, order 3 gains nothing in half the problems of `own-source`.
RESAMPLE_SOURCE = 1

PART = 5_000  # unknowns per part, so many that few nodes are at the cuts


@dataclass(frozen=True)
class PlaneDescent:
    """Descent of a functional on triangles.

    Attributes
    ----------
    movable
        Mesh, which changes.
    functional
        Functional to minimise.
    trial
        Function, which changes.
    recycled
        Nodes recycled so far.
    known
        Value of an approximate functional, None if not computed yet.
    """

    movable: MovableMesh
    functional: Functional
    trial: TrialFunction
    recycled: Recycled
    known: float | None = None

    def further(self, whole: bool) -> int:
        return (MORE if whole else MORE_IN_GROWTH)[self.functional.ritz.order - 1]

    def descend_checked(self, sweeps: int, swap_first: bool) -> tuple[Self, float]:
        # Sampled sources and fluxes hold near the sampled positions only. They are sampled again every few sweeps,
        # which are undone if the functional has not decreased. The same holds with slivers between chords and curves,
        # which the kernels do not include.
        if not self.functional.is_approximate:
            return self, sweep(self.movable, self.functional, self.trial, sweeps, swap_first)
        total = 0.0
        value = self.current_value()
        interval = RESAMPLE_SOURCE if self.functional.has_varying_source else RESAMPLE
        for done in range(0, sweeps, interval):
            ways = dict.fromkeys([(swap_first and not done, True), (False, True), (False, False)])
            tries = (self.descend_sampled(value, min(interval, sweeps - done), *way) for way in ways)
            gain, value = next((found for found in tries if found[0] > 0.0), (0.0, value))
            if not gain:
                break
            total += gain
        return replace(self, known=value), total

    def current_value(self) -> float:
        return self.value() if self.known is None else self.known

    def value(self) -> float:
        return self.functional.value(self.movable.triangulation, self.trial)

    def descend_sampled(self, before: float, sweeps: int, swap_first: bool, flips: bool) -> tuple[float, float]:
        # Returned are the decrease and the new functional.
        movable, functional, trial = self.movable, self.functional, self.trial
        state = {name: array.copy() for name, array in movable.state().items()}
        old = trial.copy()
        gain = sweep(movable, functional, trial, sweeps, swap_first, flips)
        gain += descend_curves(movable, functional, trial)
        after = self.value()
        if after < before:
            return min(gain, before - after), after
        movable.restore(state)
        trial.restore(old)
        return 0.0, before

    def recycle_checked(self, sweeps: int, swap_first: bool, whole: bool) -> tuple[Self, float, bool]:
        exchange, value = self.recycle()
        after = replace(self, trial=exchange.trial, recycled=exchange.recycled, known=value)
        after, decrease = after.descend_checked(sweeps, swap_first)
        return after, exchange.decrease + decrease, self.still_pays(exchange)

    def recycle(self) -> tuple[Exchange, float | None]:
        # Returned last is the value of an approximate functional.
        movable, functional, trial = self.movable, self.functional, self.trial
        if not functional.is_approximate:
            return recycle_by_energy(movable, functional, trial, self.recycled), None
        state, before = movable.state(), self.current_value()
        done = recycle_by_energy(movable, functional, trial, self.recycled)
        after = functional.value(movable.triangulation, done.trial)
        if after < before:
            return done._replace(decrease=min(done.decrease, before - after)), after
        movable.restore(state)
        return Exchange(trial, self.recycled, 0.0, done.offered), before

    def still_pays(self, exchange: Exchange) -> bool:
        if self.functional.ritz.order == 1:
            return exchange.recycled.splits - self.recycled.splits > SETTLED * self.movable.nnodes
        return exchange.decrease > PAYS * exchange.offered

    def close(self) -> Recycled:
        return self.recycled


def sweep(
    movable: MovableMesh,
    functional: Functional,
    trial: TrialFunction,
    sweeps: int,
    swap_first: bool,
    flips: bool = True,
) -> float:
    # Edges are flipped after the nodes of every sweep. With `swap_first` they are also flipped before the first
    # sweep, so that useless nodes are detected earlier.
    gain = 0.0
    tri = movable.triangulation
    kinds = functional.kinds(movable.outline, trial.fixed)
    constraints = movable.constraints._replace(kind=kinds)
    # values of pairs, on Robin boundaries and on chords stay, because their stars are not the whole functional
    excluded = functional.boundary.nodes(tri) | functional.chords.moving(tri) | (constraints.periodic.partner >= 0)
    mesh = movable.kernel_mesh()._replace(constraints=constraints)
    loops = functional.loops(movable, trial._replace(fixed=trial.fixed | excluded), mesh)
    order = along_curve(movable.triangulation.position).astype(np.int32)
    parts = max(1, len(order) // (PART // UNKNOWNS[functional.ritz.order - 1]))
    part, interior = parts_along(order, len(order), parts), np.empty(len(order), bool)
    if swap_first:
        gain += flip_downhill(movable, loops)
        if functional.varies:  # flipped elements have no sample of their own
            loops = functional.loops(movable, trial._replace(fixed=trial.fixed | excluded), mesh)
    for _ in range(sweeps):
        star = movable.triangulation.star
        mark_interior(star.start, star.link, part, 1, interior, np.empty_like(order))
        gain += shared_in_parts(loops.descend_nodes, order, (part, interior))
        gain += flip_downhill(movable, loops) if flips else 0.0
    return gain


def flip_downhill(movable: MovableMesh, loops: Loops) -> float:
    if not movable.flips:
        return 0.0
    gainful = np.empty(len(movable.triangulation.elements.node), bool)
    cuts = even_cuts(len(gainful), loops.few)
    shared(lambda thread, first, last: loops.descend_flips(thread, first, last, gainful, True), cuts)
    gain, flips = loops.descend_flips(0, 0, len(gainful), gainful, False)
    if flips:
        movable.triangulation.refill_star()
    return gain
