"""Energy descent on tetrahedra, with recycling between the sweeps."""

from collections.abc import Sequence
from dataclasses import replace

from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.space.descent import Descent
from kohonen_adapt.polishing.space.descent_order2 import QuadraticDescent
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.problem.protocol import Problem, order_of

__all__ = ["PLAN_IN_SPACE", "descend_and_recycle_in_space", "descend_in_space", "loops_in_space"]

# Sweeps before, between and after the recyclings. After three passes on E, F and M the error is 1 to 4 % higher with
# (4, 4), and mostly 1 % higher with (4, 4, 4).
PLAN_IN_SPACE = (2, 2, 2, 2)
SETTLED = 0.01  # fraction of the nodes, below which a recycling is the last of its pass


def descend_in_space(
    movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction, sweeps: int, swap_first: bool = False
) -> float:
    """Sweep nodes and swap elements, and return the decrease of the functional.

    Elements are swapped after the nodes of every sweep, with `swap_first` also before the first sweep. The numbering
    of nodes does not change. At order 1 the values of `trial` are those on the new mesh afterwards.
    """
    descent, gain = descent_of(movable, functional, trial).descend_checked(sweeps, swap_first)
    descent.opened.write_back(movable)
    if trial.affine:
        trial.values[:] = descent.trial.value[: len(trial.values)]
    return gain


def descend_and_recycle_in_space(
    movable: MovableSolid,
    functional: SolidFunctional,
    trial: TrialFunction,
    recycled: Recycled,
    plan: Sequence[int] = PLAN_IN_SPACE,
) -> tuple[Recycled, float]:
    """Sweep by the numbers in `plan`, with recycling by energy between the numbers.

    A recycling may raise the functional, since sweeps and swaps lower the functional afterwards. If they do not
    lower the functional enough, recycling and sweeps are undone. Returned are all recycled nodes, including those
    of `recycled`, and the decrease of the functional. A plan of one number keeps all nodes. Recycled meshes are
    numbered along a space-filling curve.
    """
    swap_first = goes_on = len(plan) > 1
    descent, pairs = descent_of(movable, functional, trial), 0
    descent.set_origins(recycled)
    descent, gain = descent.descend_checked(plan[0], swap_first)
    for sweeps in plan[1:]:
        before, more, decrease = descent, 0, 0.0
        if goes_on:
            before = descent.copy()
            more, decrease = descent.recycle()
            decrease += descent.descend(sweeps, swap_first)
            decrease = before.value() - descent.value() if functional.is_approximate else decrease
        else:
            descent, decrease = descent.descend_checked(sweeps, swap_first)
        if decrease < 0.0:
            descent, more, decrease = before, 0, 0.0
        pairs, gain, goes_on = pairs + more, gain + decrease, more > SETTLED * movable.nnodes
    nodes, origins = movable.nnodes, descent.opened.mesh.origins
    rows = descent.opened.write_back(movable, renumbered=pairs > 0)
    collapses = recycled.collapses + pairs + nodes - len(rows)  # at order 2 not as many as splits
    ancestry = {"old": origins.old[rows], "start_element": origins.start_element[rows]}
    return replace(recycled, splits=recycled.splits + pairs, collapses=collapses, **ancestry), gain


def loops_in_space(problem: Problem) -> tuple[str, ...]:
    return "space ground", "space moves", "space polish of order 2" if order_of(problem) == 2 else "space polish"


def descent_of(movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction) -> Descent:
    kind = Descent if trial.affine else QuadraticDescent
    return kind.of(movable, functional, trial)
