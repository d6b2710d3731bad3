"""Parts of the adaptive loop for tetrahedra."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.recycled import Recycled, unchanged
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.geometry.space.held_nodes import of_boundaries, reasons_in_space
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, ON_RIDGE, PLANE
from kohonen_adapt.loop.method import Method
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.stopping import stalls_by_functional
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.space.polish_in_space import (
    PLAN_IN_SPACE,
    descend_and_recycle_in_space,
    descend_in_space,
)
from kohonen_adapt.polishing.space.polish_in_space import (
    loops_in_space as polish_loops,
)
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.polishing.space.transfer_in_space import transferred_in_space
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.problem.protocol import Problem
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.moved import Moved, why_still
from kohonen_adapt.som.schedule import Schedule
from kohonen_adapt.som.space import loops_in_space, move_in_space, report_surfaces

__all__ = ["SpaceMethod"]


class SpaceMethod(Method):
    """Smoothing, swaps and polish of tetrahedra."""

    dim = TETRAHEDRON.dim
    passes_by_density = 2
    plan = PLAN_IN_SPACE
    transfer_kernels = ("space carrying",)

    def open(self, mesh: Mesh, rules: Rules, curved: bool | None) -> MovableSolid:
        return MovableSolid.of(mesh, rules, curved)

    def moving_kernels(self, topology: str, schedule: Schedule | None) -> tuple[str, ...]:
        return *loops_in_space(topology, schedule), "space locating"

    def polish_kernels(self, problem: Problem) -> tuple[str, ...]:
        return polish_loops(problem)

    def relocate(
        self,
        movable: MovableSolid,
        density: ArrayLike | Callable[[Floats], ArrayLike],
        schedule: Schedule | None,
        topology: str,
        rng: np.random.Generator,
        nodes: int,
    ) -> Moved[MovableSolid]:
        return move_in_space(movable, density, schedule, topology, rng, nodes)

    def report_sagitta(self, before: MovableSolid, now: MovableSolid) -> None:
        report_surfaces(before, now)

    def move(
        self,
        movable: MovableSolid,
        density: Floats,
        functional: SolidFunctional | None,
        estimate: float,
        settings: Settings,
        number: int,
        recycles: bool,
    ) -> Moved[MovableSolid]:
        if not recycles:  # the map would shorten the long elements that lower the energy
            why = why_still(movable, settings.schedule)
            return Moved(movable.copy(), unchanged(movable.tetrahedralization), (), why)
        nodes, rng = settings.growth.nodes(number), settings.rng(number)
        return move_in_space(movable, density, settings.schedule, settings.rules.topology, rng, nodes)

    def functional(self, ritz: Ritz, movable: MovableSolid, mesh: Mesh) -> SolidFunctional:
        return SolidFunctional.of_solution(ritz, movable, mesh)

    def value(self, functional: SolidFunctional, ritz: Ritz, movable: MovableSolid, mesh: Mesh) -> float:
        tet = movable.tetrahedralization
        curved_part = functional.faces.value(tet.position, tet.elements, functional.solution.values)
        return functional_value(mesh, ritz) + curved_part

    def carry(
        self, functional: SolidFunctional, before: MovableSolid, movable: MovableSolid, start_element: Ints
    ) -> TrialFunction:
        return transferred_in_space(functional, before, movable, start_element)

    def reasons(self, movable: MovableSolid) -> list[str]:
        return reasons_in_space(movable)

    def polish_reasons(self, movable: MovableSolid, functional: SolidFunctional) -> list[str]:
        freedom, found = movable.freedom, [""] * movable.nnodes
        fixed = functional.solution.fixed
        held = (functional.freedom(freedom, fixed).number == HELD) & (freedom.number != HELD) & ~freedom.pinned
        for v in np.flatnonzero(held).tolist():
            if freedom.number[v] == INSIDE:
                found[v] = "Dirichlet value inside the mesh"
                continue
            on_edge = freedom.number[v] == ON_RIDGE
            patches = movable.surfaces.meets[freedom.place[v]] if on_edge else freedom.place[[v]]
            patches = patches[patches >= 0]
            place = ("edge" if on_edge else "face") + of_boundaries(movable, patches)
            row = freedom.place[v] + functional.patches * on_edge
            uncounted = (movable.surfaces.shape[patches] != PLANE) & ~functional.faces.counted[patches]
            if uncounted.any():
                found[v] = f"curved {place} on which the polish moves no node"
            elif functional.held[row] and not functional.dirichlet[row]:
                found[v] = f"{place} beside a face that holds its nodes"
            else:
                found[v] = f"Dirichlet values that are not linear on the {place}"
        return found

    def descend(self, movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction, sweeps: int) -> float:
        return descend_in_space(movable, functional, trial, sweeps)

    def polish(
        self,
        movable: MovableSolid,
        functional: SolidFunctional,
        trial: TrialFunction,
        recycled: Recycled,
        plan: Sequence[int],
    ) -> tuple[Recycled, float]:
        return descend_and_recycle_in_space(movable, functional, trial, recycled, plan)

    def stalls(self, passes: tuple[Pass, ...]) -> bool:
        return stalls_by_functional(passes)
