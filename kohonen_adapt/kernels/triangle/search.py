"""Find the winner of a training point: the nearest node that it reaches within its own region.

Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps", section III: a walk from where the last winner was,
then the check that no other node lies in the circle through the winner.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import BULGE, CROSSINGS
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import distance_to_chain, parameter_of
from kohonen_adapt.kernels.triangle.geometry import squared_distance, squared_distance_to_edge
from kohonen_adapt.kernels.triangle.locate import TOLERANCE, WALK, depth_in_element, side_of_edge, walk

STRETCH = 256  # points that follow one another and may start where the one before ended


@inner_kernel
def next_stamp(scratch):
    """A stamp that nothing carries yet."""
    scratch.counter[0] += 1
    return scratch.counter[0]


@inner_kernel
def closest_neighbour(position, elements, star, inner, v, x, region):
    """The neighbour of v within the region that is nearest to x, if nearer than v itself, else v."""
    best, nearest = squared_distance(position, v, x), v
    for k in range(star.start[v], star.start[v + 1]):
        if inner[v] or elements.region[star.element[k]] == region:
            distance = squared_distance(position, np.int64(star.ahead[k]), x)
            if distance < best:
                best, nearest = distance, star.ahead[k]
            if not inner[v]:  # around an inner node the one behind is the next element's ahead
                distance = squared_distance(position, np.int64(star.behind[k]), x)
                if distance < best:
                    best, nearest = distance, star.behind[k]
    return nearest


@inner_kernel
def element_in_region(elements, star, v, region):
    """One of the elements around v that belong to the region."""
    for k in range(star.start[v], star.start[v + 1]):
        if elements.region[star.element[k]] == region:
            return star.element[k]
    return star.element[star.start[v]]


@inner_kernel
def holding_element(position, elements, star, constraints, v, x, region, scratch):
    """The element of the region that holds x: a walk that starts at v, and where that is blocked a flood.

    A point between a curve and its facets may lie in no element of its region now; the one that it is behind holds it.
    """
    e = element_in_region(elements, star, v, region)
    e, inside = walk(position, elements, e, x[0], x[1])
    if inside or behind_curve(position, elements, constraints, e, x[0], x[1]):
        return e
    stamp, queue = next_stamp(scratch), scratch.queue
    queue[0], scratch.element_stamp[e] = e, stamp
    first, last = 0, 1
    best, deepest = e, -np.inf
    while first < last and deepest < -TOLERANCE:
        e = np.int64(queue[first])
        first += 1
        depth = depth_in_element(position, elements.node, e, x[0], x[1])
        if depth > deepest:
            best, deepest = e, depth
        for k in range(3):
            across = elements.neighbour[e, k]
            if across >= 0 and elements.region[across] == region and scratch.element_stamp[across] != stamp:
                scratch.element_stamp[across] = stamp
                queue[last] = across
                last += 1
    return best


@inner_kernel
def behind_curve(position, elements, constraints, e, x, y):
    """Whether (x, y), outside of e, lies beyond a facet on a curve and no farther from that than its facets may be."""
    chains = constraints.chains
    for k in range(3):
        c = np.int64(elements.chain[e, k])
        if c >= 0 and chains.place[c, BULGE] > 0.0 and side_of_edge(position, elements.node, e, k, x, y) < 0.0:
            near = parameter_of(position, constraints, c, np.int64(elements.node[e, (k + 1) % 3]))
            if distance_to_chain(chains, c, x, y, near)[0] <= chains.place[c, BULGE] * chains.place[c, BULGE]:
                return True
    return False


@inner_kernel
def nearest_reached(position, elements, e, x, scratch):
    """The circle check: the nearest node that x reaches from element e within its region, ties to the lowest index.

    A node counts if the disc around x that just reaches it joins it to x within the region. So every element carries
    the least distance that a way to it must go to (that of the farthest edge it crosses), elements are entered in the
    order of it, and a node nearer than that does not count: it lies behind a slit or a corner that the disc misses.
    """
    stamp, frontier, reach = next_stamp(scratch), scratch.frontier, scratch.reach
    region = elements.region[e]
    frontier[0], reach[0], scratch.element_stamp[e] = e, 0.0, stamp
    count, winner, best = 1, np.int64(-1), np.inf
    while count > 0:
        near = 0
        for i in range(1, count):
            if reach[i] < reach[near]:
                near = i
        if reach[near] > best:
            break
        e, entered = frontier[near], reach[near]
        count -= 1
        frontier[near], reach[near] = frontier[count], reach[count]
        for k in range(3):
            v = np.int64(elements.node[e, k])
            distance = squared_distance(position, v, x)
            if distance >= entered and (distance < best or (distance == best and v < winner)):
                winner, best = v, distance
        for k in range(3):
            across = elements.neighbour[e, k]
            if across < 0 or elements.region[across] != region:
                continue
            waiting, known = count, scratch.element_stamp[across] == stamp
            if known:
                waiting = 0
                while waiting < count and frontier[waiting] != across:
                    waiting += 1
                if waiting == count:
                    continue
            a, b = elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]
            distance = squared_distance_to_edge(
                position[a, 0], position[a, 1], position[b, 0], position[b, 1], x[0], x[1]
            )
            distance = max(distance, entered)
            if known:
                reach[waiting] = min(reach[waiting], distance)
            elif distance <= best:
                scratch.element_stamp[across] = stamp
                frontier[count], reach[count] = across, distance
                count += 1
    return winner, best


@inner_kernel
def find_winner(neurons, v, x, region, scratch):
    """Walk from node v to ever closer neighbours, then check the circle; returns the winner and its distance."""
    position, elements, star, constraints = neurons.position, neurons.elements, neurons.star, neurons.constraints
    while True:
        nearest = closest_neighbour(position, elements, star, constraints.inner, v, x, region)
        if nearest == v:
            break
        v = nearest
    e = holding_element(position, elements, star, constraints, v, x, region, scratch)
    winner, squared = nearest_reached(position, elements, e, x, scratch)
    return winner, np.sqrt(squared)


@kernel
def find_winners(neurons, points, region, hints, winners, distances, scratch):
    """Find the winner of every point and its distance.

    `hints` has a node of the point's region to start from, best a former winner. The winner of the point before is
    another, except at every STRETCH-th point, so that points may be cut there without a difference. The walk goes from
    element to element to the one that holds the point. From there every edge that the circle through the nearest node
    so far cuts is crossed. Where no such edge belongs to an outline the disc lies within the region, and the nearest
    node found is the winner; elsewhere `find_winner` looks which nodes the point reaches. All in one body: calls would
    cost more.
    """
    position, elements, star, inner = neurons.position, neurons.elements, neurons.star, neurons.constraints.inner
    node, neighbour, regions, crossed = elements.node, elements.neighbour, elements.region, scratch.crossed
    for t in range(points.shape[0]):
        x, y, own, v = points[t, 0], points[t, 1], region[t], np.int64(hints[t])
        if t % STRETCH > 0 and region[t - 1] == own:
            v = nearer(position, v, np.int64(winners[t - 1]), x, y)
        e = int(star.element[star.start[v]])
        if not inner[v]:
            e = int(element_in_region(elements, star, v, own))
        found = False
        for _ in range(WALK):
            a, b, c = node[e, 0], node[e, 1], node[e, 2]
            ax, ay = position[a, 0] - x, position[a, 1] - y
            bx, by = position[b, 0] - x, position[b, 1] - y
            cx, cy = position[c, 0] - x, position[c, 1] - y
            side_a, side_b, side_c = bx * cy - cx * by, cx * ay - ax * cy, ax * by - bx * ay
            k, least = 0, side_a
            if side_b < least:
                k, least = 1, side_b
            if side_c < least:
                k, least = 2, side_c
            if least >= -TOLERANCE * (side_a + side_b + side_c):
                found = True
                break
            across = int(neighbour[e, k])
            if across < 0 or regions[across] != own:
                break
            e = across
        if found:
            winner, best = int(a), ax * ax + ay * ay
            distance = bx * bx + by * by
            if distance < best or (distance == best and b < winner):
                winner, best = int(b), distance
            distance = cx * cx + cy * cy
            if distance < best or (distance == best and c < winner):
                winner, best = int(c), distance
            count = crossings = 0
            for k in range(3):
                if k == 0:
                    px, py, qx, qy, side = bx, by, cx, cy, side_a
                elif k == 1:
                    px, py, qx, qy, side = cx, cy, ax, ay, side_b
                else:
                    px, py, qx, qy, side = ax, ay, bx, by, side_c
                if cuts(px, py, qx, qy, side, best):
                    crossed[count, 0], crossed[count, 1] = e, k
                    count += 1
            while count > 0 and found:
                count -= 1
                e, k = int(crossed[count, 0]), int(crossed[count, 1])
                f = int(neighbour[e, k])
                crossings += 1
                if f < 0 or regions[f] != own or crossings == CROSSINGS:
                    found = False
                    break
                p, q = node[e, (k + 1) % 3], node[e, (k + 2) % 3]
                j = 0 if neighbour[f, 0] == e else (1 if neighbour[f, 1] == e else 2)
                w = node[f, j]
                wx, wy = position[w, 0] - x, position[w, 1] - y
                distance = wx * wx + wy * wy
                if distance < best or (distance == best and w < winner):
                    winner, best = int(w), distance
                px, py = position[p, 0] - x, position[p, 1] - y
                qx, qy = position[q, 0] - x, position[q, 1] - y
                # f = (w, q, p): beyond its corner q lies the edge pw, beyond p the edge wq
                if cuts(px, py, wx, wy, px * wy - wx * py, best):
                    crossed[count, 0], crossed[count, 1] = f, (j + 1) % 3
                    count += 1
                if cuts(wx, wy, qx, qy, wx * qy - qx * wy, best):
                    crossed[count, 0], crossed[count, 1] = f, (j + 2) % 3
                    count += 1
        if found:
            winners[t], distances[t] = winner, np.sqrt(best)
        else:
            winner, distance = find_winner(neurons, v, points[t], own, scratch)
            winners[t], distances[t] = winner, distance


@inner_kernel
def nearer(position, v, other, x, y):
    """Which of two nodes is nearer to (x, y)."""
    ax, ay = position[v, 0] - x, position[v, 1] - y
    bx, by = position[other, 0] - x, position[other, 1] - y
    return other if bx * bx + by * by < ax * ax + ay * ay else v


@inner_kernel
def cuts(px, py, qx, qy, side, best):
    """Whether the edge from p to q, both relative to a point, comes nearer to it than the root of `best`.

    `side` is their cross product; both ends are known to be no nearer.
    """
    ux, uy = qx - px, qy - py
    length, along = ux * ux + uy * uy, -(px * ux + py * uy)
    return 0.0 < along < length and side * side < best * length
