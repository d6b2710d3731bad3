"""Recycling by energy: nodes whose loss costs the functional little go where a new one lowers it more."""

from dataclasses import replace

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import HELD, Offers, OpenMesh, SurgeryScratch, Trial
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.kernels.triangle.energy_recycle import exchange, weigh_collapses, weigh_splits
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.surgery import Recycled, Surgery, padded
from kohonen_adapt.polishing.functional import Functional

__all__ = ["recycle_by_energy"]

PART = 5_000  # elements or nodes per compiled call: Python hears Ctrl-C in between


def recycle_by_energy(
    movable: MovableMesh, functional: Functional, values: Floats, fixed: Mask, recycled: Recycled
) -> tuple[Floats, Mask, Recycled, float]:
    """Split edges and collapse others, in pairs, as long as a split gains more than its collapse costs.

    Returns the nodal values and which of them are given, (n,), what was recycled in all, and what it took off the
    functional. Outlines that nodes may not slide on, for the functional is not known there or would be another one,
    keep theirs.
    """
    n, fixed = movable.nnodes, fixed | (movable.constraints.twins.partner >= 0)
    surgery = Surgery.on(movable, np.ones(n), n, recycled)
    mesh, rows = surgery.mesh, len(surgery.mesh.position)
    trial = functional.trial(movable.triangulation, padded(values, rows, 0.0), padded(fixed, rows, False))
    offers = offers_of(movable, functional, fixed, mesh)
    most = weighed(movable, mesh, trial, offers)
    edges, nodes = in_order(-offers.gain.ravel(), 0.0), in_order(offers.cost, most)
    pairs, lowered = exchange(mesh, trial, offers, edges, nodes, movable.floor)
    if not pairs:
        return values, fixed, recycled, 0.0
    kept = surgery.hand_back(movable)
    known = {"old": mesh.origins.old[kept], "hint": mesh.origins.hint[kept]}
    recycled = replace(recycled, splits=recycled.splits + pairs, collapses=recycled.collapses + pairs, **known)
    return trial.value[kept], trial.fixed[kept], recycled, lowered


def offers_of(movable: MovableMesh, functional: Functional, fixed: Mask, mesh: OpenMesh) -> Offers:
    """Room for what splits and collapses are worth, with those ruled out that would change what is given."""
    n, m = movable.nnodes, len(movable.triangulation.elements.node)
    is_open = ~(functional.held | functional.given | movable.constraints.chains.paired)
    removable = functional.kinds(movable.outline, fixed) != HELD
    locked = np.zeros(len(mesh.elements.node), dtype=np.bool_)
    return Offers(np.empty((m, 3)), np.empty(n), np.empty(n, dtype=np.int32), is_open, removable, locked)


def weighed(movable: MovableMesh, mesh: OpenMesh, trial: Trial, offers: Offers) -> float:
    """Work out all gains, and all costs below the largest of them, which is returned; threads share the work.

    Each depends on the mesh as it is now alone, so none of them on the number of threads.
    """
    floor, star, cuts = movable.floor, movable.triangulation.star, even_cuts(len(offers.cost), PART)
    own = [mesh._replace(scratch=SurgeryScratch.of(len(mesh.position), len(mesh.elements.node))) for _ in cuts[1:]]

    def weigh_edges(thread: int, first: int, last: int) -> None:
        for e in range(first, last, PART):
            weigh_splits(mesh, trial, offers, floor, e, min(e + PART, last))

    shared(weigh_edges, even_cuts(len(offers.gain), PART))
    most = float(offers.gain.max())

    def weigh_nodes(thread: int, first: int, last: int) -> None:
        for v in range(first, last, PART):
            weigh_collapses(own[thread], star, trial, offers, most, floor, v, min(v + PART, last))

    shared(weigh_nodes, cuts)
    return most


def in_order(values: Floats, below: float) -> Ints:
    """The places of all values below a bound, in ascending order; of equal ones the first comes first."""
    found = np.flatnonzero(values < below)
    return found[np.argsort(values[found], kind="stable")]
