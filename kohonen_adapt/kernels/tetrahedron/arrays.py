"""Array records of the kernels on tetrahedra.

Letters of shapes are n nodes, m elements, p patches and r ridges. A *patch* is a face of the geometry, a connected and
smooth set of constrained element faces (on the outer boundary, between regions, or named) with the same names. A
*ridge* is an edge of the geometry, along which patches meet or end. Ridges meet or turn in *corners*.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Array
from kohonen_adapt.kernels.arrays import Metric, Modes, Pool
from kohonen_adapt.kernels.functionals import Laws
from kohonen_adapt.kernels.numba.array_types import B1, B2, I1, I2, I3, L1, R1, R2, R3, S1
from kohonen_adapt.kernels.numba.compilation import record, zeros

PLANE, SPHERE, CYLINDER, CONE, PROJECTED = range(5)  # shapes of patches, PROJECTED by samples
LINE, CIRCLE, INTERSECTION = range(3)  # shapes of ridges, INTERSECTION without a formula
HELD, ON_RIDGE, ON_PATCH, INSIDE = range(4)  # `Freedom.number`: dimension of the permitted moves

MOST = 1024  # maximum number of elements around a node for surgery
RIDGE_PATCHES = 4  # maximum number of patches at a ridge
UNKNOWNS = 256  # maximum number of unknowns that change with a node, at order 2
RING = 8  # maximum number of nodes in the ring of an edge for swaps
FREE, WAITS, ELSEWHERE, WANTED = range(4)  # `Queue.waiting`; ELSEWHERE turns into WANTED if an element blocks a swap

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

    node: I2  # (m, 4); unused rows begin with -1
    neighbour: I2  # (m, 4)
    region: I1  # (m,)
    patch: I2  # (m, 4): patch of the face opposite to corner k, -1 for faces that may be swapped


@record
class Samples(NamedTuple):
    """Sampled points of patches without a formula, as one k-d tree per patch."""

    start: I1  # (p + 1,): patch p has rows start[p] to start[p + 1]
    point: R2  # (s, 3)
    normal: R2  # (s, 3): unit vectors, all on the same side of the patch
    hessian: R3  # (s, 3, 3): second derivatives of the height along the normal


NO_SAMPLES = zeros(Samples, 1, (0, 3), (0, 3), (0, 3, 3))


@record
class Surfaces(NamedTuple):
    shape: S1  # (p,): PLANE, SPHERE, CYLINDER, CONE, PROJECTED
    origin: R2  # (p, 3): a point of a plane or an axis, a centre, an apex
    axis: R2  # (p, 3): unit normal of a plane, direction of an axis, for a cone from the apex inwards
    size: R1  # (p,): radius of a sphere or a cylinder, half angle of a cone
    meets: I2  # (r, RIDGE_PATCHES): patches that meet in the ridge, ascending, then -1
    ridge_shape: S1  # (r,): LINE, CIRCLE, INTERSECTION
    ridge_origin: R2  # (r, 3): a point of a line, the centre of a circle
    ridge_axis: R2  # (r, 3): direction of a line, unit normal of the plane of a circle
    ridge_size: R1  # (r,): radius of a circle
    samples: Samples = NO_SAMPLES  # empty without PROJECTED patches


@record
class Freedom(NamedTuple):
    number: S1  # (n,): HELD, ON_RIDGE, ON_PATCH, INSIDE
    place: I1  # (n,): ridge or patch of a sliding node, otherwise -1
    pinned: B1  # (n,): held by the user; edges between two pinned nodes are not split


@record
class Star(NamedTuple):
    """Elements around every node.

    Elements around node v are in rows start[v] to start[v + 1]. The corners (v, *link) of each are positively
    oriented.
    """

    start: I1  # (n + 1,)
    element: I1  # (4 m,)
    link: I2  # (4 m, 3)

    @classmethod
    def of(cls, nodes: int, elements: int) -> "Star":
        return zeros(cls, nodes + 1, 4 * elements, (4 * elements, 3))


@record
class Origins(NamedTuple):
    fineness: R1  # (n,): cube root of the requested node density
    old: I1  # (n,): row in the input mesh, -1 for new nodes
    start_element: I1  # (n,): an element of the input mesh near the node
    non_manifold: B1  # (n,): non-manifold, elements not all connected by faces
    sagitta: R1  # (p,): maximum distance of edge midpoints from the patch


@record
class Cavity(NamedTuple):
    """Scratch of surgery, with the elements to remove and to insert."""

    element_stamp: L1  # (m,): marked if equal to `counter`, like `node_stamp`
    node_stamp: L1  # (n,)
    counter: L1  # (1,): increases only
    around: I1  # (MOST,): elements around a node
    around_other: I1  # (MOST,): elements around a second node or an edge
    old: I1  # (MOST,): elements to remove
    new: I2  # (2 MOST, 4): nodes of elements to insert
    region: I1  # (2 MOST,): regions of elements to insert
    patch: I2  # (2 MOST, 4): patches of faces of `new`, except on the border of the cavity
    made: I1  # (2 MOST,): rows of inserted elements
    face: I2  # (12 MOST, 5): three nodes of a face, ascending, element and corner across
    face_patch: I1  # (12 MOST,): patch of `face`
    ring: I2  # (2, RING): nodes around an edge, in each of up to two regions
    shell: I2  # (2, RING): elements around the edge
    merit: R3  # (2, RING, RING): merit of the best triangulation of ring nodes i to k
    apex: I3  # (2, RING, RING): third node of the triangle at i and k
    stack: I2  # (4 RING, 2)
    meeting: I1  # (5,): patches at an edge, ascending, then -1

    @classmethod
    def of(cls, nodes: int, elements: int) -> "Cavity":
        new = 2 * MOST
        ring, pairs = (2, RING), (2, RING, RING)
        around = elements, nodes, 1, MOST, MOST, MOST, (new, 4), new, (new, 4), new
        return zeros(cls, *around, (12 * MOST, 5), 12 * MOST, ring, ring, pairs, pairs, (4 * RING, 2), 5)


@record
class OpenTetrahedra(NamedTuple):
    """Mesh of tetrahedra with spare rows for nodes and elements."""

    position: R2  # (n, 3)
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

    waiting: S1  # (m,): FREE, WAITS, or ELSEWHERE and WANTED in other parts of the mesh
    element: I1  # (m,): ring buffer
    state: L1  # (2,): index of the first element, and count

    @classmethod
    def of(cls, elements: int) -> "Queue":
        return zeros(cls, elements, elements, 2)


@record
class Constraints(NamedTuple):
    freedom: Freedom
    surfaces: Surfaces
    inner: B1  # (n,): all neighbours are in one region
    metric: Metric = ROUND_METRIC


@record
class Trial(NamedTuple):
    value: R1  # (n,)
    fixed: B1  # (n,): Dirichlet value
    twelfth: R1  # (regions,): coefficient / 12
    load: R1  # (regions,): source / 24
    sixth_flux: R2  # (regions, 3): flux / 6
    shift: R2  # (regions, 3)
    reduced: R1  # (regions,): 1 if reduced, otherwise 0
    laws: Laws  # by region, in place of the coefficient
    rate: R2  # (p + r, 3): gradient of Dirichlet values along patches, then along ridges
    counted: B1  # (p,): curved patches whose slivers are counted
    follows: B1  # (p,): patches whose Dirichlet values extend into slivers
    source: R2  # (n, regions): varying source / 24 around every node, otherwise (0, regions)
    surface: R2  # (n, 2): offset of the value in reduced regions and load, (0, 2) for none


@record
class SolidBlock(NamedTuple):
    """Scratch for the unknowns of order 2 that change with a node or a cavity.

    Rows of elements are those around a node, or of `Cavity.new`. Functions of an element belong to the corners, then to
    the edges in the order of `EDGES`. Rows of edges are used by index, or by far end for edges at a node.
    """

    unknowns: L1  # (1,): number of unknowns
    local: R2  # (2 MOST, 10): coefficients of elements, values relative to a common value
    dof: I2  # (2 MOST, 10): index of the unknown of each coefficient, -1 for none
    given: B2  # (2 MOST, 6): Dirichlet edges
    end: I2  # (UNKNOWNS, 2): nodes of edges, the lower first, or the far end
    mode: R1  # (UNKNOWNS,): coefficients of edges
    edge_dof: I1  # (UNKNOWNS,): index of the unknown of each edge, -1 for none
    edge_given: B1  # (UNKNOWNS,): Dirichlet edges
    slope: R2  # (4, 3): gradients of the barycentric coordinates of an element
    field: R2  # (4, 3): sum of the gradients at all corners, plus that at each corner
    product: R2  # (4, 4): products of `slope`
    stiffness: R2  # (UNKNOWNS, UNKNOWNS): second derivatives, in the lower triangle; then the Cholesky factor
    rest: R1  # (UNKNOWNS,): first derivatives; then the solution with the factor
    mixed: R2  # (UNKNOWNS, 3): second derivatives by unknown and position; then the solution with the factor
    correction: R1  # (UNKNOWNS,): change of the unknowns to the minimum
    point: R2  # (q, 4): barycentric coordinates of the quadrature points of a law
    weight: R1  # (q,): weights with sum 1
    force: R2  # (4, 3): integrals of L_a h of `law_order2`
    curvature: R3  # (4, 4, 6): integrals of L_a L_b M (xx, xy, xz, yy, yz, zz), in the lower triangle
    turn: R3  # (4, 3, 3): integrals of L_a (M g_0) grad u^T
    applied: R2  # (4, 3): product of the curvature and a function
    curve_start: I1  # (n + 1,): first curved edge of every node
    curve_end: I1  # (k,): far end of every curved edge, each edge twice
    curve_offset: R2  # (k, 3): midside offset of every curved edge
    curve_point: R2  # (q, 4): barycentric coordinates of the quadrature points of curved elements without a law
    curve_weight: R1  # (q,): weights with sum 1
    offset: R2  # (6, 3): midside offsets of an element
    tangent: R2  # (4, 3): corners of the straight element with the derivatives of a curved one
    gradient: R2  # (10, 3): gradients of the functions at a point

    @classmethod
    def of(cls, point: Array, weight: Array, curves: tuple[Array, ...], rule: tuple[Array, Array]) -> "SolidBlock":
        rows, slopes = 2 * MOST, (4, 3)
        edges = UNKNOWNS
        elements = 1, (rows, 10), (rows, 10), (rows, 6), (edges, 2), edges, edges, edges, slopes, slopes, (4, 4)
        unknowns = (edges, edges), edges, (edges, 3), edges
        moments = slopes, (4, 4, 6), (4, 3, 3), slopes
        return zeros(cls, *elements, *unknowns, point, weight, *moments, *curves, *rule, (6, 3), slopes, (10, 3))


@record
class Quadratic(NamedTuple):
    """P2 function and the Ritz functional, with scratch of a thread."""

    trial: Trial  # values at the nodes, and the functional
    modes: Modes
    dirichlet: B1  # (p,): patches with Dirichlet values
    block: SolidBlock


@record
class Offers(NamedTuple):
    gain: R2  # (m, 6): gain of splitting each edge, at one of its elements, 0 at the rest
    cost: R1  # (n,): cost of the cheapest permitted collapse of each node, or inf
    open: B1  # (p,): patches whose edges may be split
    removable: B1  # (n,): nodes that may collapse
    lone: B1  # (n,): Dirichlet nodes on no Dirichlet patch
    is_new: B1  # (n,): nodes inserted since the evaluation
