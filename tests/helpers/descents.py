"""Descents as the loop opens them, and their steps one by one."""

from kohonen_adapt import Rules
from kohonen_adapt.geometry.movable import unchanged
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.loop.dimension import method_of
from kohonen_adapt.polishing.energy_recycling import recycle_by_energy
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.plane_descent import flip_downhill, sweep


def descent_of(movable, functional, trial=None):
    """A descent from the solution, or from another function."""
    function = functional.solution.copy() if trial is None else trial
    return method_of(movable.mesh()).descent(movable, functional, function, unchanged(movable.tessellation))


def descend(movable, functional, trial, sweeps):
    """Sweep nodes and swap elements, and return the decrease of the functional."""
    return descent_of(movable, functional, trial).descend_checked(sweeps, False)[1]


class Start:
    """A function on a mesh in the plane, and steps that lower its functional by what they return."""

    def __init__(self, movable, functional):
        self.movable, self.functional, self.trial = movable, functional, functional.solution.copy()
        self.recycled = unchanged(movable.triangulation)

    @classmethod
    def of(cls, mesh, ritz, rules=None):
        movable = MovableMesh.of(mesh, rules or Rules("recycle").guarded())
        return cls(movable, Functional.of(ritz, movable, mesh))

    def value(self):
        offsets = self.movable.midside_offsets() if self.movable.curved else None
        return self.functional.value(self.movable.triangulation, self.trial, offsets)

    def sweep(self):
        return sweep(self.movable, self.functional, self.trial, 1, False)

    def flip(self):
        loops = self.functional.loops(self.movable, self.trial, self.movable.kernel_mesh())
        return flip_downhill(self.movable, loops)

    def recycle(self):
        given = self.movable, self.functional, self.trial, self.recycled
        self.trial, self.recycled, decrease, self.offered = recycle_by_energy(*given)
        return decrease
