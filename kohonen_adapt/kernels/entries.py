"""Loops that Python calls, with argument types, in the order of use."""

from numba import typeof
from numba.types import Type, UniTuple, boolean, float64, int8, int64

from kohonen_adapt.kernels import arrays as shared
from kohonen_adapt.kernels import draw, ordering, search
from kohonen_adapt.kernels.numba.compilation import record_type
from kohonen_adapt.kernels.numba.entry import (
    B1,
    GRID,
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
    R4,
    SEARCH_SCRATCH,
    Entry,
)
from kohonen_adapt.kernels.tetrahedron.entries import SPACE, TETRAHEDRA
from kohonen_adapt.kernels.triangle import (
    arrays,
    chains,
    equilibrate,
    flip,
    geometry,
    guard,
    locate,
    recycle,
    smooth,
    train,
    transport,
)
from kohonen_adapt.kernels.triangle.polish import descend, exchange, flips

__all__ = ["ENTRIES", "IN_SPACE"]

B2 = boolean[:, ::1]

STAR = record_type(arrays.Star, (I1, I1, I1, I1))
ELEMENTS = record_type(arrays.Elements, (I2, I2, I1, I2, I1, B1))
CHAINS = record_type(arrays.Chains, (R2, int8[:, ::1], I1, R2))
PERIODIC_PAIRS = record_type(arrays.PeriodicPairs, (I1, I1, R3))
CONSTRAINTS = record_type(arrays.Constraints, (int8[::1], I2, R1, B1, CHAINS, PERIODIC_PAIRS, METRIC))
KERNEL_MESH = record_type(shared.KernelMesh, (R2, ELEMENTS, STAR, CONSTRAINTS))
ORIGINS = record_type(arrays.Origins, (R1, I1, I1, B1, B1, B1, R1))
SURGERY_SCRATCH = record_type(arrays.SurgeryScratch, (I1, I1, L1, L1, I1, B1))
OPEN_MESH = record_type(arrays.OpenMesh, (R2, ELEMENTS, CONSTRAINTS, POOL, ORIGINS, SURGERY_SCRATCH, METRIC))
TRIAL = record_type(arrays.Trial, (R1, B1, R2, R2, B1, LAWS))
REFERENCE = record_type(arrays.Reference, (R1, R2, R3, R3))
POINTS = record_type(arrays.Points, (I2, R2, R3, R3, R4, R4))
SHAPES = record_type(arrays.Shapes, (R3, B1, boolean))
ROWS = I1, R1, I1, I2, B2, B2, B1, R2, R3  # triangles around a centre
BLOCK = record_type(arrays.Block, (*ROWS, I2, R2, I1, R1, R2, R2, R1, R2, R1, R1))
DESCENT = record_type(arrays.Descent, (R2, ELEMENTS, STAR, CONSTRAINTS, TRIAL, MODES, REFERENCE, POINTS, SHAPES, BLOCK))
DESCENTS = record_type(arrays.Descents, (DESCENT, DESCENT, int64))
OFFERS = record_type(arrays.Offers, (R2, R1, I1, B1, B1, B1))
FLUX_DATA = record_type(equilibrate.FluxData, (R2, I2, I2, R2, R1, R1))
PATCH_SCRATCH = record_type(equilibrate.Patch, (I1, I1, R1, R1, R1, B1, R2, R1, R2, R1, R1))


def polish(higher: Type) -> tuple[Entry, ...]:
    return (
        Entry(exchange.exchange, OPEN_MESH, DESCENTS, higher, OFFERS, L1, L1, float64),
        Entry(exchange.weigh, OPEN_MESH, DESCENTS, higher, OFFERS, float64, float64, int64, int64, boolean),
        Entry(flips.descend_flips, DESCENTS, higher, float64, B1, int64, int64, boolean),
        Entry(descend.descend_nodes, DESCENTS, higher, I1, float64),
    )


def carrying(elements: Type, components: int) -> tuple[Entry, ...]:
    origin = UniTuple(float64, components)
    return (
        Entry(search.walk_each, R2, elements, R2, origin, I1, B1),
        Entry(search.barycentric, R2, I2, R2, origin, I1, R2),
    )


def locating(elements: Type, components: int) -> tuple[Entry, ...]:
    return (
        Entry(search.count_in_cells, R2, I2, GRID),
        Entry(search.fill_cells, R2, I2, GRID),
        Entry(search.find, R2, elements, R2, UniTuple(float64, components), GRID, I1),
    )


IN_SPACE: dict[str, tuple[Entry, ...]] = {
    **SPACE,
    "space carrying": carrying(TETRAHEDRA, 3),
    "space locating": locating(TETRAHEDRA, 3),
}

# Groups by use. In "polish" the loops that exchange nodes are first: the second process works backwards, and compiles
# them when this process has stored the inner loops shared with `recycle`. For the same reason the loops at the end of a
# relocation are last in "map".
ENTRIES: dict[str, tuple[Entry, ...]] = {
    "ground": (
        Entry(geometry.find_starts, I2, I1),
        Entry(geometry.fill_star, I2, STAR, int64, int64, I1),
        Entry(ordering.hilbert_keys, R2, R1, float64, L1),
        Entry(ordering.mark_interior, I1, I2, I1, int64, B1, I1),
        Entry(chains.look_up, CONSTRAINTS, L1, R2),
        Entry(guard.move_to_targets, R2, STAR, METRIC, L1, R2, float64, float64),
    ),
    "recycling": (
        Entry(recycle.fill_heaps, OPEN_MESH, HEAP, HEAP),
        Entry(recycle.recycle, OPEN_MESH, HEAP, HEAP, int64, float64, float64, int64),
        Entry(geometry.spread_starts, ELEMENTS, I1, I1),
    ),
    "map": (
        Entry(flip.mark_non_delaunay, R2, ELEMENTS, R2, int64, int64, B1),
        Entry(flip.flip_edges, R2, ELEMENTS, METRIC, float64, B1, I1, B1, int64),
        Entry(draw.draw_points, R2, I2, I1, R1, R2, R2, I1),
        Entry(geometry.mark_valid, R2, STAR, float64, int64, int64, B1),
        Entry(locate.find_winners, KERNEL_MESH, R2, R2, I1, I1, I1, R1, SEARCH_SCRATCH),
        Entry(ordering.sort_into_tiles, I1, I1, B1, int64, int64, L1, I1),
        Entry(ordering.swap_each, I1, L1, L1),
        Entry(train.learn, KERNEL_MESH, LESSON, float64, float64, B1, SEARCH_SCRATCH),
        Entry(smooth.sweep, KERNEL_MESH, R2, R1, boolean, float64, I1, B1, boolean),
        Entry(chains.farthest_from_facets, R2, ELEMENTS, CONSTRAINTS),
    ),
    "transport": (
        Entry(transport.sum_weights, I1, I1, R1, ELEMENTS, STAR, R1),
        Entry(transport.find_crossings, R2, ELEMENTS, I1, I1, I1, R1),
        Entry(transport.find_directions, I2, CONSTRAINTS, I1, R1, R2),
        Entry(transport.move_with_clusters, STAR, CONSTRAINTS, I1, R2, int64, int64, R2),
        Entry(transport.smooth_moves, STAR, CONSTRAINTS, R2, int64, int64, R2),
        Entry(transport.measure_moves, R2, STAR, R2, int64, int64, R1),
        Entry(transport.propose_step, R2, CONSTRAINTS, R2, float64, int64, int64, R2, R1),
        Entry(transport.mark_spoiled, R2, R2, I2, float64, int64, int64, B1),
        Entry(transport.stop_nodes, R2, R2, I2, STAR, float64, B1, I1),
        Entry(transport.mark_too_long, R2, R2, ELEMENTS, CHAINS, B1),
        Entry(transport.accept_step, R2, CONSTRAINTS, R2, R1, int64, int64),
        Entry(transport.move_to_neighbour_mean, R2, R1, I2, STAR, CONSTRAINTS, B1),
        Entry(transport.slow_down, R2, R2, R1, I2, STAR, CONSTRAINTS, B1, I1, I1),
    ),
    "polish": polish(typeof(arrays.WITHOUT)),
    "polish of higher order": polish(typeof(arrays.WITH)),
    "equilibration": (Entry(equilibrate.equilibrate, FLUX_DATA, PATCH_SCRATCH, B2, R3, R1),),
    "carrying": carrying(ELEMENTS, 2),
    "locating": locating(ELEMENTS, 2),
    **IN_SPACE,
}
