"""Transport of all nodes by a flow, in steps that satisfy the quality rule.

The guard of a single node requires that the other nodes of its elements rest. Here all nodes of an element move
together, so a smooth flow can move nodes over many edge lengths.
"""

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, OWN, SLIDING
from kohonen_adapt.kernels.triangle.chains import nearest_parameter, point_at, tangent_at
from kohonen_adapt.kernels.triangle.geometry import (
    allowed,
    element_quality,
    exceeds_quality,
    quality_bound,
)
from kohonen_adapt.kernels.vectors import (
    divided,
    dot,
    from_to,
    plus,
    plus_square,
    plus_times,
    point,
    put,
    times,
    xy,
)


@kernel
def sum_weights(winners, region, weights, elements, star, mass):
    for e in range(mass.shape[0]):
        mass[e] = 0.0
    for t in range(winners.shape[0]):
        v = winners[t]
        count = 0
        for k in rows_of(star, v):
            count += elements.region[star.element[k]] == region[t]
        for k in rows_of(star, v):
            if elements.region[star.element[k]] == region[t]:
                mass[star.element[k]] += weights[t] / count


@kernel
def find_directions(node, constraints, cluster, count, along):
    """Set the admissible directions of clusters in `along`, shape (c, 3).

    A row is (xx, xy, yy) of the mean of t t^T over the boundary corners of a cluster, with the tangent t, or t = 0 at
    a held node. Clusters without boundary corners may flow in all directions.
    """
    for c in range(count.shape[0]):
        count[c] = along[c, 0] = along[c, 1] = along[c, 2] = 0.0
    for e in range(node.shape[0]):
        for k in range(3):
            v, c = node[e, k], cluster[e]
            if constraints.kind[v] != FREE:
                count[c] += 1.0
            if constraints.kind[v] == SLIDING:
                tangent = tangent_at(constraints.chains, constraints.chain[v, OWN], constraints.parameter[v])
                put(along, c, plus_square(point(along, c), 1.0, tangent))
    for c in range(along.shape[0]):
        if count[c] == 0.0:
            along[c, 0], along[c, 2] = 1.0, 1.0
        else:
            put(along, c, divided(point(along, c), count[c]))


@kernel
def move_with_clusters(star, constraints, cluster, flow, first, last, move):
    kind = constraints.kind
    for v in range(first, last):
        total = (0.0, 0.0)
        count = star.start[v + 1] - star.start[v]
        for k in rows_of(star, v):
            total = plus(total, xy(flow, cluster[star.element[k]]))
        put(move, v, divided(total, count))
        if kind[v] != FREE:
            project_on_boundary(constraints, v, move)


@kernel
def smooth_moves(star, constraints, move, first, last, smoothed):
    kind = constraints.kind
    for v in range(first, last):
        total = (0.0, 0.0)
        count = star.start[v + 1] - star.start[v]
        for k in rows_of(star, v):
            total = plus(total, xy(move, star.ahead[k]))
        if kind[v] != FREE:  # around a free node `behind` is `ahead` in the next row
            count *= 2
            for k in rows_of(star, v):
                total = plus(total, xy(move, star.behind[k]))
        put(smoothed, v, divided(total, count))
        if kind[v] != FREE:
            project_on_boundary(constraints, v, smoothed)


@inner_kernel
def project_on_boundary(constraints, v, move):
    chain = constraints.chain[v, OWN]
    if constraints.kind[v] == HELD or constraints.chains.paired[chain]:
        put(move, v, (0.0, 0.0))
        return
    tangent = tangent_at(constraints.chains, chain, constraints.parameter[v])
    put(move, v, times(dot(tangent, xy(move, v)), tangent))


@kernel
def propose_step(position, constraints, move, fraction, first, last, target, parameter):
    for v in range(first, last):
        put(target, v, plus_times(xy(position, v), fraction, xy(move, v)))
        if constraints.kind[v] == SLIDING and (move[v, 0] != 0.0 or move[v, 1] != 0.0):
            place_on_boundary(target, parameter, constraints, v)


@kernel
def mark_spoiled(position, target, node, floor, first, last, spoiled):
    bound = quality_bound(floor)
    for e in range(first, last):
        x = xy(target, node[e, 0])
        fine = exceeds_quality(bound, from_to(x, target, node[e, 1]), from_to(x, target, node[e, 2]))
        spoiled[e] = not fine and spoils(position, target, node, e, floor)


@inner_kernel
def spoils(position, target, node, e, floor):
    after = element_quality(target, node, e)
    return not allowed(after, element_quality(position, node, e), floor)


@kernel
def move_to_neighbour_mean(target, parameter, node, star, constraints, spoiled):
    # Means repair most elements. Stopped nodes would spoil the elements around, whose other nodes move on.
    kind = constraints.kind
    for e in range(spoiled.shape[0]):
        if spoiled[e]:
            for corner in range(3):
                v = node[e, corner]
                if kind[v] == HELD:
                    continue
                total = (0.0, 0.0)
                count = 2 * (star.start[v + 1] - star.start[v])
                for k in rows_of(star, v):
                    total = plus(total, plus(xy(target, star.ahead[k]), xy(target, star.behind[k])))
                put(target, v, divided(total, count))
                if kind[v] == SLIDING:
                    place_on_boundary(target, parameter, constraints, v)


@kernel
def slow_down(position, target, parameter, node, star, constraints, spoiled, ring, queue):
    """Stop the nodes of spoiled elements and slow the nodes around them.

    `ring`, shape (n,) int32, is the number of edges to the nearest stopped node, initially the number beyond which
    nodes are not slowed. A node moves the fraction of its step that is `ring` over the initial number. All calls of a
    step share `ring`, so that speeds change gradually.
    """
    last = 0
    for e in range(spoiled.shape[0]):
        if spoiled[e]:
            for corner in range(3):
                last = slow_node(position, target, parameter, constraints, node[e, corner], 0, ring, queue, last)
    first = 0
    while first < last:
        v = queue[first]
        first += 1
        for k in rows_of(star, v):
            last = slow_node(position, target, parameter, constraints, star.ahead[k], ring[v] + 1, ring, queue, last)
            if not constraints.inner[v]:  # around an inner node `behind` is `ahead` in the next row
                last = slow_node(
                    position, target, parameter, constraints, star.behind[k], ring[v] + 1, ring, queue, last
                )


@inner_kernel
def slow_node(position, target, parameter, constraints, v, rings, ring, queue, last):
    if rings >= ring[v]:
        return last
    fraction = rings / ring[v]
    ring[v], queue[last] = rings, v
    before = xy(position, v)
    step = times(fraction, from_to(before, target, v))
    put(target, v, plus(before, step))
    if constraints.kind[v] == SLIDING and (step[0] != 0.0 or step[1] != 0.0):  # a stopped node keeps its exact position
        place_on_boundary(target, parameter, constraints, v)
    return last + 1


@inner_kernel
def place_on_boundary(target, parameter, constraints, v):
    chain = constraints.chain[v, OWN]
    chains = constraints.chains
    if not chains.paired[chain]:
        parameter[v] = nearest_parameter(chains, chain, xy(target, v), constraints.parameter[v])
    put(target, v, point_at(chains, chain, parameter[v]))


@kernel
def stop_nodes(position, target, node, star, floor, spoiled, queue):
    last = 0
    for e in range(spoiled.shape[0]):
        if spoiled[e]:
            queue[last] = e
            last += 1
    while last > 0:
        last -= 1
        e = queue[last]
        for corner in range(3):
            v = node[e, corner]
            if target[v, 0] == position[v, 0] and target[v, 1] == position[v, 1]:
                continue
            put(target, v, xy(position, v))
            for k in rows_of(star, v):
                other = star.element[k]
                if not spoiled[other] and spoils(position, target, node, other, floor):
                    spoiled[other] = True
                    queue[last] = other
                    last += 1
