"""Relocation, polish and reasons of held nodes, without a loop of passes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import DataFunction, Texts
from kohonen_adapt.checks import check_count, with_nearest_names
from kohonen_adapt.geometry.held_nodes import with_pins
from kohonen_adapt.geometry.movable import unchanged
from kohonen_adapt.geometry.plane.curves import Curves
from kohonen_adapt.geometry.plane.surgery import with_thin_layers
from kohonen_adapt.geometry.rules import LeastQuality, Pinned, Rules, check_for, with_pinned
from kohonen_adapt.geometry.space.surfaces import NamedSurfaces
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.log import logger
from kohonen_adapt.loop.dimension import method_of
from kohonen_adapt.loop.functional_of_pass import functional_of
from kohonen_adapt.loop.passes import work_of
from kohonen_adapt.loop.setup import rules_for
from kohonen_adapt.mesh.cells import centroids_of, check_kind
from kohonen_adapt.mesh.locate import find_elements
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.polishing.polish import SWEEPS, descend_and_recycle
from kohonen_adapt.problem.evaluation import ritz_of
from kohonen_adapt.problem.protocol import CheckedProblem, NotOffered, Problem, check_names
from kohonen_adapt.som.relocate import report_sagitta
from kohonen_adapt.som.schedule import Schedule, check_training


@with_nearest_names({"size": "density", "sizes": "density", "indicators": "density", "fixed": "pinned"})
def relocate(
    mesh: Mesh,
    density: ArrayLike | DataFunction,
    *,
    schedule: Schedule | None = None,
    topology: str = "flip",
    min_quality: LeastQuality = "auto",
    pinned: Pinned = (),
    seed: int = 0,
    curves: Curves | None = None,
    periodic: Sequence[Pair] = (),
    layers: Mapping[str, int] | None = None,
    surfaces: NamedSurfaces | None = None,
) -> Mesh:
    """Move the nodes of a mesh to a given density.

    All nodes and their numbers are kept. Nodes of triangles are moved by a Kohonen map, nodes of tetrahedra by sweeps
    of smoothing with swaps of elements between the sweeps. `adapt`, which repeats relocation for an estimated density,
    recycles nodes by default, too.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`, a `skfem.MeshTri2`, of which the corners are moved, or a `skfem.MeshTet`. The mesh is not
        modified.
    density
        Wanted nodes per area or volume up to a factor, >= 0 and not zero everywhere: an array of shape (nelements,), or
        a callable of points x, shape (2, n), in space (3, n), that returns shape (n,). Zeros are raised to 1e-6 of the
        largest value.

        Or density tensors D of shape (nelements, d, d), from a callable (n, d, d), symmetric and positive definite:
        ``sqrt(det D)`` is the density, and edges e are to have the same ``e' D e``. These are a metric up to a factor,
        see `density_from_sizes` and `metric_from_hessian`.
    schedule
        Schedule of the map. None means `Schedule.default` with a first radius that depends on how far the mesh is from
        the density, so that repeated calls, each with a new estimate, continue to improve the mesh. ``Schedule(())``
        moves nothing; with ``topology="flip"`` it makes each region constrained Delaunay. For tetrahedra, None means 8
        sweeps with "flip", 6 with "fixed" and 3 with "recycle". Stages, if any, are presented before the sweeps; rounds
        are refused. Without stages and sweeps elements are swapped, to raise the least quality, and recycled.
    topology, min_quality, pinned, curves, periodic, layers, surfaces
        Constraints on the nodes, see `Rules`. With ``topology="recycle"`` nodes do not keep their numbers.
    seed
        Seed of all random numbers. The same seed gives the same mesh, bit for bit, on one type of CPU.

    Returns
    -------
    MeshTri or MeshTet
        Mesh with the same number of nodes and the same names. Nodes stay in their region, and boundaries and interfaces
        keep their shape. If the input is a `skfem.MeshTri2` and a boundary or interface is curved, so is the result:
        its curved sides lie on arcs, where corners and midside nodes are on a circle, or else on splines through both.
        Midside nodes are put on these curves, or nearer to the chord where an element would be inverted. Curved sides
        on no boundary or interface are straightened.

    Raises
    ------
    ValueError
        If the mesh is not a valid `skfem.MeshTri`, `skfem.MeshTri2` or `skfem.MeshTet`, if an argument is out of range,
        or if the mesh has fewer layers than `layers` requests. If a tensor is not finite, not symmetric or not positive
        definite, or if its longest edge is more than 1e6 times its shortest.

    Notes
    -----
    The density belongs to the input mesh throughout. A training point moves only nodes of its own region. Equation 1,
    the neighbourhood and the treatment of boundaries are from Lowther and Mai, "On Automatic Mesh Generation using
    Kohonen Maps". See `kernels/tetrahedron/swap.py` for the swaps of tetrahedra, and `kernels/tetrahedron/smooth.py`
    for the smoothing, which balances the mass of the density in every element and the shape of the element.

    The logger ``kohonen_adapt`` reports the reason if no node moves (WARNING), the distance between facets and the
    curves on which their nodes slide (INFO), and the arcs that are recognised (DEBUG).

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(4)
    >>> finer_below = ka.relocate(mesh, lambda x: 1 / (0.1 + x[1]))
    >>> finer_below.p.shape == mesh.p.shape
    True

    Edges that are four times as long along x as along y:

    >>> import numpy as np
    >>> metric = np.tile(np.diag([1.0, 16.0]), (mesh.nelements, 1, 1))
    >>> longer = ka.relocate(mesh, metric, topology="recycle")
    >>> x, y = np.abs(longer.p[:, longer.facets[0]] - longer.p[:, longer.facets[1]]).mean(axis=1)
    >>> bool(x > 3.0 * y)
    True
    """
    check_training(schedule, seed)
    rules = Rules(topology, min_quality, pinned, curves, periodic, layers, surfaces).guarded()
    check_kind(mesh)
    method = method_of(mesh)
    check_for(rules, mesh.dim())
    layered = with_thin_layers(mesh, rules)
    movable = method.opened(layered, rules, None)
    if layered is not mesh and not callable(density) and np.shape(density)[:1] == mesh.t.shape[1:]:
        density = np.asarray(density)[find_elements(mesh, centroids_of(layered))]
    expect(*method.moving_kernels(topology, schedule))
    moved = method.move(movable, density, schedule, topology, np.random.default_rng(seed), nodes=int(mesh.nvertices))
    report_sagitta(moved.before, movable)
    work = work_of(moved, movable)
    if not work.moved and schedule != Schedule(()):  # an empty schedule is used for its flips alone
        logger.warning("relocate moved no node: %s.", work.why_still)
    return movable.mesh()


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
    curves: Curves | None = None,
    periodic: Sequence[Pair] = (),
    layers: Mapping[str, int] | None = None,
    surfaces: NamedSurfaces | None = None,
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
        to 3, on tetrahedra of order 1 or 2.
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
    At order 1 nodes slide on spheres, cylinders and cones. Slivers between faces and these surfaces are counted
    twice where they increase the functional, which is an upper bound for both domains and any material. The next
    solution does not include the slivers. Nodes are held on surfaces that are defined by projections only, where a
    source ends at the surface, and where a surface inside the mesh or around a hole has Dirichlet values.

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
    checked = CheckedProblem(problem)
    if topology not in ("fixed", "flip"):
        raise ValueError(f"topology must be 'fixed' or 'flip', because polish keeps all nodes; got {topology!r}.")
    check_count("seed", seed)
    check_count("sweeps", sweeps)
    if not checked.has("solve"):
        raise ValueError(f"polish requires a problem with the method solve(mesh); {checked.name} has none.")
    check_names(checked)
    try:
        checked.optional("ritz")
        rules = Rules(topology, min_quality, pinned, curves, periodic, layers, surfaces).guarded()
        check_kind(mesh)
        method = method_of(mesh)
        movable = method.opened(mesh, with_pinned(rules, checked.nodes_on(mesh)), checked.is_curved)
        mesh = movable.start()
        expect(*method.polish_kernels(checked))
        functional = method.functional(ritz_of(checked, mesh, checked.solve(mesh)), movable, mesh)
    except NotOffered as reason:
        raise ValueError(f"polish requires the functional of the problem: {reason}.") from None
    start = unchanged(movable.tessellation)
    descend_and_recycle(method.descent(movable, functional, functional.solution.copy(), start), (sweeps,))
    return movable.mesh()


def why_held(mesh: Mesh, problem: Problem | Rules | None = None, rules: Rules | None = None) -> Texts:
    """Return why each node of a mesh is held.

    Layers hold no node, because they refuse flips, collapses and splits only. The quality, the reach of a move and the
    schedule depend on the pass: `Pass` counts the moves that they refused.

    Parameters
    ----------
    mesh
        A mesh of triangles with straight or curved sides, or of tetrahedra.
    problem
        A problem as for `adapt`, which is solved once on the mesh. None stands for no problem. `Rules` are accepted
        here, too.
    rules
        Rules beside those of the problem. As in `adapt`, curves of a boundary replace those of the problem, pinned
        nodes are added to its points, and pairs, if any, replace its pairs. None stands for ``Rules()``.

    Returns
    -------
    ndarray (nnodes,) of str
        The reason in words: a pin with the boundary or subdomain that pins the node, a point of the problem, a corner
        or junction with the names of boundaries or subdomains and the turn, a turn at which no curve is recognised, or
        a periodic pair. Reasons that hold a node in the polish only begin with ``polish:``, for example Dirichlet
        values that are not linear, or an open boundary. An empty string stands for a node that moves or slides.

    Raises
    ------
    ValueError
        If the mesh or a rule is invalid.
    TypeError
        If `problem` is neither a problem nor `Rules`, or if `rules` are no `Rules` or given twice.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(2).with_boundaries({"rim": lambda x: x[0] < 2.0})
    >>> why = ka.why_held(mesh, rules=ka.Rules(pinned=[12]))
    >>> str(why[0]), str(why[12]), int((why == "").sum())
    ("corner of boundary 'rim', 90 degrees", 'pinned by number', 20)
    """
    check_kind(mesh)
    if isinstance(problem, Rules):
        if rules is not None:
            raise TypeError("why_held requires Rules once, as problem or as rules; got both.")
        problem, rules = None, problem
    rules = Rules() if rules is None else rules
    if not isinstance(rules, Rules):
        raise TypeError(f"rules of why_held must be kohonen_adapt.Rules; got {rules!r}.")
    if problem is None:
        return reasons_at(mesh, None, rules)
    checked = CheckedProblem(problem)
    if not checked.has("solve"):
        raise TypeError(f"why_held requires a problem with the method solve(mesh), or Rules; got {problem!r}.")
    check_names(checked)
    return reasons_at(mesh, checked, rules)


def reasons_at(mesh: Mesh, problem: CheckedProblem | None, rules: Rules, solution: Any = None) -> Texts:
    method = method_of(mesh)
    if problem is None:
        check_for(rules, mesh.dim())
        layered = with_thin_layers(mesh, rules)  # nodes of missing layers follow the nodes of the input
        reasons = method.reasons(method.opened(layered, rules.guarded(), None))
        return np.array(with_pins(reasons, mesh, rules.pinned, None), np.str_)
    if problem.final_orders(False):  # the solution is not of the order of the passes
        problem, solution = problem.at_grading_order, None
    given = rules_for(problem, mesh, rules, rules.periodic or None)
    movable = method.opened(with_thin_layers(mesh, given), given, problem.is_curved)
    reasons = with_pins(method.reasons(movable), mesh, rules.pinned, problem.points_on(mesh))
    start = movable.start()
    found = functional_of(problem, method, movable, start, problem.solve(start) if solution is None else solution)
    polish = [found.unpolished] * movable.nnodes
    if found.functional:
        polish = method.polish_reasons(movable, found.functional)
    texts = [why or (f"polish: {other}" if other else "") for why, other in zip(reasons, polish, strict=False)]
    return np.array(texts, np.str_)
