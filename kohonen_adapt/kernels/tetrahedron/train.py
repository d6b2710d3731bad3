"""Training of the map, with guarded moves of the nodes around each winner.

Update, neighbourhood and boundaries are those of Lowther and Mai, "On Automatic Mesh Generation using Kohonen
Maps" (sections II and III), with patches and ridges instead of boundary lines. Unlike in the plane, nodes at corners
stay: exchanges of corners lower the quantisation error by less than 1 % on tetrahedra.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.search import next_stamp
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE
from kohonen_adapt.kernels.tetrahedron.guard import may_move, star_tolerable
from kohonen_adapt.kernels.tetrahedron.surfaces import slid, within_reach
from kohonen_adapt.kernels.vectors import minus, point, put, times


@kernel
def learn(mesh, lesson, rate, floor, is_valid, scratch):
    """Train the map with points whose winners are known.

    The learning rate times the weight is at most 1. Stars marked `is_valid` are not compared with their former
    quality. Returned are the numbers of moves that the quality and the reach refused.
    """
    by_quality, by_reach = 0, 0
    position, elements, star, constraints = mesh.position, mesh.elements, mesh.star, mesh.constraints
    freedom, surfaces, metric = constraints.freedom, constraints.surfaces, constraints.metric
    queue, stamps = scratch.queue, scratch.node_stamp
    for t in range(lesson.points.shape[0]):
        x = point(lesson.points, t)
        region = lesson.region[t]
        stamp, rate_of_point = next_stamp(scratch), min(1.0, rate * lesson.weights[t])
        queue[0] = lesson.winners[t]
        stamps[lesson.winners[t]] = stamp
        first, last = 0, 1
        for ring in range(lesson.strength.shape[0]):
            if ring > 0:
                end = gather_ring(mesh, region, scratch, first, last, stamp)
                first, last = last, end
            step = rate_of_point * lesson.strength[ring]
            for i in range(first, last):
                v = queue[i]
                if freedom.number[v] == HELD:
                    continue
                y = slid(position, constraints, v, times(step, minus(x, point(position, v))))
                if freedom.number[v] != INSIDE and not (
                    np.isfinite(y[0] + y[1] + y[2]) and within_reach(position, elements, star, surfaces, v, y)
                ):
                    by_reach += 1
                    continue
                if star_tolerable(position, star, metric, v, y, floor) or (
                    not is_valid[v] and may_move(position, star, metric, v, y, floor)
                ):
                    put(position, v, y)
                else:
                    by_quality += 1
    return by_quality, by_reach


@inner_kernel
def gather_ring(mesh, region, scratch, first, last, stamp):
    elements, star, inner = mesh.elements, mesh.star, mesh.constraints.inner
    queue, stamps = scratch.queue, scratch.node_stamp
    end = last
    for i in range(first, last):
        v = queue[i]
        for k in rows_of(star, v):
            if inner[v] or elements.region[star.element[k]] == region:
                for j in range(3):
                    other = star.link[k, j]
                    if stamps[other] != stamp:
                        stamps[other] = stamp
                        queue[end] = other
                        end += 1
    return end
