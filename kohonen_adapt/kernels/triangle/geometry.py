"""Measure triangles and stars, and guard them: no move leaves an element worse than the quality rule allows."""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import OWN, UNGUARDED
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import point_at, within_reach

SQRT12 = 2.0 * math.sqrt(3.0)
FLAT = 1e-12  # a quality below it is rounding: no move or flip may leave such an element, whatever the rule says


@inner_kernel
def may_join(elements, e, v, w):
    """Whether layers allow an edge between nodes v and w in the region of element e."""
    return not elements.layered[elements.region[e]] or abs(elements.level[v] - elements.level[w]) <= 1


@inner_kernel
def orientation(ax, ay, bx, by, cx, cy):
    """Twice the signed area of a triangle, positive if it is counter-clockwise."""
    return (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)


@inner_kernel
def signed_quality(ax, ay, bx, by, cx, cy):
    """Quality with the sign of the orientation; nan for three equal points, which every comparison refuses."""
    ux, uy = bx - ax, by - ay
    vx, vy = cx - ax, cy - ay
    wx, wy = cx - bx, cy - by
    squares = ux * ux + uy * uy + vx * vx + vy * vy + wx * wx + wy * wy
    return SQRT12 * (ux * vy - vx * uy) / squares


@inner_kernel
def element_quality(position, node, e):
    """Signed quality of element e."""
    a, b, c = node[e, 0], node[e, 1], node[e, 2]
    return signed_quality(
        position[a, 0], position[a, 1], position[b, 0], position[b, 1], position[c, 0], position[c, 1]
    )


@inner_kernel
def worst_in_star(position, star, v, x, y):
    """Worst signed quality of the star of v were v at (x, y)."""
    worst = 2.0
    for k in range(star.start[v], star.start[v + 1]):
        a, b = star.ahead[k], star.behind[k]
        q = signed_quality(x, y, position[a, 0], position[a, 1], position[b, 0], position[b, 1])
        if not q >= worst:
            worst = q
    return worst


@inner_kernel
def tolerable(worst, floor):
    """Whether this quality needs no comparison with what was before; UNGUARDED switches every check off."""
    return floor == UNGUARDED or (worst >= floor and worst > FLAT)


@inner_kernel
def allowed(after, before, floor):
    """The quality rule: the worst quality after a change is tolerable, or no worse than the worst before."""
    return tolerable(after, floor) or (after > FLAT and after >= before)


@inner_kernel
def least_share(floor):
    """What `better_than` is to compare with under a floor."""
    return 2.0 * max(floor, FLAT) / SQRT12


@inner_kernel
def better_than(share, ux, uy, vx, vy):
    """Whether the triangle of two edges (u, v counter-clockwise) is of better quality than a `least_share` says.

    The same as asking for `signed_quality` in a third of the time: no division, and branches that go one way.
    """
    return ux * vy - vx * uy > share * (ux * ux + uy * uy + vx * vx + vy * vy - ux * vx - uy * vy)


@inner_kernel
def star_tolerable(position, star, v, x, y, floor):
    """Whether all qualities in the star of v were tolerable with v at (x, y)."""
    share = least_share(floor)
    for k in range(star.start[v], star.start[v + 1]):
        a, b = star.ahead[k], star.behind[k]
        ux, uy = position[a, 0] - x, position[a, 1] - y
        vx, vy = position[b, 0] - x, position[b, 1] - y
        if not better_than(share, ux, uy, vx, vy):
            return floor == UNGUARDED
    return True


@kernel
def mark_sound(position, star, floor, first, last, sound):
    """Mark those of the nodes `first` to `last` whose stars are tolerable: their guard need not look back.

    Where all stars are, guarded moves keep them so. Elsewhere a neighbour may worsen a marked star within its own
    rule; the guard is then stricter than the rule until the next time stars are marked.
    """
    for v in range(first, last):
        sound[v] = star_tolerable(position, star, v, position[v, 0], position[v, 1], floor)


@inner_kernel
def may_move(position, star, v, x, y, floor):
    """The guard: whether its star is, with v at (x, y), at least as good as min(floor, the worst there before)."""
    if star_tolerable(position, star, v, x, y, floor):
        return True
    if star_tolerable(position, star, v, position[v, 0], position[v, 1], floor):
        return False
    worst = worst_in_star(position, star, v, x, y)
    return worst > FLAT and worst >= worst_in_star(position, star, v, position[v, 0], position[v, 1])


@inner_kernel
def slide(position, elements, star, constraints, v, parameter, floor):
    """Move a node along its chain to a parameter, if guard and reach allow it; returns whether."""
    chains, chain = constraints.chains, np.int64(constraints.chain[v, OWN])
    x, y = point_at(chains, chain, parameter)
    if not within_reach(position, elements, star, chains, chain, v, x, y):
        return False
    if not may_move(position, star, v, x, y, floor):
        return False
    position[v, 0], position[v, 1], constraints.parameter[v] = x, y, parameter
    return True


@inner_kernel
def slide_pair(position, elements, star, constraints, v, parameter, floor):
    """Move a node and its partner along their chains to a parameter, if both guards agree; returns whether."""
    w, before = np.int64(constraints.twins.partner[v]), constraints.parameter[v]
    before_x, before_y = position[v, 0], position[v, 1]
    # where the mesh is one element wide the partner's star moves with the node
    if not slide(position, elements, star, constraints, v, parameter, floor):
        return False
    x, y = point_at(constraints.chains, np.int64(constraints.chain[w, OWN]), parameter)
    if not may_move(position, star, w, x, y, floor):
        position[v, 0], position[v, 1], constraints.parameter[v] = before_x, before_y, before
        return False
    position[w, 0], position[w, 1], constraints.parameter[w] = x, y, parameter
    return True


@kernel
def move_to_targets(position, star, nodes, target, still, floor):
    """Move nodes that are more than `still` away from their target there, unless the guard forbids it."""
    for i in range(nodes.shape[0]):
        v, x, y = np.int64(nodes[i]), target[i, 0], target[i, 1]
        if abs(x - position[v, 0]) + abs(y - position[v, 1]) > still and may_move(position, star, v, x, y, floor):
            position[v, 0], position[v, 1] = x, y


@inner_kernel
def squared_distance(position, v, x):
    """Squared distance from node v to the point x, in any number of dimensions."""
    total = 0.0
    for k in range(x.shape[0]):
        difference = x[k] - position[v, k]
        total += difference * difference
    return total


@inner_kernel
def squared_distance_to_edge(ax, ay, bx, by, x, y):
    """Squared distance from (x, y) to the segment from a to b."""
    ux, uy = bx - ax, by - ay
    vx, vy = x - ax, y - ay
    along = min(1.0, max(0.0, (ux * vx + uy * vy) / (ux * ux + uy * uy)))
    vx -= along * ux
    vy -= along * uy
    return vx * vx + vy * vy
