"""The Kohonen map learns: around the winner of every training point the neighbourhood, and the guarded update.

Update, neighbourhood and treatment of outlines are those of Lowther and Mai, "On Automatic Mesh Generation using
Kohonen Maps" (sections II and III).
"""

from .compilation import kernel
from .geometry import (
    FREE,
    HELD,
    SLIDING,
    allowed,
    may_move,
    nearest_parameter,
    point_on_chain,
    star_tolerable,
    worst_in_star,
)
from .search import next_stamp


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
    if not allowed(after, before, floor):
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
    position, elements, star, constraints, points, region, weights, winners, rate, strength, floor, sound, scratch
):
    """Present training points whose winners are known.

    `strength[ring]` is the neighbourhood function, its length the radius plus one. Learning rate times weight is capped
    at 1. Stars marked `sound` need not look back. Neurons are moved here and not in a function of their own: its call
    would take longer than its work.
    """
    kind, inner = constraints.kind, constraints.inner
    queue, stamps, radius, parameter = scratch.queue, scratch.node_stamp, strength.shape[0] - 1, 0.0
    for t in range(points.shape[0]):
        x = points[t]
        stamp, rate_of_point = next_stamp(scratch), min(1.0, rate * weights[t])
        queue[0], stamps[winners[t]] = winners[t], stamp
        first, last = 0, 1
        for ring in range(radius + 1):
            if ring > 0:
                end = gather_ring(elements, star, inner, region[t], queue, first, last, stamps, stamp)
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
