"""Named subdomains and boundaries, and regions of elements with equal names."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skfem import Mesh, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Array, Floats, Int8s, Ints, Mask
from kohonen_adapt.checks import listed, nearest_name
from kohonen_adapt.mesh.host import facets_opposite, is_own_name, number_facets, numbered

__all__ = [
    "LEFT",
    "RIGHT",
    "UNORIENTED",
    "boundary_of",
    "codes_of_names",
    "combinations",
    "connected_components_of",
    "elements_in",
    "equal_and_connected",
    "in_order",
    "joined_names",
    "labelled",
    "labels",
    "manners_of",
    "marked_facets",
    "named",
    "named_sets",
    "nodes_of_points",
    "outer_facets_of",
    "regions_of",
    "subdomains_of",
    "turned",
]

UNORIENTED, LEFT, RIGHT = 1, 2, 3  # orientation of a name on a facet or curve segment: none, or its left or right side
Manners = Int8s
Names = str | Sequence[str]  # of subdomains

SAME = 1e-9  # maximum distance of a node from a named point, relative to the size of the mesh


def named_sets(sets: Mapping[str, ArrayLike] | None) -> dict[str, Ints]:
    return {name: np.asarray(rows, np.int64) for name, rows in (sets or {}).items() if is_own_name(name)}


def named(sets: Mapping[str, Ints] | None, name: str, kind: str) -> Ints:
    if sets is None or name not in sets:
        available = named_sets(sets)
        plural = {"boundary": "boundaries"}.get(kind, f"{kind}s")
        remedy = nearest_name(name, available) if available else f" Name {plural} by mesh.with_{plural}."
        raise ValueError(f"{kind} {name!r} is not in the mesh; it has {listed(available)}.{remedy}")
    return sets[name]


def elements_in(mesh: Mesh, names: Names) -> Mask:
    inside, text = np.zeros(mesh.nelements, bool), joined_names(names)
    for name in [names] if isinstance(names, str) else names:
        inside[named(mesh.subdomains, name, "subdomain")] = True
    if not inside.any():
        raise ValueError(f"subdomain {text} has no elements; name one that has.")
    return inside


def joined_names(names: Names) -> str:
    listed = [names] if isinstance(names, str) else names
    if not isinstance(listed, Sequence) or not listed or not all(isinstance(name, str) for name in listed):
        raise ValueError(f"a body is the name of a subdomain or a sequence of names; got {names!r}.")
    return " + ".join(map(repr, listed))


def outer_facets_of(mesh: Mesh, name: str, what: str) -> Ints:
    """Return the facets of a boundary that must be on the outside."""
    facets = np.asarray(named(mesh.boundaries, name, "boundary"))
    number_facets(mesh)
    inside = int(np.count_nonzero(mesh.f2t[1, facets] >= 0))
    if inside or not facets.size:
        raise ValueError(
            f"{what} must be on the outer boundary of the mesh; {inside} of {facets.size} facets are inside."
        )
    return facets


def nodes_of_points(mesh: MeshTri, points: Mapping[str, Floats]) -> dict[str, Ints]:
    if not points:
        return {}
    corners = mesh.p[:, : mesh.nvertices]
    tree, size, found = cKDTree(corners.T), np.ptp(corners, axis=1).max(), {}
    for name, positions in points.items():
        if name in named_sets(mesh.boundaries):
            raise ValueError(f"{name!r} is a boundary of the mesh and one of the points; rename one of them.")
        distance, nodes = tree.query(positions.T)
        worst = int(np.argmax(distance))
        if distance[worst] > SAME * size:
            near = tuple(mesh.p[:, nodes[worst]].tolist())
            raise ValueError(
                f"the mesh has no node at the point {name!r}, {tuple(positions[:, worst].tolist())}; the nearest one "
                f"is at {near}. Make it a point of the drawing; `adapt` and `polish` keep its node, for `relocate` pin "
                "it."
            )
        found[name] = np.unique(nodes)
    return found


def codes_of_names(members: Sequence[tuple[Ints, ArrayLike]], count: int) -> NDArray[np.uint64]:
    """Return an integer for the set of names of each of `count` items, 0 for none.

    `members` contains for each name its items and the manner in which they have the name, a small integer for each item
    or for all. Different sets would be confused only if their 64-bit sums of random numbers were equal.
    """
    codes = np.zeros(count, np.uint64)
    rng = np.random.default_rng(20260101)
    for things, manner in members:
        keys = rng.integers(1, 2**63, size=4, dtype=np.uint64)
        unique, first = np.unique(np.asarray(things), return_index=True)
        codes[unique] += keys[np.broadcast_to(manner, np.shape(things))[first]]
    return codes


def combinations(sets: Sequence[Ints], count: int) -> tuple[Ints, list[Ints]]:
    """Return the combination of sets that each of `count` items belongs to.

    The results are the index of the combination of every item, (count,), and the sets of every combination. No set may
    contain an item twice.
    """
    codes = codes_of_names([(items, 0) for items in sets], count)
    _, example, combination = np.unique(codes, return_index=True, return_inverse=True)
    within = np.array([np.isin(example, items) for items in sets], bool).reshape(len(sets), len(example))
    members = [np.flatnonzero(column) for column in within.T]
    order = sorted(range(len(members)), key=lambda number: members[number].tolist())
    return np.argsort(order)[combination], [members[number] for number in order]


def labelled(sets: Mapping[str, Ints], count: int) -> tuple[Ints, list[str]]:
    """Return the index of the names of each of `count` items, and all names."""
    number, members = combinations(list(sets.values()), count)
    names = list(sets)
    return number, [", ".join(names[k] for k in each.tolist()) for each in members]


def regions_of(mesh: Mesh, pairs: Ints | None = None) -> Ints:
    """Return the region index of every element, (m,).

    A region is a connected set of elements with the same subdomain names. `pairs` (2, k) are the elements that share a
    facet, by default those of scikit-fem, which are wrong if a mesh is tangled.
    """
    codes = codes_of_names([(rows, 0) for rows in named_sets(mesh.subdomains).values()], mesh.nelements)
    return equal_and_connected(mesh, codes[None], pairs).astype(np.int32)


def equal_and_connected(mesh: Mesh, data: Array, pairs: Ints | None = None) -> Ints:
    """Return the index of connected elements with equal columns of `data`, (m,)."""
    if pairs is None:
        number_facets(mesh)
        pairs = mesh.f2t[:, mesh.f2t[1] >= 0]
    same = np.all(data[:, pairs[0]] == data[:, pairs[1]], axis=0)
    return connected_components_of(mesh.nelements, pairs[:, same].T)


def connected_components_of(count: int, pairs: Ints) -> Ints:
    graph = coo_array((np.ones(len(pairs), np.int8), tuple(pairs.T)), shape=(count, count))
    return in_order(connected_components(graph, directed=False)[1])


def in_order(label: Ints) -> Ints:
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number]


def subdomains_of(mesh: Mesh, region_of_input: Ints, region: Ints) -> dict[str, Ints] | None:
    if mesh.subdomains is None:
        return None
    found = {}
    for name, rows in mesh.subdomains.items():
        if is_own_name(name):
            found[name] = np.flatnonzero(np.isin(region, region_of_input[rows])).astype(np.asarray(rows).dtype)
        elif len(region) == len(region_of_input):
            found[name] = np.array(rows)
    return found


def manners_of(mesh: Mesh, rows: Ints, facet: Ints, element: Ints) -> Manners:
    # The result is 0 for facets outside the boundary `rows`, and UNORIENTED for a boundary without orientation. In an
    # oriented boundary the result is LEFT if `element` is on the oriented side, or else RIGHT.
    manner = np.zeros(mesh.nfacets, np.int8)
    manner[np.asarray(rows)] = UNORIENTED
    if isinstance(rows, OrientedBoundary):
        side = np.full(len(manner), -1)
        side[np.asarray(rows)] = mesh.f2t[rows.ori, np.asarray(rows)]
        manner[side >= 0] = RIGHT
        return np.where(side[facet] == element, LEFT, manner[facet]).astype(np.int8)
    return manner[facet]


def marked_facets(mesh: Mesh, elements: Any) -> tuple[Ints, Ints, Ints, Ints, dict[str, Manners]]:
    """Return the facets on the rim, between regions or on a named boundary.

    Returns for every facet its element and the local index of the opposite corner, shape (f,), the regions of the
    element and of its neighbour, -1 outside, shape (f, 2), the labels of both sides, shape (f, 2), and the result of
    `manners_of` by boundary name.
    """
    across, other = elements.neighbour, np.append(elements.region, np.int32(-1))[elements.neighbour]
    marked = other != elements.region[:, None]
    boundaries = mesh.boundaries or {}
    facet = facets_opposite(mesh, elements.node) if boundaries else None
    if facet is not None:
        named_facets = np.zeros(mesh.nfacets, bool)
        named_facets[np.concatenate([np.asarray(rows, np.int64) for rows in boundaries.values()])] = True
        marked |= named_facets[facet]
    e, k = np.nonzero(marked & ((across < 0) | (across > np.arange(len(across))[:, None])))
    sides = {} if facet is None else {n: manners_of(mesh, rows, facet[e, k], e) for n, rows in boundaries.items()}
    regions = np.stack([elements.region[e], other[e, k]], axis=1)
    return e, k, regions, labels(regions, list(sides.values())), sides


def boundary_of(mesh: Mesh, facet: Ints, element: Ints, corner: Ints, on_side: Mask | None) -> Ints:
    # `facet`, shape (m, d + 1), holds the facets of `facets_opposite`. `on_side` is True for elements on the oriented
    # side. With None the boundary has no orientation.
    number, first = np.unique(facet[element, corner], return_index=True)
    if on_side is None:
        return number
    return OrientedBoundary(number, (mesh.f2t[0, number] == element[first]) != on_side[first])


def turned(side: Manners, same_direction: Mask | bool) -> Manners:
    return np.where(~np.asarray(same_direction) & (side >= LEFT), LEFT + RIGHT - side, side).astype(np.int8)


def labels(regions: Ints, sides: list[Manners]) -> Ints:
    """Return label indices of facets, equal for equal regions and names, (f, 2).

    A label is a combination of the `regions` to the left and right, (f, 2), and of the named boundaries. The columns
    are for the direction of the facet and for the opposite direction.
    """
    directions = [
        np.column_stack([pair, *(turned(side, along) for side in sides)])
        for pair, along in ((regions, True), (regions[:, ::-1], False))
    ]
    number = numbered(np.concatenate(directions).T)
    return number.reshape(2, -1).T
