"""Winners of training points on triangles.

The search follows Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps", section III.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import CROSSINGS
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.search import (
    TOLERANCE,
    WALK,
    element_in_region,
    flood,
    nearest_visible,
    size_at_side,
    walk_in_region,
)
from kohonen_adapt.kernels.triangle.chains import distance_to_chain, parameter_of
from kohonen_adapt.kernels.triangle.metric import factor_at
from kohonen_adapt.kernels.vectors import cross, dot, from_to, mapped, minus, squared_distance, xy

STRETCH = 256  # consecutive points whose searches may start at the previous winner


@inner_kernel
def find_element(mesh, v, x, region, scratch):
    position, elements = mesh.position, mesh.elements
    e, inside = walk_in_region(mesh, v, x, region)
    # A point between a curve and its facets may lie in no element of the region; the element at the facet counts.
    if inside or behind_curve(position, elements, mesh.constraints, e, x):
        return e
    return flood(position, elements, e, x, scratch)


@inner_kernel
def behind_curve(position, elements, constraints, e, x):
    chains = constraints.chains
    for k in range(3):
        c = elements.chain[e, k]
        if c >= 0 and chains.sagitta[c] > 0.0 and size_at_side(position, elements.node, e, k, x) < 0.0:
            near = parameter_of(position, constraints, c, elements.node[e, (k + 1) % 3])
            if distance_to_chain(chains, c, x, near)[0] <= chains.sagitta[c] * chains.sagitta[c]:
                return True
    return False


@inner_kernel
def find_winner(mesh, v, x, map_, region, scratch):
    e = find_element(mesh, v, x, region, scratch)
    winner, squared = nearest_visible(mesh.position, mesh.elements, e, x, map_, scratch)
    return winner, np.sqrt(squared)


@kernel
def find_winners(mesh, points, shape, region, start_nodes, winners, distances, scratch):
    """Find the winner and its distance for every point, in a metric.

    `shape` (t, 3) are the shapes at the points, `start_nodes` are nodes in the regions of the points, preferably former
    winners. The search begins at the previous winner if nearer, except at every STRETCH-th point, where points may be
    divided among threads. From the element that contains the point the search crosses every edge cut by the circle
    through the nearest node so far. `find_winner` searches again if the circle cuts a boundary.
    """
    position, elements, star, inner = mesh.position, mesh.elements, mesh.star, mesh.constraints.inner
    node, neighbour, regions, crossed = elements.node, elements.neighbour, elements.region, scratch.crossed
    for t in range(points.shape[0]):
        x = xy(points, t)
        own = region[t]
        v = start_nodes[t]
        if t % STRETCH > 0 and region[t - 1] == own:
            other = winners[t - 1]
            v = other if squared_distance(position, other, x) < squared_distance(position, v, x) else v
        map_ = factor_at(shape, t)
        e = int(star.element[star.start[v]])  # the walk is inlined, because calls would take longer
        if not inner[v]:
            e = int(element_in_region(elements, star, v, own))
        found = False
        for _ in range(WALK):
            a, b = mapped(map_, from_to(x, position, node[e, 0])), mapped(map_, from_to(x, position, node[e, 1]))
            c = mapped(map_, from_to(x, position, node[e, 2]))
            side_a, side_b, side_c = cross(b, c), cross(c, a), cross(a, b)
            k, least = 0, side_a
            if side_b < least:
                k, least = 1, side_b
            if side_c < least:
                k, least = 2, side_c
            if least >= -TOLERANCE * (side_a + side_b + side_c):
                found = True
                break
            across = int(neighbour[e, k])
            if across < 0 or regions[across] != own:
                break
            e = across
        if found:
            winner, best = int(node[e, 0]), dot(a, a)
            distance = dot(b, b)
            if distance < best or (distance == best and node[e, 1] < winner):
                winner = int(node[e, 1])
                best = distance
            distance = dot(c, c)
            if distance < best or (distance == best and node[e, 2] < winner):
                winner = int(node[e, 2])
                best = distance
            count = crossings = 0
            for k in range(3):
                if k == 0:
                    p, q, side = b, c, side_a
                elif k == 1:
                    p, q, side = c, a, side_b
                else:
                    p, q, side = a, b, side_c
                if cuts(p, q, side, best):
                    crossed[count, 0], crossed[count, 1] = e, k
                    count += 1
            while count > 0 and found:
                count -= 1
                e, k = int(crossed[count, 0]), int(crossed[count, 1])
                f = int(neighbour[e, k])
                crossings += 1
                if f < 0 or regions[f] != own or crossings == CROSSINGS:
                    found = False
                    break
                j = 0 if neighbour[f, 0] == e else (1 if neighbour[f, 1] == e else 2)
                w = mapped(map_, from_to(x, position, node[f, j]))
                distance = dot(w, w)
                if distance < best or (distance == best and node[f, j] < winner):
                    winner = int(node[f, j])
                    best = distance
                p = mapped(map_, from_to(x, position, node[e, (k + 1) % 3]))
                q = mapped(map_, from_to(x, position, node[e, (k + 2) % 3]))
                # in f = (w, q, p) the edge pw is opposite to q, and wq to p
                if cuts(p, w, cross(p, w), best):
                    crossed[count, 0] = f
                    crossed[count, 1] = (j + 1) % 3
                    count += 1
                if cuts(w, q, cross(w, q), best):
                    crossed[count, 0] = f
                    crossed[count, 1] = (j + 2) % 3
                    count += 1
        if found:
            winners[t], distances[t] = winner, np.sqrt(best)
        else:
            winner, distance = find_winner(mesh, v, x, map_, own, scratch)
            winners[t], distances[t] = winner, distance


@inner_kernel
def cuts(p, q, side, best):
    edge = minus(q, p)
    length = dot(edge, edge)
    return 0.0 < -dot(p, edge) < length and side * side < best * length
