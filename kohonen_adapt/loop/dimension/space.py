"""Movement and polish of the nodes of tetrahedra."""

from typing import Any

from skfem import Mesh

from kohonen_adapt.geometry.held_nodes import reasons_in_space as reasons
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.loop.state import stalls_by_functional as stalls
from kohonen_adapt.polishing.held_nodes import held_by_polish_in_space as held_in_polish
from kohonen_adapt.polishing.held_nodes import polish_reasons_in_space as polish_reasons
from kohonen_adapt.polishing.space.descent import SpaceDescent
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.polishing.space.transfer_in_space import transferred_in_space as carry
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.problem.protocol import CheckedProblem
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.relocate import loops_in_space as moving_kernels
from kohonen_adapt.som.relocate import move_in_space, split_edges
from kohonen_adapt.som.relocation_record import Moved
from kohonen_adapt.som.schedule import Schedule

__all__ = [
    "ALWAYS_DIRECTED",
    "BEFORE_POLISH",
    "PASSES_BY_DENSITY",
    "TRANSFER_KERNELS",
    "carry",
    "descent",
    "functional",
    "held_in_polish",
    "longest_sides",
    "move",
    "moving_kernels",
    "opened",
    "polish_kernels",
    "polish_reasons",
    "reasons",
    "stalls",
    "value",
]

PASSES_BY_DENSITY = 2
# Directions multiply errors at a given number of nodes by .67 to .97. Residuals overrate long elements, so runs to a
# tolerance take up to four times as long, and a goal has directions of the dual solution, too.
ALWAYS_DIRECTED = False
BEFORE_POLISH = None
TRANSFER_KERNELS = ("space carrying",)

opened = MovableSolid.of
functional = SolidFunctional.of_solution
descent = SpaceDescent.of


def polish_kernels(problem: CheckedProblem) -> tuple[str, ...]:
    return "space ground", "space moves", "space polish of order 2" if problem.order == 2 else "space polish"


def move(
    movable: MovableSolid,
    density: Any,
    schedule: Schedule | None,
    topology: str,
    rng: Any,
    nodes: int,
    recycles: bool = True,
    longest: None = None,
) -> Moved[MovableSolid]:
    if not recycles:  # the map would shorten the long elements that lower the energy
        return split_edges(movable, density, movable.nnodes)
    return move_in_space(movable, density, schedule, topology, rng, nodes)


def longest_sides(movable: MovableSolid, functional: SolidFunctional, estimate: float) -> None:
    return None


def value(functional: SolidFunctional, ritz: Ritz, movable: MovableSolid, mesh: Mesh) -> float:
    tet, solution = movable.tetrahedralization, functional.solution
    curved = functional.faces.value(tet.position, tet.elements, solution.values, solution.surface)
    return functional_value(mesh, ritz) + curved
