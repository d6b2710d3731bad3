"""Recycling by energy, collapses at low cost paired with splits of larger gain."""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Ints, Mask, padded, sorted_below
from kohonen_adapt.geometry.movable import Recycled
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import Surgery
from kohonen_adapt.kernels.arrays import Modes
from kohonen_adapt.kernels.numba.compilation import zeros
from kohonen_adapt.kernels.threads import even_cuts, number_of_threads, shared
from kohonen_adapt.kernels.triangle.arrays import HELD, Offers, OpenMesh, SurgeryScratch
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.loops import Loops

__all__ = ["Exchange", "recycle_by_energy"]

PART = 5_000  # elements or nodes per compiled call, because Ctrl-C is handled between calls only


class Exchange(NamedTuple):
    trial: TrialFunction  # function on the new mesh
    recycled: Recycled  # including earlier recyclings
    decrease: float  # decrease of the functional
    offered: float  # sum of the gains of all splits, an estimate of the distance to the minimum


def recycle_by_energy(
    movable: MovableMesh, functional: Functional, trial: TrialFunction, recycled: Recycled
) -> Exchange:
    # Curve segments on which nodes are held keep their nodes.
    n = movable.nnodes
    surgery = Surgery.on(movable, np.ones(n), n, recycled)
    mesh = surgery.mesh
    offers = offers_of(movable, functional, trial.fixed, surgery.mesh)
    spacious = with_spare_rows(trial, len(mesh.position), len(mesh.elements.node))
    loops = functional.loops(movable, spacious, mesh)
    most = compute_gains(loops, mesh, offers)
    edges, nodes = sorted_below(-offers.gain.ravel(), 0.0), sorted_below(offers.cost, most)
    offered, (pairs, decrease) = float(offers.gain.sum()), loops.exchange(mesh, offers, edges, nodes)
    if not pairs:
        return Exchange(trial, recycled, 0.0, offered)
    kept, used = surgery.write_back(movable)
    recycled = recycled.followed_by(mesh.origins, kept, pairs, pairs)
    return Exchange(without_spare_rows(spacious, kept, used), recycled, decrease, offered)


def offers_of(movable: MovableMesh, functional: Functional, fixed: Mask, mesh: OpenMesh) -> Offers:
    n = movable.nnodes
    m = len(movable.triangulation.elements.node)
    is_open = ~functional.held
    if functional.ritz.order == 1:
        is_open &= ~functional.dirichlet
    removable = functional.kinds(movable.outline, fixed) != HELD
    return zeros(Offers, (m, 3), n, n, is_open, removable, len(mesh.elements.node))


def with_spare_rows(trial: TrialFunction, nodes: int, elements: int) -> TrialFunction:
    dual = trial.dual and with_spare_rows(trial.dual, nodes, elements)
    modes = trial.modes and Modes(*(padded(array, elements, 0) for array in trial.modes))
    surface = padded(trial.surface, nodes, 0.0) if len(trial.surface) else trial.surface
    return TrialFunction(padded(trial.values, nodes, 0.0), padded(trial.fixed, nodes, False), modes, dual, surface)


def without_spare_rows(trial: TrialFunction, kept: Ints, used: Ints) -> TrialFunction:
    dual = trial.dual and without_spare_rows(trial.dual, kept, used)
    modes = trial.modes and trial.modes.rows(used)
    return TrialFunction(trial.values[kept], trial.fixed[kept], modes, dual)


def compute_gains(loops: Loops, mesh: OpenMesh, offers: Offers) -> float:
    # Costs above the largest gain are not computed. Gains and costs depend on the current mesh alone, and therefore
    # not on the number of threads.
    rows = len(mesh.position), len(mesh.elements.node)
    own = [mesh._replace(scratch=SurgeryScratch.of(*rows)) for _ in range(number_of_threads())]

    def weigh(edges: bool, rows: int, most: float) -> None:
        def task(thread: int, first: int, last: int) -> None:
            for start in range(first, last, PART):
                loops.weigh(thread, own[thread], offers, most, start, min(start + PART, last), edges)

        shared(task, even_cuts(rows, loops.few))

    weigh(True, len(offers.gain), 0.0)
    most = float(offers.gain.max())
    weigh(False, len(offers.cost), most)
    return most
