"""Signatures of the kernels on tetrahedra, grouped for compilation."""

from numba.types import Type, boolean, float64, int8, int32, int64, none

from kohonen_adapt.kernels import arrays as shared
from kohonen_adapt.kernels import coils, draw, ordering
from kohonen_adapt.kernels.numba.compilation import record_type
from kohonen_adapt.kernels.numba.entry import (
    B1,
    HEAP,
    I1,
    I2,
    L1,
    LAWS,
    LESSON,
    METRIC,
    MODES,
    POOL,
    R1,
    R2,
    R3,
    SEARCH_SCRATCH,
    Entry,
)
from kohonen_adapt.kernels.tetrahedron import (
    arrays,
    geometry,
    guard,
    locate,
    recycle,
    smooth,
    surfaces,
    swap,
    train,
)
from kohonen_adapt.kernels.tetrahedron.polish import descend, exchange

__all__ = ["SPACE", "TETRAHEDRA"]

TETRAHEDRA = record_type(arrays.Tetrahedra, (I2, I2, I1, I2))
STAR = record_type(arrays.Star, (I1, I1, I2))
SAMPLES = record_type(arrays.Samples, (I1, R2, R2, R3))
SURFACES = record_type(arrays.Surfaces, (int8[::1], R2, R2, R1, int32[:, ::1], int8[::1], R2, R2, R1, SAMPLES))
FREEDOM = record_type(arrays.Freedom, (int8[::1], I1, B1))
CONSTRAINTS = record_type(arrays.Constraints, (FREEDOM, SURFACES, B1, METRIC))
ORIGINS = record_type(arrays.Origins, (R1, I1, I1, B1, R1))
I3 = int32[:, :, ::1]
CAVITY = record_type(arrays.Cavity, (L1, L1, L1, I1, I1, I1, I2, I1, I2, I1, I2, I1, I2, I2, R3, I3, I2, I1))
OPEN_TETRAHEDRA = record_type(arrays.OpenTetrahedra, (R2, TETRAHEDRA, SURFACES, FREEDOM, POOL, ORIGINS, CAVITY, METRIC))
QUEUE = record_type(arrays.Queue, (int8[::1], I1, L1))
TRIAL = record_type(arrays.Trial, (R1, B1, R2, LAWS, R2, B1, B1, R2, R2))
SOLID_BLOCK = record_type(
    arrays.SolidBlock,
    (L1, R2, I2, boolean[:, ::1], I2, R1, I1, B1, R2, R2, R2, R2, R1, R2, R1, R2, R1, R2, R3, R3, R2)
    + (I1, I1, R2, R2, R1, R2, R2, R2),  # of curved edges
)
QUADRATIC = record_type(arrays.Quadratic, (TRIAL, MODES, B1, SOLID_BLOCK))
OFFERS = record_type(arrays.Offers, (R2, R1, B1, B1, B1, B1))
KERNEL_MESH = record_type(shared.KernelMesh, (R2, TETRAHEDRA, STAR, CONSTRAINTS))
BARS = record_type(coils.Bars, (R2, I2, R1, R3, I2, R2, R2, R2))
ARCS = record_type(coils.Arcs, (R2, R3, R1, R2, R1, I1, R1, R2, R2))


def polish(quadratic: Type) -> tuple[Entry, ...]:
    return (
        Entry(descend.descend_nodes, KERNEL_MESH, TRIAL, quadratic, I1, float64),
        Entry(swap.enter_changed, OPEN_TETRAHEDRA, TRIAL, QUEUE, R2, float64),
        Entry(swap.swap_downhill, OPEN_TETRAHEDRA, TRIAL, quadratic, QUEUE, R2, B1, float64, float64, int64),
        Entry(exchange.weigh_splits, OPEN_TETRAHEDRA, TRIAL, quadratic, OFFERS, int64, float64, L1),
        Entry(exchange.weigh_collapses, OPEN_TETRAHEDRA, TRIAL, quadratic, OFFERS, float64, float64, L1),
        Entry(exchange.exchange, OPEN_TETRAHEDRA, TRIAL, quadratic, QUEUE, OFFERS, I2, R1, L1, L1, float64, float64),
    )


# Groups "space ..." are compiled by a warm-up on request only.
SPACE: dict[str, tuple[Entry, ...]] = {
    "space ground": (
        Entry(ordering.hilbert_keys_in_space, R2, R1, float64, L1),
        Entry(geometry.fill_star, I2, STAR),
        Entry(ordering.mark_interior, I1, I2, I1, int64, B1, I1),
        Entry(geometry.find_parts, I2, I1, I1),
    ),
    "space moves": (
        Entry(geometry.mark_non_manifold, OPEN_TETRAHEDRA, STAR, B1),
        Entry(surfaces.measure_sagittas, OPEN_TETRAHEDRA, R1),
        Entry(swap.enter_worse, OPEN_TETRAHEDRA, QUEUE, float64),
        Entry(swap.swap_waiting, OPEN_TETRAHEDRA, QUEUE, float64, float64, int64),
        Entry(smooth.smooth_nodes, KERNEL_MESH, R1, float64, I1),
    ),
    "space recycling": (
        Entry(recycle.fill_heaps, OPEN_TETRAHEDRA, HEAP, HEAP, int64, int64),
        Entry(recycle.recycle, OPEN_TETRAHEDRA, QUEUE, HEAP, HEAP, int64, float64, float64, int64),
    ),
    "space map": (
        Entry(draw.draw_points, R2, I2, I1, R1, R2, R2, I1),
        Entry(guard.mark_valid, R2, STAR, float64, int64, int64, B1),
        Entry(locate.find_winners, KERNEL_MESH, R2, R2, I1, I1, I1, R1, SEARCH_SCRATCH),
        Entry(train.learn, KERNEL_MESH, LESSON, float64, float64, boolean[::1], SEARCH_SCRATCH),
    ),
    "space polish": polish(none),
    "space polish of order 2": polish(QUADRATIC),
    "space coils": (
        Entry(coils.add_bars, BARS, R2, int64, int64, R2, R2),
        Entry(coils.add_arcs, ARCS, R2, int64, int64, R2),
    ),
}
