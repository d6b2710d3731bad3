"""Triangles of nodes, merged nodes, split and flipped edges as rows of a `Block`."""

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.triangle.arrays import ROWS
from kohonen_adapt.kernels.triangle.geometry import corner_of, corner_towards, ends_of, row_beside, rows_with
from kohonen_adapt.kernels.triangle.polish.by_points import is_curved
from kohonen_adapt.kernels.triangle.polish.patch import BUBBLE, EVEN
from kohonen_adapt.kernels.vectors import put, xy


@inner_kernel
def reference_value(descent, v):
    # An offset of all values only adds a constant to the functional of the rows, because their area is constant. Around
    # an axis constants are no functions of the space.
    return 0.0 if descent.shapes.around else descent.trial.value[v]


@inner_kernel
def begin(descent, v, own):
    block = descent.block
    block.size[ROWS] = 0
    block.own[0], block.own[1] = own, descent.trial.value[v] - own


@inner_kernel
def add_row(descent, e, a, b):
    """Add a triangle of nodes `a` and `b` with straight sides and an affine function."""
    block, value = descent.block, descent.trial.value
    own = descent.block.own[0]
    j = block.size[ROWS]
    block.size[ROWS] = j + 1
    block.element[j], block.special[j] = e, descent.shapes.around
    block.end[j, 0] = -1
    block.end[j, 1], block.end[j, 2] = a, b
    block.held[j], block.dirichlet[j] = False, False
    block.local[j], block.offset[j] = 0.0, 0.0
    block.local[j, 0] = block.own[1]
    block.local[j, 1], block.local[j, 2] = value[a] - own, value[b] - own
    return j


@inner_kernel
def take_side(descent, j, i, e, k):
    """Copy coefficients and shape of side `k` of element `e` to side `i` of row `j`."""
    block, modes = descent.block, descent.modes
    for d in range(modes.side.shape[2]):
        block.local[j, EVEN + 3 * d + i] = modes.side[e, k, d]
    block.dirichlet[j, i] = modes.dirichlet[e, k]
    take_offset(descent, j, i, e, k)


@inner_kernel
def take_offset(descent, j, i, e, k):
    block = descent.block
    offset = xy(descent.shapes.offset[e], k)
    put(block.offset[j], i, offset)
    block.special[j] |= offset[0] != 0.0 or offset[1] != 0.0


@inner_kernel
def add_own_row(descent, e, v):
    """Add element `e` of node `v`."""
    block = descent.block
    k = corner_of(descent.elements.node, e, v)
    a, b = ends_of(descent.elements.node, e, k)
    j = add_row(descent, e, a, b)
    for i in range(3):
        take_side(descent, j, i, e, (k + i) % 3)
        block.held[j, i] = block.dirichlet[j, i]
    if block.local.shape[1] > BUBBLE:
        block.local[j, BUBBLE] = descent.modes.bubble[e]
    return j


@inner_kernel
def gather_star(descent, v):
    star = descent.star
    begin(descent, v, reference_value(descent, v))
    for row in rows_of(star, v):
        add_own_row(descent, star.element[row], v)


@inner_kernel
def gather_merged(descent, v, w):
    """Add the elements of `v` after a collapse into `w`, with new straight sides."""
    star, node, block = descent.star, descent.elements.node, descent.block
    removed = rows_with(star, v, w)
    begin(descent, w, reference_value(descent, v))
    for row in rows_of(star, v):
        e, a, b = star.element[row], star.ahead[row], star.behind[row]
        if a == w or b == w:
            continue
        k = corner_of(node, e, v)
        j = add_row(descent, e, a, b)
        take_side(descent, j, 0, e, k)
        for side in range(1, 3):
            known = row_beside(removed, a if side == 2 else b)
            if known >= 0:
                f = star.element[known]
                take_side(descent, j, side, f, corner_of(node, f, v))
            else:
                block.dirichlet[j, side] = descent.modes.dirichlet[e, (k + side) % 3]
            block.held[j, side] = known >= 0 or block.dirichlet[j, side]


@inner_kernel
def gather_beside(descent, e, k, own):
    """Add the elements of an edge, from its first node on. A missing element is -1."""
    v, other = ends_of(descent.elements.node, e, k)[0], descent.elements.neighbour[e, k]
    begin(descent, v, own)
    add_own_row(descent, e, v)
    if other >= 0:
        add_own_row(descent, other, v)


@inner_kernel
def gather_halves(descent, e, k):
    """Add the halves of the elements of an edge.

    The halves are (p, c, a) and (p, b, c), then (p, d, b) and (p, a, d).
    The edge ab between the corners c and d is split at p. The function is that of the elements.
    """
    node, block, halves = descent.elements.node, descent.block, descent.reference.halves
    is_dirichlet = descent.modes.dirichlet[e, k]
    begin(descent, ends_of(node, e, k)[0], reference_value(descent, ends_of(node, e, k)[0]))
    at, corner = e, k
    for _ in range(2):
        if at < 0:
            continue
        (a, b), c = ends_of(node, at, corner), node[at, corner]
        gather_part(descent, at, corner)
        for half in range(2):
            j = add_row(descent, at, c if half == 0 else b, a if half == 0 else c)
            side = (corner + 2 - half) % 3
            take_side(descent, j, 0, at, side)
            along = 1 + half  # the side along the edge
            block.held[j, along] = block.dirichlet[j, along] = is_dirichlet
            for i in range(block.part.shape[0]):
                total = 0.0
                for other in range(block.part.shape[0]):
                    total += halves[half, i, other] * block.part[other]
                block.local[j, i] = total
        across = descent.elements.neighbour[at, corner]
        corner = corner_towards(descent.elements.neighbour, across, at) if across >= 0 else 0
        at = across


@inner_kernel
def gather_part(descent, e, k):
    modes, part, value = descent.modes, descent.block.part, descent.trial.value
    for i in range(3):
        corner = (k + i) % 3
        part[i] = value[descent.elements.node[e, corner]] - descent.block.own[0]
        for d in range(modes.side.shape[2]):
            part[EVEN + 3 * d + i] = modes.side[e, corner, d]
    if part.shape[0] > BUBBLE:
        part[BUBBLE] = modes.bubble[e]


@inner_kernel
def gather_flipped(descent, e, k, other, own):
    """Add the elements (r, p, s) and (r, s, q) after a flip of edge pq.

    The edge is between `e` = (r, p, q) and `other` = (s, q, p).
    """
    (p, q), r = ends_of(descent.elements.node, e, k), descent.elements.node[e, k]
    j = corner_towards(descent.elements.neighbour, other, e)
    s = descent.elements.node[other, j]
    begin(descent, r, own)
    one = add_row(descent, e, p, s)
    take_side(descent, one, 0, other, (j + 1) % 3)
    take_side(descent, one, 2, e, (k + 2) % 3)
    two = add_row(descent, e, s, q)
    take_side(descent, two, 0, other, (j + 2) % 3)
    take_side(descent, two, 1, e, (k + 1) % 3)


@inner_kernel
def hold_all_but(block, end):
    for j in range(block.size[ROWS]):
        block.held[j, 1], block.held[j, 2] = block.end[j, 2] != end, block.end[j, 1] != end


@inner_kernel
def put_coefficients(descent, j, e, k):
    modes, local = descent.modes, descent.block.local
    for i in range(3):
        for d in range(modes.side.shape[2]):
            modes.side[e, (k + i) % 3, d] = local[j, EVEN + 3 * d + i]
    if local.shape[1] > BUBBLE:
        modes.bubble[e] = local[j, BUBBLE]


@inner_kernel
def put_row(descent, j, e, k):
    """Store row `j` as element `e`, whose corner `k` is the centre."""
    block, shapes = descent.block, descent.shapes
    put_coefficients(descent, j, e, k)
    for i in range(3):
        descent.modes.dirichlet[e, (k + i) % 3] = block.dirichlet[j, i]
        put(shapes.offset[e], (k + i) % 3, xy(block.offset[j], i))
    shapes.special[e] = shapes.around or is_curved(block.offset[j])


@inner_kernel
def put_star(descent, v, has_value):
    block = descent.block
    if has_value:
        descent.trial.value[v] = block.own[0] + block.local[0, 0]
    for j in range(block.size[ROWS]):
        e = block.element[j]
        put_coefficients(descent, j, e, corner_of(descent.elements.node, e, v))
