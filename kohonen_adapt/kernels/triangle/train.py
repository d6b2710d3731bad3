"""Training of a Kohonen map by guarded moves of nodes towards random points.

Update, neighbourhood and boundaries follow Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps",
sections II and III. A corner passes from a node to a neighbour, so that nodes move from segment to segment (Fig.
3).
"""

from kohonen_adapt.kernels.arrays import BY_QUALITY, BY_REACH
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.search import next_stamp
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, OTHER, OWN, SLIDING
from kohonen_adapt.kernels.triangle.chains import (
    advanced_parameter,
    distance_to_chain,
    nearest_parameter,
    parameter_of,
    point_at,
    signed_distance,
    slide_pair,
    within_reach,
)
from kohonen_adapt.kernels.triangle.geometry import allowed
from kohonen_adapt.kernels.triangle.guard import may_move, star_tolerable, worst_around
from kohonen_adapt.kernels.vectors import minus, plus_times, put, xy


@kernel
def learn(mesh, lesson, rate, floor, is_valid, scratch):
    """Move the winners of training points and their neighbours towards the points.

    The learning rate times the weight is limited to 1. Stars marked `is_valid` satisfy the floor and need no comparison
    with the quality before. Returned are the numbers of moves that the quality and the reach refused.
    """
    position, star, constraints = mesh.position, mesh.star, mesh.constraints
    points, region, weights, winners = lesson.points, lesson.region, lesson.weights, lesson.winners
    strength = lesson.strength
    kind, chains, metric = constraints.kind, constraints.chains, constraints.metric
    queue, stamps = scratch.queue, scratch.node_stamp
    radius = strength.shape[0] - 1
    parameter = 0.0
    by_quality, by_reach = 0, 0
    for t in range(points.shape[0]):
        x = xy(points, t)
        stamp, rate_of_point = next_stamp(scratch), min(1.0, rate * weights[t])
        queue[0] = winners[t]
        stamps[winners[t]] = stamp
        first, last = 0, 1
        for ring in range(radius + 1):
            if ring > 0:
                end = gather_ring(mesh, region[t], queue, first, last, stamps, stamp)
                first, last = last, end
            step = rate_of_point * strength[ring]
            for i in range(first, last):  # moves are inlined, because calls would take longer
                v = queue[i]
                if kind[v] == FREE:
                    before = xy(position, v)
                    there = plus_times(before, step, minus(x, before))
                elif kind[v] == SLIDING:
                    chain = constraints.chain[v, OWN]
                    parameter = stepped_parameter(constraints, chain, v, x, step)
                    if chains.paired[chain]:
                        cause = slide_pair(mesh, v, parameter, floor)
                        by_quality += cause == BY_QUALITY
                        by_reach += cause == BY_REACH
                        continue
                    there = point_at(chains, chain, parameter)
                    if not within_reach(mesh, chain, v, there):
                        by_reach += 1
                        continue
                else:
                    if constraints.chain[v, OTHER] >= 0:
                        jump(mesh, v, x, step, floor)
                    continue
                if star_tolerable(position, star, metric, v, there, floor) or (
                    not is_valid[v] and may_move(position, star, metric, v, there, floor)
                ):
                    put(position, v, there)
                    if kind[v] == SLIDING:
                        constraints.parameter[v] = parameter
                else:
                    by_quality += 1
    return by_quality, by_reach


@inner_kernel
def gather_ring(mesh, region, queue, first, last, stamps, stamp):
    elements, star, inner = mesh.elements, mesh.star, mesh.constraints.inner
    end = last
    for i in range(first, last):
        v = queue[i]
        if inner[v]:
            for k in rows_of(star, v):
                other = star.ahead[k]
                queue[end] = other  # overwritten unless new, because a branch would be unpredictable
                end += stamps[other] != stamp
                stamps[other] = stamp
            continue
        for k in rows_of(star, v):
            if elements.region[star.element[k]] != region:
                continue
            for other in (star.ahead[k], star.behind[k]):
                if stamps[other] != stamp:
                    stamps[other] = stamp
                    queue[end] = other
                    end += 1
    return end


@inner_kernel
def stepped_parameter(constraints, chain, v, x, step):
    chains = constraints.chains
    parameter = constraints.parameter[v]
    distance = signed_distance(chains, chain, parameter, nearest_parameter(chains, chain, x, parameter))
    return advanced_parameter(chains, chain, parameter, step * distance)


@inner_kernel
def sliding_neighbour(elements, star, constraints, corner, chain):
    found = -1
    for k in rows_of(star, corner):
        e = star.element[k]
        outlines = 0
        for j in range(3):
            if elements.node[e, j] == corner:
                continue
            if elements.chain[e, j] >= 0:
                outlines += 1
            if elements.chain[e, j] == chain:
                found = star.ahead[k] + star.behind[k] - elements.node[e, j]
        if outlines == 2:  # the element would be flat without the corner
            return -1
    if found >= 0 and constraints.kind[found] == SLIDING and constraints.chain[found, OWN] == chain:
        return found
    return -1


@inner_kernel
def relabel_edge(elements, star, a, b, chain):
    for k in rows_of(star, a):
        e = star.element[k]
        if star.ahead[k] != b and star.behind[k] != b:
            continue
        for j in range(3):
            if elements.node[e, j] != a and elements.node[e, j] != b:
                elements.chain[e, j] = chain


@inner_kernel
def jump(mesh, v, x, step, floor):
    position, elements, star, constraints = mesh.position, mesh.elements, mesh.star, mesh.constraints
    chains = constraints.chains
    onto, away = constraints.chain[v, OWN], constraints.chain[v, OTHER]
    corner, corner_away = parameter_of(position, constraints, onto, v), parameter_of(position, constraints, away, v)
    distance, target = distance_to_chain(chains, onto, x, corner)
    distance_away, target_away = distance_to_chain(chains, away, x, corner_away)
    if distance_away < distance:
        onto, away, corner, target = away, onto, corner_away, target_away
    next_node = sliding_neighbour(elements, star, constraints, v, away)
    parameter = corner + step * (target - corner)
    if next_node < 0 or parameter == corner or elements.level[next_node] != elements.level[v]:
        return
    if not within_reach(mesh, away, next_node, xy(position, v)):
        return
    if not swap_nodes(position, star, constraints, v, next_node, onto, parameter, floor):
        return
    hand_over(constraints, v, next_node, onto, away, parameter)
    relabel_edge(elements, star, v, next_node, onto)


@inner_kernel
def swap_nodes(position, star, constraints, v, next_node, onto, parameter, floor):
    before = worst_of_two(position, star, constraints.metric, v, next_node)
    corner, old = xy(position, v), xy(position, next_node)
    put(position, v, point_at(constraints.chains, onto, parameter))
    put(position, next_node, corner)
    if allowed(worst_of_two(position, star, constraints.metric, v, next_node), before, floor):
        return True
    put(position, v, corner)
    put(position, next_node, old)
    return False


@inner_kernel
def worst_of_two(position, star, metric, v, w):
    return min(
        worst_around(position, star, metric, v, xy(position, v)),
        worst_around(position, star, metric, w, xy(position, w)),
    )


@inner_kernel
def hand_over(constraints, v, next_node, onto, away, parameter):
    constraints.kind[next_node], constraints.kind[v] = HELD, SLIDING
    constraints.chain[next_node, OWN], constraints.chain[next_node, OTHER] = onto, away
    constraints.chain[v, OWN], constraints.chain[v, OTHER] = onto, -1
    constraints.parameter[v] = parameter
