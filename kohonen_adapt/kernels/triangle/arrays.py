"""Array records of the kernels on triangles.

Shapes are given by n nodes, m elements, r regions, c curve segments (`chain`) and k knots of tabulated segments.
Annotations are the types of arrays, for numba too.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Array
from kohonen_adapt.kernels.arrays import KernelMesh, Metric, Modes, Pool
from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.numba.array_types import B1, B2, I1, I2, L1, R1, R2, R3, R4, S1
from kohonen_adapt.kernels.numba.compilation import record, zeros

FREE, SLIDING, HELD = 0, 1, 2  # degrees of freedom: in the plane, along a curve segment, none
STRAIGHT, ROUND, TABLED = 0, 1, 2  # shapes of curve segments

# Columns of tables
OWN, OTHER = 0, 1  # of `Constraints.chain`
AT, AT_X, AT_Y, RATE_X, RATE_Y = range(5)  # of `Chains.knot`
HALF_COEFFICIENT, SIXTH_SOURCE, HALF_FLUX_X, HALF_FLUX_Y, CENTRE_X, CENTRE_Y = range(6)  # of `Trial.data`
# Number of constants, first columns of the derivatives of a varying flux, and number of columns with these derivatives
CONSTANTS, RATES_X, RATES_Y, VARYING = 4, 6, 11, 16
# Columns after the centre if the source varies: affine coordinates, then the terms of the polynomial
X_BY_X, X_BY_Y, Y_BY_X, Y_BY_Y, SOURCE_TERMS = range(6, 11)


@record
class Elements(NamedTuple):
    """Triangles, counter-clockwise, with the neighbours across their edges.

    ``neighbour[e, k]`` is the neighbour across the edge opposite to corner k, -1 at the boundary.
    """

    node: I2  # (m, 3)
    neighbour: I2  # (m, 3)
    region: I1  # (m,)
    chain: I2  # (m, 3): segment of the edge opposite to corner k, -1 for an edge that may flip
    level: I1  # (n,): from 0 on one side of a subdomain with layers to their number on the opposite side
    layered: B1  # (r,): regions in which no edge may join nodes whose levels differ by more than 1

    def ends(self, e: Array, k: Array) -> tuple[Array, Array]:
        return self.node[e, (k + 1) % 3], self.node[e, (k + 2) % 3]


@record
class Star(NamedTuple):
    """Elements around every node.

    Node v has the rows from ``start[v]`` to ``start[v + 1]``. The nodes (v, ahead, behind) of an element are
    counter-clockwise.
    """

    start: I1  # (n + 1,)
    element: I1  # (3 m,)
    ahead: I1  # (3 m,)
    behind: I1  # (3 m,)

    @property
    def link(self) -> Array:
        return np.column_stack([self.ahead, self.behind])


@record
class Chains(NamedTuple):
    shape: S1  # (c,): STRAIGHT, ROUND or TABLED
    closed: B1  # (c,): without ends, so that the parameter is periodic
    paired: B1  # (c,): with a periodic partner at the same parameters
    origin: R2  # (c, 2): position at the parameter 0
    direction: R2  # (c, 2): unit tangent at the origin
    length: R1  # (c,): largest parameter
    curvature: R1  # (c,): 1 / radius of ROUND segments, positive if counter-clockwise
    reach: R1  # (c,): maximum length of a facet, due to its distance from the curve
    merged: R1  # (c,): maximum length of two facets that a collapse joins
    sagitta: R1  # (c,): maximum distance between curve and facets
    even: R1  # (c,): length of equal facets that are as far from the curve as the input
    row: I1  # (c + 1,): segment c has the knots row[c] to row[c + 1]
    knot: R2  # (k, 5): parameter, position and derivative by the parameter of TABLED segments

    @classmethod
    def of(cls, count: int) -> "Chains":
        return zeros(cls, *[count] * 3, *[(count, 2)] * 2, *[count] * 6, count + 1, (0, RATE_Y + 1))


@record
class PeriodicPairs(NamedTuple):
    partner: I1  # (n,): partner node, -1 for none
    motion: I1  # (n,): motion that maps the node to its partner, -1 for none
    motions: R3  # (motions, 2, 3): x -> A x + b as rows [A | b]


@record
class Constraints(NamedTuple):
    kind: S1  # (n,): FREE, SLIDING or HELD
    chain: I2  # (n, 2): segment of the node, or both segments of a corner; -1 for none
    parameter: R1  # (n,): position on the segment
    inner: B1  # (n,): in the interior of a region, with all neighbours in the closed region
    chains: Chains
    periodic: PeriodicPairs
    metric: Metric = Metric(np.zeros((0, 3)), 1.0)  # of the map; Euclidean in the polish

    @property
    def own_chain(self) -> Array:
        """Segment on which a node slides, else -1 or the first segment of a corner."""
        return self.chain[:, OWN]


@record
class Origins(NamedTuple):
    density: R1  # (n,): wanted nodes per area
    old: I1  # (n,): index before, -1 for a new node
    start_element: I1  # (n,): element near the node in the mesh before
    pinned: B1  # (n,): edges between two pinned nodes are not split
    is_new: B1  # (n,): new in this round, and not collapsed, so that a round ends
    non_manifold: B1  # (n,): non-manifold nodes, into which no node is collapsed
    longest: R1  # (n,): maximum length of a facet made by collapsing a node on a curve


@record
class SurgeryScratch(NamedTuple):
    around: I1  # (m,): elements around a node
    around_other: I1  # (m,)
    stamp: L1  # (n,)
    counter: L1  # (1,)
    stack: I1  # (m,): elements with edges to check for a flip
    waiting: B1  # (m,): elements in the stack

    @classmethod
    def of(cls, nodes: int, elements: int) -> "SurgeryScratch":
        return zeros(cls, elements, elements, nodes, 1, elements, elements)


@record
class OpenMesh(NamedTuple):
    position: R2  # (n, 2)
    elements: Elements
    constraints: Constraints
    pool: Pool
    origins: Origins
    scratch: SurgeryScratch
    metric: Metric


@record
class Trial(NamedTuple):
    """Function of order 1 (see also `Modes`) and the functional to minimise."""

    value: R1  # (n,)
    fixed: B1  # (n,): Dirichlet value at the node or along its segment
    on_chain: R2  # (c, 2): Dirichlet values of a segment, as value at the origin and derivative
    # Half of the coefficient, a sixth of the source and half of the flux of every element. If the flux varies inside
    # regions, then a centre, to which the half refers, and the derivatives of its components. If the source varies,
    # then a centre, affine coordinates X, Y relative to the centre, and the coefficients of X^i Y^j, in the order of j
    # and then i; a function with a varying source has `Modes` at order 1 as well.
    data: R2  # (m, CONSTANTS), or (m, VARYING) for a varying flux, or (m, SOURCE_TERMS + terms)
    nonlinear: B1  # (n,): the node touches nonlinear material
    laws: Laws  # replace the coefficient


@record
class Reference(NamedTuple):
    """Functions of order 1, 2 or 3 on the triangle (0, 0), (1, 0), (0, 1).

    With the barycentric coordinates L_k, the functions are L_k, then for the side opposite to each corner the even
    function 4 L_i L_j; at order 3 also the odd function 27/2 L_i L_j (L_i - L_j) of each side and the bubble 27 L_0 L_1
    L_2.
    """

    mean: R1  # (functions,): integrals
    mean_slope: R2  # (functions, 2): means of the gradients
    product: R3  # (functions, functions, 3): means of g1 h1, g1 h2 + g2 h1 and g2 h2 of gradients g and h
    halves: R3  # (2, functions, functions): coefficients on (p, 0, 1) and (p, 2, 0), p the midpoint of 1 and 2


STRAIGHT_SIDED, STRAIGHT_WITH_SOURCE = 7, 8  # kinds of `Points`


@record
class Points(NamedTuple):
    """Quadrature points of elements by kind.

    Points for linear material are first, points for nonlinear material follow.

    Kind 0 has a curved side and no corner on the axis, kinds 1 to 3 have corner ``kind - 1`` on the axis, and kinds 4
    to 6 have all corners on the axis except ``kind - 4``. Kind 7 has straight sides in the plane, and kind 8 is for the
    polynomial of a varying source there.
    """

    last: I2  # (9, 2): numbers of points up to the last for linear and for nonlinear material
    weight: R2  # (9, points): with sum 1 for each material
    share: R3  # (9, points, 3): barycentric coordinates
    value: R3  # (9, points, functions)
    slope: R4  # (9, points, functions, 2): gradients
    side: R4  # (9, points, 3, 3): value and gradient of the even function of each side


@record
class Shapes(NamedTuple):
    offset: R3  # (m, 3, 2): midside offsets, from the midpoint of the chord opposite to corner k to the curve
    special: B1  # (m,): the element has a curved side, or is around an axis
    around: bool  # around an axis: coefficients are divided by x, and laws evaluated at |grad u| / x


# Derivatives wanted of an element: none; by a block, at the points of linear material; by a block; by position, too.
VALUE, COARSE_BLOCK, BLOCK, POSITION = range(4)
ROWS, UNKNOWNS = 0, 1  # of `Block.size`
# Tuples as arguments, so that numba compiles the branch for their length alone.
WITHOUT, WITH = (), (0,)


@record
class Block(NamedTuple):
    """Triangles around a centre, with the unknowns that change with the centre.

    Rows are the triangles of a node, of a merged node, at the midpoint of an edge or beside an edge. Corner 0 is
    the centre, and sides are opposite to corners. Unknowns are the value at the centre, the coefficients of the sides
    from the centre that are not held, and the bubbles. Shapes are given by d elements, u unknowns and b functions.
    """

    size: I1  # (2,): numbers of rows and of unknowns
    own: R1  # (2,): value to which values are relative, and the value at the centre relative to this value
    element: I1  # (d,): element with the data of the row
    end: I2  # (d, 3): -1 for the centre, then the next corners counter-clockwise
    held: B2  # (d, 3): the coefficients of the side are not unknowns
    dirichlet: B2  # (d, 3): as in `Modes`
    special: B1  # (d,): as in `Shapes`
    local: R2  # (d, b): coefficients
    offset: R3  # (d, 3, 2): as in `Shapes`
    dof: I2  # (d, b): index of the unknown of every coefficient, -1 for none
    sign: R2  # (d, b): factor from the unknown to the coefficient
    far_end: I1  # (u,): far end of the side of every unknown
    part: R1  # (b,): coefficients of an element that is halved
    added: R2  # (b, b + 3): derivatives by the coefficients of an element: second, first, mixed by x and y
    stiffness: R2  # (u, u): second derivatives, in the lower triangle; then the Cholesky factor
    rest: R1  # (u,): first derivatives; then the solution with the factor
    mixed: R2  # (u, 2): second derivatives by unknown and position; then the solution with the factor
    correction: R1  # (u,): change of the unknowns to the minimum at the old position
    response: R1  # (u,): further change of the unknowns due to a step of the node

    @classmethod
    def of(cls, elements: int, functions: int) -> "Block":
        rows = max(elements, 4)  # a split edge has up to four
        unknowns = 1 + (rows + 1) * (functions // 3 - 1) + rows * (functions == 10)
        sides, local = (rows, 3), (rows, functions)
        marks = 2, 2, rows, sides, sides, sides, rows
        coefficients = local, (*sides, 2), local, local, unknowns, functions, (functions, functions + 3)
        return zeros(cls, *marks, *coefficients, (unknowns, unknowns), unknowns, (unknowns, 2), unknowns, unknowns)


@record
class Descent(NamedTuple):
    """Mesh and function with scratch of a thread."""

    position: R2  # (n, 2)
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
class Descents(NamedTuple):
    """Primal and dual function on a mesh.

    Loops with this record have an argument `higher`, which is WITHOUT for functions that are affine on every element.
    numba then compiles their closed forms, and WITH the unknowns of a `Block` all others.
    """

    primal: Descent
    dual: Descent  # in linear materials
    terms: int  # 1 without a dual function, else 2

    @classmethod
    def of(
        cls,
        mesh: KernelMesh,
        trials: tuple[Trial, Trial],
        modes: tuple[Modes, ...],
        shapes: tuple[Reference, Points, Shapes],
    ) -> "Descents":
        most = int(np.diff(mesh.star.start).max())
        primal, dual = (Block.of(most, len(shapes[0].mean)) for _ in trials)
        first = Descent(*mesh, trials[0], modes[0], *shapes, primal)
        second = Descent(*mesh, trials[1], modes[-1], *shapes, dual)
        return cls(first, second, 2 if len(trials[1].value) else 1)


@record
class Offers(NamedTuple):
    gain: R2  # (m, 3): decrease by a split of the edge opposite to corner k, at the element of larger index
    cost: R1  # (n,): increase by the cheapest valid collapse of the node, inf without one
    into: I1  # (n,): neighbour into which the node is collapsed
    open: B1  # (c,): segments with edges that may be split
    removable: B1  # (n,): nodes that may be removed
    locked: B1  # (m,): elements changed by a split or a collapse, or about to be changed
