"""Bisect newest vertices: the baseline that the theory of adaptive methods is about."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import MeshTri

from benchmarks.peers.edges import find_edges, unique_edges

Array = np.ndarray


@dataclass(frozen=True)
class Bisection:
    """A mesh with its state: rows 0 and 1 of `t` (3, nelements) are the ends of the edge that is halved next.

    `parent` (nelements,) is the element of the start mesh, `named` the facets of every boundary as pairs of nodes.
    """

    p: Array
    t: Array
    parent: Array
    named: dict[str, Array]
    start: MeshTri

    @classmethod
    def of(cls, mesh: MeshTri) -> "Bisection":
        """The state of a start mesh: every element is halved at its longest edge first."""
        corners = mesh.p[:, mesh.t]
        lengths = np.hypot(*(np.roll(corners, -1, axis=1) - corners))
        rows = (np.argmax(lengths, axis=0) + np.arange(3)[:, None]) % 3
        named = {name: mesh.facets[:, facets] for name, facets in (mesh.boundaries or {}).items()}
        return cls(mesh.p, np.take_along_axis(mesh.t, rows, axis=0), np.arange(mesh.t.shape[1]), named, mesh)

    def mesh(self) -> MeshTri:
        """As scikit-fem's mesh, elements in the same order, every name kept."""
        plain = MeshTri(np.ascontiguousarray(self.p), np.ascontiguousarray(self.t))
        subdomains = {
            name: np.flatnonzero(np.isin(self.parent, elements))
            for name, elements in (self.start.subdomains or {}).items()
        }
        boundaries = {name: find_edges(plain.facets, pairs) for name, pairs in self.named.items()}
        return plain.with_subdomains(subdomains).with_boundaries(boundaries)

    def refined(self, marked: Array) -> "Bisection":
        """Halve the marked elements (indices) at least once, and what else makes the mesh conform."""
        edges, edge_of = unique_edges(np.stack((self.t, np.roll(self.t, -1, axis=0))).reshape(2, -1))
        edge_of = edge_of.reshape(self.t.shape)  # between rows 0 and 1, 1 and 2, 2 and 0
        halved = _closure(edge_of, marked, edges.shape[1])
        midpoint = np.full(halved.size, -1)
        midpoint[halved] = self.p.shape[1] + np.arange(np.count_nonzero(halved))
        p = np.hstack((self.p, self.p[:, edges[:, halved]].mean(axis=1)))
        t, parent = _split(self.t, self.parent, midpoint[edge_of])
        named = {name: _halve(pairs, midpoint[find_edges(edges, pairs)]) for name, pairs in self.named.items()}
        return Bisection(p, t, parent, named, self.start)


def mark_bulk(indicators: Array, share: float) -> Array:
    """The fewest elements that have the given share of the sum of squared indicators (Doerfler's criterion)."""
    order = np.argsort(-indicators, kind="stable")
    running = np.cumsum(indicators[order] ** 2)
    return order[: 1 + np.searchsorted(running, share * running[-1])]


def bisected_meshes(problem: Any, mesh: MeshTri, share: float = 0.25) -> Iterator[tuple[MeshTri, Array]]:
    """The adaptive loop without end: every mesh with its solution."""
    state = Bisection.of(mesh)
    while True:
        mesh = state.mesh()
        solution = problem.solve(mesh)
        yield mesh, solution
        state = state.refined(mark_bulk(problem.indicators(mesh, solution), share))


def _closure(edge_of: Array, marked: Array, count: int) -> Array:
    """Which edges to halve (nedges,): an element with any halved edge has its first one halved, too."""
    halved = np.zeros(count, dtype=bool)
    halved[edge_of[0, marked]] = True
    while True:
        late = halved[edge_of].any(axis=0) & ~halved[edge_of[0]]
        if not late.any():
            return halved
        halved[edge_of[0, late]] = True


def _split(t: Array, parent: Array, midpoints: Array) -> tuple[Array, Array]:
    """Elements in two, three or four, by which of their edges have a midpoint (not -1)."""
    first, second, third = midpoints
    a, b, c = t
    whole = first < 0
    halves = [  # the element at either end of the halved edge, and what is halved in it next
        (np.stack((c, a, first)), third),
        (np.stack((b, c, first)), second),
    ]
    parts, parents = [t[:, whole]], [parent[whole]]
    for half, middle in halves:
        once, twice = ~whole & (middle < 0), ~whole & (middle >= 0)
        start, end, apex = half
        parts += [half[:, once], *(np.stack(q)[:, twice] for q in ((apex, start, middle), (end, apex, middle)))]
        parents += [parent[once], parent[twice], parent[twice]]
    return np.hstack(parts), np.concatenate(parents)


def _halve(pairs: Array, middle: Array) -> Array:
    """Pairs of nodes (2, n), those with a middle node (not -1) in two."""
    whole = middle < 0
    halves = [np.stack((end[~whole], middle[~whole])) for end in pairs]
    return np.hstack((pairs[:, whole], *halves))
