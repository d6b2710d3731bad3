"""Triangle meshes with spare rows, and creation of missing thin layers."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Array, Floats, Ints, IntsPair, free_rows, padded, ranks
from kohonen_adapt.checks import listed
from kohonen_adapt.geometry.movable import Recycled, element_order, reordered_state, unchanged
from kohonen_adapt.geometry.plane.layers import bands_with, steps_from
from kohonen_adapt.geometry.plane.movable import BY_ELEMENT, MovableMesh, with_state
from kohonen_adapt.geometry.rules import Rules, checked_layers
from kohonen_adapt.kernels.arrays import Metric, Pool
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.kernels.triangle.arrays import SLIDING, OpenMesh, Origins, SurgeryScratch
from kohonen_adapt.kernels.triangle.surgery import find_edge, midpoint, split
from kohonen_adapt.log import logger
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Surgery", "numbered_along_curve", "with_thin_layers"]

FEW = 10_000  # number of nodes of a mesh that fits in the cache of a processor in any order
FAR = 4.0  # median index distance of neighbours above which nodes are renumbered, relative to sqrt(nnodes)
# Values of unused rows; all other arrays have -1 there.
UNUSED = {
    "position": 0.0,
    "pinned": False,
    "shape": 0.0,
    "elements.level": 0,
    "constraints.kind": 0,
    "constraints.parameter": 0.0,
    "constraints.inner": False,
}


@contextmanager
def numbered_along_curve(movable: MovableMesh) -> Iterator[Ints | None]:
    # Yields the previous index of every element, shape (m,), or None if neighbours have near indices already and
    # nothing changes. The old numbering is restored on exit; the numbers of nodes and elements must be the same as on
    # entry.
    tri = movable.triangulation
    if not is_scattered(tri):
        yield None
        return
    nodes, count = along_curve(tri.position), len(tri.elements.node)
    elements = element_order(tri.elements.node, ranks(nodes, tri.nnodes))
    movable.set_arrays(reordered_state(movable.state(), nodes, elements, BY_ELEMENT))
    try:
        yield elements
    finally:
        movable.set_arrays(
            reordered_state(movable.state(), ranks(nodes, tri.nnodes), ranks(elements, count), BY_ELEMENT)
        )


def is_scattered(triangulation: Triangulation) -> bool:
    node = triangulation.elements.node
    if triangulation.nnodes < FEW:
        return False
    return bool(np.median(np.abs(node[:, 0] - node[:, 1])) > FAR * np.sqrt(triangulation.nnodes))


@dataclass(frozen=True)
class Surgery:
    state: dict[str, Array]
    mesh: OpenMesh

    @classmethod
    def on(cls, movable: MovableMesh, density: Floats, target: int, done: Recycled, relief: float = 1.0) -> "Surgery":
        """Copy the arrays of `movable`, with spare rows for nodes and elements.

        Rows are allocated for one node more than `target`, so that a split can precede the collapse. By Euler's
        formula, every node that moves from the outer boundary to the interior adds an element. Old indices refer to the
        mesh before the earlier steps `done`.
        """
        n = movable.nnodes
        elements = movable.triangulation.elements
        m = len(elements.node)
        on_boundary = np.bincount(np.concatenate(elements.ends(*np.nonzero(elements.neighbour < 0))), minlength=n)
        rows, spare = target + 1, m + int(np.count_nonzero(on_boundary)) + 2 * (target - n) + 4
        state = movable.padded_state(rows, spare, UNUSED)
        anchor = padded(unchanged(movable.triangulation).start_element, rows, -1)
        pool = Pool(anchor, free_rows(n, rows), free_rows(m, spare), np.array([rows - n, spare - m], np.int64))
        origins = Origins(
            padded(density, rows, 1.0),
            padded(done.old, rows, -1),
            padded(done.start_element, rows, -1),
            state["pinned"],
            np.zeros(rows, bool),
            padded(on_boundary > 2, rows, False),
            padded(longest_merged(movable), rows, np.inf),
        )
        records = with_state(elements, movable.constraints, state)
        scratch, metric = SurgeryScratch.of(rows, spare), Metric(state["shape"], relief)
        return cls(state, OpenMesh(state["position"], *records, pool, origins, scratch, metric))

    def write_back(self, movable: MovableMesh, renumbered: bool = False) -> IntsPair:
        anchor, node = self.mesh.pool.anchor, self.mesh.elements.node
        nodes = np.flatnonzero(anchor >= 0)
        if renumbered:
            nodes = nodes[along_curve(self.state["position"][nodes])]
        elements = np.flatnonzero(node[:, 0] >= 0)
        elements = elements[element_order(node[elements], ranks(nodes, len(anchor)))]
        movable.set_arrays(reordered_state(self.state, nodes, elements, BY_ELEMENT))
        return nodes, elements


def longest_merged(movable: MovableMesh) -> Floats:
    even = np.append(movable.constraints.chains.even, np.inf)
    return even[np.where(movable.constraints.kind == SLIDING, movable.constraints.own_chain, -1)]


MOST = 8  # maximum number of layers that is made; more must be in the input mesh


def with_thin_layers(mesh: MeshTri, rules: Rules, grows: bool = False) -> MeshTri:
    # Every edge in the middle of a path across with too few edges is halved, until all paths are long enough. New
    # nodes follow the nodes of the input in number.
    if not rules.layers or not (grows or rules.topology == "recycle"):
        return mesh
    movable = MovableMesh.of(mesh, replace(rules, layers=None, periodic=()))
    wanted = {name: number for name, number in checked_layers(mesh, rules.layers).items() if number <= MOST}
    while len(edges := edges_to_split(movable, wanted)):
        split_edges(movable, edges)
    made = movable.nnodes - mesh.p.shape[1]
    if made:
        logger.info("made layers of elements in %s by %d new nodes", listed(rules.layers), made)
    return movable.mesh() if made else mesh


def edges_to_split(movable: MovableMesh, wanted: dict[str, int]) -> Ints:
    found = [np.empty((0, 2), np.int64)]
    for band in bands_with(movable.triangulation, movable.constraints, wanted):
        from_one, from_other = (steps_from(band, side, movable.nnodes) for side in (0, 1))
        a, b = np.concatenate([band.pairs, band.pairs[:, ::-1]]).T
        across = from_one[a] + 1 + from_other[b]
        found.append(np.stack([a, b], axis=1)[(across < band.number) & (from_one[a] == across // 2)])
    return np.unique(np.sort(np.concatenate(found), axis=1), axis=0)


def split_edges(movable: MovableMesh, edges: Ints) -> None:
    n = movable.nnodes
    surgery = Surgery.on(movable, np.ones(n), n + len(edges), unchanged(movable.triangulation))
    # interpreted, because few edges are halved, once for a mesh: compiling would take longer
    find, middle, halve = (interpreted(loop) for loop in (find_edge, midpoint, split))
    for a, b in edges.tolist():
        e, k = find(surgery.mesh, a, b)
        halve(surgery.mesh, e, k, *middle(surgery.mesh, np.int64(surgery.mesh.elements.chain[e, k]), a, b))
    surgery.write_back(movable)
