"""Move the nodes around the winner of every training point towards it, each step guarded.

Update, neighbourhood and treatment of outlines are those of Lowther and Mai, "On Automatic Mesh Generation using
Kohonen Maps" (sections II and III).
"""

import numpy as np

from kohonen_adapt.kernels.arrays import FREE, JUNCTION, OTHER, OWN, PAIRED, SLIDING
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import gone_along, nearest_parameter, point_at, way_along, within_reach
from kohonen_adapt.kernels.triangle.geometry import may_move, slide_pair, star_tolerable
from kohonen_adapt.kernels.triangle.jump import jump, jump_at_junction
from kohonen_adapt.kernels.triangle.search import next_stamp


@inner_kernel
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


@inner_kernel
def reach_beyond(position, elements, star, constraints, x, region, rate, strength, rings, floor, scratch):
    """Let a point also reach those around it that lie beyond a periodic boundary, where its image is.

    Ring r of the nodes that it has reached stands in ``scratch.queue[rings[r] : rings[r + 1]]``. On the other side the
    rings begin at the partners of those, each with its own number; the partners have moved already.
    """
    twins, queue, stamps = constraints.twins, scratch.queue, scratch.node_stamp
    reached = rings[-1]
    for m in range(twins.motions.shape[0]):
        there, stamp = twins.region[m, region], next_stamp(scratch)
        if there < 0:
            continue
        motion = twins.motions[m]
        image_x = motion[0, 0] * x[0] + motion[0, 1] * x[1] + motion[0, 2]
        image_y = motion[1, 0] * x[0] + motion[1, 1] * x[1] + motion[1, 2]
        first, last = reached, reached
        for ring in range(strength.shape[0]):
            if last > first:
                end = gather_ring(elements, star, constraints.inner, there, queue, first, last, stamps, stamp)
                first, last = last, end
                for i in range(first, last):
                    follow_image(
                        position,
                        elements,
                        star,
                        constraints,
                        np.int64(queue[i]),
                        image_x,
                        image_y,
                        rate * strength[ring],
                        floor,
                    )
            for i in range(rings[ring], rings[ring + 1]):
                v = queue[i]
                if twins.motion[v] == m and stamps[twins.partner[v]] != stamp:
                    stamps[twins.partner[v]] = stamp
                    queue[last] = twins.partner[v]
                    last += 1


@inner_kernel
def follow_image(position, elements, star, constraints, v, x, y, step, floor):
    """Move one neuron towards (x, y), guarded; corners and those with a partner stay."""
    chains, chain = constraints.chains, np.int64(constraints.chain[v, OWN])
    if constraints.kind[v] == FREE:
        new_x, new_y = position[v, 0] + step * (x - position[v, 0]), position[v, 1] + step * (y - position[v, 1])
        if may_move(position, star, v, new_x, new_y, floor):
            position[v, 0], position[v, 1] = new_x, new_y
    elif constraints.kind[v] == SLIDING and not chains.flags[chain, PAIRED]:
        parameter = constraints.parameter[v]
        target = nearest_parameter(chains, chain, x, y, parameter)
        parameter = gone_along(chains, chain, parameter, step * way_along(chains, chain, parameter, target))
        new_x, new_y = point_at(chains, chain, parameter)
        if within_reach(position, elements, star, chains, chain, v, new_x, new_y) and may_move(
            position, star, v, new_x, new_y, floor
        ):
            position[v, 0], position[v, 1], constraints.parameter[v] = new_x, new_y, parameter


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
    periodic, rings = constraints.twins.motions.shape[0] > 0, np.zeros(strength.shape[0] + 1, dtype=np.int64)
    for t in range(points.shape[0]):
        x = points[t]
        stamp, rate_of_point = next_stamp(scratch), min(1.0, rate * weights[t])
        queue[0], stamps[winners[t]] = winners[t], stamp
        first, last = np.int64(0), np.int64(1)
        for ring in range(radius + 1):
            if ring > 0:
                end = gather_ring(elements, star, inner, region[t], queue, first, last, stamps, stamp)
                first, last = last, end
            step, rings[ring + 1] = rate_of_point * strength[ring], last
            for i in range(first, last):
                v = np.int64(queue[i])
                if kind[v] == FREE:
                    new_x = position[v, 0] + step * (x[0] - position[v, 0])
                    new_y = position[v, 1] + step * (x[1] - position[v, 1])
                elif kind[v] == SLIDING:
                    chain, parameter = np.int64(constraints.chain[v, OWN]), constraints.parameter[v]
                    target = nearest_parameter(chains, chain, x[0], x[1], parameter)
                    parameter = gone_along(chains, chain, parameter, step * way_along(chains, chain, parameter, target))
                    if chains.flags[chain, PAIRED]:
                        slide_pair(position, elements, star, constraints, v, parameter, floor)
                        continue
                    new_x, new_y = point_at(chains, chain, parameter)
                    if not within_reach(position, elements, star, chains, chain, v, new_x, new_y):
                        continue
                else:
                    if constraints.chain[v, OTHER] >= 0:
                        jump(position, elements, star, constraints, v, x[0], x[1], step, floor)
                    elif ring == 0 and constraints.chain[v, OWN] == JUNCTION:  # drawn along by others it would wander
                        jump_at_junction(position, elements, star, constraints, v, x[0], x[1], step, floor)
                    continue
                if star_tolerable(position, star, v, new_x, new_y, floor) or (
                    not sound[v] and may_move(position, star, v, new_x, new_y, floor)
                ):
                    position[v, 0], position[v, 1] = new_x, new_y
                    if kind[v] == SLIDING:
                        constraints.parameter[v] = parameter
        if periodic:
            reach_beyond(
                position, elements, star, constraints, x, region[t], rate_of_point, strength, rings, floor, scratch
            )
