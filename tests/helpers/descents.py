"""Descents as the loop opens them."""

from kohonen_adapt.geometry.movable import unchanged
from kohonen_adapt.loop.dimension import method_of


def descent_of(movable, functional, trial=None):
    """A descent from the solution, or from another function."""
    function = functional.solution.copy() if trial is None else trial
    return method_of(movable.mesh()).descent(movable, functional, function, unchanged(movable.tessellation))


def descend(movable, functional, trial, sweeps):
    """Sweep nodes and swap elements, and return the decrease of the functional."""
    return descent_of(movable, functional, trial).descend_checked(sweeps, False)[1]
