"""Parallel sweeps of energy descent over nodes and edges.

Parts of the mesh do not depend on the number of threads.
"""

import numpy as np

from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.ordering import along_curve, mark_interior, parts_along
from kohonen_adapt.kernels.threads import even_cuts, shared, shared_in_parts
from kohonen_adapt.kernels.triangle.arrays import HELD
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.elements import UNKNOWNS
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.loops import Linear
from kohonen_adapt.polishing.paired_stars import Freedom, descend_pairs, set_partners
from kohonen_adapt.problem.protocol import Problem, order_of

__all__ = ["SWEEPS", "loops_of", "sweep"]

PART = 5_000  # unknowns per part, so many that few nodes are at the cuts

# Medians of five seeds after four passes of map and polish (`python -m benchmarks sweeps`), by number of sweeps:
#                                    0       4       8      12      16      32
#     L: E sqrt(N), N = 3201     0.794   0.735   0.730   0.728   0.728   0.726
#     M: error %, N = 1681       7.059   6.480   6.434   6.423   6.417   6.419
#     the same with iron         5.128   4.707   4.657   4.642   4.639   4.630
#     F: E sqrt(N), N = 3201     0.966   0.707   0.678   0.669   0.664   0.657
# A sweep takes 0.6 microseconds per node. Eight sweeps and the recycling take no longer than the map.
SWEEPS = 8


def sweep(movable: MovableMesh, functional: Functional, trial: TrialFunction, sweeps: int, swap_first: bool) -> float:
    # Edges are flipped after the nodes of every sweep. With `swap_first` they are also flipped before the first
    # sweep, so that useless nodes are detected earlier. The decrease excludes the gain of better values on Robin
    # boundaries.
    outline, gain = movable.outline, 0.0
    freedom = Freedom(functional.kinds(outline, trial.fixed), trial.fixed, functional.sign)
    # pairs, Robin nodes and nodes on chords are excluded, because their star is not the whole functional
    pairs, on_robin = outline.constraints.periodic.partner >= 0, functional.boundary.nodes(movable.triangulation)
    constraints = outline.constraints._replace(kind=np.where(pairs, HELD, freedom.kind).astype(np.int8))
    if pairs.any():
        set_partners(movable, trial, functional.sign)
    excluded = pairs | on_robin | functional.chords.moving(movable.triangulation)
    mesh = movable.kernel_mesh()._replace(constraints=constraints)
    loops = functional.loops(movable, trial._replace(fixed=trial.fixed | excluded), mesh)
    order = along_curve(movable.triangulation.position).astype(np.int32)
    parts = max(1, len(order) // (PART // UNKNOWNS[functional.ritz.order - 1]))
    part, interior = parts_along(order, len(order), parts), np.empty(len(order), dtype=np.bool_)
    if swap_first:
        gain += flip_downhill(movable, loops)
    for _ in range(sweeps):
        mark_interior(movable.triangulation.star, part, 1, interior, np.empty_like(order))
        gain += shared_in_parts(loops.descend_nodes, order, (part, interior))
        gain += descend_pairs(movable, loops, freedom)
        gain += flip_downhill(movable, loops)
        offsets = movable.midside_offsets() if movable.curved else None
        functional.improve_on_boundary(movable.triangulation, trial, offsets)
    return gain


def loops_of(problem: Problem) -> tuple[str, ...]:
    higher = order_of(problem) > 1 or getattr(problem, "axisymmetric", False)
    return "ground", "polish of higher order" if higher else "polish"


def flip_downhill(movable: MovableMesh, loops: Linear) -> float:
    if not movable.flips:
        return 0.0
    gainful = np.empty(len(movable.triangulation.elements.node), dtype=np.bool_)
    cuts = even_cuts(len(gainful), loops.few)
    shared(lambda thread, first, last: loops.descend_flips(thread, first, last, gainful, True), cuts)
    gain, flips = loops.descend_flips(0, 0, len(gainful), gainful, False)
    if flips:
        movable.triangulation.refill_star()
    return gain
