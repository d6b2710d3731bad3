"""Cutting of polylines of facets into straight segments and arcs of circles.

The nodes of all polylines are in one array `node`; a slot is an index into this array.
"""

import math

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask

FIRST, LAST, IS_ROUND, IS_CLOSED = range(4)  # columns of the rows of segments

TURN = 1e-6  # radians: maximum turn between facets of a straight segment
COLLINEAR = 1e-9  # maximum distance of the nodes of a straight segment from its chord, relative to the chord
FEWEST = 6  # fewest nodes of an arc
FEWEST_FACETS = 3  # fewest facets of a coarse arc, with four nodes: any three nodes are on a circle
CLOSE = 0.05  # maximum distance of a node that lies on a circle, in sagittas of its facet
LEAVING = 0.5  # distance of the next node above which an arc ends, in sagittas; 4 if a tangent follows
ROUNDING = 1e-15  # rounding error of distances, relative to the coordinates
LOOSE = 1e-3  # maximum distance from a circle if a whole polyline is an arc, relative to the radius
DISTINCT = 10.0  # minimum extent of an arc across its chord, relative to the largest distance from the circle
MOST = 1.8 * math.pi  # radians: a longer arc is halved, so that the nearer end of a node is unique


def cut_polylines(
    position: Floats, node: Ints, facet: Ints, start: Ints, closed: Mask, whole: Mask, segments: Ints, circle: Floats
) -> int:
    """Cut polylines into straight segments, arcs and single facets.

    Writes row p of `segments`, shape (p, 4): the slots (indices in `node`) of the first and last node, 1 if the segment
    is an arc, 1 if the segment is closed; and row p of `circle`, shape (p, 3): centre and radius of an arc. Polylines
    of the mask `whole` are not cut, except loops with a corner, which are halved. Closed polylines are rotated in place
    in `node` and `facet` to begin where a segment begins. Returns the number of segments.
    """
    count = 0
    for r in range(len(start) - 1):
        first, last = int(start[r]), int(start[r + 1]) - 1
        if whole[r]:
            write_segment(segments, count, first, last, False, closed[r])
            if not closed[r] and node[first] == node[last]:  # a loop with a corner: a segment needs two end nodes
                middle = (first + last) // 2
                segments[count, LAST] = middle
                count += 1
                write_segment(segments, count, middle, last, False, closed[r])
            count += 1
            continue
        if closed[r] and cut_loop(position, node, facet, first, last, segments, circle, count):
            count += 1
            continue
        before = count
        count, has_long = cut_open(position, node, first, last, segments, circle, count)
        if not has_long and 0.0 < abs(angle_on_circle(position, node, first, last, circle, before)) <= MOST:
            write_segment(segments, before, first, last, True, False)
            count = before + 1
    return count


def write_segment(segments: Ints, p: int, first: int, last: int, is_round: bool, closed: bool) -> None:
    segments[p, FIRST], segments[p, LAST] = first, last
    segments[p, IS_ROUND], segments[p, IS_CLOSED] = int(is_round), int(closed)


def cut_loop(
    position: Floats, node: Ints, facet: Ints, first: int, last: int, segments: Ints, circle: Floats, count: int
) -> bool:
    if circle_of_loop(position, node, first, last, circle, count):
        write_segment(segments, count, first, last, True, True)
        return True
    at = first
    while at < last:
        end, _ = next_segment(position, node, at, last, at, circle, count)
        if end > at + 1 and end < last:
            rotate_polyline(node, facet, first, last, end - first)
            return False
        at = end
    if is_full_turn(angle_on_circle(position, node, first, last, circle, count)):
        write_segment(segments, count, first, last, True, True)
        return True
    return False


def rotate_polyline(node: Ints, facet: Ints, first: int, last: int, shift: int) -> None:
    length = last - first
    nodes, facets = node[first:last].copy(), facet[first:last].copy()
    for i in range(length):
        node[first + i], facet[first + i] = nodes[(i + shift) % length], facets[(i + shift) % length]
    node[last] = node[first]


def cut_open(
    position: Floats, node: Ints, first: int, last: int, segments: Ints, circle: Floats, count: int
) -> tuple[int, bool]:
    at, begin, has_long = first, first, False
    while at < last:
        end, is_round = next_segment(position, node, at, last, begin, circle, count)
        if is_round and abs(angle_around(position, node, at, end, circle[count, 0], circle[count, 1])) > MOST:
            end = (at + end) // 2
        write_segment(segments, count, at, end, is_round, False)
        if end > at + 1:
            begin, has_long = end, True
        count += 1
        at = end
    return count, has_long


def next_segment(
    position: Floats, node: Ints, first: int, last: int, begin: int, circle: Floats, count: int
) -> tuple[int, bool]:
    """Return the end of the segment that begins at `first`, and True for an arc.

    Nodes on another smooth curve nearly fit a circle, too. Therefore the neighbouring nodes must be clearly off the
    circle, except at an end of the polyline and at slot `begin`, where the last segment of several facets ends.
    """
    end = straight_end(position, node, first, last)
    if end > first + 1 and on_chord(position, node, first, end):
        return end, False
    end = arc_end(position, node, first, last)
    if end - first + 1 >= FEWEST:
        x, y, radius = circle_of_part(position, node, first, end)
        enters = first == begin or not off_circle(position, node[first - 1], node[first], x, y, radius) <= LEAVING
        if enters and (end == last or not off_circle(position, node[end + 1], node[end], x, y, radius) <= LEAVING):
            circle[count, 0], circle[count, 1], circle[count, 2] = x, y, radius
            return end, True
    return first + 1, False


def straight_end(position: Floats, node: Ints, first: int, last: int) -> int:
    end, count = first + 1, 1
    while end < last:
        turning = np.abs(turning_angles(position, node[end - 1 : min(end + count, last) + 1])) > TURN
        if turning.any():
            return end + int(np.argmax(turning))
        end, count = end + len(turning), 2 * count
    return end


def turning_angles(position: Floats, nodes: Ints) -> Floats:
    edges = np.diff(position[nodes], axis=0)
    (ux, uy), (wx, wy) = edges[:-1].T, edges[1:].T
    return np.arctan2(ux * wy - uy * wx, ux * wx + uy * wy)


def turning_angle(position: Floats, node: Ints, slot: int) -> float:
    a, v, b = node[slot - 1], node[slot], node[slot + 1]
    ux, uy = position[v, 0] - position[a, 0], position[v, 1] - position[a, 1]
    wx, wy = position[b, 0] - position[v, 0], position[b, 1] - position[v, 1]
    return math.atan2(ux * wy - uy * wx, ux * wx + uy * wy)


def on_chord(position: Floats, node: Ints, first: int, last: int) -> bool:
    ux, uy = (position[node[first + 1 : last + 1]] - position[node[first]]).T
    tx, ty = ux[-1], uy[-1]
    return bool(np.all(np.abs(ux * ty - uy * tx) <= COLLINEAR * (tx * tx + ty * ty)))


def arc_end(position: Floats, node: Ints, first: int, last: int) -> int:
    end = first + 2
    if end > last:
        return first
    left = turning_angle(position, node, first + 1) > 0.0
    while end < last:
        turn = turning_angle(position, node, end)
        x, y, radius = circle_through(position, node[first], node[(first + end) // 2], node[end])
        if (turn > 0.0) != left or not off_circle(position, node[end + 1], node[end], x, y, radius) <= CLOSE:
            break
        end += 1
    return end


def off_circle(position: Floats, v: int, neighbour: int, x: float, y: float, radius: float) -> float:
    """Return the distance of node `v` from a circle in sagittas of its facet.

    Node `neighbour` lies on the circle. Hence |v - c|^2 - r^2 is computed without r, which may be large, and the ratio
    is 4 | |v - c|^2 - r^2 | / |v - neighbour|^2.
    """
    if radius == np.inf:
        return radius
    dx, dy = position[v, 0] - position[neighbour, 0], position[v, 1] - position[neighbour, 1]
    squared = dx * dx + dy * dy
    twice = abs(squared - 2.0 * (dx * (x - position[neighbour, 0]) + dy * (y - position[neighbour, 1])))
    noise = 2.0 * radius * ROUNDING * (abs(position[v, 0]) + abs(position[v, 1]))
    return 4.0 * max(0.0, twice - noise) / squared


def circle_through(position: Floats, a: int, b: int, c: int) -> tuple[float, float, float]:
    ux, uy = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1]
    wx, wy = position[c, 0] - position[a, 0], position[c, 1] - position[a, 1]
    doubled = 2.0 * (ux * wy - uy * wx)
    if doubled == 0.0:
        return position[a, 0], position[a, 1], np.inf
    uu, ww = ux * ux + uy * uy, wx * wx + wy * wy
    x, y = (wy * uu - uy * ww) / doubled, (ux * ww - wx * uu) / doubled
    return position[a, 0] + x, position[a, 1] + y, math.hypot(x, y)


def circle_of_part(position: Floats, node: Ints, first: int, last: int) -> tuple[float, float, float]:
    if node[first] == node[last]:
        third = (last - first) // 3
        return circle_through(position, node[first], node[first + third], node[first + 2 * third])
    return circle_through(position, node[first], node[(first + last) // 2], node[last])


def circle_of_loop(position: Floats, node: Ints, first: int, last: int, circle: Floats, count: int) -> bool:
    if last - first < FEWEST:
        return False
    x, y, radius = circle_of_part(position, node, first, last)
    for i in range(first, last):
        if not off_circle(position, node[i], node[i + 1], x, y, radius) <= CLOSE:
            return False
    circle[count, 0], circle[count, 1], circle[count, 2] = x, y, radius
    return is_full_turn(angle_around(position, node, first, last, x, y))


def angle_on_circle(position: Floats, node: Ints, first: int, last: int, circle: Floats, count: int) -> float:
    # The circle is written to row `count` of `circle`.
    closed = node[first] == node[last]
    if last - first + (0 if closed else 1) < FEWEST:
        return 0.0
    x, y, radius = fitted_circle(position, node, first, last)
    distance = low = high = 0.0
    a, b = node[first], node[last - 1 if closed else last]
    tx, ty = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1]
    length = math.hypot(tx, ty)
    for i in range(first, last + 1):
        px, py = position[node[i], 0], position[node[i], 1]
        distance = max(distance, abs(math.hypot(px - x, py - y) - radius))
        side = (tx * (py - position[a, 1]) - ty * (px - position[a, 0])) / length
        low, high = min(low, side), max(high, side)
    if not (distance <= LOOSE * radius and DISTINCT * distance <= high - low):
        return 0.0
    circle[count, 0], circle[count, 1], circle[count, 2] = x, y, radius
    return angle_around(position, node, first, last, x, y)


def angle_around(position: Floats, node: Ints, first: int, last: int, x: float, y: float) -> float:
    total = 0.0
    for i in range(first, last):
        angle = angle_between(position, node[i], node[i + 1], x, y)
        if i > first and (angle > 0.0) != (total > 0.0):
            return 0.0
        total += angle
    return total


def is_full_turn(angle: float) -> bool:
    return abs(abs(angle) - 2.0 * math.pi) < 1.0


def angle_between(position: Floats, a: int, b: int, x: float, y: float) -> float:
    ax, ay = position[a, 0] - x, position[a, 1] - y
    bx, by = position[b, 0] - x, position[b, 1] - y
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


def fitted_circle(position: Floats, node: Ints, first: int, last: int) -> tuple[float, float, float]:
    """Return centre and radius of the least-squares circle (Kasa, 1976).

    The sum of (|x - c|^2 - r^2)^2 over the nodes is least. Closed polylines count the first node twice.
    """
    count, mean_x, mean_y = last - first + 1, 0.0, 0.0
    for i in range(first, last + 1):
        mean_x += position[node[i], 0] / count
        mean_y += position[node[i], 1] / count
    xx = xy = yy = xz = yz = zz = 0.0
    for i in range(first, last + 1):
        ux, uy = position[node[i], 0] - mean_x, position[node[i], 1] - mean_y
        z = ux * ux + uy * uy
        xx, xy, yy = xx + ux * ux, xy + ux * uy, yy + uy * uy
        xz, yz, zz = xz + ux * z, yz + uy * z, zz + z
    determinant = 2.0 * (xx * yy - xy * xy)
    if not determinant > 0.0:
        return mean_x, mean_y, np.inf
    x, y = (yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant
    return mean_x + x, mean_y + y, math.sqrt(x * x + y * y + zz / count)


def lengths_and_angles(
    position: Floats, node: Ints, segments: Ints, circle: Floats, longest: Floats, even: Floats, angle: Floats
) -> None:
    """Write longest facet, equivalent facet length and angle of every segment.

    A chord of length l cuts the area ``l^3 / (12 r)`` off a circle of radius r. Equal facets that cut off as much as
    the facets of a segment have the length `even`, sqrt(sum l^3 / sum l). Angles are in radians, positive to the left.
    """
    for p in range(segments.shape[0]):
        longest[p] = angle[p] = total = cubes = 0.0
        for i in range(segments[p, FIRST], segments[p, LAST]):
            a, b = node[i], node[i + 1]
            length = math.hypot(position[b, 0] - position[a, 0], position[b, 1] - position[a, 1])
            longest[p] = max(longest[p], length)
            total, cubes = total + length, cubes + length**3
            if segments[p, IS_ROUND]:
                angle[p] += angle_between(position, a, b, circle[p, 0], circle[p, 1])
        even[p] = math.sqrt(cubes / total)
