"""Edge flips that lower functionals, with the inner unknowns eliminated."""

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import BLOCK, COARSE_BLOCK, VALUE
from kohonen_adapt.kernels.triangle.flip import flip_edge, mark_neighbours, may_flip
from kohonen_adapt.kernels.triangle.geometry import corner_of, corners_around, twice_area
from kohonen_adapt.kernels.triangle.polish import linear
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING
from kohonen_adapt.kernels.triangle.polish.patch import derivatives, may_centre, minimise, number_unknowns, term_of
from kohonen_adapt.kernels.triangle.polish.rows import (
    gather_beside,
    gather_flipped,
    hold_all_but,
    put_row,
    reference_value,
)
from kohonen_adapt.kernels.vectors import xy

NEAR = 0.25  # of twice the decrease of a step by few points: more than another step takes off

change_by_linear_flip = linear.change_by_flip


@kernel
def descend_flips(descents, higher, floor, gainful, first, last, marks):
    """Flip edges of the elements `first` to `last` if the functional falls.

    Only elements marked in `gainful`, shape (m,), are visited, and every flip marks the neighbours. If `marks`, no
    edge is flipped, and elements are marked whose edge to an element of greater index is gainful. Return the gain and
    the number of flips.
    """
    position, elements, metric = descents.primal.position, descents.primal.elements, descents.primal.constraints.metric
    gain, flips = 0.0, 0
    for e in range(first, last):
        gainful[e] &= not marks
        for k in range(3):
            other = elements.neighbour[e, k]
            if gainful[e] == marks or other < e or elements.chain[e, k] >= 0:
                continue
            decrease = gain_of_flip(descents, higher, e, k, other)
            if marks:
                gainful[e] = decrease > 0.0
            elif decrease > 0.0 and may_flip(position, elements, metric, e, k, other, floor):
                flip(descents, higher, e, k, other)
                gain += decrease
                flips += 1
                mark_neighbours(elements, e, gainful)
                mark_neighbours(elements, other, gainful)
    return gain, flips


@inner_kernel
def flip(descents, higher, e, k, other):
    q = descents.primal.elements.node[e, (k + 2) % 3]
    flip_edge(descents.primal.elements, e, k)
    for i in range(descents.terms if len(higher) > 0 else 0):
        descent = term_of(descents, i)
        put_row(descent, 0, e, k)
        put_row(descent, 1, other, (corner_of(descent.elements.node, other, q) + 1) % 3)


@inner_kernel
def gain_of_flip(descents, higher, e, k, other):
    """Return the decrease of the functionals by a flip, or 0 if negligible.

    The rows of the block are then the flipped elements.
    """
    gain, magnitude = 0.0, 0.0
    for i in range(descents.terms):
        descent = term_of(descents, i)
        if len(higher) == 0:
            decrease, more = change_by_linear_flip(descent, e, k, other)
        else:
            decrease, more = change_by_flip(descent, e, k, other)
        gain, magnitude = gain + decrease, magnitude + more
    return gain if gain > ROUNDING * magnitude else 0.0


@inner_kernel
def change_by_flip(descent, e, k, other):
    p, q, r, s = corners_around(descent.elements.node, e, k, other)
    if not (twice_area(descent.position, r, p, s) > 0.0 and twice_area(descent.position, s, q, r) > 0.0):
        return 0.0, 0.0
    at_p, at_r, own = xy(descent.position, p), xy(descent.position, r), reference_value(descent, r)
    gather_beside(descent, e, k, own)
    descent.block.element[1] = e  # data that vary are extrapolated from the same element before and after
    hold_all_but(descent.block, q)
    number_unknowns(descent, False)
    _, magnitude, before, square = minimise(descent, 1, at_p, BLOCK)
    before -= 0.5 * square
    gather_flipped(descent, e, k, other, own)
    if not may_centre(descent, at_r):
        return 0.0, 0.0
    hold_all_but(descent.block, s)
    number_unknowns(descent, False)
    nonlinear = descent.trial.laws.number[e] >= 0
    _, more, after, square = minimise(descent, 1, at_r, COARSE_BLOCK if nonlinear else BLOCK)
    if not nonlinear:
        return before - after + 0.5 * square, magnitude + more
    # few points first, and all points if the functional may fall
    more, after = derivatives(descent, at_r, VALUE)[:2]
    if after - before < NEAR * square:
        minimise(descent, 1, at_r, BLOCK)
        more, after = derivatives(descent, at_r, VALUE)[:2]
    return before - after, magnitude + more
