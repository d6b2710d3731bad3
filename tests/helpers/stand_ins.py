"""Stand in for a problem in tests of the loop: a tiny mesh, and estimates that are told, without any physics."""

from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka

MESH = MeshTri().refined(2)
ELEMENTS = MESH.nelements


def adapt(*arguments, **options):
    """The loop without its polish, which these problems cannot have."""
    return ka.adapt(*arguments, polish=False, **options)


@dataclass
class Script:
    """A problem whose k-th mesh has the k-th estimate, spread evenly; an exception in its place is raised."""

    estimates: list
    energy: float = 10.0
    calls: list = field(default_factory=list)
    calibrated: bool = True

    def solve(self, mesh):
        number = len(self.calls)
        self.calls.append(mesh)
        if isinstance(self.estimates[number], BaseException):
            raise self.estimates[number]
        return number

    def indicators(self, mesh, solution):
        return np.full(mesh.nelements, self.estimates[solution] / np.sqrt(mesh.nelements))

    def energy_norm(self, mesh, solution):
        return self.energy


class Without:
    """A problem that lacks some of its methods."""

    def __init__(self, problem, *names):
        self.problem, self.names = problem, names

    def __getattr__(self, name):
        if name.startswith("_") or name in self.names:
            raise AttributeError(name)
        return getattr(self.problem, name)


def script_of(*values):
    """An output that has the k-th value on the k-th mesh; an exception in its place is raised."""

    def function(solution):
        if isinstance(values[solution], BaseException):
            raise values[solution]
        return values[solution]

    return function


class Killed(BaseException):
    """The end of the process, as far as the loop can tell."""


def killed_at(moment, mesh, problem, **options):
    """Run the loop until a step of a pass begins."""

    def progress(*now):
        if now == moment:
            raise Killed

    with suppress(Killed):
        ka.adapt(mesh, problem, **options, progress=progress)
