"""One epoch of the Kohonen map: for every training point the winner, its neighbourhood, and the guarded update.

Update, neighbourhood and treatment of outlines are those of Lowther and Mai, "On Automatic Mesh Generation using
Kohonen Maps" (sections II and III).
"""

from typing import NamedTuple

import numpy as np

from .compilation import kernel
from .geometry import (
    FLAT,
    FREE,
    HELD,
    SLIDING,
    mark_sound,
    may_move,
    nearest_parameter,
    point_on_chain,
    squared_distance,
    squared_distance_to_edge,
    star_tolerable,
    tolerable,
    worst_in_star,
)
from .locate import TOLERANCE, depth_in_element, walk


class Scratch(NamedTuple):
    """Room that an epoch works in; the stamps are compared with a counter that only grows."""

    node_stamp: np.ndarray  # (n,) int64
    element_stamp: np.ndarray  # (m,) int64
    counter: np.ndarray  # (1,) int64
    queue: np.ndarray  # (max(n, m) + 1,) int32
    frontier: np.ndarray  # (m,) int32: elements that the flood may enter
    reach: np.ndarray  # (m,) float64: squared distance from the point to the edge it would enter through
    sound: np.ndarray  # (n,) bool: stars that the quality rule finds nothing wrong with
    trial: np.ndarray  # (d,) a position


@kernel
def next_stamp(scratch):
    """A stamp that nothing carries yet."""
    scratch.counter[0] += 1
    return scratch.counter[0]


@kernel
def closest_neighbour(position, elements, star, inner, v, x, region):
    """The neighbour of v within the region that is nearest to x, if nearer than v itself, else v."""
    best, nearest = squared_distance(position, v, x), v
    for k in range(star.start[v], star.start[v + 1]):
        if inner[v] or elements.region[star.element[k]] == region:
            distance = squared_distance(position, star.ahead[k], x)
            if distance < best:
                best, nearest = distance, star.ahead[k]
            if not inner[v]:  # around an inner node the one behind is the next element's ahead
                distance = squared_distance(position, star.behind[k], x)
                if distance < best:
                    best, nearest = distance, star.behind[k]
    return nearest


@kernel
def element_in_region(elements, star, v, region):
    """One of the elements around v that belong to the region."""
    for k in range(star.start[v], star.start[v + 1]):
        if elements.region[star.element[k]] == region:
            return star.element[k]
    return star.element[star.start[v]]


@kernel
def holding_element(position, elements, star, v, x, region, scratch):
    """The element of the region that holds x: a walk that starts at v, and where that is blocked a flood."""
    e = element_in_region(elements, star, v, region)
    e, inside = walk(position, elements, e, x[0], x[1])
    if inside:
        return e
    stamp, queue = next_stamp(scratch), scratch.queue
    queue[0], scratch.element_stamp[e] = e, stamp
    first, last = 0, 1
    best, deepest = e, -np.inf
    while first < last and deepest < -TOLERANCE:
        e = queue[first]
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


@kernel
def nearest_reached(position, elements, e, x, scratch):
    """The circle check: the nearest node that x reaches from element e within its region, ties to the lowest index.

    A node counts if the disc around x that just reaches it joins it to x within the region. So every element carries
    the least distance that a way to it must go to (that of the farthest edge it crosses), elements are entered in the
    order of it, and a node nearer than that does not count: it lies behind a slit or a corner that the disc misses.
    """
    stamp, frontier, reach = next_stamp(scratch), scratch.frontier, scratch.reach
    region = elements.region[e]
    frontier[0], reach[0], scratch.element_stamp[e] = e, 0.0, stamp
    count, winner, best = 1, -1, np.inf
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
            v = elements.node[e, k]
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


@kernel
def find_winner(position, elements, star, inner, v, x, region, scratch):
    """Walk from node v to ever closer neighbours, then check the circle; returns winner, distance and steps walked."""
    steps = 0
    while True:
        nearest = closest_neighbour(position, elements, star, inner, v, x, region)
        if nearest == v:
            break
        v = nearest
        steps += 1
    e = holding_element(position, elements, star, v, x, region, scratch)
    winner, squared = nearest_reached(position, elements, e, x, scratch)
    return winner, np.sqrt(squared), steps


@kernel
def distance_to_chain(constraints, c, x):
    """Squared distance from x to the chain's nearest point, and the arc length of that point."""
    parameter = nearest_parameter(constraints, c, x)
    total = 0.0
    for k in range(x.shape[0]):
        difference = x[k] - constraints.origin[c, k] - parameter * constraints.direction[c, k]
        total += difference * difference
    return total, parameter


@kernel
def follower(elements, star, constraints, corner, chain):
    """The sliding node next to a corner on a chain, or -1; -1 as well where the corner would leave a flat ear."""
    found = -1
    for k in range(star.start[corner], star.start[corner + 1]):
        e, outlines = star.element[k], 0
        for j in range(3):
            if elements.node[e, j] == corner:
                continue
            if elements.chain[e, j] >= 0:
                outlines += 1
            if elements.chain[e, j] == chain:
                found = star.ahead[k] + star.behind[k] - elements.node[e, j]
        if outlines == 2:
            return -1
    if found >= 0 and constraints.kind[found] == SLIDING and constraints.chain[found, 0] == chain:
        return found
    return -1


@kernel
def relabel_edge(elements, star, a, b, chain):
    """Hand the edge ab to another chain, in the elements on both sides of it."""
    for k in range(star.start[a], star.start[a + 1]):
        e = star.element[k]
        if star.ahead[k] != b and star.behind[k] != b:
            continue
        for j in range(3):
            if elements.node[e, j] != a and elements.node[e, j] != b:
                elements.chain[e, j] = chain


@kernel
def jump(position, elements, star, constraints, v, x, step, floor, trial):
    """The jump around a corner (the paper's Fig. 3): v goes on along the nearer chain, its follower takes over."""
    onto, away = constraints.chain[v, 0], constraints.chain[v, 1]
    distance, target = distance_to_chain(constraints, onto, x)
    distance_away, target_away = distance_to_chain(constraints, away, x)
    if distance_away < distance:
        onto, away, target = away, onto, target_away
    next_node = follower(elements, star, constraints, v, away)
    corner = nearest_parameter(constraints, onto, position[v])
    parameter = corner + step * (target - corner)
    if next_node < 0 or parameter == corner:
        return
    before = min(
        worst_in_star(position, star, v, position[v, 0], position[v, 1]),
        worst_in_star(position, star, next_node, position[next_node, 0], position[next_node, 1]),
    )
    point_on_chain(constraints, onto, parameter, trial)
    for k in range(trial.shape[0]):
        trial[k], position[v, k], position[next_node, k] = position[next_node, k], trial[k], position[v, k]
    after = min(
        worst_in_star(position, star, v, position[v, 0], position[v, 1]),
        worst_in_star(position, star, next_node, position[next_node, 0], position[next_node, 1]),
    )
    if not (tolerable(after, floor) or (after > FLAT and after >= before)):
        for k in range(trial.shape[0]):
            position[v, k], position[next_node, k] = position[next_node, k], trial[k]
        return
    hand_over(constraints, v, next_node, onto, away, parameter)
    relabel_edge(elements, star, v, next_node, onto)


@kernel
def hand_over(constraints, v, next_node, onto, away, parameter):
    """The corner's constraint goes to the follower, and v slides from now on."""
    constraints.kind[next_node], constraints.kind[v] = HELD, SLIDING
    constraints.chain[next_node, 0], constraints.chain[next_node, 1] = onto, away
    constraints.chain[v, 0], constraints.chain[v, 1] = onto, -1
    constraints.parameter[v] = parameter


@kernel
def gather_ring(elements, star, inner, region, queue, first, last, stamps, stamp):
    """Append the next ring of neighbours within the region to the queue; returns its new end.

    Around inner nodes every neighbour is written and only new ones are kept: which are new no branch could predict.
    """
    end = last
    for i in range(first, last):
        v = queue[i]
        if inner[v]:
            for k in range(star.start[v], star.start[v + 1]):
                other = star.ahead[k]
                queue[end] = other
                end += stamps[other] != stamp
                stamps[other] = stamp
            continue
        for k in range(star.start[v], star.start[v + 1]):
            if elements.region[star.element[k]] != region:
                continue
            for other in (star.ahead[k], star.behind[k]):
                if stamps[other] != stamp:
                    stamps[other] = stamp
                    queue[end] = other
                    end += 1
    return end


@kernel
def learn(
    position, elements, star, constraints, points, region, slot, winners, weights, rate, strength, floor, scratch
):
    """Present training points; returns the sum of their distances to their winners and the number of search steps.

    `winners[slot[t]]` is the last winner of point t (or of points like it): the search starts there, and the new one
    is kept there. `strength[ring]` is the neighbourhood function, its length the radius plus one. Learning rate times
    weight is capped at 1. Neurons are moved here and not in a function of their own: its call would take longer than
    its work.
    """
    kind, inner, sound = constraints.kind, constraints.inner, scratch.sound
    queue, radius = scratch.queue, strength.shape[0] - 1
    mark_sound(position, star, floor, sound)
    total, steps, parameter = 0.0, 0, 0.0
    for t in range(points.shape[0]):
        x = points[t]
        winner, distance, walked = find_winner(
            position, elements, star, inner, np.int64(winners[slot[t]]), x, region[t], scratch
        )
        winners[slot[t]] = winner
        total += distance
        steps += walked
        stamp, rate_of_point = next_stamp(scratch), min(1.0, rate * weights[t])
        queue[0], scratch.node_stamp[winner] = winner, stamp
        first, last = 0, 1
        for ring in range(radius + 1):
            if ring > 0:
                end = gather_ring(elements, star, inner, region[t], queue, first, last, scratch.node_stamp, stamp)
                first, last = last, end
            step = rate_of_point * strength[ring]
            for i in range(first, last):
                v = queue[i]
                if kind[v] == FREE:
                    new_x = position[v, 0] + step * (x[0] - position[v, 0])
                    new_y = position[v, 1] + step * (x[1] - position[v, 1])
                elif kind[v] == SLIDING:
                    chain, parameter = constraints.chain[v, 0], constraints.parameter[v]
                    parameter += step * (nearest_parameter(constraints, chain, x) - parameter)
                    new_x = constraints.origin[chain, 0] + parameter * constraints.direction[chain, 0]
                    new_y = constraints.origin[chain, 1] + parameter * constraints.direction[chain, 1]
                else:
                    if constraints.chain[v, 1] >= 0:
                        jump(position, elements, star, constraints, v, x, step, floor, scratch.trial)
                    continue
                if star_tolerable(position, star, v, new_x, new_y, floor) or (
                    not sound[v] and may_move(position, star, v, new_x, new_y, floor)
                ):
                    position[v, 0], position[v, 1] = new_x, new_y
                    if kind[v] == SLIDING:
                        constraints.parameter[v] = parameter
    return total, steps


@kernel
def search_path(position, elements, star, inner, v, x, region, scratch, path):
    """The nodes that the search for the winner of x visits from v on, the winner last; returns their number."""
    path[0], count = v, 1
    while True:
        nearest = closest_neighbour(position, elements, star, inner, v, x, region)
        if nearest == v:
            break
        v = nearest
        path[count] = v
        count += 1
    winner = find_winner(position, elements, star, inner, v, x, region, scratch)[0]
    if winner != v:
        path[count] = winner
        count += 1
    return count


@kernel
def ball_means(elements, star, inner, mass, centres, radius, scratch, mean):
    """Mean of a nodal quantity over the nodes within `radius` rings of each centre, in one region of it."""
    queue, stamps = scratch.queue, scratch.node_stamp
    for i in range(centres.shape[0]):
        stamp, region = next_stamp(scratch), elements.region[star.element[star.start[centres[i]]]]
        queue[0], stamps[centres[i]] = centres[i], stamp
        first, last = 0, 1
        for _ in range(radius):
            first, last = last, gather_ring(elements, star, inner, region, queue, first, last, stamps, stamp)
        total = 0.0
        for j in range(last):
            total += mass[queue[j]]
        mean[i] = total / last
