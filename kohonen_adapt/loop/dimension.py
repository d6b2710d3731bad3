"""Parts of the adaptive loop for triangles and for tetrahedra."""

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.held_nodes import reasons_in_plane, reasons_in_space
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.plane.arcs import possible_arcs
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.stopping import stalls_by_estimate, stalls_by_functional
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE, cell_of
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
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


class Method(ABC):
    """Movement and polish of the nodes of meshes of one dimension.

    Attributes
    ----------
    dim
        Dimension of the meshes.
    schedule_before_polish
        Schedule of the map in passes that recycle and polish, None for the default.
    passes_by_density
        Number of passes with recycling by density; later passes recycle by energy alone.
    """

    dim: ClassVar[int]
    schedule_before_polish: ClassVar[Schedule | None] = None
    # A density without directions moves a fifth of all nodes in every pass to positions from which the energy removes
    # them again, if long elements have the lowest energy. With directions, too, further passes by density gain nothing.
    passes_by_density: ClassVar[int]

    @abstractmethod
    def open(self, mesh: Mesh, rules: Rules, curved: bool | None) -> Any:
        """Return the movable mesh, with sides as in the input if `curved` is None."""

    @abstractmethod
    def moving_kernels(self, topology: str, schedule: Schedule | None) -> tuple[str, ...]:
        """Return the groups of `kernels/entries.py` that a relocation needs."""

    @abstractmethod
    def polish_kernels(self, problem: CheckedProblem) -> tuple[str, ...]: ...

    @property
    @abstractmethod
    def transfer_kernels(self) -> tuple[str, ...]: ...

    @abstractmethod
    def move(
        self,
        movable: Any,
        density: ArrayLike | Callable[[Floats], ArrayLike],
        schedule: Schedule | None,
        topology: str,
        rng: np.random.Generator,
        nodes: int,
        recycles: bool = True,
        longest: Floats | None = None,
    ) -> Moved[Any]:
        """Relocate to a density or to tensors, with `nodes` nodes.

        Nodes are exchanged only if the pass `recycles`. Sides on curves are at most as long as `longest`.
        """

    def longest_sides(self, movable: Any, functional: Any, estimate: float) -> Floats | None:
        # of sides on curves, at each node
        return None

    @abstractmethod
    def split(self, movable: Any, density: ArrayLike, nodes: int) -> Moved[Any]: ...

    @abstractmethod
    def functional(self, ritz: Ritz, movable: Any, mesh: Mesh) -> Any:
        """Return the functional that the polish lowers, for a solution on `mesh`."""

    @abstractmethod
    def value(self, functional: Any, ritz: Ritz, movable: Any, mesh: Mesh) -> float:
        """Return the value of the functional, up to the curves and surfaces."""

    @abstractmethod
    def carry(self, functional: Any, before: Any, movable: Any, start_element: Ints) -> Any: ...

    @abstractmethod
    def reasons(self, movable: Any) -> list[str]:
        """Return why each node is held, an empty string for nodes that move or slide."""

    @abstractmethod
    def held_in_polish(self, movable: Any, functional: Any) -> Mask:
        """Return the mask (n,) of nodes held by the polish alone."""

    @abstractmethod
    def polish_reasons(self, movable: Any, functional: Any) -> list[str]:
        """Return why the polish alone holds each node, else an empty string."""

    @abstractmethod
    def descent(self, movable: Any, functional: Any, trial: Any, recycled: Recycled) -> Descent:
        """Return the descent for the polish, which changes `movable`."""

    @abstractmethod
    def takes_directions(self, settings: Settings, last: Pass) -> bool:
        """Return True if elements get directions with ``anisotropic="auto"``."""

    @abstractmethod
    def stalls(self, passes: tuple[Pass, ...]) -> bool: ...

    def corrects(self, problem: CheckedProblem) -> bool:
        return False


logger = logging.getLogger("kohonen_adapt")


def opened_in_plane(mesh: Mesh, rules: Rules, curved: bool | None) -> MovableMesh:
    movable = MovableMesh.of(mesh, rules, curved)
    for arc in possible_arcs(movable):
        if arc.is_cut:  # of other polygons only `check` reports
            logger.warning("%s", arc.advice())
    return movable


class PlaneMethod(Method):
    dim = TRIANGLE.dim
    passes_by_density = 3
    transfer_kernels = ("carrying",)
    open = staticmethod(opened_in_plane)
    schedule_before_polish = BEFORE_POLISH
    move = staticmethod(move)
    split = staticmethod(split_edges)
    functional = staticmethod(Functional.of_solution)
    carry = staticmethod(transferred)
    reasons = staticmethod(reasons_in_plane)
    held_in_polish = staticmethod(held_by_polish)
    polish_reasons = staticmethod(polish_reasons)
    descent = staticmethod(PlaneDescent)
    stalls = staticmethod(stalls_by_estimate)

    def moving_kernels(self, topology: str, schedule: Schedule | None) -> tuple[str, ...]:
        return loops_in_plane(topology)

    def polish_kernels(self, problem: CheckedProblem) -> tuple[str, ...]:
        higher = problem.order > 1 or getattr(problem, "axisymmetric", False)
        return "ground", "polish of higher order" if higher else "polish"

    def longest_sides(self, movable: MovableMesh, functional: Functional, estimate: float) -> Floats | None:
        if functional.dual is not None:  # the effect of arcs on a goal is unknown
            return None
        return longest_on_arcs(functional.ritz, movable, estimate)

    def value(self, functional: Functional, ritz: Ritz, movable: MovableMesh, mesh: Mesh) -> float:
        curved_part = functional.energy_beyond_chords(movable.triangulation, functional.solution)
        return functional_value(mesh, ritz) + curved_part

    def takes_directions(self, settings: Settings, last: Pass) -> bool:
        return settings.rules.topology != "fixed"

    def corrects(self, problem: CheckedProblem) -> bool:
        # At order 1 the misplaced nodes cost 0.5 to 1 % of the error after three or four passes, and save a pass over
        # all nodes, with 1.4 to 1.9 times the time. At higher orders they cost several per cent, and on tetrahedra as
        # well, because growth by density shortens long elements.
        return problem.has_functional and problem.order == 1


class SpaceMethod(Method):
    dim = TETRAHEDRON.dim
    passes_by_density = 2
    transfer_kernels = ("space carrying",)
    open = staticmethod(MovableSolid.of)
    split = staticmethod(split_edges)
    functional = staticmethod(SolidFunctional.of_solution)
    carry = staticmethod(transferred_in_space)
    reasons = staticmethod(reasons_in_space)
    held_in_polish = staticmethod(held_by_polish_in_space)
    polish_reasons = staticmethod(polish_reasons_in_space)
    stalls = staticmethod(stalls_by_functional)

    def moving_kernels(self, topology: str, schedule: Schedule | None) -> tuple[str, ...]:
        return *loops_in_space(topology, schedule), "space locating"

    def polish_kernels(self, problem: CheckedProblem) -> tuple[str, ...]:
        return "space ground", "space moves", "space polish of order 2" if problem.order == 2 else "space polish"

    def descent(
        self, movable: MovableSolid, functional: SolidFunctional, trial: TrialFunction, recycled: Recycled
    ) -> Descent:
        return SpaceDescent.of(movable, functional, trial, recycled)

    def move(
        self,
        movable: MovableSolid,
        density: ArrayLike | Callable[[Floats], ArrayLike],
        schedule: Schedule | None,
        topology: str,
        rng: np.random.Generator,
        nodes: int,
        recycles: bool = True,
        longest: Floats | None = None,
    ) -> Moved[MovableSolid]:
        if not recycles:  # the map would shorten the long elements that lower the energy
            return self.split(movable, density, movable.nnodes)
        return move_in_space(movable, density, schedule, topology, rng, nodes)

    def takes_directions(self, settings: Settings, last: Pass) -> bool:
        # Directions multiply errors at a given number of nodes by .67 to .97.
        # Residuals overrate long elements, so runs to a tolerance take up to four times as long, and a goal has
        # directions of the dual solution, too.
        return settings.rules.topology != "fixed" and not settings.tolerance and last.goal is None

    def value(self, functional: SolidFunctional, ritz: Ritz, movable: MovableSolid, mesh: Mesh) -> float:
        tet = movable.tetrahedralization
        solution = functional.solution
        curved_part = functional.faces.value(tet.position, tet.elements, solution.values, solution.surface)
        return functional_value(mesh, ritz) + curved_part


def method_of(mesh: Mesh) -> Method:
    return SpaceMethod() if cell_of(mesh) is TETRAHEDRON else PlaneMethod()
