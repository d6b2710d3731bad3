"""Reasons for which nodes of tetrahedra stay where they are."""

import numpy as np

from kohonen_adapt.arrays import Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import HELD

__all__ = ["of_boundaries", "reasons_in_space"]


def reasons_in_space(movable: MovableSolid) -> list[str]:
    """Return the reason for every node, an empty string for nodes that move or slide."""
    found, elements = [""] * movable.nnodes, movable.tetrahedralization.elements
    e, k = np.nonzero(elements.patch >= 0)
    node = elements.node[e[:, None], (k[:, None] + [1, 2, 3]) % 4]
    pairs = np.unique(np.stack([node.ravel(), np.repeat(elements.patch[e, k], 3)], axis=1), axis=0)
    start = np.searchsorted(pairs[:, 0], np.arange(movable.nnodes + 1))
    for v in np.flatnonzero((movable.freedom.number == HELD) | movable.freedom.pinned).tolist():
        patches = pairs[start[v] : start[v + 1], 1]
        where = of_boundaries(movable, patches)
        if movable.freedom.pinned[v]:
            found[v] = "pinned"
        elif len(patches) > 2:
            found[v] = f"corner of {len(patches)} faces{where}"
        elif len(patches) == 2:
            found[v] = f"corner of an edge between two faces{where}"
        else:
            found[v] = f"rim of a sheet that is neither straight nor an arc{where}"
    return found


def of_boundaries(movable: MovableSolid, patches: Ints) -> str:
    names = [name for name, side in movable.patches.names.items() if np.any(side[patches])]
    return f" of {'boundary' if len(names) == 1 else 'boundaries'} {listed(names)}" if names else ""
