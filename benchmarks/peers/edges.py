"""Find edges by the pairs of their end nodes, and faces by their corners."""

import numpy as np

Array = np.ndarray


def unique_edges(pairs: Array) -> tuple[Array, Array]:
    """The edges (2, nedges) that pairs of nodes (2, n) make, whichever way round, and which of them each pair is."""
    size = int(pairs.max()) + 1
    keys, number = np.unique(_keys(pairs, size), return_inverse=True)
    return np.stack(np.divmod(keys, size)), number


def find_edges(edges: Array, pairs: Array) -> Array:
    """Where in edges (2, nedges), or faces (3, nfaces), the pairs (2, n) or triples stand; every one must be there."""
    size = int(edges.max()) + 1
    keys = _keys(edges, size)
    order = np.argsort(keys)
    return order[np.searchsorted(keys, _keys(pairs, size), sorter=order)]


def _keys(pairs: Array, size: int) -> Array:
    first, *others = np.sort(pairs, axis=0).astype(np.int64)
    for row in others:
        first = first * size + row
    return first
