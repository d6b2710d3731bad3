"""Energy descent on tetrahedra, with recycling between the sweeps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kohonen_adapt.arrays import Floats, padded
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.geometry.space.thread_parts import Parts
from kohonen_adapt.kernels.arrays import KernelMesh
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, Constraints, Freedom, Trial
from kohonen_adapt.kernels.tetrahedron.polish.descend import descend_nodes
from kohonen_adapt.kernels.threads import Nodes
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.polishing.space.surgery_in_space import recycle_in_space, swap_in_space
from kohonen_adapt.problem.protocol import Problem

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
    of nodes does not change.
    """
    descent, gain = Descent.of(movable, functional, trial).descend_checked(sweeps, swap_first)
    descent.opened.write_back(movable)
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
    descent, pairs = Descent.of(movable, functional, trial), 0
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
    rows, origins = descent.opened.write_back(movable, renumbered=pairs > 0), descent.opened.mesh.origins
    ancestry = {"old": origins.old[rows], "start_element": origins.start_element[rows]}
    return replace(recycled, splits=recycled.splits + pairs, collapses=recycled.collapses + pairs, **ancestry), gain


def loops_in_space(problem: Problem) -> tuple[str, ...]:
    return "space ground", "space moves", "space polish"


@dataclass(frozen=True)
class Descent:
    """Descent of a functional on an open mesh of tetrahedra.

    Attributes
    ----------
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
    """

    opened: OpenSolid
    functional: SolidFunctional
    trial: Trial
    floor: float
    swaps: bool
    seen: Floats

    @classmethod
    def of(cls, movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction) -> "Descent":
        opened = OpenSolid.of(movable, np.ones(movable.nnodes))
        rows = len(opened.mesh.position)
        own = functional.trial(padded(trial.values, rows, 0.0), padded(trial.fixed, rows, False))
        seen = np.zeros((len(opened.mesh.elements.node), 2))
        return cls(opened, functional, own, movable.floor, movable.flips, seen)

    def copy(self) -> "Descent":
        trial = self.trial._replace(value=self.trial.value.copy(), fixed=self.trial.fixed.copy())
        return replace(self, opened=self.opened.copy(), trial=trial, seen=self.seen.copy())

    def set_origins(self, recycled: Recycled) -> None:
        origins, n = self.opened.mesh.origins, len(recycled.old)
        origins.old[:n], origins.start_element[:n] = recycled.old, recycled.start_element

    def descend(self, sweeps: int, swap_first: bool) -> float:
        freedom = self.functional.freedom(self.opened.mesh.freedom, self.trial.fixed)
        parts = self.opened.parts()
        gain = self.swap(parts) if swap_first else 0.0
        for _ in range(sweeps):
            gain += self.sweep(parts, freedom)
            gain += self.swap(parts)
        return gain

    def descend_checked(self, sweeps: int, swap_first: bool) -> tuple["Descent", float]:
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

    def value(self) -> float:
        return self.functional.value_on(self.opened.mesh.position, self.opened.mesh.elements, self.trial.value)

    def swap(self, parts: Parts) -> float:
        if not self.swaps:
            return 0.0
        self.sample_source()
        return swap_in_space(self.opened, parts, self.functional, self.trial, self.seen, self.floor)

    def recycle(self) -> tuple[int, float]:
        self.sample_source()
        return recycle_in_space(self.opened, self.functional, self.trial, self.floor)

    def sample_source(self) -> None:
        self.functional.sample_source(self.opened.mesh.position, self.opened.mesh.elements, self.trial)

    def sweep(self, parts: Parts, freedom: Freedom) -> float:
        mesh, star = self.opened.mesh, self.opened.star()
        self.sample_source()
        constraints = Constraints(freedom, mesh.surfaces, freedom.number == INSIDE)
        arrays = KernelMesh(mesh.position, mesh.elements, star, constraints)

        def task(thread: int, nodes: Nodes) -> float:
            return float(descend_nodes(arrays, self.trial, nodes, self.floor**3))

        return parts.sweep(star, task)
