"""Descent of a functional of order 1 on an open mesh of tetrahedra."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

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

__all__ = ["Descent"]


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

    sweeps_per_swap: ClassVar[int] = 1

    @classmethod
    def of(cls, movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction) -> "Descent":
        opened = OpenSolid.of(movable, np.ones(movable.nnodes))
        rows = len(opened.mesh.position)
        surface = padded(trial.surface, rows, 0.0) if len(trial.surface) else trial.surface
        own = functional.trial(padded(trial.values, rows, 0.0), padded(trial.fixed, rows, False), surface)
        seen = np.zeros((len(opened.mesh.elements.node), 2))
        return cls(opened, functional, own, movable.floor, movable.flips, seen)

    def copy(self) -> Self:
        trial = self.trial._replace(value=self.trial.value.copy(), fixed=self.trial.fixed.copy())
        return replace(self, opened=self.opened.copy(), trial=trial, seen=self.seen.copy())

    def set_origins(self, recycled: Recycled) -> None:
        origins, n = self.opened.mesh.origins, len(recycled.old)
        origins.old[:n], origins.start_element[:n] = recycled.old, recycled.start_element

    def descend(self, sweeps: int, swap_first: bool) -> float:
        freedom = self.functional.freedom(self.opened.mesh.freedom, self.trial.fixed, self.trial.surface)
        parts = self.opened.parts()
        gain = self.swap(parts) if swap_first else 0.0
        for k in range(sweeps):
            gain += self.sweep(parts, freedom)
            if (k + 1) % self.sweeps_per_swap == 0 or k + 1 == sweeps:
                gain += self.swap(parts)
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

    def value(self) -> float:
        function = TrialFunction(self.trial.value, self.trial.fixed, None, surface=self.trial.surface)
        return self.functional.value_on(self.opened.mesh.position, self.opened.mesh.elements, function)

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
            return self.descend_nodes(thread, arrays, nodes)

        return parts.sweep(star, task)

    def descend_nodes(self, thread: int, mesh: KernelMesh, nodes: Nodes) -> float:
        return float(descend_nodes(mesh, self.trial, nodes, self.floor**3))
