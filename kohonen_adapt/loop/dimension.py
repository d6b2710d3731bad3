"""Parts of the adaptive loop for triangles and for tetrahedra."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from skfem import Mesh

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.geometry.held_nodes import reasons_in_plane, reasons_in_space
from kohonen_adapt.geometry.plane.arcs import possible_arcs
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.log import logger
from kohonen_adapt.loop.state import stalls_by_estimate, stalls_by_functional
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE, cell_of
from kohonen_adapt.polishing.chords import longest_on_arcs
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.held_nodes import (
    held_by_polish,
    held_by_polish_in_space,
    polish_reasons,
    polish_reasons_in_space,
)
from kohonen_adapt.polishing.plane_descent import PlaneDescent
from kohonen_adapt.polishing.polish import Descent
from kohonen_adapt.polishing.space.descent import SpaceDescent
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.polishing.space.transfer_in_space import transferred_in_space
from kohonen_adapt.polishing.transfer import transferred
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.problem.protocol import CheckedProblem
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.relocate import (
    loops_in_plane,
    loops_in_space,
    move,
    move_in_space,
    split_edges,
)
from kohonen_adapt.som.relocation_record import Moved
from kohonen_adapt.som.schedule import BEFORE_POLISH, Schedule


@dataclass(frozen=True)
class Method:
    """Movement and polish of the nodes of meshes of one dimension.

    Attributes
    ----------
    dim
        Dimension of the meshes.
    passes_by_density
        Number of passes with recycling by density; later passes recycle by energy alone.
    always_directed
        True if elements get directions with ``anisotropic="auto"`` beside a tolerance or a goal, too.
    open
        Function of the mesh, the rules and the sides, as in the input if None, that returns the movable mesh.
    moving_kernels, polish_kernels
        Functions of topology and schedule, or of the problem, that return groups of `kernels/entries.py`.
    transfer_kernels
        Groups for the transfer of a solution.
    move
        Function that relocates to a density or to tensors, as `som.relocate.move`.
    longest_sides
        Function that returns the largest length of sides on curves at each node, or None.
    functional
        Function that returns the functional that the polish lowers, for a solution on a mesh.
    curved_part
        Function that returns the part of the functional between chords and curves or surfaces.
    carry
        Function that transfers a solution to the moved mesh.
    reasons, polish_reasons
        Functions that return why each node is held, always or by the polish alone, else an empty string.
    held_in_polish
        Function that returns the mask (n,) of nodes held by the polish alone.
    descent
        Function that returns the descent for the polish, which changes the movable mesh.
    stalls
        Function of the passes that returns True if these do not improve the result.
    schedule_before_polish
        Schedule of the map in passes that recycle and polish, None for the default.
    """

    dim: int
    # A density without directions moves a fifth of all nodes in every pass to positions from which the energy removes
    # them again, if long elements have the lowest energy. With directions, too, further passes by density gain nothing.
    passes_by_density: int
    always_directed: bool
    open: Callable[..., Any]
    moving_kernels: Callable[..., tuple[str, ...]]
    polish_kernels: Callable[..., tuple[str, ...]]
    transfer_kernels: tuple[str, ...]
    move: Callable[..., Moved[Any]]
    longest_sides: Callable[..., Floats | None]
    functional: Callable[..., Any]
    curved_part: Callable[..., float]
    carry: Callable[..., Any]
    reasons: Callable[..., list[str]]
    polish_reasons: Callable[..., list[str]]
    held_in_polish: Callable[..., Mask]
    descent: Callable[..., Descent]
    stalls: Callable[..., bool]
    schedule_before_polish: Schedule | None = None

    def value(self, functional: Any, ritz: Ritz, movable: Any, mesh: Mesh) -> float:
        return functional_value(mesh, ritz) + self.curved_part(functional, movable)


def opened_in_plane(mesh: Mesh, rules: Rules, curved: bool | None) -> MovableMesh:
    movable = MovableMesh.of(mesh, rules, curved)
    for arc in possible_arcs(movable):
        if arc.is_cut:  # of other polygons only `check` reports
            logger.warning("%s", arc.advice())
    return movable


def polish_kernels_in_plane(problem: CheckedProblem) -> tuple[str, ...]:
    higher = problem.order > 1 or getattr(problem, "axisymmetric", False)
    return "ground", "polish of higher order" if higher else "polish"


def longest_sides(movable: MovableMesh, functional: Functional, estimate: float) -> Floats | None:
    if functional.dual is not None:  # the effect of arcs on a goal is unknown
        return None
    return longest_on_arcs(functional.ritz, movable, estimate)


PLANE = Method(
    dim=TRIANGLE.dim,
    passes_by_density=3,
    always_directed=True,
    open=opened_in_plane,
    moving_kernels=lambda topology, schedule: loops_in_plane(topology),
    polish_kernels=polish_kernels_in_plane,
    transfer_kernels=("carrying",),
    move=move,
    longest_sides=longest_sides,
    functional=Functional.of_solution,
    curved_part=lambda functional, movable: functional.energy_beyond_chords(movable.triangulation, functional.solution),
    carry=transferred,
    reasons=reasons_in_plane,
    polish_reasons=polish_reasons,
    held_in_polish=held_by_polish,
    descent=PlaneDescent,
    stalls=stalls_by_estimate,
    schedule_before_polish=BEFORE_POLISH,
)


def moved_in_space(
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


def curved_part_in_space(functional: SolidFunctional, movable: MovableSolid) -> float:
    tet, solution = movable.tetrahedralization, functional.solution
    return functional.faces.value(tet.position, tet.elements, solution.values, solution.surface)


SPACE = Method(
    dim=TETRAHEDRON.dim,
    passes_by_density=2,
    # Directions multiply errors at a given number of nodes by .67 to .97. Residuals overrate long elements, so runs to
    # a tolerance take up to four times as long, and a goal has directions of the dual solution, too.
    always_directed=False,
    open=MovableSolid.of,
    moving_kernels=lambda topology, schedule: (*loops_in_space(topology, schedule), "space locating"),
    polish_kernels=lambda problem: (
        *("space ground", "space moves", "space polish of order 2" if problem.order == 2 else "space polish"),
    ),
    transfer_kernels=("space carrying",),
    move=moved_in_space,
    longest_sides=lambda *of_curves: None,
    functional=SolidFunctional.of_solution,
    curved_part=curved_part_in_space,
    carry=transferred_in_space,
    reasons=reasons_in_space,
    polish_reasons=polish_reasons_in_space,
    held_in_polish=held_by_polish_in_space,
    descent=SpaceDescent.of,
    stalls=stalls_by_functional,
)


def method_of(mesh: Mesh) -> Method:
    return SPACE if cell_of(mesh) is TETRAHEDRON else PLANE
