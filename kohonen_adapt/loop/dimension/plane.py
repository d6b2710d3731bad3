"""Movement and polish of the nodes of triangles."""

from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.geometry.held_nodes import reasons_in_plane as reasons
from kohonen_adapt.geometry.plane.arcs import possible_arcs
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.log import logger
from kohonen_adapt.loop.state import stalls_by_estimate as stalls
from kohonen_adapt.polishing.chords import longest_on_arcs
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.held_nodes import held_by_polish as held_in_polish
from kohonen_adapt.polishing.held_nodes import polish_reasons
from kohonen_adapt.polishing.plane_descent import PlaneDescent as descent
from kohonen_adapt.polishing.transfer import transferred as carry
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.problem.protocol import CheckedProblem
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.relocate import loops_in_plane as moving_kernels
from kohonen_adapt.som.relocate import move
from kohonen_adapt.som.schedule import BEFORE_POLISH

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

PASSES_BY_DENSITY = 3
ALWAYS_DIRECTED = True
TRANSFER_KERNELS = ("carrying",)

functional = Functional.of_solution


def opened(mesh: Mesh, rules: Rules, curved: bool | None) -> MovableMesh:
    movable = MovableMesh.of(mesh, rules, curved)
    for arc in possible_arcs(movable):
        if arc.is_cut:  # of other polygons only `check` reports
            logger.warning("%s", arc.advice())
    return movable


def polish_kernels(problem: CheckedProblem) -> tuple[str, ...]:
    higher = problem.order > 1 or getattr(problem, "axisymmetric", False)
    return "ground", "polish of higher order" if higher else "polish"


def longest_sides(movable: MovableMesh, functional: Functional, estimate: float) -> Floats | None:
    if functional.dual is not None:  # the effect of arcs on a goal is unknown
        return None
    return longest_on_arcs(functional.ritz, movable, estimate)


def value(functional: Functional, ritz: Ritz, movable: MovableMesh, mesh: Mesh) -> float:
    beyond = functional.energy_beyond_chords(movable.triangulation, functional.solution)
    return functional_value(mesh, ritz) + beyond
