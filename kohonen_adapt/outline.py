"""Outlines: chains of facets from corner to corner, where each node may go, and which names each chain carries."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import MeshTri
from skfem.generic_utils import OrientedBoundary

from .facets import number_facets
from .kernels.geometry import FREE, HELD, SLIDING, Constraints
from .triangulation import Triangulation, codes_of_names

__all__ = ["Outline", "pinned_nodes"]

TURN = 1e-6  # radians: a larger one is a corner
BEND = 1e-9  # of a chain's length: no node of a straight chain may lie farther off its chord
UNORIENTED, LEFT, RIGHT = 1, 2, 3  # how a facet or chain carries a name: without a side, or with that of its direction

Mask = NDArray[np.bool_]
Indices = NDArray[np.integer]


class Facets(NamedTuple):
    """The facets that outlines are made of, a row each, running counter-clockwise in their element."""

    element: Indices  # (f,)
    corner: Indices  # (f,) local number of the element's corner opposite to the facet
    nodes: Indices  # (f, 2)
    label: Indices  # (f,) facets of one label carry the same names and divide the same regions
    sides: dict[str, NDArray[np.int8]]  # per boundary name (f,): 0, UNORIENTED, LEFT or RIGHT


class Joints(NamedTuple):
    """The nodes in which just two outline facets meet."""

    node: Indices  # (j,)
    facets: Indices  # (j, 2)
    ends: Indices  # (j, 2) the facets' other nodes


@dataclass
class Outline:
    """What the outlines of a triangulation allow each node, and the names of its chains.

    Attributes
    ----------
    constraints
        Arrays for the kernels, which change them when nodes slide or jump.
    names
        Per boundary name, how each chain carries it: 0, UNORIENTED, LEFT or RIGHT, (c,).
    pinned
        (n,): nodes that were asked to stay where they are.
    """

    constraints: Constraints
    names: dict[str, NDArray[np.int8]]
    pinned: Mask

    @classmethod
    def of(cls, triangulation: Triangulation, pinned: Mask) -> "Outline":
        """Find the chains of a triangulation, and mark their facets in it."""
        facets = outline_facets(triangulation)
        joints = joints_of(facets, triangulation.nnodes)
        chain, held = straight_chains(triangulation.position, facets, joints, pinned)
        mark_facets(triangulation, facets, chain)
        constraints = constrain(triangulation, facets, joints, chain, held, pinned)
        along = runs_along(triangulation, constraints, facets.element, facets.corner)
        first = np.unique(chain, return_index=True)[1]
        names = {name: turned(side, along)[first] for name, side in facets.sides.items()}
        return cls(constraints, names, pinned)

    def copy(self) -> "Outline":
        """The outline as it is now."""
        return replace(self, constraints=Constraints(*(array.copy() for array in self.constraints)))

    def with_boundaries(self, mesh: MeshTri, triangulation: Triangulation) -> MeshTri:
        """`mesh`, just made from the triangulation, with the named boundaries of the mesh that one came from."""
        if triangulation.mesh.boundaries is None:
            return mesh
        facet = facet_of_edge(mesh, triangulation.elements.node)
        boundaries = {name: self._boundary(mesh, facet, triangulation, name) for name in self.names}
        mesh._boundaries = boundaries  # in place: a copy would have to number its facets again
        return mesh

    def _boundary(self, mesh: MeshTri, facet: Indices, triangulation: Triangulation, name: str) -> NDArray:
        """The facets on the chains that carry a name; with their sides if it had them."""
        chain = triangulation.elements.chain
        e, k = np.nonzero((chain >= 0) & np.append(self.names[name], 0)[chain].astype(bool))
        number, first = np.unique(facet[e, k], return_index=True)
        if not isinstance(triangulation.mesh.boundaries[name], OrientedBoundary):
            return number
        e, k = e[first], k[first]
        side = turned(self.names[name][chain[e, k]], runs_along(triangulation, self.constraints, e, k))
        return OrientedBoundary(number, (mesh.f2t[0, number] == e) != (side == LEFT))


def pinned_nodes(mesh: MeshTri, pinned: Sequence[int | str] | Indices | str) -> Mask:
    """Mask (nodes,) of the nodes meant by node indices and names of boundaries and subdomains.

    Raises
    ------
    ValueError
        If a name is unknown or both a boundary and a subdomain, an index is out of range, or an entry is neither an
        integer nor a name.
    """
    mask = np.zeros(mesh.p.shape[1], dtype=bool)
    if not isinstance(pinned, Iterable):
        raise ValueError(f"pinned must be a sequence of node numbers and names; got {pinned!r}.")
    for entry in [pinned] if isinstance(pinned, str) else pinned:
        if isinstance(entry, str):
            mask[nodes_of_name(mesh, entry)] = True
        elif isinstance(entry, int | np.integer) and not isinstance(entry, bool):
            if not 0 <= entry < len(mask):
                raise ValueError(f"pinned nodes must be from 0 to {len(mask) - 1}; got {entry}.")
            mask[entry] = True
        else:
            raise ValueError(f"pinned must hold node numbers and names; got {entry!r}.")
    return mask


def nodes_of_name(mesh: MeshTri, name: str) -> Indices:
    """The nodes of a named boundary or subdomain."""
    boundaries, subdomains = mesh.boundaries or {}, mesh.subdomains or {}
    if name in boundaries and name in subdomains:
        raise ValueError(f"pinned name {name!r} is both a boundary and a subdomain; rename one of them.")
    if name in boundaries:
        return mesh.facets[:, np.asarray(boundaries[name])]
    if name in subdomains:
        return mesh.t[:, subdomains[name]]
    known = ", ".join(repr(known) for known in sorted({*boundaries, *subdomains})) or "none"
    raise ValueError(f"pinned name {name!r} is not in the mesh; its boundaries and subdomains are: {known}.")


def facet_of_edge(mesh: MeshTri, node: NDArray[np.int32]) -> NDArray[np.int32]:
    """Number of the facet opposite to each corner of the counter-clockwise elements, (m, 3)."""
    number_facets(mesh)
    facet = np.empty_like(node)
    for row in range(3):  # scikit-fem's facets of an element: corners 01, 12, 02
        corner = np.argmax(node == mesh.t[(row + 2) % 3][:, None], axis=1)
        facet[np.arange(len(node)), corner] = mesh.t2f[row]
    return facet


def outline_facets(triangulation: Triangulation) -> Facets:
    """Facets on the outer boundary, between regions, and in named boundaries."""
    mesh, elements = triangulation.mesh, triangulation.elements
    across, own = elements.neighbour, elements.region[:, None]
    other = np.where(across >= 0, elements.region[across], -1)
    marked = other != own
    boundaries = mesh.boundaries or {}
    facet = facet_of_edge(mesh, elements.node) if boundaries else None
    if boundaries:
        named = np.zeros(mesh.facets.shape[1], dtype=bool)
        named[np.concatenate([np.asarray(rows, dtype=np.int64) for rows in boundaries.values()])] = True
        marked |= named[facet]
    e, k = np.nonzero(marked & ((across < 0) | (across > np.arange(len(own))[:, None])))
    nodes = np.stack([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]], axis=1)
    sides = {} if facet is None else {n: sides_of(mesh, rows, facet[e, k], e) for n, rows in boundaries.items()}
    pair = np.sort(np.stack([elements.region[e], other[e, k]], axis=1), axis=1)
    canonical = points_right(triangulation.position[nodes[:, 1]] - triangulation.position[nodes[:, 0]])
    return Facets(e, k, nodes, labels(pair, [turned(side, canonical) for side in sides.values()]), sides)


def sides_of(mesh: MeshTri, rows: Indices, facet: Indices, element: Indices) -> NDArray[np.int8]:
    """How the given facets, seen from the given elements, carry a boundary of these rows."""
    manner = np.zeros(mesh.facets.shape[1], dtype=np.int8)
    manner[np.asarray(rows)] = UNORIENTED
    if isinstance(rows, OrientedBoundary):
        side = np.full(len(manner), -1)
        side[np.asarray(rows)] = mesh.f2t[rows.ori, np.asarray(rows)]
        return np.where(manner[facet] == 0, 0, np.where(side[facet] == element, LEFT, RIGHT)).astype(np.int8)
    return manner[facet]


def turned(side: NDArray[np.int8], same_direction: Mask) -> NDArray[np.int8]:
    """Sides seen along another direction: LEFT and RIGHT change places where it is not the same."""
    return np.where(~same_direction & (side >= LEFT), LEFT + RIGHT - side, side).astype(np.int8)


def points_right(vector: NDArray[np.float64]) -> Mask:
    """One of the two directions of a line, the same for all facets on it."""
    x, y = vector.T
    return np.where(np.abs(x) > TURN * np.abs(y), x > 0, y > 0)


def labels(pair: Indices, sides: list[NDArray[np.int8]]) -> Indices:
    """Number the combinations of adjacent regions and carried names."""
    carried = [(np.flatnonzero(side), side[side > 0]) for side in sides]
    code = codes_of_names(carried, len(pair)).view(np.int64)
    return np.unique(np.column_stack([pair, code]), axis=0, return_inverse=True)[1].ravel()


def joints_of(facets: Facets, nnodes: int) -> Joints:
    """Pair the facets at every node in which just two meet."""
    ends = facets.nodes.ravel()
    order = np.argsort(ends, kind="stable")
    count = np.bincount(ends, minlength=nnodes)
    node = np.flatnonzero(count == 2)
    first = (np.cumsum(count) - count)[node]
    rows = np.stack([order[first], order[first + 1]], axis=1)
    return Joints(node, rows // 2, ends[rows ^ 1])


def straight_chains(
    position: NDArray[np.float64], facets: Facets, joints: Joints, pinned: Mask
) -> tuple[Indices, Mask]:
    """Chain of every outline facet, (f,), and the nodes that are held because they are corners or pinned, (n,)."""
    held = pinned.copy()
    held[facets.nodes] = True
    u, w = (position[joints.ends[:, side]] - position[joints.node] for side in (0, 1))
    turn = np.abs(np.arctan2(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0], -np.sum(u * w, axis=1)))
    same = facets.label[joints.facets[:, 0]] == facets.label[joints.facets[:, 1]]
    held[joints.node[same & (turn <= TURN) & ~pinned[joints.node]]] = False
    chain = joined(facets, joints, held)
    bent = bent_chains(position, facets, chain, held)
    if bent.any():  # many turns, each too small for a corner, that add up: its geometry is kept node by node
        held[facets.nodes[bent[chain]]] = True
        chain = joined(facets, joints, held)
    return chain, held


def joined(facets: Facets, joints: Joints, held: Mask) -> Indices:
    """Number the chains: facets that meet in a node that is not held belong together."""
    a, b = joints.facets[~held[joints.node]].T
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=2 * (len(facets.label),))
    return connected_components(graph, directed=False)[1]


def bent_chains(position: NDArray[np.float64], facets: Facets, chain: Indices, held: Mask) -> Mask:
    """Chains with a node off the chord between their ends, or without ends, (c,)."""
    count = chain.max(initial=-1) + 1
    open_ended = np.bincount(np.repeat(chain, 2), weights=held[facets.nodes].ravel(), minlength=count) == 2
    start, end = ends_of_chains(facets, chain, np.where(open_ended[chain][:, None], held[facets.nodes], True))
    chord = position[end] - position[start]
    off = position[facets.nodes] - position[start[chain]][:, None]
    cross = np.abs(off[..., 0] * chord[chain, None, 1] - off[..., 1] * chord[chain, None, 0])
    bent = ~open_ended
    np.logical_or.at(bent, chain, np.any(cross > BEND * np.sum(chord[chain] ** 2, axis=1)[:, None], axis=1))
    return bent


def ends_of_chains(facets: Facets, chain: Indices, is_end: Mask) -> tuple[Indices, Indices]:
    """The lowest and the highest numbered end node of every chain."""
    count = chain.max(initial=-1) + 1
    low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    rows, side = np.nonzero(is_end)
    np.minimum.at(low, chain[rows], facets.nodes[rows, side])
    np.maximum.at(high, chain[rows], facets.nodes[rows, side])
    return low, high


def mark_facets(triangulation: Triangulation, facets: Facets, chain: Indices) -> None:
    """Write the chain of every outline facet into the elements on both of its sides."""
    elements = triangulation.elements
    elements.chain[facets.element, facets.corner] = chain
    across = elements.neighbour[facets.element, facets.corner]
    inside = across >= 0
    e, own = across[inside], facets.element[inside]
    k = np.argmax(elements.neighbour[e] == own[:, None], axis=1)
    elements.chain[e, k] = chain[inside]


def constrain(
    triangulation: Triangulation, facets: Facets, joints: Joints, chain: Indices, held: Mask, pinned: Mask
) -> Constraints:
    """The constraint of every node, and the table of chains."""
    position, n = triangulation.position, triangulation.nnodes
    start, end = ends_of_chains(facets, chain, held[facets.nodes])
    chord = position[end] - position[start]
    length = np.sqrt(np.sum(chord**2, axis=1))
    direction = chord / length[:, None]
    kind = np.full(n, FREE, dtype=np.int8)
    kind[facets.nodes] = SLIDING
    kind[held] = HELD
    chains = np.full((n, 2), -1, dtype=np.int32)
    chains[joints.node] = chain[joints.facets]
    chains[pinned] = -1
    sliding = np.flatnonzero(kind == SLIDING)
    parameter = np.zeros(n)
    on = chains[sliding, 0]
    parameter[sliding] = np.sum((position[sliding] - position[start[on]]) * direction[on], axis=1)
    return Constraints(kind, chains, parameter, inner_nodes(triangulation), position[start], direction, length)


def inner_nodes(triangulation: Triangulation) -> Mask:
    """Nodes neither on the outer boundary nor on an interface, (n,)."""
    elements = triangulation.elements
    inner = np.ones(triangulation.nnodes, dtype=bool)
    across = elements.neighbour
    e, k = np.nonzero((across < 0) | (elements.region[across] != elements.region[:, None]))
    inner[elements.node[e, (k + 1) % 3]] = False
    inner[elements.node[e, (k + 2) % 3]] = False
    return inner


def runs_along(triangulation: Triangulation, constraints: Constraints, element: Indices, corner: Indices) -> Mask:
    """Whether the edges opposite to these corners run counter-clockwise in the direction of their chains."""
    node, position = triangulation.elements.node, triangulation.position
    edge = position[node[element, (corner + 2) % 3]] - position[node[element, (corner + 1) % 3]]
    return np.sum(edge * constraints.direction[triangulation.elements.chain[element, corner]], axis=1) > 0
