"""Polish by descent of the energy."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from skfem import Mesh

from kohonen_adapt.checks import check_count, with_nearest_names
from kohonen_adapt.kernels.compilation import expect
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE, cell_of, check_kind
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.outline.curves import Curve
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.movable_solid import MovableSolid
from kohonen_adapt.outline.rules import LeastQuality, Pinned, Rules, with_pinned
from kohonen_adapt.outline.surfaces import Surface
from kohonen_adapt.outline.surgery import Recycled
from kohonen_adapt.polishing.curve_nodes import descend_curves
from kohonen_adapt.polishing.energy_recycling import Exchange, recycle_by_energy
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.polish_in_space import SETTLED, descend_in_space, loops_in_space
from kohonen_adapt.polishing.solid_functional import SolidFunctional
from kohonen_adapt.polishing.sweeps import SWEEPS, loops_of, sweep
from kohonen_adapt.problem.protocol import (
    NotOffered,
    Problem,
    check_names,
    is_curved,
    nodes_held,
    offered,
    offers,
    ritz_of,
)

__all__ = ["PLAN", "descend", "descend_and_recycle", "polish"]

# Sweeps before, between and after the recyclings. Three groups instead of two lower the error on F by 1 %.
PLAN = (2, 2, 2, 2)
# Further recyclings by order, each with the last number of sweeps, while the decrease exceeds PAYS times the gains of
# splits of all edges (an estimate of the distance to the minimum, for few and for many nodes that carry the distance).
# Error after two passes divided by the error after four, at order 3, with 0 / 3 / 6 / 10 further recyclings:
#     L, N = 2827       1.03   1.04   1.00   1.02
#     L, N = 11 059     1.06   1.02   1.01   1.01
#     C                 1.04   1.02   1.02   1.02
MORE = (0, 6, 6)
PAYS = 0.01
KNOWN = 2  # sweeps between two samplings of a varying flux
# Sweeps between two samplings of a varying source. With 2, order 3 gains nothing in half the problems of `own-source`.
KNOWN_SOURCE = 1


@with_nearest_names({"iterations": "sweeps", "passes": "sweeps", "steps": "sweeps", "fixed": "pinned"})
def polish(
    mesh: Mesh,
    problem: Problem,
    *,
    sweeps: int = SWEEPS,
    topology: str = "flip",
    min_quality: LeastQuality = "auto",
    pinned: Pinned = (),
    seed: int = 0,
    curves: Mapping[str, Curve] | None = None,
    periodic: Sequence[Pair] = (),
    layers: Mapping[str, int] | None = None,
    surfaces: Mapping[str, Surface] | None = None,
) -> Mesh:
    """Move nodes by descent of the energy of the discrete solution.

    For ``Pi(u) = int coefficient / 2 |grad u|^2 - source u - flux . grad u``, or with the energies of nonlinear
    laws, the functional of the discrete solution exceeds the exact minimum by half the squared error in the
    energy norm. A sweep moves every node in turn by Newton's method to where the functional of the adjacent
    elements is lower, with the value of the node (and at order 2 and 3 of its sides) eliminated. A sweep then
    flips every edge whose flip lowers the functional, and swaps tetrahedra by the same rule. The result of a
    sweep is a function on the new mesh with a lower functional. The solution on the new mesh is lower still, so
    the error does not grow.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`, `skfem.MeshTri2` or `skfem.MeshTet`, which is not modified. The problem is solved once.
    problem
        An object with ``solve(mesh) -> solution`` and ``ritz(mesh, solution) -> kohonen_adapt.Ritz``, of order 1
        to 3, on tetrahedra of order 1.
    sweeps
        Number of sweeps.
    topology
        ``"flip"`` flips edges and swaps tetrahedra if the functional decreases, so the result need not be
        Delaunay. ``"fixed"`` keeps ``mesh.t``.
    min_quality, pinned, curves, periodic, layers, surfaces
        Constraints on nodes and elements, see `Rules`. Nodes slide on arcs and splines with straight facets only
        under the conditions in the notes.
    seed
        An integer >= 0, for the same interface as other functions. The polish has no random part.

    Returns
    -------
    Mesh
        Mesh with the same number of nodes and the same names. Nodes stay in their region, and boundaries and
        interfaces keep their shape. A `MeshTri2` if the input is one or the problem is `curved`, provided that a
        boundary or interface is curved.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri` or `skfem.MeshTet`, an argument is out of range, the problem
        has no ``ritz``, or one for the plane only, or its constants change inside a region of the mesh.

    Notes
    -----
    At order 1, with straight facets on curves, the functional includes the slivers between chords and curves with
    the material of the true domain. Slivers require linear material, a flux and source that do not vary, and no
    periodic pairs. Dirichlet values must be constant, on the outer boundary of a convex domain. All other nodes
    on curves are held, and so are nodes whose Dirichlet values are not linear along their curve segment. If they
    moved, the set of admissible functions would change, and a lower functional would not imply a lower error.

    Energies of nonlinear material are tabulated with a relative error of 1e-10.

    Nodes of tetrahedra are held where Dirichlet values are not linear on a face or along an edge of the body.
    Nodes slide on spheres, cylinders and cones. Slivers between faces and these surfaces are counted twice where
    they increase the functional, which is an upper bound for both domains and any material. The next solution
    does not include the slivers. Nodes are held on surfaces that are defined by projections only, where a source
    ends at the surface, and where a surface inside the mesh or around a hole has Dirichlet values.

    Descent of nodal positions by the energy: P. Thoutireddy and M. Ortiz, "A variational r-adaption and
    shape-optimization method for finite-deformation elasticity", Int. J. Numer. Meth. Engng 61 (2004).

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
    >>> mesh = skfem.MeshTri().refined(4).with_subdomains({"coil": lambda x: x[0] < 0.5, "air": lambda x: x[0] > 0.5})
    >>> mesh = mesh.with_boundaries({"outer": lambda x: x[0] < 2.0})
    >>> coil = Material(current_density=1e6)
    >>> problem = Magnetostatics({"coil": coil, "air": Material()}, potential={"outer": 0.0})
    >>> better = ka.polish(mesh, problem)
    >>> problem.solve(better).energy > problem.solve(mesh).energy  # nearer to the exact energy, from below
    True
    """
    check_polish(problem, sweeps, topology, seed)
    rules = Rules(topology, min_quality, pinned, curves, periodic, layers, surfaces).guarded()
    check_kind(mesh, curved=True, space=True)
    method = METHODS[cell_of(mesh).dim]
    movable = method.from_mesh(mesh, with_pinned(rules, nodes_held(problem, mesh)), is_curved(problem))
    mesh = movable.start()
    expect(*method.loops(problem))
    try:
        functional = method.stated(ritz_of(problem, mesh, problem.solve(mesh)), movable, mesh)
    except NotOffered as reason:
        raise without_functional(reason) from None
    method.descended(movable, functional, functional.solution.copy(), sweeps)
    return movable.mesh()


def check_polish(problem: Problem, sweeps: object, topology: object, seed: object) -> None:
    if topology not in ("fixed", "flip"):
        raise ValueError(f"topology must be 'fixed' or 'flip', because polish keeps all nodes; got {topology!r}.")
    check_count("seed", seed)
    check_count("sweeps", sweeps)
    if not offers(problem, "solve"):
        raise ValueError(f"polish requires a problem with the method solve(mesh); {type(problem).__name__} has none.")
    check_names(problem)
    try:
        offered(problem, "ritz")
    except NotOffered as reason:
        raise without_functional(reason) from None


def without_functional(reason: NotOffered) -> ValueError:
    return ValueError(f"polish requires the functional of the problem: {reason}.")


def descend_and_recycle(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, recycled: Recycled, plan: Sequence[int] = PLAN
) -> tuple[Recycled, float]:
    """Sweep by the numbers in `plan`, with recycling by energy between the numbers.

    At order 2 and 3 up to `MORE` recyclings and sweeps follow. Returned are all recycled nodes, including those
    of `recycled`, and the decrease of the functional. A plan of one number keeps all nodes.
    """
    eager = pays = len(plan) > 1
    gain = descend(movable, functional, trial, plan[0], eager)
    for sweeps, planned in rounds(plan, functional.ritz.order):
        if pays:
            exchange = recycle_downhill(movable, functional, trial, recycled)
            pays = still_pays(exchange, recycled, movable.nnodes, functional.ritz.order)
            trial, recycled, gain = exchange.trial, exchange.recycled, gain + exchange.lowered
        elif not planned:
            break
        gain += descend(movable, functional, trial, sweeps, eager)
    return recycled, gain


def rounds(plan: Sequence[int], order: int) -> list[tuple[int, bool]]:
    more = MORE[order - 1] if len(plan) > 1 else 0
    return [(sweeps, True) for sweeps in plan[1:]] + [(plan[-1], False)] * more


def still_pays(exchange: Exchange, before: Recycled, nodes: int, order: int) -> bool:
    if order == 1:
        return exchange.recycled.splits - before.splits > SETTLED * nodes
    return exchange.lowered > PAYS * exchange.offered


def descend(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, sweeps: int = SWEEPS, eager: bool = False
) -> float:
    """Sweep nodes and edges, and return the decrease of the functional.

    Sampled sources and fluxes hold near the sampled positions only. They are sampled again every few sweeps,
    which are undone if the functional has not decreased. The same holds with slivers between chords and curves,
    which the kernels do not include.
    """
    if not functional.nearly:
        return sweep(movable, functional, trial, sweeps, eager)
    total, known = 0.0, KNOWN_SOURCE if functional.has_varying_source else KNOWN
    for done in range(0, sweeps, known):
        state, old = {name: array.copy() for name, array in movable.state().items()}, trial.copy()
        before = functional.value(movable.triangulation, trial)
        gain = sweep(movable, functional, trial, min(known, sweeps - done), eager)
        gain += descend_curves(movable, functional, trial)
        fallen = before - functional.value(movable.triangulation, trial)
        if not fallen > 0.0:
            movable.restore(state)
            trial.restore(old)
            break
        total += min(gain, fallen)
    return total


def recycle_downhill(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, recycled: Recycled
) -> Exchange:
    if not functional.nearly:
        return recycle_by_energy(movable, functional, trial, recycled)
    state, before = movable.state(), functional.value(movable.triangulation, trial)
    done = recycle_by_energy(movable, functional, trial, recycled)
    fallen = before - functional.value(movable.triangulation, done.trial)
    if fallen > 0.0:
        return done._replace(lowered=min(done.lowered, fallen))
    movable.restore(state)
    return Exchange(trial, recycled, 0.0, done.offered)


class Method(NamedTuple):
    """Methods of the polish for one dimension."""

    from_mesh: Callable[..., Any]
    loops: Callable[[Problem], tuple[str, ...]]
    stated: Callable[..., Any]
    descended: Callable[..., float]


METHODS = {
    TRIANGLE.dim: Method(MovableMesh.of, loops_of, Functional.of_solution, descend),
    TETRAHEDRON.dim: Method(MovableSolid.of, loops_in_space, SolidFunctional.of_solution, descend_in_space),
}
