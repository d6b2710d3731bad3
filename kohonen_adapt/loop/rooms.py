"""Methods of the adaptive loop for triangles and for tetrahedra."""

from skfem import Mesh

from kohonen_adapt.arrays import Floats
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.step import Method
from kohonen_adapt.loop.stopping import stalls_by_estimate, stalls_by_functional
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.movable_solid import MovableSolid
from kohonen_adapt.outline.surgery import unchanged
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.polish import PLAN, descend_and_recycle
from kohonen_adapt.polishing.polish_in_space import PLAN_IN_SPACE, descend_and_recycle_in_space
from kohonen_adapt.polishing.polish_in_space import loops_in_space as loops_of_solids
from kohonen_adapt.polishing.slivers import longest_on_arcs
from kohonen_adapt.polishing.solid_functional import SolidFunctional
from kohonen_adapt.polishing.sweeps import loops_of
from kohonen_adapt.polishing.transfer import carried
from kohonen_adapt.polishing.transfer_in_space import carried_in_space
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.problem.protocol import Problem, has_functional, order_of
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.moved import Moved, why_still
from kohonen_adapt.som.relocate import loops_in_plane, move
from kohonen_adapt.som.space import loops_in_space, move_in_space

__all__ = ["METHODS"]


def loops_for_triangles(problem: Problem, settings: Settings) -> tuple[str, ...]:
    return *loops_in_plane(settings.rules.topology), *([*loops_of(problem), "carrying"] if settings.polish else [])


def moved_triangles(
    movable: MovableMesh,
    density: Floats,
    functional: Functional | None,
    estimate: float,
    settings: Settings,
    number: int,
    recycles: bool,
) -> Moved[MovableMesh]:
    """Return the relocation of pass `number` for a density (nelements,).

    Nodes are exchanged only if the pass `recycles`.
    """
    longest = None
    if functional is not None and functional.dual is None:  # the effect of arcs on a goal is unknown
        longest = longest_on_arcs(functional.ritz, movable, estimate)
    topology, nodes = settings.rules.topology, settings.growth.nodes(number, functional is not None)
    return move(movable, density, settings.schedule, topology, settings.rng(number), nodes, recycles, longest)


def corrects_triangles(problem: Problem) -> bool:
    """Return True if the polish corrects nodes that the estimate misplaced."""
    # At order 1 the misplaced nodes cost 0.5 to 1 % of the error after three or four passes, and save a pass over all
    # nodes: `python -m benchmarks growth`. At higher orders they cost several per cent, and on tetrahedra as well,
    # because growth by density shortens long elements.
    return has_functional(problem) and order_of(problem) == 1


def stated_on_triangles(ritz: Ritz, movable: MovableMesh, mesh: Mesh) -> tuple[Functional, float]:
    functional = Functional.of_solution(ritz, movable, mesh)
    beyond = functional.beyond_chords(movable.triangulation, functional.solution)
    return functional, functional_value(mesh, ritz) + beyond


def loops_for_tetrahedra(problem: Problem, settings: Settings) -> tuple[str, ...]:
    moving = loops_in_space(settings.rules.topology, settings.schedule)
    return *moving, "space locating", *([*loops_of_solids(problem), "space carrying"] if settings.polish else [])


def moved_tetrahedra(
    movable: MovableSolid,
    density: Floats,
    functional: SolidFunctional | None,
    estimate: float,
    settings: Settings,
    number: int,
    recycles: bool,
) -> Moved[MovableSolid]:
    """Return the relocation of pass `number` for a density (nelements,).

    Without recycling the mesh is unchanged, because the map shortens the long elements that lower the energy.
    """
    if not recycles:
        return Moved(movable.copy(), unchanged(movable.tetrahedralization), (), why_still(movable, settings.schedule))
    nodes, rng = settings.growth.nodes(number), settings.rng(number)
    return move_in_space(movable, density, settings.schedule, settings.rules.topology, rng, nodes)


def stated_on_tetrahedra(ritz: Ritz, movable: MovableSolid, mesh: Mesh) -> tuple[SolidFunctional, float]:
    functional, tet = SolidFunctional.of_solution(ritz, movable, mesh), movable.tetrahedralization
    beyond = functional.faces.value(tet.position, tet.elements, functional.solution.values)
    return functional, functional_value(mesh, ritz) + beyond


METHODS = {
    TRIANGLE.dim: Method(
        TRIANGLE.dim, MovableMesh.of, loops_for_triangles, moved_triangles, stated_on_triangles, carried,
        descend_and_recycle, 3, corrects_triangles, stalls_by_estimate, PLAN,
    ),
    TETRAHEDRON.dim: Method(
        TETRAHEDRON.dim, MovableSolid.of, loops_for_tetrahedra, moved_tetrahedra, stated_on_tetrahedra,
        carried_in_space, descend_and_recycle_in_space, 2, lambda problem: False,
        stalls_by_functional, PLAN_IN_SPACE,
    ),
}  # fmt: skip
