"""Swaps and recycling of tetrahedra by energy."""

import numpy as np

from kohonen_adapt.arrays import Floats, Mask, sorted_below
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.geometry.space.thread_parts import Parts
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, PLANE, Cavity, Offers, OpenTetrahedra, Queue, Trial
from kohonen_adapt.kernels.tetrahedron.connectivity import EDGES, OPPOSITE
from kohonen_adapt.kernels.tetrahedron.polish.energy_recycle import exchange, weigh_collapses, weigh_splits
from kohonen_adapt.kernels.tetrahedron.polish.swap_by_energy import enter_changed, swap_downhill
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

__all__ = ["recycle_in_space", "swap_in_space"]

LOOKS = 50_000  # elements per compiled call, at most 0.5 s, because Ctrl-C is handled between calls only
FEW = 1_000  # nodes per thread at least
PART = 20_000  # nodes per compiled call
PAIRS = 20_000  # edges per compiled call
CHANGED = 0.1  # relative change of volume or energy after which an element is searched again

# Smallest gain of a split, relative to the cost of its collapse. Gains are underestimated and costs overestimated,
# because both are computed without the sweeps and swaps that follow. With 1, exchanges end after one pass, and the
# error is 5 % higher.
MARGIN = 0.2


def swap_in_space(
    opened: OpenSolid, parts: Parts, functional: SolidFunctional, trial: Trial, seen: Floats, floor: float
) -> float:
    """Swap while the functional decreases, and return the decrease.

    `seen` (m, 2) holds volume and energy of elements at their last search. Elements that have changed since are
    searched again. Edges on patches change only if the domain and the Dirichlet values stay the same.
    """
    mesh, queue = opened.mesh, opened.queue
    free = (mesh.surfaces.shape == PLANE) & ~functional.held[: functional.patches]
    enter_changed(mesh, trial, queue, seen, CHANGED)

    def swap(part: OpenTetrahedra, own: Queue) -> float:
        return float(swap_downhill(part, trial, own, seen, free, floor**3, LOOKS)[1])

    return parts.work_off(queue, swap)


def recycle_in_space(opened: OpenSolid, functional: SolidFunctional, trial: Trial, floor: float) -> tuple[int, float]:
    """Split edges and collapse nodes in pairs while the gain exceeds the cost.

    Returned are the number of pairs and the decrease of the functional, negative for an increase. New elements
    enter the queue of swaps.
    """
    mesh, offers = opened.mesh, offers_of(opened.mesh, functional, trial)
    most = compute_gains(mesh, trial, offers, floor**3)
    gain, node = offers.gain.ravel(), mesh.elements.node
    edges = sorted_below(-gain, -max(0.0, MARGIN * offers.cost.min(initial=0.0)))
    ends = node[edges[:, None] // 6, EDGES[edges % 6, :2]]
    nodes = sorted_below(offers.cost, most)
    pairs, decrease = 0, 0.0
    for i in range(0, len(edges), PAIRS):
        part = ends[i : i + PAIRS], gain[edges[i : i + PAIRS]]
        more, fall = exchange(mesh, trial, opened.queue, offers, *part, nodes, MARGIN, floor**3)
        pairs, decrease = pairs + more, decrease + fall
    return pairs, decrease


def offers_of(mesh: OpenTetrahedra, functional: SolidFunctional, trial: Trial) -> Offers:
    patches, rows = slice(functional.patches), len(mesh.position)
    removable = (functional.freedom(mesh.freedom, trial.fixed, trial.surface).number != HELD) & (mesh.pool.anchor >= 0)
    lone = trial.fixed & ~on_patches(mesh, functional.dirichlet[patches])
    is_open = ~(functional.held | functional.dirichlet)[patches]
    gain, cost = np.zeros((len(mesh.elements.node), 6)), np.full(rows, np.inf)
    return Offers(gain, cost, is_open, removable, lone, np.zeros(rows, dtype=np.bool_))


def on_patches(mesh: OpenTetrahedra, some: Mask) -> Mask:
    found, patch = np.zeros(len(mesh.position), dtype=np.bool_), mesh.elements.patch
    e, k = np.nonzero((mesh.elements.node[:, :1] >= 0) & np.append(some, False)[patch])
    found[mesh.elements.node[e[:, None], OPPOSITE[k]]] = True
    return found


def compute_gains(mesh: OpenTetrahedra, trial: Trial, offers: Offers, floor: float) -> float:
    """Compute all gains and costs, and return the largest worthwhile cost.

    Larger costs are not computed. Gains and costs depend on the current mesh alone, and therefore not on the
    number of threads.
    """
    cuts = even_cuts(len(mesh.position), FEW)
    rows = len(mesh.position), len(mesh.elements.node)
    own = [mesh, *(mesh._replace(cavity=Cavity.of(*rows)) for _ in cuts[2:])]

    def weigh_edges(thread: int, first: int, last: int) -> None:
        for v in range(first, last, PART):
            weigh_splits(own[thread], trial, offers, floor, v, min(v + PART, last))

    shared(weigh_edges, cuts)
    most = float(offers.gain.max()) / MARGIN

    def weigh_nodes(thread: int, first: int, last: int) -> None:
        for v in range(first, last, PART):
            weigh_collapses(own[thread], trial, offers, most, floor, v, min(v + PART, last))

    shared(weigh_nodes, cuts)
    return most
