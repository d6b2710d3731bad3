"""Parallel sweeps of energy descent over nodes and edges.

Parts of the mesh do not depend on the number of threads.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Mask
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.arrays import HELD, Constraints
from kohonen_adapt.kernels.ordering import along_curve, mark_interior, parts_along
from kohonen_adapt.kernels.threads import even_cuts, shared, shared_in_parts
from kohonen_adapt.kernels.triangle.polish.descend import descend_nodes
from kohonen_adapt.kernels.triangle.polish.descend_higher import Descents
from kohonen_adapt.kernels.triangle.polish.flip_higher import descend_flips_higher
from kohonen_adapt.kernels.triangle.polish.flip_linear import descend_flips
from kohonen_adapt.kernels.triangle.polish.sweep_higher import descend_nodes_higher
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.polishing.elements import UNKNOWNS, min_per_thread, shapes_of
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.paired_stars import Descending, Freedom, Patch, descend_pairs, set_partners
from kohonen_adapt.problem.protocol import Problem, order_of

__all__ = ["SWEEPS", "Higher", "Linear", "loops_of", "sweep"]

PART = 5_000  # unknowns per part, so many that few nodes are at the cuts

# Medians of five seeds after four passes of map and polish (`python -m benchmarks sweeps`), by number of sweeps:
#                                    0       4       8      12      16      32
#     L: E sqrt(N), N = 3201     0.794   0.735   0.730   0.728   0.728   0.726
#     M: error %, N = 1681       7.059   6.480   6.434   6.423   6.417   6.419
#     the same with iron         5.128   4.707   4.657   4.642   4.639   4.630
#     F: E sqrt(N), N = 3201     0.966   0.707   0.678   0.669   0.664   0.657
# A sweep takes 0.6 microseconds per node. Eight sweeps and the recycling take no longer than the map.
SWEEPS = 8


class Downhill(Descending, Protocol):
    """Methods of a sweep for one order of elements."""

    few: int  # elements per thread at least

    def descend_nodes(self, thread: int, nodes: NDArray[np.int32]) -> float:
        """Move nodes in the given order, and return the decrease of the functional."""

    def descend_flips(self, thread: int, first: int, last: int, gainful: Mask, marks: bool) -> tuple[float, int]:
        """Mark elements with an edge whose flip gains, or flip edges of marked elements.

        Returned are the decrease of the functional and the number of flips.
        """


def sweep(movable: MovableMesh, functional: Functional, trial: TrialFunction, sweeps: int, swap_first: bool) -> float:
    """Sweep nodes and edges, and return the decrease by moves and flips.

    Edges are flipped after the nodes of every sweep. With `swap_first` they are also flipped before the first sweep,
    so that useless nodes are detected earlier. The decrease excludes the gain of better values on Robin
    boundaries.
    """
    outline, gain = movable.outline, 0.0
    freedom = Freedom(functional.kinds(outline, trial.fixed), trial.fixed, functional.sign)
    # pairs, Robin nodes and nodes on chords are excluded, because their star is not the whole functional
    pairs, on_robin = outline.constraints.periodic.partner >= 0, functional.boundary.nodes(movable.triangulation)
    constraints = outline.constraints._replace(kind=np.where(pairs, HELD, freedom.kind).astype(np.int8))
    if pairs.any():
        set_partners(movable, trial, functional.sign)
    excluded = pairs | on_robin | functional.chords.moving(movable.triangulation)
    downhill = _downhill(movable, functional, trial._replace(fixed=trial.fixed | excluded), constraints)
    order = along_curve(movable.triangulation.position).astype(np.int32)
    parts = max(1, len(order) // (PART // UNKNOWNS[functional.ritz.order - 1]))
    part, interior = parts_along(order, len(order), parts), np.empty(len(order), dtype=np.bool_)
    if swap_first:
        gain += flip_downhill(movable, downhill)
    for _ in range(sweeps):
        mark_interior(movable.triangulation.star, part, 1, interior, np.empty_like(order))
        gain += shared_in_parts(downhill.descend_nodes, order, (part, interior))
        gain += descend_pairs(movable, downhill, freedom)
        gain += flip_downhill(movable, downhill)
        offsets = movable.midside_offsets() if movable.curved else None
        functional.improve_on_boundary(movable.triangulation, trial, offsets)
    return gain


def loops_of(problem: Problem) -> tuple[str, ...]:
    higher = order_of(problem) > 1 or getattr(problem, "axisymmetric", False)
    return "ground", "polish of higher order" if higher else "polish"


class Linear:
    """Sweeps of functions of order 1."""

    def __init__(
        self, movable: MovableMesh, functional: Functional, trial: TrialFunction, constraints: Constraints
    ) -> None:
        self.triangulation, self.floor, self.constraints = movable.triangulation, movable.floor, constraints
        self.few = min_per_thread(functional.ritz.order)
        self.trials, self.modes, self.shapes = functional.trials(self.triangulation, trial), (), None

    def descend_nodes(self, thread: int, nodes: NDArray[np.int32]) -> float:
        position, star = self.triangulation.position, self.triangulation.star
        return float(descend_nodes(position, star, self.constraints, self.trials, nodes, self.floor))

    def descend_flips(self, thread: int, first: int, last: int, gainful: Mask, marks: bool) -> tuple[float, int]:
        position, elements = self.triangulation.position, self.triangulation.elements
        return descend_flips(position, elements, self.trials, self.floor, gainful, first, last, marks)

    def descend_patch(self, patch: Patch) -> float:
        return float(
            descend_nodes(patch.position, patch.star, patch.constraints, patch.trials, patch.nodes, self.floor)
        )


class Higher:
    """Sweeps at order 2 and 3, and at order 1 around an axis."""

    def __init__(
        self, movable: MovableMesh, functional: Functional, trial: TrialFunction, constraints: Constraints
    ) -> None:
        triangulation, self.few = movable.triangulation, min_per_thread(functional.ritz.order)
        self.triangulation, self.floor, self.scratches = triangulation, movable.floor, dict[int, Descents]()
        self.trials, self.modes = functional.trials(triangulation, trial), trial.all_modes
        points, self.shapes = shapes_of(functional.ritz, movable.midside_offsets(), len(triangulation.elements.node))
        self.mesh = triangulation.position, triangulation.elements, triangulation.star, constraints
        self.functions = functional.reference, points

    def scratch(self, thread: int) -> Descents:
        most = int(np.diff(self.triangulation.star.start).max())
        if thread not in self.scratches or len(self.scratches[thread].primal.block.dof) < most:
            self.scratches[thread] = Descents.of(
                self.mesh, self.trials, self.modes, (*self.functions, self.shapes), most
            )
        return self.scratches[thread]

    def descend_nodes(self, thread: int, nodes: NDArray[np.int32]) -> float:
        return float(descend_nodes_higher(self.scratch(thread), nodes, self.floor))

    def descend_flips(self, thread: int, first: int, last: int, gainful: Mask, marks: bool) -> tuple[float, int]:
        return descend_flips_higher(self.scratch(thread), self.floor, gainful, first, last, marks)

    def descend_patch(self, patch: Patch) -> float:
        if patch.shapes is None:
            raise TypeError("a patch of order 2 or 3, or around an axis, requires shapes")
        mesh = patch.position, patch.elements, patch.star, patch.constraints
        most = int(np.diff(patch.star.start).max())
        scratch = Descents.of(mesh, patch.trials, patch.modes, (*self.functions, patch.shapes), most)
        return float(descend_nodes_higher(scratch, patch.nodes, self.floor))


def _downhill(movable: MovableMesh, functional: Functional, trial: TrialFunction, constraints: Constraints) -> Downhill:
    kind = Linear if trial.affine else Higher
    return kind(movable, functional, trial, constraints)


def flip_downhill(movable: MovableMesh, downhill: Downhill) -> float:
    if not movable.flips:
        return 0.0
    gainful = np.empty(len(movable.triangulation.elements.node), dtype=np.bool_)
    cuts = even_cuts(len(gainful), downhill.few)
    shared(lambda thread, first, last: downhill.descend_flips(thread, first, last, gainful, True), cuts)
    gain, flips = downhill.descend_flips(0, 0, len(gainful), gainful, False)
    if flips:
        movable.triangulation.refill_star()
    return gain
