"""The Kohonen map learns: around the winner of every training point the neighbourhood, and the guarded update.

Update, neighbourhood and treatment of outlines are those of Lowther and Mai, "On Automatic Mesh Generation using
Kohonen Maps" (sections II and III).
"""

from .chains import (
    FREE,
    HELD,
    SLIDING,
    distance_to_chain,
    gone_along,
    nearest_parameter,
    parameter_of,
    point_at,
    way_along,
    within_reach,
)
from .compilation import kernel
from .geometry import allowed, may_move, star_tolerable, worst_in_star
from .search import next_stamp


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
def jump(position, elements, star, constraints, v, x, y, step, floor):
    """The jump around a corner (the paper's Fig. 3): v goes on along the nearer chain, its follower takes over."""
    chains, onto, away = constraints.chains, constraints.chain[v, 0], constraints.chain[v, 1]
    corner_x, corner_y = position[v, 0], position[v, 1]
    corner, corner_away = parameter_of(position, constraints, onto, v), parameter_of(position, constraints, away, v)
    distance, target = distance_to_chain(chains, onto, x, y, corner)
    distance_away, target_away = distance_to_chain(chains, away, x, y, corner_away)
    if distance_away < distance:
        onto, away, corner, target = away, onto, corner_away, target_away
    next_node = follower(elements, star, constraints, v, away)
    parameter = corner + step * (target - corner)
    if next_node < 0 or parameter == corner or elements.level[next_node] != elements.level[v]:
        return
    if not within_reach(position, elements, star, chains, away, next_node, corner_x, corner_y):
        return
    before = worst_of_two(position, star, v, next_node)
    next_x, next_y = position[next_node, 0], position[next_node, 1]
    position[v, 0], position[v, 1] = point_at(chains, onto, parameter)
    position[next_node, 0], position[next_node, 1] = corner_x, corner_y
    if not allowed(worst_of_two(position, star, v, next_node), before, floor):
        position[v, 0], position[v, 1] = corner_x, corner_y
        position[next_node, 0], position[next_node, 1] = next_x, next_y
        return
    hand_over(constraints, v, next_node, onto, away, parameter)
    relabel_edge(elements, star, v, next_node, onto)


@kernel
def worst_of_two(position, star, v, w):
    """Worst signed quality of the stars of two nodes."""
    return min(
        worst_in_star(position, star, v, position[v, 0], position[v, 1]),
        worst_in_star(position, star, w, position[w, 0], position[w, 1]),
    )


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
    kind, inner, chains = constraints.kind, constraints.inner, constraints.chains
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
                    target = nearest_parameter(chains, chain, x[0], x[1], parameter)
                    parameter = gone_along(chains, chain, parameter, step * way_along(chains, chain, parameter, target))
                    new_x, new_y = point_at(chains, chain, parameter)
                    if not within_reach(position, elements, star, chains, chain, v, new_x, new_y):
                        continue
                else:
                    if constraints.chain[v, 1] >= 0:
                        jump(position, elements, star, constraints, v, x[0], x[1], step, floor)
                    continue
                if star_tolerable(position, star, v, new_x, new_y, floor) or (
                    not sound[v] and may_move(position, star, v, new_x, new_y, floor)
                ):
                    position[v, 0], position[v, 1] = new_x, new_y
                    if kind[v] == SLIDING:
                        constraints.parameter[v] = parameter
