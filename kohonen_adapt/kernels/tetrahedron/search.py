"""Find the winner of a training point: the nearest node that it reaches within its own region.

Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps", section III: a walk from where the last winner was,
then the check that no other node lies in the sphere through the winner.
"""

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import PLANE
from kohonen_adapt.kernels.tetrahedron.locate import TOLERANCE, depth_in_element, side_of_face, walk
from kohonen_adapt.kernels.tetrahedron.surfaces import signed_distance

STRETCH = 64  # points that follow one another and may start where the one before ended


@inner_kernel
def next_stamp(scratch):
    """A stamp that nothing carries yet."""
    scratch.counter[0] += 1
    return scratch.counter[0]


@inner_kernel
def triple(a, b, c):
    """The triple product a . (b x c), six times the volume that three edges span."""
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])


@inner_kernel
def squared_distance(position, v, x):
    """Squared distance from node v to the point x."""
    dx, dy, dz = x[0] - position[v, 0], x[1] - position[v, 1], x[2] - position[v, 2]
    return dx * dx + dy * dy + dz * dz


@inner_kernel
def element_in_region(elements, star, v, region):
    """One of the elements around v that belong to the region."""
    for k in range(star.start[v], star.start[v + 1]):
        if elements.region[star.element[k]] == region:
            return np.int64(star.element[k])
    return np.int64(star.element[star.start[v]])


@inner_kernel
def descended(position, elements, star, v, x, region):
    """The node at the end of a way from v over edges of the region, each to a nearer node than the last."""
    best = squared_distance(position, v, x)
    while True:
        nearest = v
        for k in range(star.start[v], star.start[v + 1]):
            if elements.region[star.element[k]] != region:
                continue
            for j in range(3):
                other = np.int64(star.link[k, j])
                distance = squared_distance(position, other, x)
                if distance < best:
                    best, nearest = distance, other
        if nearest == v:
            return v
        v = nearest


@inner_kernel
def behind_surface(position, elements, surfaces, e, x):
    """Whether x, outside of e, lies beyond a facet of e on a curved patch and no farther off that than the facet is."""
    for k in range(4):
        p = np.int64(elements.patch[e, k])
        if p < 0 or surfaces.shape[p] == PLANE:
            continue
        if side_of_face(position, elements.node, e, k, x[0], x[1], x[2]) >= 0.0:
            continue
        mean_x, mean_y, mean_z = 0.0, 0.0, 0.0
        for i in range(4):
            if i != k:
                v = elements.node[e, i]
                mean_x += position[v, 0] / 3.0
                mean_y += position[v, 1] / 3.0
                mean_z += position[v, 2] / 3.0
        if abs(signed_distance(surfaces, p, x[0], x[1], x[2])[0]) <= abs(
            signed_distance(surfaces, p, mean_x, mean_y, mean_z)[0]
        ):
            return True
    return False


@inner_kernel
def holding_element(neurons, v, x, region, scratch):
    """The element of the region that holds x: a walk that starts at v, and where that is blocked one from nearer nodes.

    What blocks that, too, a flood goes around. A point between a curved surface and its facets may lie in no element of
    its region now; the one that it is behind holds it.
    """
    position, elements, star = neurons.position, neurons.elements, neurons.star
    e, inside = walk(position, elements, element_in_region(elements, star, v, region), x[0], x[1], x[2])
    if inside:
        return e
    nearer_node = descended(position, elements, star, v, x, region)
    e, inside = walk(position, elements, element_in_region(elements, star, nearer_node, region), x[0], x[1], x[2])
    if inside or behind_surface(position, elements, neurons.constraints.surfaces, e, x):
        return e
    stamp, queue = next_stamp(scratch), scratch.queue
    queue[0], scratch.element_stamp[e] = e, stamp
    first, last = 0, 1
    best, deepest = e, -np.inf
    while first < last and deepest < -TOLERANCE:
        e = np.int64(queue[first])
        first += 1
        depth = depth_in_element(position, elements.node, e, x[0], x[1], x[2])
        if depth > deepest:
            best, deepest = e, depth
        for k in range(4):
            across = elements.neighbour[e, k]
            if across >= 0 and elements.region[across] == region and scratch.element_stamp[across] != stamp:
                scratch.element_stamp[across] = stamp
                queue[last] = across
                last += 1
    return best


@inner_kernel
def nearest_reached(position, elements, e, x, scratch):
    """The check by a sphere: the nearest node that x reaches from e within its region, ties to the lowest index.

    A node counts if the ball around x that just reaches it joins it to x within the region. So every element carries
    the least distance that a way to it must go to (that of the farthest face it crosses), elements are entered in the
    order of it, and a node nearer than that does not count: it lies behind a slit or an edge that the ball misses.
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
        for k in range(4):
            v = np.int64(elements.node[e, k])
            distance = squared_distance(position, v, x)
            if distance >= entered and (distance < best or (distance == best and v < winner)):
                winner, best = v, distance
        for k in range(4):
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
            distance = max(entered, squared_distance_to_face(position, elements.node, e, k, x))
            if known:
                reach[waiting] = min(reach[waiting], distance)
            elif distance <= best:
                scratch.element_stamp[across] = stamp
                frontier[count], reach[count] = across, distance
                count += 1
    return winner, best


@inner_kernel
def squared_distance_to_face(position, node, e, k, x):
    """Squared distance from x to the face of e opposite to corner k."""
    a, b, c = node[e, (k + 1) % 4], node[e, (k + 2) % 4], node[e, (k + 3) % 4]
    ax, ay, az = position[a, 0] - x[0], position[a, 1] - x[1], position[a, 2] - x[2]
    bx, by, bz = position[b, 0] - x[0], position[b, 1] - x[1], position[b, 2] - x[2]
    cx, cy, cz = position[c, 0] - x[0], position[c, 1] - x[1], position[c, 2] - x[2]
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    # the foot on the plane lies inside where it lies on the inner side of every edge
    to_a, to_b, to_c, normal = (ax, ay, az), (bx, by, bz), (cx, cy, cz), (nx, ny, nz)
    beyond_ab, beyond_bc = triple(normal, to_a, to_b) < 0.0, triple(normal, to_b, to_c) < 0.0
    beyond_ca = triple(normal, to_c, to_a) < 0.0
    if not (beyond_ab or beyond_bc or beyond_ca) and square > 0.0:
        side = ax * nx + ay * ny + az * nz
        return side * side / square
    return min(
        squared_distance_to_edge(ax, ay, az, bx, by, bz),
        squared_distance_to_edge(bx, by, bz, cx, cy, cz),
        squared_distance_to_edge(cx, cy, cz, ax, ay, az),
    )


@inner_kernel
def squared_distance_to_edge(ax, ay, az, bx, by, bz):
    """Squared distance from the origin to the segment from a to b."""
    ux, uy, uz = bx - ax, by - ay, bz - az
    along, length = -(ax * ux + ay * uy + az * uz), ux * ux + uy * uy + uz * uz
    share = min(1.0, max(0.0, along / length)) if length > 0.0 else 0.0
    x, y, z = ax + share * ux, ay + share * uy, az + share * uz
    return x * x + y * y + z * z


@inner_kernel
def find_winner(neurons, v, x, region, scratch):
    """Walk from node v to the element that holds x, then check the sphere; returns the winner and its distance."""
    e = holding_element(neurons, v, x, region, scratch)
    winner, squared = nearest_reached(neurons.position, neurons.elements, e, x, scratch)
    return winner, np.sqrt(squared)


@kernel
def find_winners(neurons, points, region, hints, winners, distances, scratch):
    """Find the winner of every point and its distance.

    `hints` has a node of the point's region to start from, best a former winner. The winner of the point before is
    another, except at every STRETCH-th point, so that points may be cut there without a difference.
    """
    for t in range(points.shape[0]):
        x, v = points[t], np.int64(hints[t])
        if t % STRETCH > 0 and region[t - 1] == region[t]:
            other = np.int64(winners[t - 1])
            if squared_distance(neurons.position, other, x) < squared_distance(neurons.position, v, x):
                v = other
        winner, distance = find_winner(neurons, v, x, region[t], scratch)
        winners[t], distances[t] = winner, distance
