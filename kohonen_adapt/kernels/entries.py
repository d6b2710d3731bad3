"""Loops that Python calls, with argument types, in the order of use."""

from numba import typeof
from numba.types import Type, UniTuple, float64

from kohonen_adapt.kernels import draw, ordering, search
from kohonen_adapt.kernels.arrays import KernelMesh, Lesson, Metric, SearchScratch
from kohonen_adapt.kernels.grid import Grid
from kohonen_adapt.kernels.heap import Heap
from kohonen_adapt.kernels.numba.array_types import B1, B2, I1, I2, L1, R1, R2, R3
from kohonen_adapt.kernels.numba.compilation import record_type
from kohonen_adapt.kernels.numba.entry import Entry
from kohonen_adapt.kernels.tetrahedron.arrays import Tetrahedra
from kohonen_adapt.kernels.tetrahedron.entries import SPACE
from kohonen_adapt.kernels.triangle import (
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
from kohonen_adapt.kernels.triangle.arrays import (
    WITH,
    WITHOUT,
    Constraints,
    Descents,
    Elements,
    Offers,
    OpenMesh,
    Star,
)
from kohonen_adapt.kernels.triangle.polish import descend, exchange, flips

__all__ = ["ENTRIES", "IN_SPACE"]

KERNEL_MESH = record_type(KernelMesh, elements=Elements, star=Star, constraints=Constraints)


def polish(higher: Type) -> tuple[Entry, ...]:
    return (
        Entry(exchange.exchange, OpenMesh, Descents, higher, Offers, L1, L1, float),
        Entry(exchange.weigh, OpenMesh, Descents, higher, Offers, float, float, int, int, bool),
        Entry(flips.descend_flips, Descents, higher, float, B1, int, int, bool),
        Entry(descend.descend_nodes, Descents, higher, I1, float),
    )


def carrying(elements: type, components: int) -> tuple[Entry, ...]:
    origin = UniTuple(float64, components)
    return (
        Entry(search.walk_each, R2, elements, R2, origin, I1, B1),
        Entry(search.barycentric, R2, I2, R2, origin, I1, R2),
    )


def locating(elements: type, components: int) -> tuple[Entry, ...]:
    return (
        Entry(search.list_in_cells, R2, I2, Grid, bool),
        Entry(search.find, R2, elements, R2, UniTuple(float64, components), Grid, I1),
    )


IN_SPACE: dict[str, tuple[Entry, ...]] = {
    **SPACE,
    "space carrying": carrying(Tetrahedra, 3),
    "space locating": locating(Tetrahedra, 3),
}

# Groups by use. In "polish" the loops that exchange nodes are first: the second process works backwards, and compiles
# them when this process has stored the inner loops shared with `recycle`. For the same reason the loops at the end of a
# relocation are last in "map".
ENTRIES: dict[str, tuple[Entry, ...]] = {
    "ground": (
        Entry(geometry.find_starts, I2, I1),
        Entry(geometry.fill_star, I2, Star, int, int, I1),
        Entry(ordering.hilbert_keys, R2, R1, float, L1),
        Entry(ordering.mark_interior, I1, I2, I1, int, B1, I1),
        Entry(chains.look_up, Constraints, L1, R2),
        Entry(guard.move_to_targets, R2, Star, Metric, L1, R2, float, float),
    ),
    "recycling": (
        Entry(recycle.fill_heaps, OpenMesh, Heap, Heap),
        Entry(recycle.recycle, OpenMesh, Heap, Heap, int, float, float, int),
        Entry(geometry.spread_starts, Elements, I1, I1),
    ),
    "map": (
        Entry(flip.mark_non_delaunay, R2, Elements, R2, int, int, B1),
        Entry(flip.flip_edges, R2, Elements, Metric, float, B1, I1, B1, int),
        Entry(draw.draw_points, R2, I2, I1, R1, R2, R2, I1),
        Entry(geometry.mark_valid, R2, Star, float, int, int, B1),
        Entry(locate.find_winners, KERNEL_MESH, R2, R2, I1, I1, I1, R1, SearchScratch),
        Entry(ordering.swap_each, I1, L1, L1),
        Entry(train.learn, KERNEL_MESH, Lesson, float, float, B1, SearchScratch),
        Entry(smooth.sweep, KERNEL_MESH, R2, R1, bool, float, I1, B1, bool),
    ),
    "transport": (
        Entry(transport.sum_weights, I1, I1, R1, Elements, Star, R1),
        Entry(transport.find_directions, I2, Constraints, I1, R1, R2),
        Entry(transport.move_with_clusters, Star, Constraints, I1, R2, int, int, R2),
        Entry(transport.smooth_moves, Star, Constraints, R2, int, int, R2),
        Entry(transport.propose_step, R2, Constraints, R2, float, int, int, R2, R1),
        Entry(transport.mark_spoiled, R2, R2, I2, float, int, int, B1),
        Entry(transport.stop_nodes, R2, R2, I2, Star, float, B1, I1),
        Entry(transport.move_to_neighbour_mean, R2, R1, I2, Star, Constraints, B1),
        Entry(transport.slow_down, R2, R2, R1, I2, Star, Constraints, B1, I1, I1),
    ),
    "polish": polish(typeof(WITHOUT)),
    "polish of higher order": polish(typeof(WITH)),
    "equilibration": (Entry(equilibrate.equilibrate, equilibrate.FluxData, equilibrate.Patch, B2, R3, R1),),
    "carrying": carrying(Elements, 2),
    "locating": locating(Elements, 2),
    **IN_SPACE,
}
