"""Parts of the adaptive loop for triangles."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.held_nodes import names_at, reasons_in_plane
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.recycled import Recycled
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.kernels.arrays import FREE, HELD
from kohonen_adapt.loop.method import Method
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.stopping import stalls_by_estimate
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.polish import PLAN, descend, descend_and_recycle
from kohonen_adapt.polishing.slivers import longest_on_arcs
from kohonen_adapt.polishing.sweeps import loops_of
from kohonen_adapt.polishing.transfer import transferred
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.problem.protocol import Problem, has_functional, order_of
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.moved import Moved
from kohonen_adapt.som.relocate import loops_in_plane, move, report_curves
from kohonen_adapt.som.schedule import Schedule

__all__ = ["PlaneMethod"]


class PlaneMethod(Method):
    """Kohonen map and polish of triangles."""

    dim = TRIANGLE.dim
    passes_by_density = 3
    plan = PLAN
    transfer_kernels = ("carrying",)

    def open(self, mesh: Mesh, rules: Rules, curved: bool | None) -> MovableMesh:
        return MovableMesh.of(mesh, rules, curved)

    def moving_kernels(self, topology: str, schedule: Schedule | None) -> tuple[str, ...]:
        return loops_in_plane(topology)

    def polish_kernels(self, problem: Problem) -> tuple[str, ...]:
        return loops_of(problem)

    def relocate(
        self,
        movable: MovableMesh,
        density: ArrayLike | Callable[[Floats], ArrayLike],
        schedule: Schedule | None,
        topology: str,
        rng: np.random.Generator,
        nodes: int,
    ) -> Moved[MovableMesh]:
        return move(movable, density, schedule, topology, rng, nodes)

    def report_sagitta(self, before: MovableMesh, now: MovableMesh) -> None:
        report_curves(before, now)

    def move(
        self,
        movable: MovableMesh,
        density: Floats,
        functional: Functional | None,
        estimate: float,
        settings: Settings,
        number: int,
        recycles: bool,
    ) -> Moved[MovableMesh]:
        longest = None
        if functional is not None and functional.dual is None:  # the effect of arcs on a goal is unknown
            longest = longest_on_arcs(functional.ritz, movable, estimate)
        topology, nodes = settings.rules.topology, settings.growth.nodes(number, functional is not None)
        return move(movable, density, settings.schedule, topology, settings.rng(number), nodes, recycles, longest)

    def functional(self, ritz: Ritz, movable: MovableMesh, mesh: Mesh) -> Functional:
        return Functional.of_solution(ritz, movable, mesh)

    def value(self, functional: Functional, ritz: Ritz, movable: MovableMesh, mesh: Mesh) -> float:
        curved_part = functional.energy_beyond_chords(movable.triangulation, functional.solution)
        return functional_value(mesh, ritz) + curved_part

    def carry(
        self, functional: Functional, before: MovableMesh, movable: MovableMesh, start_element: Ints
    ) -> TrialFunction:
        return transferred(functional, before, movable, start_element)

    def reasons(self, movable: MovableMesh) -> list[str]:
        return reasons_in_plane(movable)

    def polish_reasons(self, movable: MovableMesh, functional: Functional) -> list[str]:
        found, kind = [""] * movable.nnodes, movable.constraints.kind
        held = (functional.kinds(movable.outline, functional.solution.fixed) == HELD) & (kind != HELD)
        for v in np.flatnonzero(held).tolist():
            if kind[v] == FREE:
                found[v] = "Dirichlet value inside the mesh"
                continue
            c = movable.constraints.own_chain[v]
            found[v] = reason_on_segment(movable, functional, c).format(names_at(movable, v, np.array([c])))
        return found

    def descend(self, movable: MovableMesh, functional: Functional, trial: TrialFunction, sweeps: int) -> float:
        return descend(movable, functional, trial, sweeps)

    def polish(
        self,
        movable: MovableMesh,
        functional: Functional,
        trial: TrialFunction,
        recycled: Recycled,
        plan: Sequence[int],
    ) -> tuple[Recycled, float]:
        return descend_and_recycle(movable, functional, trial, recycled, plan)

    def stalls(self, passes: tuple[Pass, ...]) -> bool:
        return stalls_by_estimate(passes)

    def corrects(self, problem: Problem) -> bool:
        # At order 1 the misplaced nodes cost 0.5 to 1 % of the error after three or four passes, and save a pass over
        # all nodes: `python -m benchmarks growth`. At higher orders they cost several per cent, and on tetrahedra as
        # well, because growth by density shortens long elements.
        return has_functional(problem) and order_of(problem) == 1


# Reason for which the polish holds the nodes of a curve segment. The braces stand for the names of the segment.
def reason_on_segment(movable: MovableMesh, functional: Functional, c: int) -> str:
    parts = (functional,) if functional.dual is None else (functional, functional.dual)
    if any(part.boundary.on[c] for part in parts):
        return "open {} (Robin condition)"
    if functional.sign[c] == 0.0 and any(movable.outline.names[name][c] for name in names_of_pairs(functional.ritz)):
        return "periodic condition on {} without a matched boundary"
    if movable.outline.straight[c]:
        whose = "" if functional.dirichlet[c] and not functional.linear[c] else " of the dual solution"
        return f"Dirichlet values{whose} that are not linear along {{}}"
    if functional.chords.cut[c]:
        return "source that ends at the curve of {}"
    return (
        "" if functional.chords.counted[c] else f"curve of {{}}, where the polish moves no node {case_of(functional)}"
    )


def case_of(functional: Functional) -> str:
    ritz = functional.ritz
    if ritz.order > 1:
        return f"at order {ritz.order}"
    if ritz.axisymmetric:
        return "around an axis"
    if any(ritz.laws):
        return "with a nonlinear law"
    if callable(ritz.source) or callable(ritz.flux):
        return "with a varying source or flux"
    return "with periodic boundaries" if ritz.signs else "with these Dirichlet values"


def names_of_pairs(ritz: Ritz) -> list[str]:
    return [name for names in ritz.signs for name in names]
