"""Look up the names of a mesh; number sets of names, regions with one set each, and how facets carry them."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skfem import Mesh, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import listed
from kohonen_adapt.mesh.host import is_own_name

__all__ = [
    "LEFT",
    "RIGHT",
    "UNORIENTED",
    "codes_of_names",
    "combinations",
    "in_order",
    "joined",
    "labels",
    "manners_of",
    "named",
    "named_sets",
    "nodes_of_points",
    "regions_of",
    "subdomains_of",
    "turned",
]

UNORIENTED, LEFT, RIGHT = 1, 2, 3  # how a facet or chain carries a name: without a side, or with that of its direction
SAME = 1e-9  # of the size of the mesh: nodes nearer than that to a point are there


def named_sets(sets: Mapping[str, ArrayLike] | None) -> dict[str, Ints]:
    """Name to elements or facets, for the names of the user."""
    return {name: np.asarray(rows, dtype=np.int64) for name, rows in (sets or {}).items() if is_own_name(name)}


def named(sets: Mapping[str, Ints] | None, name: str, kind: str) -> Ints:
    """The set of that name; refused with the names there are, called by `kind`: "subdomain" or "boundary"."""
    if sets is None or name not in sets:
        raise ValueError(f"{kind} {name!r} is not in the mesh; it has {listed(named_sets(sets))}.")
    return sets[name]


def nodes_of_points(mesh: MeshTri, points: Mapping[str, Floats]) -> dict[str, Ints]:
    """The nodes of a mesh at named places (2, n); refused where it has none, or a boundary has the name of a point."""
    if not points:
        return {}
    corners = mesh.p[:, : mesh.nvertices]
    tree, size, found = cKDTree(corners.T), np.ptp(corners, axis=1).max(), {}
    for name, places in points.items():
        if name in named_sets(mesh.boundaries):
            raise ValueError(f"{name!r} is a boundary of the mesh and one of the points; rename one of them.")
        off, nodes = tree.query(places.T)
        worst = int(np.argmax(off))
        if off[worst] > SAME * size:
            near = tuple(mesh.p[:, nodes[worst]].tolist())
            raise ValueError(
                f"the mesh has no node at the point {name!r}, {tuple(places[:, worst].tolist())}; the nearest one is "
                f"at {near}. Make it a point of the drawing; `adapt` and `polish` keep its node, for `relocate` pin it."
            )
        found[name] = np.unique(nodes)
    return found


def codes_of_names(members: Sequence[tuple[Ints, ArrayLike]], count: int) -> NDArray[np.uint64]:
    """One number for the set of names that each of `count` things carries, 0 for none.

    `members` has per name the things that carry it, and how (a small number for each or for all). A random number is
    drawn per name and manner; their sum identifies the set: two sets would have to share a sum of 64-bit numbers to be
    confused.
    """
    codes = np.zeros(count, dtype=np.uint64)
    rng = np.random.default_rng(20260101)
    for things, manner in members:
        keys = rng.integers(1, 2**63, size=4, dtype=np.uint64)
        unique, first = np.unique(np.asarray(things), return_index=True)
        codes[unique] += keys[np.broadcast_to(manner, np.shape(things))[first]]
    return codes


def combinations(sets: Sequence[Ints], count: int) -> tuple[Ints, list[Ints]]:
    """Number the distinct combinations of sets that `count` items are in; a set has no item twice.

    Returns the number of the combination of every item, (count,), from 0, in the order of the sets, where no set at all
    comes first; and which sets make every combination.
    """
    codes = codes_of_names([(items, 0) for items in sets], count)
    _, example, combination = np.unique(codes, return_index=True, return_inverse=True)
    within = np.array([np.isin(example, items) for items in sets], dtype=bool).reshape(len(sets), len(example))
    members = [np.flatnonzero(column) for column in within.T]
    order = sorted(range(len(members)), key=lambda number: members[number].tolist())
    return np.argsort(order)[combination], [members[number] for number in order]


def regions_of(mesh: Mesh, neighbour: NDArray[np.int32]) -> NDArray[np.int32]:
    """Number of the region of every element: a connected set of elements that carry the same subdomain names.

    They are numbered in the order of their first elements. `neighbour` (m, d + 1) is -1 outside.
    """
    m = len(neighbour)
    codes = codes_of_names([(rows, 0) for rows in named_sets(mesh.subdomains).values()], m)
    e, k = np.nonzero(neighbour > np.arange(m)[:, None])
    other = neighbour[e, k]
    alike = codes[e] == codes[other]
    return joined(m, np.stack([e[alike], other[alike]], axis=1)).astype(np.int32)


def joined(count: int, pairs: Ints) -> Ints:
    """Number of the connected set of every one of `count` things that pairs (k, 2) link, (count,).

    The sets are numbered in the order of their first members.
    """
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), tuple(pairs.T)), shape=(count, count))
    return in_order(connected_components(graph, directed=False)[1])


def in_order(label: Ints) -> Ints:
    """Labels as numbers in the order in which they come first."""
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number]


def subdomains_of(mesh: Mesh, region_of_input: Ints, region: Ints) -> dict[str, Ints] | None:
    """The elements of every name of a mesh when its elements are of these regions; one carries the names of its region.

    `region_of_input` are those of the elements that the mesh has itself. What is no name of the user's is kept only
    while there are as many elements as that.
    """
    if mesh.subdomains is None:
        return None
    found = {}
    for name, rows in mesh.subdomains.items():
        if not is_own_name(name):
            if len(region) == len(region_of_input):
                found[name] = np.array(rows)
            continue
        named = np.zeros(region_of_input.max() + 1, dtype=bool)
        named[region_of_input[rows]] = True
        found[name] = np.flatnonzero(named[region]).astype(np.asarray(rows).dtype)
    return found


def manners_of(mesh: Mesh, rows: Ints, facet: Ints, element: Ints) -> NDArray[np.int8]:
    """How the given facets, seen from the given elements, carry a boundary of these rows."""
    manner = np.zeros(mesh.facets.shape[1], dtype=np.int8)
    manner[np.asarray(rows)] = UNORIENTED
    if isinstance(rows, OrientedBoundary):
        side = np.full(len(manner), -1)
        side[np.asarray(rows)] = mesh.f2t[rows.ori, np.asarray(rows)]
        return np.where(manner[facet] == 0, 0, np.where(side[facet] == element, LEFT, RIGHT)).astype(np.int8)
    return manner[facet]


def turned(side: NDArray[np.int8], same_direction: Mask | bool) -> NDArray[np.int8]:
    """Sides seen along another direction: LEFT and RIGHT change places where it is not the same."""
    return np.where(~np.asarray(same_direction) & (side >= LEFT), LEFT + RIGHT - side, side).astype(np.int8)


def labels(left: Ints, right: Ints, sides: list[NDArray[np.int8]]) -> Ints:
    """Number the combinations of regions to the left and right and of carried names, along and against, (f, 2)."""
    rows = []
    for pair, along in (((left, right), True), ((right, left), False)):
        seen = [turned(side, along) for side in sides]
        code = codes_of_names([(np.flatnonzero(side), side[side > 0]) for side in seen], len(left)).view(np.int64)
        rows.append(np.column_stack([*pair, code]))
    number = np.unique(np.concatenate(rows), axis=0, return_inverse=True)[1].ravel()
    return number.reshape(2, -1).T
