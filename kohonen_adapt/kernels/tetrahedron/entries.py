"""Signatures of the kernels on tetrahedra, grouped for compilation."""

from typing import Any

from numba.types import none

from kohonen_adapt.kernels import coils, draw, ordering
from kohonen_adapt.kernels.arrays import KernelMesh, Lesson, SearchScratch
from kohonen_adapt.kernels.heap import Heap
from kohonen_adapt.kernels.numba.array_types import B1, I1, I2, L1, R1, R2
from kohonen_adapt.kernels.numba.compilation import record_type
from kohonen_adapt.kernels.numba.entry import Entry
from kohonen_adapt.kernels.tetrahedron import (
    geometry,
    guard,
    locate,
    recycle,
    smooth,
    surfaces,
    swap,
    train,
)
from kohonen_adapt.kernels.tetrahedron.arrays import (
    Constraints,
    Offers,
    OpenTetrahedra,
    Quadratic,
    Queue,
    Star,
    Tetrahedra,
    Trial,
)
from kohonen_adapt.kernels.tetrahedron.polish import descend, exchange

__all__ = ["SPACE"]

KERNEL_MESH = record_type(KernelMesh, elements=Tetrahedra, star=Star, constraints=Constraints)


def polish(quadratic: Any) -> tuple[Entry, ...]:
    return (
        Entry(descend.descend_nodes, KERNEL_MESH, Trial, quadratic, I1, float),
        Entry(swap.enter_changed, OpenTetrahedra, Trial, Queue, R2, float),
        Entry(swap.swap_downhill, OpenTetrahedra, Trial, quadratic, Queue, R2, B1, float, float, int),
        Entry(exchange.weigh_splits, OpenTetrahedra, Trial, quadratic, Offers, int, float, L1),
        Entry(exchange.weigh_collapses, OpenTetrahedra, Trial, quadratic, Offers, float, float, L1),
        Entry(exchange.exchange, OpenTetrahedra, Trial, quadratic, Queue, Offers, I2, R1, L1, L1, float, float),
    )


# Groups "space ..." are compiled by a warm-up on request only.
SPACE: dict[str, tuple[Entry, ...]] = {
    "space ground": (
        Entry(ordering.hilbert_keys_in_space, R2, R1, float, L1),
        Entry(geometry.fill_star, I2, Star),
        Entry(ordering.mark_interior, I1, I2, I1, int, B1, I1),
        Entry(geometry.find_parts, I2, I1, I1),
    ),
    "space moves": (
        Entry(geometry.mark_non_manifold, OpenTetrahedra, Star, B1),
        Entry(surfaces.measure_sagittas, OpenTetrahedra, R1),
        Entry(swap.enter_worse, OpenTetrahedra, Queue, float),
        Entry(swap.swap_waiting, OpenTetrahedra, Queue, float, float, int),
        Entry(smooth.smooth_nodes, KERNEL_MESH, R1, float, I1),
    ),
    "space recycling": (
        Entry(recycle.fill_heaps, OpenTetrahedra, Heap, Heap, int, int),
        Entry(recycle.recycle, OpenTetrahedra, Queue, Heap, Heap, int, float, float, int),
    ),
    "space map": (
        Entry(draw.draw_points, R2, I2, I1, R1, R2, R2, I1),
        Entry(guard.mark_valid, R2, Star, float, int, int, B1),
        Entry(locate.find_winners, KERNEL_MESH, R2, R2, I1, I1, I1, R1, SearchScratch),
        Entry(train.learn, KERNEL_MESH, Lesson, float, float, B1, SearchScratch),
    ),
    "space polish": polish(none),
    "space polish of order 2": polish(Quadratic),
    "space coils": (
        Entry(coils.add_bars, coils.Bars, R2, int, int, R2, R2),
        Entry(coils.add_arcs, coils.Arcs, R2, int, int, R2),
    ),
}
