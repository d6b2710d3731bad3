"""Descent of the energy of triangles, with recycling of nodes."""

from collections.abc import Sequence

from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.curve_nodes import descend_curves
from kohonen_adapt.polishing.energy_recycling import Exchange, recycle_by_energy
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.sweeps import SWEEPS, sweep

__all__ = ["PLAN", "descend", "descend_and_recycle"]

# Sweeps before, between and after the recyclings. Three groups instead of two lower the error on F by 1 %.
PLAN = (2, 2, 2, 2)
# Further recyclings by order, each with the last number of sweeps, while the decrease exceeds PAYS times the gains of
# splits of all edges (an estimate of the distance to the minimum, for few and for many nodes that carry the distance).
# Error after two passes divided by the error after four, at order 3, with 0 / 3 / 6 / 10 further recyclings:
#     L, N = 2827       1.03   1.04   1.00   1.02
#     L, N = 11 059     1.06   1.02   1.01   1.01
#     C                 1.04   1.02   1.02   1.02
MORE = (0, 6, 6)
PAYS = 0.01
SETTLED = 0.01  # fraction of the nodes at order 1, below which a recycling is the last of its pass
RESAMPLE = 2  # sweeps between two samplings of a varying flux
# Sweeps between two samplings of a varying source. With 2, order 3 gains nothing in half the problems of `own-source`.
RESAMPLE_SOURCE = 1


def descend_and_recycle(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, recycled: Recycled, plan: Sequence[int] = PLAN
) -> tuple[Recycled, float]:
    """Sweep by the numbers in `plan`, with recycling by energy between the numbers.

    At order 2 and 3 up to `MORE` recyclings and sweeps follow. Returned are all recycled nodes, including those
    of `recycled`, and the decrease of the functional. A plan of one number keeps all nodes.
    """
    swap_first = pays = len(plan) > 1
    gain = descend(movable, functional, trial, plan[0], swap_first)
    for sweeps, planned in recyclings(plan, functional.ritz.order):
        if pays:
            exchange = recycle_downhill(movable, functional, trial, recycled)
            pays = still_pays(exchange, recycled, movable.nnodes, functional.ritz.order)
            trial, recycled, gain = exchange.trial, exchange.recycled, gain + exchange.decrease
        elif not planned:
            break
        gain += descend(movable, functional, trial, sweeps, swap_first)
    return recycled, gain


def recyclings(plan: Sequence[int], order: int) -> list[tuple[int, bool]]:
    more = MORE[order - 1] if len(plan) > 1 else 0
    return [(sweeps, True) for sweeps in plan[1:]] + [(plan[-1], False)] * more


def still_pays(exchange: Exchange, before: Recycled, nodes: int, order: int) -> bool:
    if order == 1:
        return exchange.recycled.splits - before.splits > SETTLED * nodes
    return exchange.decrease > PAYS * exchange.offered


def descend(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, sweeps: int = SWEEPS, swap_first: bool = False
) -> float:
    # Sampled sources and fluxes hold near the sampled positions only. They are sampled again every few sweeps, which
    # are undone if the functional has not decreased. The same holds with slivers between chords and curves, which the
    # kernels do not include.
    if not functional.is_approximate:
        return sweep(movable, functional, trial, sweeps, swap_first)
    total, interval = 0.0, RESAMPLE_SOURCE if functional.has_varying_source else RESAMPLE
    for done in range(0, sweeps, interval):
        state, old = {name: array.copy() for name, array in movable.state().items()}, trial.copy()
        before = functional.value(movable.triangulation, trial)
        gain = sweep(movable, functional, trial, min(interval, sweeps - done), swap_first)
        gain += descend_curves(movable, functional, trial)
        full_decrease = before - functional.value(movable.triangulation, trial)
        if not full_decrease > 0.0:
            movable.restore(state)
            trial.restore(old)
            break
        total += min(gain, full_decrease)
    return total


def recycle_downhill(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, recycled: Recycled
) -> Exchange:
    if not functional.is_approximate:
        return recycle_by_energy(movable, functional, trial, recycled)
    state, before = movable.state(), functional.value(movable.triangulation, trial)
    done = recycle_by_energy(movable, functional, trial, recycled)
    full_decrease = before - functional.value(movable.triangulation, done.trial)
    if full_decrease > 0.0:
        return done._replace(decrease=min(done.decrease, full_decrease))
    movable.restore(state)
    return Exchange(trial, recycled, 0.0, done.offered)
