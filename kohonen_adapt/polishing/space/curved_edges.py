"""Curved edges between the nodes that a polish of order 2 holds."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import SolidBlock
from kohonen_adapt.mesh.basis import CURVED_RULE_IN_SPACE
from kohonen_adapt.mesh.host import keys_of
from kohonen_adapt.mesh.measures import EDGES, edge_midside_offsets
from kohonen_adapt.problem.functional_in_space import LAW_POINTS, LAW_WEIGHTS

__all__ = ["CurvedEdges"]


class CurvedEdges(NamedTuple):
    # as in `SolidBlock`
    start: NDArray[np.int32]  # (n + 1,)
    end: NDArray[np.int32]  # (k,)
    offset: Floats  # (k, 3)

    @classmethod
    def of(cls, movable: MovableSolid, nodes: int) -> "CurvedEdges":
        # for up to `nodes` nodes
        if not movable.curved:
            return cls(np.zeros(1, dtype=np.int32), np.zeros(0, dtype=np.int32), np.zeros((0, 3)))
        mesh = movable.mesh()
        offset = edge_midside_offsets(mesh)
        rows = np.flatnonzero(offset.any(axis=0))
        one, other = mesh.edges[:, np.append(rows, rows)]
        one[rows.size :], other[rows.size :] = mesh.edges[::-1, rows]
        order = np.lexsort((other, one))
        start = np.searchsorted(one[order], np.arange(nodes + 1)).astype(np.int32)
        return cls(
            start, other[order].astype(np.int32), np.ascontiguousarray(offset[:, np.append(rows, rows)[order]].T)
        )

    def on(self, node: Ints) -> Floats:
        # of elements with nodes (4, m), (3, 6, m)
        if not self.end.size:
            return np.zeros((3, len(EDGES[0]), node.shape[1]))
        count = len(self.start) - 1
        known = keys_of(np.stack([np.repeat(np.arange(count), np.diff(self.start)), self.end]), count)
        key = keys_of(node[EDGES], count)
        row = np.searchsorted(known, key).clip(max=known.size - 1)
        return np.where(known[row] == key, self.offset.T[:, row], 0.0)

    def block(self) -> SolidBlock:
        return SolidBlock.of(LAW_POINTS, LAW_WEIGHTS, self, CURVED_RULE_IN_SPACE)
