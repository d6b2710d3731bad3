"""Draw training points, and move the nodes around the winner of each towards it, each step guarded.

Update, neighbourhood and treatment of outlines are those of Lowther and Mai, "On Automatic Mesh Generation using
Kohonen Maps" (sections II and III), with patches and ridges in place of outlines: corners go from one node to its
neighbour on another ridge, so that nodes travel from ridge to ridge (Fig. 3).
"""

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, ON_RIDGE, PROJECTED
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, star_quality
from kohonen_adapt.kernels.tetrahedron.search import next_stamp
from kohonen_adapt.kernels.tetrahedron.stars import may_move, star_tolerable
from kohonen_adapt.kernels.tetrahedron.surfaces import onto_ridge, slid, within_reach

SETS = 4  # patches that meet in a ridge, at most
AT_CORNER = 3  # ridges that meet in a corner which nodes may leave, at most


@kernel
def draw_points(position, node, order, cumulated, random, points, element):
    """Draw a random point in each of as many stretches of equal mass, in the elements in the given order.

    `cumulated` sums the masses up in that order; `random` (k, 4) has numbers from 0 to 1 for the place in the stretch
    and in the element, which is filled evenly: the unit cube is folded into the tetrahedron (Rocchini and Cignoni, J.
    Graph. Tools 5, 2000).
    """
    number, at = points.shape[0], 0
    share = cumulated[-1] / number
    for t in range(number):
        level = (t + random[t, 0]) * share
        while at < order.shape[0] - 1 and cumulated[at] < level:
            at += 1
        e, u, v, w = order[at], random[t, 1], random[t, 2], random[t, 3]
        if u + v > 1.0:
            u, v = 1.0 - u, 1.0 - v
        if v + w > 1.0:
            v, w = 1.0 - w, 1.0 - u - v
        elif u + v + w > 1.0:
            u, w = 1.0 - v - w, u + v + w - 1.0
        a, b, c, d = node[e, 0], node[e, 1], node[e, 2], node[e, 3]
        for k in range(3):
            start = position[a, k]
            points[t, k] = (
                start + u * (position[b, k] - start) + v * (position[c, k] - start) + w * (position[d, k] - start)
            )
        element[t] = e


@kernel
def learn(neurons, lesson, rate, floor, sound, scratch):
    """Present training points whose winners are known.

    Learning rate times weight is capped at 1. Stars marked `sound` need not look back.
    """
    position, elements, star, constraints = neurons.position, neurons.elements, neurons.star, neurons.constraints
    freedom, surfaces = constraints.freedom, constraints.surfaces
    queue, stamps = scratch.queue, scratch.node_stamp
    for t in range(lesson.points.shape[0]):
        x, region = lesson.points[t], lesson.region[t]
        stamp, rate_of_point = next_stamp(scratch), min(1.0, rate * lesson.weights[t])
        queue[0], stamps[lesson.winners[t]] = lesson.winners[t], stamp
        first, last = np.int64(0), np.int64(1)
        for ring in range(lesson.strength.shape[0]):
            if ring > 0:
                end = gather_ring(neurons, region, scratch, first, last, stamp)
                first, last = last, end
            step = rate_of_point * lesson.strength[ring]
            for i in range(first, last):
                v = np.int64(queue[i])
                if freedom.number[v] == HELD:
                    if not freedom.pinned[v]:
                        jump(neurons, v, x, step, floor, scratch)
                    continue
                new_x, new_y, new_z = slid(
                    position, constraints, v,
                    step * (x[0] - position[v, 0]), step * (x[1] - position[v, 1]), step * (x[2] - position[v, 2]),
                )  # fmt: skip
                if freedom.number[v] != INSIDE and not (
                    np.isfinite(new_x + new_y + new_z)
                    and within_reach(position, elements, star, surfaces, v, new_x, new_y, new_z)
                ):
                    continue
                if star_tolerable(position, star, v, new_x, new_y, new_z, floor) or (
                    not sound[v] and may_move(position, star, v, new_x, new_y, new_z, floor)
                ):
                    position[v, 0], position[v, 1], position[v, 2] = new_x, new_y, new_z


@inner_kernel
def gather_ring(neurons, region, scratch, first, last, stamp):
    """Append the next ring of neighbours within the region to the queue; returns its new end."""
    elements, star, inner = neurons.elements, neurons.star, neurons.constraints.inner
    queue, stamps, end = scratch.queue, scratch.node_stamp, last
    for i in range(first, last):
        v = queue[i]
        for k in range(star.start[v], star.start[v + 1]):
            if inner[v] or elements.region[star.element[k]] == region:
                for j in range(3):
                    other = star.link[k, j]
                    if stamps[other] != stamp:
                        stamps[other] = stamp
                        queue[end] = other
                        end += 1
    return end


@inner_kernel
def jump(neurons, v, x, step, floor, scratch):
    """Let v leave a corner along the nearest of its ridges, and its neighbour on another take over (Fig. 3).

    Where three ridges meet, one face is all that may lie between that neighbour's ridge and the third: it changes to
    the patch between the third ridge and the nearest one, and its edge from the neighbour to the third ridge's next
    node becomes that ridge's end.
    """
    position, constraints, ends = neurons.position, neurons.constraints, scratch.crossed
    count = ridges_at_corner(neurons, v, ends)
    if count < 2 or count > AT_CORNER:
        return
    nearest = nearest_ridge(position, constraints.surfaces, ends, count, v, x)
    if nearest < 0:
        return
    onto = np.int64(ends[nearest, 1])
    new_x, new_y, new_z = onto_ridge(
        constraints.surfaces, onto,
        position[v, 0] + step * (x[0] - position[v, 0]),
        position[v, 1] + step * (x[1] - position[v, 1]),
        position[v, 2] + step * (x[2] - position[v, 2]),
    )  # fmt: skip
    if not np.isfinite(new_x + new_y + new_z):
        return
    for i in range(count):
        f, away = np.int64(ends[i, 0]), np.int64(ends[i, 1])
        if away == onto or constraints.freedom.number[f] != ON_RIDGE or constraints.freedom.place[f] != away:
            continue
        other = np.int64(ends[AT_CORNER - i - nearest, 0]) if count == AT_CORNER else np.int64(-1)
        patch = patch_to_take(neurons, v, f, other, onto)
        if patch == -2:
            continue
        if swapped(neurons, v, f, new_x, new_y, new_z, floor):
            if other >= 0:
                relabel_face(neurons, v, f, other, patch)
            constraints.freedom.number[f], constraints.freedom.place[f] = HELD, -1
            constraints.freedom.number[v], constraints.freedom.place[v] = ON_RIDGE, onto
            return


@inner_kernel
def ridges_at_corner(neurons, v, ends):
    """List the next node and the number of every ridge at v; returns how many, one more than may be if there are."""
    elements, star, count = neurons.elements, neurons.star, 0
    for k in range(star.start[v], star.start[v + 1]):
        e = star.element[k]
        for j in range(3):
            w, known = np.int64(star.link[k, j]), False
            for i in range(count):
                if ends[i, 0] == w:
                    known = True
            if known or not on_patch_of(elements, e, v, w):
                continue
            r = ridge_of_edge(neurons, v, w)
            if r == -2:  # an edge of a ridge that nobody knows, or on a patch that no loop knows
                return AT_CORNER + 1
            if r >= 0:
                if count == AT_CORNER:
                    return AT_CORNER + 1
                ends[count, 0], ends[count, 1] = w, r
                count += 1
    return count


@inner_kernel
def on_patch_of(elements, e, v, w):
    """Whether one of the two faces of e with both nodes is constrained."""
    for k in range(4):
        if elements.patch[e, k] >= 0 and elements.node[e, k] != v and elements.node[e, k] != w:
            return True
    return False


@inner_kernel
def ridge_of_edge(neurons, v, w):
    """The ridge that the edge vw is on: -1 if it is on one patch only, -2 if that cannot be told."""
    elements, star, freedom = neurons.elements, neurons.star, neurons.constraints.freedom
    surfaces, only, sides, same = neurons.constraints.surfaces, np.int64(-1), 0, True
    for k in range(star.start[v], star.start[v + 1]):
        if star.link[k, 0] != w and star.link[k, 1] != w and star.link[k, 2] != w:
            continue
        e = np.int64(star.element[k])
        for j in range(4):
            p = np.int64(elements.patch[e, j])
            if p < 0 or elements.node[e, j] == v or elements.node[e, j] == w:
                continue
            if surfaces.shape[p] == PROJECTED:
                return -2
            if only >= 0 and only != p:
                same = False
            only = p
            sides += 2 if elements.neighbour[e, j] < 0 else 1  # every face has two
    if same and sides == 4:
        return -1
    if freedom.number[w] == ON_RIDGE:
        return np.int64(freedom.place[w])
    return ridge_between(neurons, v, w)


@inner_kernel
def ridge_between(neurons, v, w):
    """The ridge with just the patches that meet in the edge vw, the nearest to its middle; -2 if there is none."""
    position, surfaces, found, least = neurons.position, neurons.constraints.surfaces, np.int64(-2), np.inf
    x = 0.5 * (position[v, 0] + position[w, 0])
    y = 0.5 * (position[v, 1] + position[w, 1])
    z = 0.5 * (position[v, 2] + position[w, 2])
    for r in range(surfaces.meets.shape[0]):
        if meets_in(neurons, r, v, w):
            rx, ry, rz = onto_ridge(surfaces, np.int64(r), x, y, z)
            distance = (rx - x) * (rx - x) + (ry - y) * (ry - y) + (rz - z) * (rz - z)
            if distance < least:
                found, least = np.int64(r), distance
    return found


@inner_kernel
def meets_in(neurons, r, v, w):
    """Whether the patches of ridge r are those that meet in the edge vw."""
    elements, star, meets = neurons.elements, neurons.star, neurons.constraints.surfaces.meets
    for i in range(SETS):
        if meets[r, i] >= 0 and not has_face(elements, star, v, w, meets[r, i]):
            return False
    for k in range(star.start[v], star.start[v + 1]):
        if star.link[k, 0] != w and star.link[k, 1] != w and star.link[k, 2] != w:
            continue
        e = star.element[k]
        for j in range(4):
            p = elements.patch[e, j]
            if p >= 0 and elements.node[e, j] != v and elements.node[e, j] != w and not is_of(meets, r, p):
                return False
    return True


@inner_kernel
def is_of(meets, r, p):
    """Whether ridge r is on patch p."""
    for i in range(SETS):
        if meets[r, i] == p:
            return True
    return False


@inner_kernel
def has_face(elements, star, v, w, p):
    """Whether a face of patch p has both nodes."""
    for k in range(star.start[v], star.start[v + 1]):
        if star.link[k, 0] != w and star.link[k, 1] != w and star.link[k, 2] != w:
            continue
        e = star.element[k]
        for j in range(4):
            if elements.patch[e, j] == p and elements.node[e, j] != v and elements.node[e, j] != w:
                return True
    return False


@inner_kernel
def nearest_ridge(position, surfaces, ends, count, v, x):
    """Which ridge at v comes nearest to x ahead of v; -1 if v itself is as near as any."""
    nearest = np.int64(-1)
    dx, dy, dz = x[0] - position[v, 0], x[1] - position[v, 1], x[2] - position[v, 2]
    best = dx * dx + dy * dy + dz * dz
    for i in range(count):
        w, r = ends[i, 0], np.int64(ends[i, 1])
        rx, ry, rz = onto_ridge(surfaces, r, x[0], x[1], x[2])
        ahead = (
            (rx - position[v, 0]) * (position[w, 0] - position[v, 0])
            + (ry - position[v, 1]) * (position[w, 1] - position[v, 1])
            + (rz - position[v, 2]) * (position[w, 2] - position[v, 2])
        )
        distance = (x[0] - rx) * (x[0] - rx) + (x[1] - ry) * (x[1] - ry) + (x[2] - rz) * (x[2] - rz)
        if ahead > 0.0 and distance < best:
            nearest, best = np.int64(i), distance
    return nearest


@inner_kernel
def patch_to_take(neurons, v, f, other, onto):
    """The patch that the face of v, f and the other node changes to as v leaves its corner along a ridge, -1 for none.

    All other constrained faces at v must be on patches of that ridge, else the answer is -2. So it is where the face
    would come between other regions than it is between.
    """
    elements, star, meets = neurons.elements, neurons.star, neurons.constraints.surfaces.meets
    found = np.int64(-1)
    for k in range(star.start[v], star.start[v + 1]):
        e = np.int64(star.element[k])
        for j in range(4):
            p = elements.patch[e, j]
            if p < 0 or elements.node[e, j] == v or is_of(meets, onto, p):
                continue
            if other < 0 or not is_face(elements, e, j, v, f, other):
                return np.int64(-2)
            found = patch_beside(neurons, e, j, v, other, onto)
            if found < 0:
                return np.int64(-2)
    return found if found >= 0 or other < 0 else np.int64(-2)


@inner_kernel
def is_face(elements, e, j, v, f, other):
    """Whether the face of e opposite to corner j is that of three nodes."""
    for i in range(4):
        w = elements.node[e, i]
        if i != j and w != v and w != f and w != other:
            return False
    return True


@inner_kernel
def patch_beside(neurons, e, j, v, other, onto):
    """The patch of a ridge with a face at the edge from v to the other node, between the regions of face j of e."""
    elements, star, meets = neurons.elements, neurons.star, neurons.constraints.surfaces.meets
    for k in range(star.start[v], star.start[v + 1]):
        if star.link[k, 0] != other and star.link[k, 1] != other and star.link[k, 2] != other:
            continue
        g = np.int64(star.element[k])
        for i in range(4):
            p = np.int64(elements.patch[g, i])
            if p < 0 or elements.node[g, i] == v or elements.node[g, i] == other or not is_of(meets, onto, p):
                continue
            if elements.region[g] == elements.region[e] and region_beyond(elements, g, i) == region_beyond(
                elements, e, j
            ):
                return p
    return np.int64(-1)


@inner_kernel
def region_beyond(elements, e, j):
    """The region across the face of e opposite to corner j, -1 outside."""
    across = elements.neighbour[e, j]
    return np.int64(elements.region[across]) if across >= 0 else np.int64(-1)


@inner_kernel
def relabel_face(neurons, v, f, other, patch):
    """Give the constrained face of three nodes to another patch, on both of its sides."""
    elements, star = neurons.elements, neurons.star
    for k in range(star.start[v], star.start[v + 1]):
        e = star.element[k]
        for j in range(4):
            if elements.patch[e, j] >= 0 and is_face(elements, e, j, v, f, other):
                elements.patch[e, j] = patch


@inner_kernel
def swapped(neurons, v, f, x, y, z, floor):
    """Move v to (x, y, z) and its follower into the corner; returns whether quality and reach allow it."""
    position, elements, star = neurons.position, neurons.elements, neurons.star
    surfaces = neurons.constraints.surfaces
    corner_x, corner_y, corner_z = position[v, 0], position[v, 1], position[v, 2]
    old_x, old_y, old_z = position[f, 0], position[f, 1], position[f, 2]
    if not within_reach(position, elements, star, surfaces, f, corner_x, corner_y, corner_z):
        return False
    before = worst_of_two(position, star, v, f)
    position[v, 0], position[v, 1], position[v, 2] = x, y, z
    position[f, 0], position[f, 1], position[f, 2] = corner_x, corner_y, corner_z
    both = star_tolerable(position, star, v, x, y, z, floor)
    both = both and star_tolerable(position, star, f, corner_x, corner_y, corner_z, floor)
    if not both:
        after = worst_of_two(position, star, v, f)
        both = after > FLAT and after >= before
    if not both:
        position[v, 0], position[v, 1], position[v, 2] = corner_x, corner_y, corner_z
        position[f, 0], position[f, 1], position[f, 2] = old_x, old_y, old_z
    return both


@inner_kernel
def worst_of_two(position, star, v, w):
    """Worst cubed quality of the stars of two nodes."""
    return min(
        star_quality(position, star, v, position[v, 0], position[v, 1], position[v, 2], -2.0),
        star_quality(position, star, w, position[w, 0], position[w, 1], position[w, 2], -2.0),
    )
