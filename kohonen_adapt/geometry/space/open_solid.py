"""Arrays of a tetrahedral mesh with spare rows for new nodes and elements."""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Array, Floats, Int32s, Ints, IntsPair, copied, free_rows, padded, ranks
from kohonen_adapt.geometry.movable import arrays_of, element_order, reordered_state
from kohonen_adapt.geometry.space.movable_solid import BY_ELEMENT, MovableSolid, metric_of
from kohonen_adapt.geometry.space.thread_parts import Parts, wait_in
from kohonen_adapt.kernels.arrays import Pool
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    MOST,
    Cavity,
    Freedom,
    OpenTetrahedra,
    Origins,
    Queue,
    Star,
    Tetrahedra,
)
from kohonen_adapt.kernels.tetrahedron.geometry import fill_star, mark_non_manifold
from kohonen_adapt.kernels.tetrahedron.surfaces import measure_sagittas
from kohonen_adapt.kernels.tetrahedron.swap import enter_worse, swap_waiting
from kohonen_adapt.mesh.shapes import round_shapes

__all__ = ["OpenSolid", "swap_elements"]

PER_NODE = 7.5  # number of elements per node: meshes of good quality have 5 to 6.5
GOOD = 0.7  # quality above which elements are not queued after nodes have moved; a tenth is worse
ELEMENTS_PER_CALL = 50_000  # elements per compiled call, so that Ctrl-C takes effect within half a second

# Values of unused rows; all other arrays have -1 there.
UNUSED = {"position": 0.0, "shape": 0.0, "freedom.number": HELD, "freedom.pinned": False}


@dataclass(frozen=True)
class OpenSolid:
    """Arrays of a tetrahedral mesh with spare rows for new nodes and elements.

    Attributes
    ----------
    state
        Arrays by the names of `MovableSolid.state`.
    mesh
        The same arrays as a kernel record.
    queue
        Elements whose surroundings have changed since the last search for swaps.
    floor
        Minimum Euclidean quality after a swap, or the worst quality before if that is lower.
    """

    state: dict[str, Array]
    mesh: OpenTetrahedra
    queue: Queue
    floor: float

    @classmethod
    def of(cls, movable: MovableSolid, density: Floats, target: int = 0, relief: float | None = None) -> "OpenSolid":
        """Copy the arrays of `movable`, with spare rows and all elements in the queue.

        `density`, shape (nnodes,), is the wanted number of nodes per volume up to a factor. `relief` is that of
        `Metric`, None for that of `movable`.
        """
        n, node = movable.nnodes, movable.tetrahedralization.elements.node
        rows = max(n, target) + 2
        capacity = max(len(node) + len(node) // 4, int(PER_NODE * rows)) + 4 * MOST
        state = movable.padded_state(rows, capacity, UNUSED)
        star = star_of(node, n)
        first = star.element[star.start[:-1]]
        fineness = padded(np.cbrt(density / density.max()), rows, 1.0)
        numbers, start_element = padded(np.arange(n, dtype=np.int32), rows, -1), padded(first, rows, -1)
        sagitta, non_manifold = np.zeros(len(movable.surfaces.shape)), np.zeros(rows, bool)
        used = np.count_nonzero(node[:, 0] >= 0)
        empty = np.append(np.flatnonzero(node[:, 0] < 0)[::-1], free_rows(len(node), capacity)[: capacity - len(node)])
        stack = np.empty(capacity, np.int32)
        stack[: capacity - used] = np.sort(empty)[::-1]
        height = np.array([rows - n, capacity - used], np.int64)
        state["shape"][n:] = round_shapes(rows - n, 3)
        position, elements, freedom = records_of(state)
        metric = metric_of(state["shape"], movable.relief if relief is None else relief)
        mesh = OpenTetrahedra(
            position,
            elements,
            movable.surfaces,
            freedom,
            Pool(padded(first, rows, -1), free_rows(n, rows), stack, height),
            Origins(fineness, numbers, start_element, non_manifold, sagitta),
            Cavity.of(rows, capacity),
            metric,
        )
        mark_non_manifold(mesh, star, non_manifold)
        measure_sagittas(mesh, sagitta)
        queue = Queue.of(capacity)
        enter_worse(mesh, queue, 1.0)
        return cls(state, mesh, queue, movable.euclidean_floor)

    def copy(self) -> "OpenSolid":
        state = {name: array.copy() for name, array in self.state.items()}
        position, elements, freedom = records_of(state)
        pool, origins = copied(self.mesh.pool), copied(self.mesh.origins)
        metric = metric_of(state["shape"], self.mesh.metric.relief)
        own = OpenTetrahedra(position, elements, self.mesh.surfaces, freedom, pool, origins, self.mesh.cavity, metric)
        return OpenSolid(state, own, copied(self.queue), self.floor)

    def swap(self) -> int:
        floor = self.floor**3
        return round(
            self.parts().work_off(self.queue, lambda *part: swap_waiting(*part, 1.0, floor, ELEMENTS_PER_CALL))
        )

    def queue_worse(self) -> None:
        enter_worse(self.mesh, self.queue, GOOD**3)

    def parts(self) -> Parts:
        return Parts(self.mesh)

    def star(self) -> Star:
        return star_of(self.mesh.elements.node, len(self.mesh.position))

    def nodes(self) -> Ints:
        return np.flatnonzero(self.mesh.pool.anchor >= 0)

    def elements(self) -> Ints:
        return np.flatnonzero(self.mesh.elements.node[:, 0] >= 0)

    def renumber(self) -> None:
        mesh, queue = self.mesh, self.queue
        nodes, elements = self.along_curve()
        mesh.pool.height[:] = len(mesh.position) - len(nodes), len(queue.waiting) - len(elements)
        wait_in(queue, np.flatnonzero(queue.waiting[elements]))
        nodes = np.append(nodes, np.flatnonzero(mesh.pool.anchor < 0))
        elements = np.append(elements, np.flatnonzero(mesh.elements.node[:, 0] < 0))
        for name, array in reordered_state(self.state, nodes, elements, BY_ELEMENT).items():
            self.state[name][:] = array
        origins, anchor = mesh.origins, mesh.pool.anchor
        anchor[:] = np.append(ranks(elements, len(elements)), np.int32(-1))[anchor]
        for array in (origins.fineness, origins.old, origins.start_element, origins.non_manifold, anchor):
            array[:] = array[nodes]
        for stack, height in zip((mesh.pool.free_nodes, mesh.pool.free_elements), mesh.pool.height, strict=True):
            stack[:height] = free_rows(len(stack) - height, len(stack))[:height]

    def along_curve(self) -> IntsPair:
        nodes, used = self.nodes(), self.elements()
        nodes = nodes[along_curve(self.mesh.position[nodes])]
        return nodes, used[element_order(self.mesh.elements.node[used], ranks(nodes, len(self.mesh.position)))]

    def write_back(self, movable: MovableSolid, renumbered: bool = False) -> Ints:
        nodes, elements = self.along_curve() if renumbered else (self.nodes(), self.elements())
        movable.set_arrays(reordered_state(self.state, nodes, elements, BY_ELEMENT))
        return nodes


def records_of(state: dict[str, Array]) -> tuple[Floats, Tetrahedra, Freedom]:
    return (
        state["position"],
        Tetrahedra(**arrays_of("tetrahedra", state)),
        Freedom(**arrays_of("freedom", state)),
    )


def swap_elements(movable: MovableSolid) -> None:
    if movable.flips:
        opened = OpenSolid.of(movable, np.ones(movable.nnodes))
        opened.swap()
        opened.write_back(movable)


def star_of(node: Int32s, nodes: int) -> Star:
    star = Star.of(nodes, len(node))
    fill_star(node, star)
    return star
