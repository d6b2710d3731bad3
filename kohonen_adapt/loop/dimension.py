"""Parts of the adaptive loop for triangles and for tetrahedra."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.movable import Recycled, unchanged
from kohonen_adapt.geometry.plane.held_nodes import reasons_in_plane
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.geometry.space.held_nodes import reasons_in_space
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.loop.method import Method
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.stopping import stalls_by_estimate, stalls_by_functional
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE, cell_of
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.held_nodes import (
    held_by_polish,
    held_by_polish_in_space,
    polish_reasons,
    polish_reasons_in_space,
)
from kohonen_adapt.polishing.polish import PLAN, descend, descend_and_recycle
from kohonen_adapt.polishing.slivers import longest_on_arcs
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
from kohonen_adapt.polishing.sweeps import loops_of
from kohonen_adapt.polishing.transfer import transferred
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.problem.protocol import Problem, has_functional, order_of
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.relocate import (
    loops_in_plane,
    loops_in_space,
    move,
    move_in_space,
)
from kohonen_adapt.som.relocation_record import Moved, why_still
from kohonen_adapt.som.schedule import Schedule

__all__ = ["PlaneMethod", "SpaceMethod", "method_of"]


class PlaneMethod(Method):
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

    def move(
        self,
        movable: MovableMesh,
        density: Floats,
        functional: Functional | None,
        estimate: float,
        settings: Settings,
        number: int,
        nodes: int,
        recycles: bool,
    ) -> Moved[MovableMesh]:
        longest = None
        if functional is not None and functional.dual is None:  # the effect of arcs on a goal is unknown
            longest = longest_on_arcs(functional.ritz, movable, estimate)
        topology, rng = settings.rules.topology, settings.rng(number)
        return move(movable, density, settings.schedule, topology, rng, nodes, recycles, longest)

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

    def held_in_polish(self, movable: MovableMesh, functional: Functional) -> Mask:
        return held_by_polish(movable, functional)

    def polish_reasons(self, movable: MovableMesh, functional: Functional) -> list[str]:
        return polish_reasons(movable, functional)

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


class SpaceMethod(Method):
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

    def move(
        self,
        movable: MovableSolid,
        density: Floats,
        functional: SolidFunctional | None,
        estimate: float,
        settings: Settings,
        number: int,
        nodes: int,
        recycles: bool,
    ) -> Moved[MovableSolid]:
        if not recycles:  # the map would shorten the long elements that lower the energy
            why = why_still(movable, settings.schedule)
            return Moved(movable.copy(), unchanged(movable.tetrahedralization), (), why)
        topology, rng = settings.rules.topology, settings.rng(number)
        return move_in_space(movable, density, settings.schedule, topology, rng, nodes)

    def functional(self, ritz: Ritz, movable: MovableSolid, mesh: Mesh) -> SolidFunctional:
        return SolidFunctional.of_solution(ritz, movable, mesh)

    def value(self, functional: SolidFunctional, ritz: Ritz, movable: MovableSolid, mesh: Mesh) -> float:
        tet = movable.tetrahedralization
        solution = functional.solution
        curved_part = functional.faces.value(tet.position, tet.elements, solution.values, solution.surface)
        return functional_value(mesh, ritz) + curved_part

    def carry(
        self, functional: SolidFunctional, before: MovableSolid, movable: MovableSolid, start_element: Ints
    ) -> TrialFunction:
        return transferred_in_space(functional, before, movable, start_element)

    def reasons(self, movable: MovableSolid) -> list[str]:
        return reasons_in_space(movable)

    def held_in_polish(self, movable: MovableSolid, functional: SolidFunctional) -> Mask:
        return held_by_polish_in_space(movable, functional)

    def polish_reasons(self, movable: MovableSolid, functional: SolidFunctional) -> list[str]:
        return polish_reasons_in_space(movable, functional)

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


def method_of(mesh: Mesh) -> Method:
    return SpaceMethod() if cell_of(mesh) is TETRAHEDRON else PlaneMethod()
