"""Array records of the kernels on tetrahedra.

Letters of shapes are n nodes, m elements, p patches and r ridges. Arrays without a type are float64. A
*patch* is a face of the geometry, a connected and smooth set of constrained element faces (on the outer
boundary, between regions, or named) with the same names. A *ridge* is an edge of the geometry, along which
patches meet or end. Ridges meet or turn in *corners*.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.arrays import Laws, Pool
from kohonen_adapt.kernels.records import record

PLANE, SPHERE, CYLINDER, CONE, PROJECTED = range(5)  # shapes of patches; of PROJECTED ones loops know samples
LINE, CIRCLE, INTERSECTION = range(3)  # shapes of ridges; an INTERSECTION is on both of its patches and nothing more
HELD, ON_RIDGE, ON_PATCH, INSIDE = range(4)  # `Freedom.number`: how many directions a node has

MOST = 1024  # elements around a node that surgery takes on: nodes with more stay what they are
RING = 8  # nodes in a ring around an edge that swaps take on
FREE, WAITS, ELSEWHERE, WANTED = range(4)  # `Queue.waiting`; what is ELSEWHERE is WANTED once it has been in the way

# Columns of `Trial.data`.
TWELFTH_COEFFICIENT, SOURCE_24TH, SIXTH_FLUX_X, SIXTH_FLUX_Y, SIXTH_FLUX_Z = range(5)


@record
class Tetrahedra(NamedTuple):
    """Tetrahedra of positive volume.

    ``neighbour[e, k]`` lies across the face opposite to corner k, -1 outside. Corners a, b, c, d of an element
    satisfy (b - a) . ((c - a) x (d - a)) = 6 V.
    """

    node: np.ndarray  # (m, 4) int32; rows that are not in use begin with -1
    neighbour: np.ndarray  # (m, 4) int32
    region: np.ndarray  # (m,) int32
    patch: np.ndarray  # (m, 4) int32: of the face opposite to corner k, -1 for one that is free to be swapped


@record
class Samples(NamedTuple):
    """Sampled points of patches without a formula, as one k-d tree per patch."""

    start: np.ndarray  # (p + 1,) int32: those of patch p are in rows start[p] to start[p + 1]
    point: np.ndarray  # (s, 3)
    normal: np.ndarray  # (s, 3): unit vectors, all to one side of the patch
    bend: np.ndarray  # (s, 3, 3): second derivatives of the patch's height along the normal


NO_SAMPLES = Samples(np.zeros(1, dtype=np.int32), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3)))


@record
class Surfaces(NamedTuple):
    """Geometry of patches and ridges."""

    shape: np.ndarray  # (p,) int8: PLANE, SPHERE, CYLINDER, CONE, PROJECTED
    origin: np.ndarray  # (p, 3): a point of a plane or an axis, a centre, an apex
    axis: np.ndarray  # (p, 3): unit normal of a plane, direction of an axis; that of a cone points into it
    size: np.ndarray  # (p,): radius of a sphere or a cylinder, half angle of a cone
    meets: np.ndarray  # (r, 4) int32: the patches that meet in a ridge, ascending, then -1
    ridge_shape: np.ndarray  # (r,) int8: LINE, CIRCLE, INTERSECTION
    ridge_origin: np.ndarray  # (r, 3): a point of a line, the centre of a circle
    ridge_axis: np.ndarray  # (r, 3): direction of a line, unit normal of the plane of a circle
    ridge_size: np.ndarray  # (r,): radius of a circle
    samples: Samples = NO_SAMPLES  # where no patch is PROJECTED


@record
class Freedom(NamedTuple):
    """Directions in which each node may move."""

    number: np.ndarray  # (n,) int8: HELD, ON_RIDGE, ON_PATCH, INSIDE
    place: np.ndarray  # (n,) int32: the ridge or patch that a node slides on, -1 for others
    pinned: np.ndarray  # (n,) bool: held because the user says so; an edge between two of them is not split


@record
class Star(NamedTuple):
    """Elements around every node.

    Elements around node v are in rows start[v] to start[v + 1]. The corners (v, *link) of each are positively
    oriented.
    """

    start: np.ndarray  # (n + 1,) int32
    element: np.ndarray  # (4 m,) int32
    link: np.ndarray  # (4 m, 3) int32

    @classmethod
    def of(cls, nodes: int, elements: int) -> "Star":
        """Return arrays to be filled by `fill_star`."""
        shapes = (nodes + 1,), (4 * elements,), (4 * elements, 3)
        return cls(*(np.zeros(shape, dtype=np.int32) for shape in shapes))


@record
class Origins(NamedTuple):
    """Data of nodes and patches for recycling."""

    fineness: np.ndarray  # (n,) cube root of the wanted nodes per volume
    old: np.ndarray  # (n,) int32: number before, -1 for a new node
    hint: np.ndarray  # (n,) int32: an element before that is near
    pinched: np.ndarray  # (n,) bool: its elements do not all hang together by their faces
    bulge: np.ndarray  # (p,) how far middles of edges on a patch may be off it


@record
class Cavity(NamedTuple):
    """Scratch of surgery, with the elements to remove and to insert."""

    element_stamp: np.ndarray  # (m,) int64, compared with a counter that only grows, as the next one
    node_stamp: np.ndarray  # (n,) int64
    counter: np.ndarray  # (1,) int64
    around: np.ndarray  # (MOST,) int32: elements around a node
    around_other: np.ndarray  # (MOST,) int32: around another one
    old: np.ndarray  # (MOST,) int32: elements to be taken out
    new: np.ndarray  # (2 MOST, 4) int32: nodes of those to be put in
    region: np.ndarray  # (2 MOST,) int32: their regions
    patch: np.ndarray  # (2 MOST, 4) int32: patches of their faces, where these are not on the cavity's border
    made: np.ndarray  # (2 MOST,) int32: where they were put
    face: np.ndarray  # (12 MOST, 5) int32: three nodes ascending, the element beyond and its corner, of faces
    face_patch: np.ndarray  # (12 MOST,) int32
    ring: np.ndarray  # (2, RING) int32: nodes around an edge, in each of up to two regions
    fan: np.ndarray  # (2, RING) int32: elements around it
    worth: np.ndarray  # (2, RING, RING) of the best triangulation of a part of a ring
    apex: np.ndarray  # (2, RING, RING) int32: of the triangle on the side of that part
    stack: np.ndarray  # (4 RING, 2) int32
    meeting: np.ndarray  # (5,) int32: patches that meet at an edge, and how many constrained faces

    @classmethod
    def of(cls, nodes: int, elements: int) -> "Cavity":
        """Return scratch for the given numbers of rows of nodes and elements."""
        small = (MOST,), (MOST,), (MOST,), (2 * MOST, 4), (2 * MOST,), (2 * MOST, 4), (2 * MOST,)
        faces = (12 * MOST, 5), (12 * MOST,), (2, RING), (2, RING)
        ints = [np.empty(shape, dtype=np.int32) for shape in (*small, *faces)]
        stamps = [np.zeros(count, dtype=np.int64) for count in (elements, nodes, 1)]
        last = [np.empty(shape, dtype=np.int32) for shape in ((2, RING, RING), (4 * RING, 2), (5,))]
        return cls._make([*stamps, *ints, np.empty((2, RING, RING)), *last])


@record
class OpenTetrahedra(NamedTuple):
    """Mesh of tetrahedra with spare rows for nodes and elements."""

    position: np.ndarray  # (n, 3)
    elements: Tetrahedra
    surfaces: Surfaces
    freedom: Freedom
    pool: Pool
    origins: Origins
    cavity: Cavity


@record
class Queue(NamedTuple):
    """Ring buffer of elements whose edges and faces are to be searched for swaps."""

    waiting: np.ndarray  # (m,) int8: FREE, WAITS; ELSEWHERE or WANTED where a part must not touch it
    element: np.ndarray  # (m,) int32: a ring
    state: np.ndarray  # (2,) int64: where the first is, and how many there are

    @classmethod
    def of(cls, elements: int) -> "Queue":
        """Return an empty queue for the given number of rows of elements."""
        return cls(np.zeros(elements, dtype=np.int8), np.empty(elements, dtype=np.int32), np.zeros(2, dtype=np.int64))


@record
class Constraints(NamedTuple):
    """Freedom of nodes, with the geometry."""

    freedom: Freedom
    surfaces: Surfaces
    inner: np.ndarray  # (n,) bool: inside one region, so that every neighbour belongs to it


@record
class Trial(NamedTuple):
    """P1 function and the Ritz functional."""

    value: np.ndarray  # (n,)
    fixed: np.ndarray  # (n,) bool: the value is given
    # Of every region a twelfth of the coefficient, a 24th of the source, a sixth of the flux.
    data: np.ndarray  # (regions, 5)
    laws: Laws  # numbers are those of regions, not of elements; where there is one, the coefficient has no say
    rate: np.ndarray  # (p + r, 3): gradient along patches, then along ridges, of values that are given there
    counted: np.ndarray  # (p,) bool: curved patches of which what is between them and their faces is counted
    follows: np.ndarray  # (p,) bool: patches on which values are given, that go on beyond the faces
    # A 24th of the source around every node in every region, where a function gives it; else no rows.
    source: np.ndarray  # (n, regions) or (0, regions)


@record
class Offers(NamedTuple):
    """Gains of splits, costs of collapses, and restrictions of both."""

    gain: np.ndarray  # (m, 6): of a split of each edge, at one of its elements; 0 at all others
    cost: np.ndarray  # (n,): of the cheapest collapse of the node that is allowed, inf without one
    open: np.ndarray  # (p,) bool: patches whose edges may be split
    removable: np.ndarray  # (n,) bool: nodes that may be taken away
    lone: np.ndarray  # (n,) bool: nodes with a given value that no patch of theirs has
    fresh: np.ndarray  # (n,) bool: nodes that have been made since
