"""Array records of the kernels on tetrahedra.

Letters of shapes are n nodes, m elements, p patches and r ridges. Arrays without a type are float64. A
*patch* is a face of the geometry, a connected and smooth set of constrained element faces (on the outer
boundary, between regions, or named) with the same names. A *ridge* is an edge of the geometry, along which
patches meet or end. Ridges meet or turn in *corners*.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Array
from kohonen_adapt.kernels.arrays import Metric, Modes, Pool
from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.numba.compilation import record

PLANE, SPHERE, CYLINDER, CONE, PROJECTED = range(5)  # shapes of patches, PROJECTED by samples
LINE, CIRCLE, INTERSECTION = range(3)  # shapes of ridges, INTERSECTION without a formula
HELD, ON_RIDGE, ON_PATCH, INSIDE = range(4)  # `Freedom.number`: dimension of the permitted moves

MOST = 1024  # maximum number of elements around a node for surgery
RIDGE_PATCHES = 4  # maximum number of patches at a ridge
UNKNOWNS = 256  # maximum number of unknowns that change with a node, at order 2
RING = 8  # maximum number of nodes in the ring of an edge for swaps
FREE, WAITS, ELSEWHERE, WANTED = range(4)  # `Queue.waiting`; ELSEWHERE turns into WANTED if an element blocks a swap

# Columns of `Trial.data`.
TWELFTH_COEFFICIENT, SOURCE_24TH, SIXTH_FLUX_X, SIXTH_FLUX_Y, SIXTH_FLUX_Z = range(5)
SHIFT_X, SHIFT_Y, SHIFT_Z, REDUCED = range(5, 9)

OFFSET, LOAD = range(2)  # columns of `Trial.surface`
NO_SURFACE = np.zeros((0, 2))  # `Trial.surface` of functions without offsets and loads

ROUND_METRIC = Metric(np.zeros((0, 6)), 1.0)

# Levels of derivatives at order 2: none, by unknowns, and by the position of corner 0.
VALUE, BLOCK, POSITION = range(3)


@record
class Tetrahedra(NamedTuple):
    """Tetrahedra of positive volume.

    ``neighbour[e, k]`` lies across the face opposite to corner k, -1 outside. Corners a, b, c, d of an element
    satisfy (b - a) . ((c - a) x (d - a)) = 6 V.
    """

    node: Array  # (m, 4) int32; unused rows begin with -1
    neighbour: Array  # (m, 4) int32
    region: Array  # (m,) int32
    patch: Array  # (m, 4) int32: patch of the face opposite to corner k, -1 for faces that may be swapped


@record
class Samples(NamedTuple):
    """Sampled points of patches without a formula, as one k-d tree per patch."""

    start: Array  # (p + 1,) int32: patch p has rows start[p] to start[p + 1]
    point: Array  # (s, 3)
    normal: Array  # (s, 3): unit vectors, all on the same side of the patch
    hessian: Array  # (s, 3, 3): second derivatives of the height along the normal


NO_SAMPLES = Samples(np.zeros(1, np.int32), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3)))


@record
class Surfaces(NamedTuple):
    shape: Array  # (p,) int8: PLANE, SPHERE, CYLINDER, CONE, PROJECTED
    origin: Array  # (p, 3): a point of a plane or an axis, a centre, an apex
    axis: Array  # (p, 3): unit normal of a plane, direction of an axis, for a cone from the apex inwards
    size: Array  # (p,): radius of a sphere or a cylinder, half angle of a cone
    meets: Array  # (r, RIDGE_PATCHES) int32: patches that meet in the ridge, ascending, then -1
    ridge_shape: Array  # (r,) int8: LINE, CIRCLE, INTERSECTION
    ridge_origin: Array  # (r, 3): a point of a line, the centre of a circle
    ridge_axis: Array  # (r, 3): direction of a line, unit normal of the plane of a circle
    ridge_size: Array  # (r,): radius of a circle
    samples: Samples = NO_SAMPLES  # empty without PROJECTED patches


@record
class Freedom(NamedTuple):
    number: Array  # (n,) int8: HELD, ON_RIDGE, ON_PATCH, INSIDE
    place: Array  # (n,) int32: ridge or patch of a sliding node, otherwise -1
    pinned: Array  # (n,) bool: held by the user; edges between two pinned nodes are not split


@record
class Star(NamedTuple):
    """Elements around every node.

    Elements around node v are in rows start[v] to start[v + 1]. The corners (v, *link) of each are positively
    oriented.
    """

    start: Array  # (n + 1,) int32
    element: Array  # (4 m,) int32
    link: Array  # (4 m, 3) int32

    @classmethod
    def of(cls, nodes: int, elements: int) -> "Star":
        shapes = (nodes + 1,), (4 * elements,), (4 * elements, 3)
        return cls(*(np.zeros(shape, np.int32) for shape in shapes))


@record
class Origins(NamedTuple):
    fineness: Array  # (n,): cube root of the requested node density
    old: Array  # (n,) int32: row in the input mesh, -1 for new nodes
    start_element: Array  # (n,) int32: an element of the input mesh near the node
    non_manifold: Array  # (n,) bool: non-manifold, elements not all connected by faces
    sagitta: Array  # (p,): maximum distance of edge midpoints from the patch


@record
class Cavity(NamedTuple):
    """Scratch of surgery, with the elements to remove and to insert."""

    element_stamp: Array  # (m,) int64: marked if equal to `counter`, like `node_stamp`
    node_stamp: Array  # (n,) int64
    counter: Array  # (1,) int64: increases only
    around: Array  # (MOST,) int32: elements around a node
    around_other: Array  # (MOST,) int32: elements around a second node or an edge
    old: Array  # (MOST,) int32: elements to remove
    new: Array  # (2 MOST, 4) int32: nodes of elements to insert
    region: Array  # (2 MOST,) int32: regions of elements to insert
    patch: Array  # (2 MOST, 4) int32: patches of faces of `new`, except on the border of the cavity
    made: Array  # (2 MOST,) int32: rows of inserted elements
    face: Array  # (12 MOST, 5) int32: three nodes of a face, ascending, element and corner across
    face_patch: Array  # (12 MOST,) int32: patch of `face`
    ring: Array  # (2, RING) int32: nodes around an edge, in each of up to two regions
    shell: Array  # (2, RING) int32: elements around the edge
    merit: Array  # (2, RING, RING): merit of the best triangulation of ring nodes i to k
    apex: Array  # (2, RING, RING) int32: third node of the triangle at i and k
    stack: Array  # (4 RING, 2) int32
    meeting: Array  # (5,) int32: patches at an edge, ascending, then -1

    @classmethod
    def of(cls, nodes: int, elements: int) -> "Cavity":
        small = (MOST,), (MOST,), (MOST,), (2 * MOST, 4), (2 * MOST,), (2 * MOST, 4), (2 * MOST,)
        faces = (12 * MOST, 5), (12 * MOST,), (2, RING), (2, RING)
        ints = [np.empty(shape, np.int32) for shape in (*small, *faces)]
        stamps = [np.zeros(count, np.int64) for count in (elements, nodes, 1)]
        last = [np.empty(shape, np.int32) for shape in ((2, RING, RING), (4 * RING, 2), (5,))]
        return cls._make([*stamps, *ints, np.empty((2, RING, RING)), *last])


@record
class OpenTetrahedra(NamedTuple):
    """Mesh of tetrahedra with spare rows for nodes and elements."""

    position: Array  # (n, 3)
    elements: Tetrahedra
    surfaces: Surfaces
    freedom: Freedom
    pool: Pool
    origins: Origins
    cavity: Cavity
    metric: Metric = ROUND_METRIC


@record
class Queue(NamedTuple):
    """Ring buffer of elements whose edges and faces are to be searched for swaps."""

    waiting: Array  # (m,) int8: FREE, WAITS, or ELSEWHERE and WANTED in other parts of the mesh
    element: Array  # (m,) int32: ring buffer
    state: Array  # (2,) int64: index of the first element, and count

    @classmethod
    def of(cls, elements: int) -> "Queue":
        return cls(np.zeros(elements, np.int8), np.empty(elements, np.int32), np.zeros(2, np.int64))


@record
class Constraints(NamedTuple):
    freedom: Freedom
    surfaces: Surfaces
    inner: Array  # (n,) bool: all neighbours are in one region
    metric: Metric = ROUND_METRIC


@record
class Trial(NamedTuple):
    value: Array  # (n,)
    fixed: Array  # (n,) bool: Dirichlet value
    data: Array  # (regions, 9): coefficient / 12, source / 24, flux / 6, shift, 1 if reduced, otherwise 0
    laws: Laws  # by region, in place of the coefficient
    rate: Array  # (p + r, 3): gradient of Dirichlet values along patches, then along ridges
    counted: Array  # (p,) bool: curved patches whose slivers are counted
    follows: Array  # (p,) bool: patches whose Dirichlet values extend into slivers
    source: Array  # (n, regions): varying source / 24 around every node, otherwise (0, regions)
    surface: Array  # (n, 2): offset of the value in reduced regions and load, (0, 2) for none


@record
class SolidBlock(NamedTuple):
    """Scratch for the unknowns of order 2 that change with a node or a cavity.

    Rows of elements are those around a node, or of `Cavity.new`. Functions of an element belong to the corners, then to
    the edges in the order of `EDGES`. Rows of edges are used by index, or by far end for edges at a node.
    """

    unknowns: Array  # (1,) int64: number of unknowns
    local: Array  # (2 MOST, 10): coefficients of elements, values relative to a common value
    dof: Array  # (2 MOST, 10) int32: index of the unknown of each coefficient, -1 for none
    given: Array  # (2 MOST, 6) bool: Dirichlet edges
    end: Array  # (UNKNOWNS, 2) int32: nodes of edges, the lower first, or the far end
    mode: Array  # (UNKNOWNS,): coefficients of edges
    edge_dof: Array  # (UNKNOWNS,) int32: index of the unknown of each edge, -1 for none
    edge_given: Array  # (UNKNOWNS,) bool: Dirichlet edges
    slope: Array  # (4, 3): gradients of the barycentric coordinates of an element
    field: Array  # (4, 3): sum of the gradients at all corners, plus that at each corner
    product: Array  # (4, 4): products of `slope`
    stiffness: Array  # (UNKNOWNS, UNKNOWNS): second derivatives, in the lower triangle; then the Cholesky factor
    rest: Array  # (UNKNOWNS,): first derivatives; then the solution with the factor
    mixed: Array  # (UNKNOWNS, 3): second derivatives by unknown and position; then the solution with the factor
    correction: Array  # (UNKNOWNS,): change of the unknowns to the minimum
    point: Array  # (q, 4): barycentric coordinates of the quadrature points of a law
    weight: Array  # (q,): weights with sum 1
    force: Array  # (4, 3): integrals of L_a h of `law_order2`
    curvature: Array  # (4, 4, 6): integrals of L_a L_b M (xx, xy, xz, yy, yz, zz), in the lower triangle
    turn: Array  # (4, 3, 3): integrals of L_a (M g_0) grad u^T
    applied: Array  # (4, 3): product of the curvature and a function
    curve_start: Array  # (n + 1,) int32: first curved edge of every node
    curve_end: Array  # (k,) int32: far end of every curved edge, each edge twice
    curve_offset: Array  # (k, 3): midside offset of every curved edge
    curve_point: Array  # (q, 4): barycentric coordinates of the quadrature points of curved elements without a law
    curve_weight: Array  # (q,): weights with sum 1
    offset: Array  # (6, 3): midside offsets of an element
    tangent: Array  # (4, 3): corners of the straight element with the derivatives of a curved one
    gradient: Array  # (10, 3): gradients of the functions at a point

    @classmethod
    def of(cls, point: Array, weight: Array, curves: tuple[Array, ...], rule: tuple[Array, Array]) -> "SolidBlock":
        rows = 2 * MOST
        edges = UNKNOWNS
        small = [np.empty(shape) for shape in ((4, 3), (4, 3), (4, 4), (edges, edges), edges, (edges, 3), edges)]
        moments = [np.empty(shape) for shape in ((4, 3), (4, 4, 6), (4, 3, 3), (4, 3))]
        return cls._make(
            [
                np.zeros(1, np.int64),
                np.empty((rows, 10)),
                np.empty((rows, 10), np.int32),
                np.empty((rows, 6), bool),
                np.empty((edges, 2), np.int32),
                np.empty(edges),
                np.empty(edges, np.int32),
                np.empty(edges, bool),
                *small,
                point,
                weight,
                *moments,
                *curves,
                *rule,
                *(np.empty((count, 3)) for count in (6, 4, 10)),
            ]
        )


@record
class Quadratic(NamedTuple):
    """P2 function and the Ritz functional, with scratch of a thread."""

    trial: Trial  # values at the nodes, and the functional
    modes: Modes
    dirichlet: Array  # (p,) bool: patches with Dirichlet values
    block: SolidBlock


@record
class Offers(NamedTuple):
    gain: Array  # (m, 6): gain of splitting each edge, at one of its elements, 0 at the rest
    cost: Array  # (n,): cost of the cheapest permitted collapse of each node, or inf
    open: Array  # (p,) bool: patches whose edges may be split
    removable: Array  # (n,) bool: nodes that may collapse
    lone: Array  # (n,) bool: Dirichlet nodes on no Dirichlet patch
    is_new: Array  # (n,) bool: nodes inserted since the evaluation
