"""Every array that kernels share, in records: its shape, its type and what it says.

Letters of shapes: n nodes, m elements, r regions, c chains, k knots of tabled chains, p pieces of outline, t training
points, d dimensions. Where no type is given it is float64. Wide tables stand in place of an array
for each column because every array handed to a kernel costs numba as much as some lines of code; kernels name the
columns by the constants here, and everybody else by the properties of the records.
"""

from typing import Any, NamedTuple

import numpy as np

from kohonen_adapt.kernels.records import record

FREE, SLIDING, HELD = 0, 1, 2  # what a node may do: move in the plane, along its chain, not at all
STRAIGHT, ROUND, TABLED = 0, 1, 2  # shapes of chains
JUNCTION = -2  # in place of a chain: the node is held where three of them meet

UNGUARDED = -2.0  # in place of a least quality: every triangle exceeds it, overturned ones included
NEAR_AXIS = 1e-6  # of the largest x of its element: a corner with a smaller one is on the axis; no other one can be
CROSSINGS = 32  # edges crossed by a check of a circle; where there are more the check in order takes over

# Columns of tables.
OWN, OTHER = 0, 1  # of `Constraints.chain`
ORIGIN_X, ORIGIN_Y, DIRECTION_X, DIRECTION_Y, LENGTH = range(5)  # of `Chains.place`, and
CURVATURE, REACH, MERGED, BULGE, EVEN = range(5, 10)
SHAPE, CLOSED, PAIRED = 0, 1, 2  # of `Chains.flags`
AT, AT_X, AT_Y, RATE_X, RATE_Y = range(5)  # of `Chains.knot`
FIRST, LAST, IS_ROUND, IS_CLOSED = range(4)  # of the rows of pieces that outlines are cut into
HALF_COEFFICIENT, SIXTH_SOURCE, HALF_FLUX_X, HALF_FLUX_Y, CENTRE_X, CENTRE_Y = range(6)  # of `Trial.data`
CONSTANTS, RATES_X, RATES_Y, VARYING = 4, 6, 11, 16  # of its columns: how many, where fluxes vary more of them
# Of its columns where a source varies, after the centre: the affine coordinates, and the terms of the polynomial.
X_BY_X, X_BY_Y, Y_BY_X, Y_BY_Y, SOURCE_TERMS = range(6, 11)
DENSITY, RATE = 0, 1  # of `Laws.table`


@record
class Elements(NamedTuple):
    """Triangles counter-clockwise; ``neighbour[e, k]`` lies across the edge opposite to corner k, -1 outside."""

    node: np.ndarray  # (m, 3) int32
    neighbour: np.ndarray  # (m, 3) int32
    region: np.ndarray  # (m,) int32
    chain: np.ndarray  # (m, 3) int32: chain of the edge opposite to corner k, -1 for an edge that is free to flip
    level: np.ndarray  # (n,) int32: 0 on one side of a subdomain with layers, their number on the other
    layered: np.ndarray  # (r,) bool: regions in which no edge may join nodes whose levels differ by more than 1

    def ends(self, e: np.ndarray, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nodes of the edges opposite to corners k of elements e, counter-clockwise."""
        return self.node[e, (k + 1) % 3], self.node[e, (k + 2) % 3]


@record
class Star(NamedTuple):
    """The elements around node v stand in rows start[v] to start[v + 1]; (v, ahead, behind) is counter-clockwise."""

    start: np.ndarray  # (n + 1,) int32
    element: np.ndarray  # (3 m,) int32
    ahead: np.ndarray  # (3 m,) int32
    behind: np.ndarray  # (3 m,) int32


@record
class Chains(NamedTuple):
    """Where positions on every chain are looked up; a chain begins at its origin, in the direction given."""

    place: np.ndarray  # (c, 10): origin, direction, length, curvature, reach, merged, bulge, even
    flags: np.ndarray  # (c, 3) int8: shape, closed, paired
    row: np.ndarray  # (c + 1,) int32: knots of chain c stand in rows row[c] to row[c + 1]
    knot: np.ndarray  # (k, 5) of TABLED ones: parameter, position, and its derivative by the parameter

    @classmethod
    def of(cls, count: int) -> "Chains":
        """A table of so many straight chains without knots, to be filled."""
        flags, row = np.zeros((count, PAIRED + 1), dtype=np.int8), np.zeros(count + 1, dtype=np.int32)
        return cls(np.zeros((count, EVEN + 1)), flags, row, np.empty((0, RATE_Y + 1)))

    @property
    def shape(self) -> np.ndarray:
        """STRAIGHT, ROUND or TABLED, (c,)."""
        return self.flags[:, SHAPE]

    @property
    def origin(self) -> np.ndarray:
        """Where the parameter is 0, (c, 2)."""
        return self.place[:, ORIGIN_X : ORIGIN_Y + 1]

    @property
    def direction(self) -> np.ndarray:
        """Unit vectors: the tangent at the origin, (c, 2)."""
        return self.place[:, DIRECTION_X : DIRECTION_Y + 1]

    @property
    def length(self) -> np.ndarray:
        """The parameter goes from 0 to here, (c,)."""
        return self.place[:, LENGTH]

    @property
    def curvature(self) -> np.ndarray:
        """Of ROUND ones 1 / radius, positive if they run counter-clockwise, (c,)."""
        return self.place[:, CURVATURE]

    @property
    def closed(self) -> np.ndarray:
        """Whether it is a loop without a corner, on which the parameter begins anew at its end, (c,)."""
        return self.flags[:, CLOSED].view(np.bool_)

    @property
    def reach(self) -> np.ndarray:
        """The longest facet that may be made: longer ones would leave too much of a curve out, (c,)."""
        return self.place[:, REACH]

    @property
    def merged(self) -> np.ndarray:
        """The same of two facets that are to be one, (c,)."""
        return self.place[:, MERGED]

    @property
    def bulge(self) -> np.ndarray:
        """How far a curve may be from its facets, (c,)."""
        return self.place[:, BULGE]

    @property
    def even(self) -> np.ndarray:
        """Facets of this length, all alike, would leave out of a curve what those of the input do, (c,)."""
        return self.place[:, EVEN]

    @property
    def paired(self) -> np.ndarray:
        """Whether its nodes have partners on another chain, at the same parameters, (c,)."""
        return self.flags[:, PAIRED].view(np.bool_)


@record
class Twins(NamedTuple):
    """Nodes that are one because a boundary is another's periodic image, and how the mesh goes on there."""

    partner: np.ndarray  # (n,) int32: the other node, -1 for none
    motion: np.ndarray  # (n,) int32: the motion that carries the node to its partner, -1 likewise
    motions: np.ndarray  # (number, 2, 3): x -> A x + b as rows [A | b]
    region: np.ndarray  # (number, r) int32: the region in which a region goes on where a motion carries it, or -1


@record
class Constraints(NamedTuple):
    """Where each node may go."""

    kind: np.ndarray  # (n,) int8: FREE, SLIDING or HELD
    chain: np.ndarray  # (n, 2) int32: its own chain, or the two that meet in a corner; -1 for none, or JUNCTION
    parameter: np.ndarray  # (n,) where on its chain
    inner: np.ndarray  # (n,) bool: inside one region, so that every neighbour belongs to it
    chains: Chains
    twins: Twins

    @property
    def own_chain(self) -> np.ndarray:
        """The chain that a node slides on; of others no chain, JUNCTION, or the first of a corner's two, (n,)."""
        return self.chain[:, OWN]


@record
class SearchScratch(NamedTuple):
    """Room for one thread to search and learn in; the stamps are compared with a counter that only grows."""

    node_stamp: np.ndarray  # (n,) int64
    element_stamp: np.ndarray  # (m,) int64
    counter: np.ndarray  # (1,) int64
    queue: np.ndarray  # (n + m + 1,) int32
    frontier: np.ndarray  # (m,) int32: elements that the flood may enter
    reach: np.ndarray  # (m,): squared distance from the point to the edge it would enter through
    crossed: np.ndarray  # (CROSSINGS + 3, 2) int32: edges to be crossed, as element and opposite corner

    @classmethod
    def of(cls, nodes: int, elements: int) -> "SearchScratch":
        """Room for a mesh with so many nodes and elements."""
        return cls(
            np.zeros(nodes, dtype=np.int64),
            np.zeros(elements, dtype=np.int64),
            np.zeros(1, dtype=np.int64),
            np.empty(nodes + elements + 1, dtype=np.int32),
            np.empty(elements, dtype=np.int32),
            np.empty(elements),
            np.empty((CROSSINGS + 3, 2), dtype=np.int32),
        )


@record
class Neurons(NamedTuple):
    """A mesh that learns: triangles, or tetrahedra with the records of `tetrahedron/arrays.py`."""

    position: np.ndarray  # (n, d)
    elements: Any  # Elements, or Tetrahedra
    star: Any
    constraints: Any


@record
class Lesson(NamedTuple):
    """Training points in the order in which they are presented, and how far around their winners they reach."""

    points: np.ndarray  # (t, d)
    region: np.ndarray  # (t,) int32
    weights: np.ndarray  # (t,)
    winners: np.ndarray  # (t,) int32
    strength: np.ndarray  # (radius + 1,) the neighbourhood function, of ring 0 to the radius
    ends: np.ndarray  # (radius + 2,) int64: room for where the rings end in the queue


@record
class Pool(NamedTuple):
    """Which rows of the arrays of nodes and elements are in use; rows of free elements have node -1."""

    anchor: np.ndarray  # (n,) int32: one of the elements around each node, -1 for a free row
    free_nodes: np.ndarray  # (n,) int32: a stack
    free_elements: np.ndarray  # (m,) int32: a stack
    height: np.ndarray  # (2,) int64: of the two stacks


@record
class Origins(NamedTuple):
    """What surgery knows of each node beside its position and constraint."""

    density: np.ndarray  # (n,) wanted nodes per area
    old: np.ndarray  # (n,) int32: number before, -1 for a new node
    hint: np.ndarray  # (n,) int32: an element of the mesh before that is near the node
    pinned: np.ndarray  # (n,) bool: an edge between two of them is not split
    young: np.ndarray  # (n,) bool: made in this round; not collapsed in it, so that a round comes to an end
    pinched: np.ndarray  # (n,) bool: nodes where the mesh touches itself; nothing is collapsed into them
    longest: np.ndarray  # (n,) of the facets that a collapse of a node on a curve may make


@record
class SurgeryScratch(NamedTuple):
    """Room to split, collapse and flip in."""

    around: np.ndarray  # (m,) int32: the elements around a node
    around_other: np.ndarray  # (m,) int32
    stamp: np.ndarray  # (n,) int64
    counter: np.ndarray  # (1,) int64
    stack: np.ndarray  # (m,) int32: elements whose edges may have to be flipped
    waiting: np.ndarray  # (m,) bool

    @classmethod
    def of(cls, nodes: int, elements: int) -> "SurgeryScratch":
        """Room for a mesh with so many rows of nodes and elements."""
        around, other, stack = (np.empty(elements, dtype=np.int32) for _ in range(3))
        counter, stamp = np.zeros(1, dtype=np.int64), np.zeros(nodes, dtype=np.int64)
        return cls(around, other, stamp, counter, stack, np.zeros(elements, dtype=np.bool_))


@record
class OpenMesh(NamedTuple):
    """A mesh with rows to spare, in which edges are split and collapsed."""

    position: np.ndarray  # (n, 2)
    elements: Elements
    constraints: Constraints
    pool: Pool
    origins: Origins
    scratch: SurgeryScratch


@record
class Laws(NamedTuple):
    """The nonlinear laws of the elements, as tables of the energy density W over s = |grad u|^2."""

    number: np.ndarray  # (m,) int32: of every element the place of its law, -1 for none
    first: int  # the tables begin with s = 2^(first - 1)
    table: np.ndarray  # (laws, rows, 2): W and dW/ds at the steps


@record
class Trial(NamedTuple):
    """A function, of order 1 but for its `Modes`, and the functional it is judged by."""

    value: np.ndarray  # (n,)
    fixed: np.ndarray  # (n,) bool: the value is given, at the node or along its chain
    on_chain: np.ndarray  # (c, 2): where a chain's values are given, that at its origin and the rate along it
    # Of every element a half of the coefficient, a sixth of the source, a half of the flux; where fluxes vary inside
    # regions then a centre, where that half is, and the derivatives of both its parts.
    # With a source that varies a centre, affine coordinates X, Y about it, and coefficients of X^i Y^j, j ascending and
    # then i. Such functions have `Modes` at order 1, too.
    data: np.ndarray  # (m, CONSTANTS), with a flux that varies (m, VARYING), with a source (m, SOURCE_TERMS + terms)
    bent: np.ndarray  # (n,) bool: the node touches nonlinear material
    laws: Laws  # where there is one, the coefficient has no say


@record
class Trials(NamedTuple):
    """What is judged by the sum of its functionals: one function, or a solution and the dual one of a goal."""

    one: Trial
    other: Trial  # of linear material, its values given where those of the first are; without values if there is none


@record
class Modes(NamedTuple):
    """What functions of order 2 or 3 have beside their values at the nodes: coefficients of `Reference` functions.

    Every side has its coefficients in both of its elements. An odd function of a side runs counter-clockwise round the
    element, so its coefficients in the two have opposite signs.
    """

    side: np.ndarray  # (m, 3, order - 1): of the side opposite to corner k: even, of order 3 also odd
    bubble: np.ndarray  # (m,): of order 3
    given: np.ndarray  # (m, 3) bool: the values on the side are given


@record
class Reference(NamedTuple):
    """Functions of order 2 or 3 on the triangle (0, 0), (1, 0), (0, 1), and where they are integrated.

    The first three are linear, 1 at one corner. An even one for the side opposite to each corner follows, 4 times the
    product of the two linear functions that it joins; of order 3 an odd one for each, the even one times 27 / 8 of
    their difference, and the bubble, 27 times the product of all three.
    """

    slope: np.ndarray  # (points, functions, 2): gradients
    weight: np.ndarray  # (points,): 1 in sum, of those with a law once more
    mean: np.ndarray  # (functions,): integrals
    halves: np.ndarray  # (2, functions, functions): coefficients on (p, 0, 1) and (p, 2, 0), p in the middle of 1, 2
    plain: int  # number of points of elements without a law, which come first; elements with one have the others


@record
class Points(NamedTuple):
    """Where elements with curved sides, or around an axis, are integrated, and their functions there, by kind.

    The kinds are none of the three corners on the axis, 0; one, 1 more than which; two, 4 more than the one off it.
    """

    weight: np.ndarray  # (7, points): as of `Reference`
    share: np.ndarray  # (7, points, 3): barycentric coordinates
    value: np.ndarray  # (7, points, functions)
    slope: np.ndarray  # (7, points, functions, 2): gradients
    side: np.ndarray  # (7, points, 3, 3): of 4 times the product of the linear functions of a side, and its gradient
    plain: int  # as of `Reference`


@record
class Shapes(NamedTuple):
    """What elements are beside triangles in the plane: curved on some sides, or around the axis x = 0."""

    bend: np.ndarray  # (m, 3, 2): from the middle of the chord opposite to corner k to that of the side
    special: np.ndarray  # (m,) bool: the element has a curved side, or is around an axis
    around: bool  # an axis, all of them: the coefficient is divided by x, and a law has |grad u| / x


VALUE, BLOCK, PLACE = range(3)  # wanted of an element: its value, derivatives by a block too, and by a position too


@record
class Block(NamedTuple):
    """Room for the unknowns that change with a node, or with an edge: d elements, u unknowns, b functions."""

    unknowns: np.ndarray  # (1,) int32: how many there are
    own: np.ndarray  # (1,): what values around the node are taken relative to
    place: np.ndarray  # (d, b) int32: the unknown that each coefficient of an element is, -1 for none
    sign: np.ndarray  # (d, b): of the coefficient, times the unknown
    spoke: np.ndarray  # (u,) int32: the other end of every side that is an unknown
    local: np.ndarray  # (4, b): coefficients of elements
    part: np.ndarray  # (b,): of one more
    bend: np.ndarray  # (5, 3, 2): as of `Shapes`, of the same five
    across: np.ndarray  # (b, 2): of each function, D times its gradient turned
    added: np.ndarray  # (b, b + 3): derivatives by the coefficients of an element: second, first, mixed by x and y
    stiffness: np.ndarray  # (u, u): second derivatives, in the lower triangle; then its Cholesky factor
    rest: np.ndarray  # (u,): first derivatives; then solved for with the factor
    mixed: np.ndarray  # (u, 2): second ones by the unknown and the position; then solved for with the factor
    still: np.ndarray  # (u,): change to the least value at the old place
    follow: np.ndarray  # (u,): what a step adds to it

    @classmethod
    def of(cls, elements: int, functions: int) -> "Block":
        """Room for the elements around a node, so many at most."""
        elements = max(elements, 4)  # of an edge that is split
        unknowns = 1 + (elements + 1) * (functions // 3 - 1) + elements * (functions == 10)
        place, sign = np.empty((elements, functions), dtype=np.int32), np.empty((elements, functions))
        numbers = np.empty(1, dtype=np.int32), np.empty(1), place, sign
        local, across, vectors = np.empty((5, functions)), np.empty((functions, 2)), np.empty((3, unknowns))
        table, mixed, spoke = np.empty((unknowns, unknowns)), np.empty((unknowns, 2)), np.empty(unknowns, np.int32)
        rooms = spoke, local[:4], local[4], np.empty((5, 3, 2)), across, np.empty((functions, functions + 3))
        return cls(*numbers, *rooms, table, vectors[0], mixed, vectors[1], vectors[2])


@record
class Descent(NamedTuple):
    """A mesh, the function on it that is judged, of order 2 or 3 or around an axis, and room for one thread."""

    position: np.ndarray  # (n, 2)
    elements: Elements
    star: Star
    constraints: Constraints
    trial: Trial
    modes: Modes
    reference: Reference
    points: Points
    shapes: Shapes
    block: Block


@record
class Offers(NamedTuple):
    """What splits would take off a functional, what collapses would add to it, and what is out of the question."""

    gain: np.ndarray  # (m, 3): of a split of the edge opposite to corner k, at the element of the greater number
    cost: np.ndarray  # (n,): of the cheapest collapse of the node that is allowed, inf without one
    into: np.ndarray  # (n,) int32: the neighbour that it goes into then
    open: np.ndarray  # (c,) bool: chains whose edges may be split
    removable: np.ndarray  # (n,) bool: nodes that may be taken away
    locked: np.ndarray  # (m,) bool: elements that a split or a collapse has changed, or is about to
