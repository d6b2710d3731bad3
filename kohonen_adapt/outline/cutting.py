"""Cut runs of outline facets into straight pieces and arcs of circles."""

import math

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import FIRST, IS_CLOSED, IS_ROUND, LAST

TURN = 1e-6  # radians: where facets turn by no more they are straight
BEND = 1e-9  # of its length: no node of a straight piece may lie farther off its chord
FEWEST = 6  # nodes of an arc
FEWEST_FACETS = 3  # of a coarse one, of four nodes: any three are on a circle
CLOSE = 0.05  # of the sagitta of its facet: a node nearer than that to a circle lies on it
LEAVING = 0.5  # of the same: the next node is farther off where an arc ends; it is 4 off where a tangent goes on
ROUNDING = 1e-15  # of the coordinates: likewise, however short the facet
LOOSE = 1e-3  # of the radius: a whole run whose nodes are no farther from a circle is an arc
DISTINCT = 10.0  # times that distance the run must bulge, or it may as well be straight
MOST = 1.8 * math.pi  # radians: an arc that goes farther round is two, so that it is clear which end is near


def cut_runs(
    position: Floats, node: Ints, facet: Ints, start: Ints, closed: Mask, whole: Mask, pieces: Ints, circle: Floats
) -> int:
    """Cut runs into straight pieces, arcs, and facets that are neither; returns the number of pieces.

    Of piece p, `pieces` (p, 4) are the slots of its first and last node, whether it is round, and whether it is closed;
    `circle` (p, 3) the centre and radius of round ones. Runs that are `whole` are not cut. Closed runs are turned, so
    that they begin where a piece does.
    """
    count = 0
    for r in range(len(start) - 1):
        first, last = int(start[r]), int(start[r + 1]) - 1
        if whole[r]:
            enter_piece(pieces, count, first, last, False, closed[r])
            if not closed[r] and node[first] == node[last]:  # a loop with a corner: its ends are to be two nodes
                middle = (first + last) // 2
                pieces[count, LAST] = middle
                count += 1
                enter_piece(pieces, count, middle, last, False, closed[r])
            count += 1
            continue
        if closed[r] and cut_loop(position, node, facet, first, last, pieces, circle, count):
            count += 1
            continue
        before = count
        count, proper = cut_open(position, node, first, last, pieces, circle, count)
        if not proper and 0.0 < abs(turn_of_arc(position, node, first, last, circle, before)) <= MOST:
            enter_piece(pieces, before, first, last, True, False)
            count = before + 1
    return count


def enter_piece(pieces: Ints, p: int, first: int, last: int, is_round: bool, closed: bool) -> None:
    """Write the row of a piece."""
    pieces[p, FIRST], pieces[p, LAST] = first, last
    pieces[p, IS_ROUND], pieces[p, IS_CLOSED] = int(is_round), int(closed)


def cut_loop(
    position: Floats, node: Ints, facet: Ints, first: int, last: int, pieces: Ints, circle: Floats, count: int
) -> bool:
    """Whether a closed run is a circle, which is entered; else it is turned to begin where a piece does."""
    if circle_of_loop(position, node, first, last, circle, count):
        enter_piece(pieces, count, first, last, True, True)
        return True
    at = first
    while at < last:
        end, _ = next_piece(position, node, at, last, at, circle, count)
        if end > at + 1 and end < last:
            turn_run(node, facet, first, last, end - first)
            return False
        at = end
    if is_round_trip(turn_of_arc(position, node, first, last, circle, count)):
        enter_piece(pieces, count, first, last, True, True)
        return True
    return False


def turn_run(node: Ints, facet: Ints, first: int, last: int, shift: int) -> None:
    """Let a closed run begin `shift` nodes later."""
    length = last - first
    nodes, facets = node[first:last].copy(), facet[first:last].copy()
    for i in range(length):
        node[first + i], facet[first + i] = nodes[(i + shift) % length], facets[(i + shift) % length]
    node[last] = node[first]


def cut_open(
    position: Floats, node: Ints, first: int, last: int, pieces: Ints, circle: Floats, count: int
) -> tuple[int, bool]:
    """Cut a run from its first node to its last; returns the number of pieces and whether any has several facets."""
    at, begin, proper = first, first, False
    while at < last:
        end, is_round = next_piece(position, node, at, last, begin, circle, count)
        if is_round and abs(turn_round(position, node, at, end, circle[count, 0], circle[count, 1])) > MOST:
            end = (at + end) // 2
        enter_piece(pieces, count, at, end, is_round, False)
        if end > at + 1:
            begin, proper = end, True
        count += 1
        at = end
    return count, proper


def next_piece(
    position: Floats, node: Ints, first: int, last: int, begin: int, circle: Floats, count: int
) -> tuple[int, bool]:
    """Where the piece that begins at a slot ends, and whether it is an arc, whose circle is entered.

    A part of another curve looks like an arc, too; but an arc ends where its circle is left at once, and begins where
    it is entered at once, at slot `begin` or later.
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
    """The slot up to which a run does not turn from a slot on.

    Nodes are looked at many at a time, each time twice as many, for most runs are short or straight.
    """
    end, count = first + 1, 1
    while end < last:
        turning = np.abs(turns_between(position, node[end - 1 : min(end + count, last) + 1])) > TURN
        if turning.any():
            return end + int(np.argmax(turning))
        end, count = end + len(turning), 2 * count
    return end


def turns_between(position: Floats, nodes: Ints) -> Floats:
    """The angles by which a run turns at all of some nodes but the first and the last, as `turn_at` has them."""
    ways = np.diff(position[nodes], axis=0)
    (ux, uy), (wx, wy) = ways[:-1].T, ways[1:].T
    return np.arctan2(ux * wy - uy * wx, ux * wx + uy * wy)


def turn_at(position: Floats, node: Ints, slot: int) -> float:
    """The angle by which a run turns at the node in a slot, positive to the left."""
    a, v, b = node[slot - 1], node[slot], node[slot + 1]
    ux, uy = position[v, 0] - position[a, 0], position[v, 1] - position[a, 1]
    wx, wy = position[b, 0] - position[v, 0], position[b, 1] - position[v, 1]
    return math.atan2(ux * wy - uy * wx, ux * wx + uy * wy)


def on_chord(position: Floats, node: Ints, first: int, last: int) -> bool:
    """Whether all nodes of a piece lie on its chord."""
    ux, uy = (position[node[first + 1 : last + 1]] - position[node[first]]).T
    tx, ty = ux[-1], uy[-1]
    return bool(np.all(np.abs(ux * ty - uy * tx) <= BEND * (tx * tx + ty * ty)))


def arc_end(position: Floats, node: Ints, first: int, last: int) -> int:
    """The slot up to which nodes from a slot on lie on one circle: each on the one through three of those before."""
    end = first + 2
    if end > last:
        return first
    left = turn_at(position, node, first + 1) > 0.0
    while end < last:
        turn = turn_at(position, node, end)
        x, y, radius = circle_through(position, node[first], node[(first + end) // 2], node[end])
        if (turn > 0.0) != left or not off_circle(position, node[end + 1], node[end], x, y, radius) <= CLOSE:
            break
        end += 1
    return end


def off_circle(position: Floats, v: int, beside: int, x: float, y: float, radius: float) -> float:
    """How far node v is off a circle, as a share of how far its facet, to the node beside, leaves that.

    The node beside is on the circle, so that |v - c|^2 - r^2 can be had without the radius, which may be large.
    """
    if radius == np.inf:
        return radius
    dx, dy = position[v, 0] - position[beside, 0], position[v, 1] - position[beside, 1]
    squared = dx * dx + dy * dy
    twice = abs(squared - 2.0 * (dx * (x - position[beside, 0]) + dy * (y - position[beside, 1])))
    noise = 2.0 * radius * ROUNDING * (abs(position[v, 0]) + abs(position[v, 1]))
    return 4.0 * max(0.0, twice - noise) / squared


def circle_through(position: Floats, a: int, b: int, c: int) -> tuple[float, float, float]:
    """Centre and radius of the circle through three nodes; the radius is infinite if they lie on a line."""
    ux, uy = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1]
    wx, wy = position[c, 0] - position[a, 0], position[c, 1] - position[a, 1]
    doubled = 2.0 * (ux * wy - uy * wx)
    if doubled == 0.0:
        return position[a, 0], position[a, 1], np.inf
    uu, ww = ux * ux + uy * uy, wx * wx + wy * wy
    x, y = (wy * uu - uy * ww) / doubled, (ux * ww - wx * uu) / doubled
    return position[a, 0] + x, position[a, 1] + y, math.hypot(x, y)


def circle_of_part(position: Floats, node: Ints, first: int, last: int) -> tuple[float, float, float]:
    """The circle through the ends of a part of a run and a node between, or two nodes where it ends as it began."""
    if node[first] == node[last]:
        third = (last - first) // 3
        return circle_through(position, node[first], node[first + third], node[first + 2 * third])
    return circle_through(position, node[first], node[(first + last) // 2], node[last])


def circle_of_loop(position: Floats, node: Ints, first: int, last: int, circle: Floats, count: int) -> bool:
    """Whether a closed run is a circle, on which every node lies; the circle is entered."""
    if last - first < FEWEST:
        return False
    x, y, radius = circle_of_part(position, node, first, last)
    for i in range(first, last):
        if not off_circle(position, node[i], node[i + 1], x, y, radius) <= CLOSE:
            return False
    circle[count, 0], circle[count, 1], circle[count, 2] = x, y, radius
    return is_round_trip(turn_round(position, node, first, last, x, y))


def turn_of_arc(position: Floats, node: Ints, first: int, last: int, circle: Floats, count: int) -> float:
    """How far round a whole run goes on a circle that it fits well enough, which is entered; 0 if there is none.

    The circle is that of least squares.
    """
    closed = node[first] == node[last]
    if last - first + (0 if closed else 1) < FEWEST:
        return 0.0
    x, y, radius = fitted_circle(position, node, first, last)
    off = low = high = 0.0
    a, b = node[first], node[last - 1 if closed else last]
    tx, ty = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1]
    length = math.hypot(tx, ty)
    for i in range(first, last + 1):
        px, py = position[node[i], 0], position[node[i], 1]
        off = max(off, abs(math.hypot(px - x, py - y) - radius))
        side = (tx * (py - position[a, 1]) - ty * (px - position[a, 0])) / length
        low, high = min(low, side), max(high, side)
    if not (off <= LOOSE * radius and DISTINCT * off <= high - low):
        return 0.0
    circle[count, 0], circle[count, 1], circle[count, 2] = x, y, radius
    return turn_round(position, node, first, last, x, y)


def turn_round(position: Floats, node: Ints, first: int, last: int, x: float, y: float) -> float:
    """The angle by which a run goes round a point, one way all along; else 0."""
    total = 0.0
    for i in range(first, last):
        angle = angle_between(position, node[i], node[i + 1], x, y)
        if i > first and (angle > 0.0) != (total > 0.0):
            return 0.0
        total += angle
    return total


def is_round_trip(angle: float) -> bool:
    """Whether that is once round."""
    return abs(abs(angle) - 2.0 * math.pi) < 1.0


def angle_between(position: Floats, a: int, b: int, x: float, y: float) -> float:
    """The angle from node a to node b as seen from (x, y)."""
    ax, ay = position[a, 0] - x, position[a, 1] - y
    bx, by = position[b, 0] - x, position[b, 1] - y
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


def fitted_circle(position: Floats, node: Ints, first: int, last: int) -> tuple[float, float, float]:
    """Centre and radius of the circle for which the sum of the squares of |x - c|^2 - r^2 is least (Kasa, 1976).

    A run that ends where it began counts that node twice. Relative to the mean of the nodes the equations are 2 by 2.
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
    position: Floats, node: Ints, pieces: Ints, circle: Floats, longest: Floats, even: Floats, angle: Floats
) -> None:
    """Of every piece the longest facet, the length of facets that would cut off as much of a curve were they all alike,
    and, of round ones, the angle from first to last node, positive to the left.

    A chord of length l cuts ``l^3 / (12 r)`` off a circle of radius r, so theirs is the root of sum l^3 / sum l.
    """
    for p in range(pieces.shape[0]):
        longest[p] = angle[p] = total = cubes = 0.0
        for i in range(pieces[p, FIRST], pieces[p, LAST]):
            a, b = node[i], node[i + 1]
            length = math.hypot(position[b, 0] - position[a, 0], position[b, 1] - position[a, 1])
            longest[p] = max(longest[p], length)
            total, cubes = total + length, cubes + length**3
            if pieces[p, IS_ROUND]:
                angle[p] += angle_between(position, a, b, circle[p, 0], circle[p, 1])
        even[p] = math.sqrt(cubes / total)
