"""Elements at points, by walks and a grid, and winners of training points.

The search of a winner follows Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps", section III.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import CROSSINGS
from kohonen_adapt.kernels.grid import cell_index, cells_between, clear_counts, enter, sum_up_counts
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.search import element_in_region, next_stamp
from kohonen_adapt.kernels.triangle.arrays import SAGITTA
from kohonen_adapt.kernels.triangle.chains import distance_to_chain, parameter_of
from kohonen_adapt.kernels.triangle.geometry import orientation, squared_distance_to_segment
from kohonen_adapt.kernels.triangle.metric import factor_at, mapped
from kohonen_adapt.kernels.vectors import cross, dot, from_to, minus, squared_distance, xy

TOLERANCE = 1e-10  # relative to an element: points on an edge or on the boundary count as inside
WALK = 64  # maximum number of steps; walks from a grid cell take two or three

STRETCH = 256  # consecutive points whose searches may start at the previous winner


@inner_kernel
def side_of_edge(position, node, e, k, x):
    return orientation(xy(position, node[e, (k + 1) % 3]), xy(position, node[e, (k + 2) % 3]), x)


@inner_kernel
def least_barycentric(position, node, e, x):
    least, doubled = np.inf, 0.0
    for k in range(3):
        side = side_of_edge(position, node, e, k, x)
        least = min(least, side)
        doubled += side
    return least / doubled


@inner_kernel
def walk(position, elements, e, x):
    node, region = elements.node, elements.region[e]
    e = np.int64(e)
    for _ in range(WALK):
        if least_barycentric(position, node, e, x) >= -TOLERANCE:
            return e, True
        onward, most = np.int64(-1), 0.0
        for k in range(3):
            side = side_of_edge(position, node, e, k, x)
            across = np.int64(elements.neighbour[e, k])
            if side < most and across >= 0 and elements.region[across] == region:
                onward, most = across, side
        if onward < 0:
            return e, False
        e = onward
    return e, False


@kernel
def walk_each(position, elements, points, found, inside):
    for t in range(points.shape[0]):
        found[t], inside[t] = walk(position, elements, found[t], xy(points, t))


@kernel
def count_in_cells(position, node, grid):
    clear_counts(grid)
    start, shape = grid.start, grid.shape
    for e in range(node.shape[0]):
        (i0, i1), (j0, j1) = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                start[i * shape[1] + j] += 1
    sum_up_counts(grid)


@kernel
def fill_cells(position, node, grid):
    shape = grid.shape
    for e in range(node.shape[0] - 1, -1, -1):
        (i0, i1), (j0, j1) = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                enter(grid, i * shape[1] + j, e)


@inner_kernel
def cells_of_element(position, node, e, grid):
    return cells_between(position, node, e, 0, grid), cells_between(position, node, e, 1, grid)


@inner_kernel
def best_in_cell(position, node, content, first, last, x):
    best, deepest = -1, -TOLERANCE
    for k in range(first, last):
        depth = least_barycentric(position, node, np.int64(content[k]), x)
        if depth >= deepest:
            best, deepest = content[k], depth
    return best


@kernel
def find(position, elements, points, grid, found):
    node, start, content = elements.node, grid.start, grid.content
    for t in range(points.shape[0]):
        x = xy(points, t)
        found[t] = -1
        if not (np.isfinite(x[0]) and np.isfinite(x[1])):
            continue
        c = cell_index(grid, x[0], 0) * grid.shape[1] + cell_index(grid, x[1], 1)
        if start[c] == start[c + 1]:
            continue
        e, inside = walk(position, elements, content[start[c]], x)
        found[t] = e if inside else best_in_cell(position, node, content, start[c], start[c + 1], x)


@kernel
def barycentric(position, node, points, found, out):
    for t in range(points.shape[0]):
        e = np.int64(found[t])
        total = 0.0
        for k in range(3):
            out[t, k] = np.nan if e < 0 else side_of_edge(position, node, e, k, xy(points, t))
            total += out[t, k]
        for k in range(3):
            out[t, k] /= total


@inner_kernel
def closest_neighbour(position, elements, star, inner, v, x, region):
    best, nearest = squared_distance(position, v, x), v
    for k in range(star.start[v], star.start[v + 1]):
        if inner[v] or elements.region[star.element[k]] == region:
            distance = squared_distance(position, np.int64(star.ahead[k]), x)
            if distance < best:
                best, nearest = distance, star.ahead[k]
            if not inner[v]:  # around an inner node `behind` is `ahead` in the next row
                distance = squared_distance(position, np.int64(star.behind[k]), x)
                if distance < best:
                    best, nearest = distance, star.behind[k]
    return nearest


@inner_kernel
def containing_element(position, elements, star, constraints, v, x, region, scratch):
    e = element_in_region(elements, star, v, region)
    e, inside = walk(position, elements, e, x)
    # A point between a curve and its facets may lie in no element of the region; the element at the facet counts.
    if inside or behind_curve(position, elements, constraints, e, x):
        return e
    stamp, queue = next_stamp(scratch), scratch.queue
    queue[0], scratch.element_stamp[e] = e, stamp
    first, last = 0, 1
    best, deepest = e, -np.inf
    while first < last and deepest < -TOLERANCE:
        e = np.int64(queue[first])
        first += 1
        depth = least_barycentric(position, elements.node, e, x)
        if depth > deepest:
            best, deepest = e, depth
        for k in range(3):
            across = elements.neighbour[e, k]
            if across >= 0 and elements.region[across] == region and scratch.element_stamp[across] != stamp:
                scratch.element_stamp[across] = stamp
                queue[last] = across
                last += 1
    return best


@inner_kernel
def behind_curve(position, elements, constraints, e, x):
    chains = constraints.chains
    for k in range(3):
        c = np.int64(elements.chain[e, k])
        if c >= 0 and chains.geometry[c, SAGITTA] > 0.0 and side_of_edge(position, elements.node, e, k, x) < 0.0:
            near = parameter_of(position, constraints, c, np.int64(elements.node[e, (k + 1) % 3]))
            if distance_to_chain(chains, c, x, near)[0] <= chains.geometry[c, SAGITTA] * chains.geometry[c, SAGITTA]:
                return True
    return False


@inner_kernel
def nearest_visible(position, elements, e, x, map_, scratch):
    """Return the nearest node visible from `x` and its squared distance.

    A node is visible if the disc around `x` through the node connects both within the region of `e`. The reach of an
    element is the squared distance of the farthest edge on the path to the element. Elements are entered by increasing
    reach, and a node nearer than the reach of its element lies behind a slit or a corner. Ties go to the lowest index.
    """
    stamp = next_stamp(scratch)
    frontier, reach = scratch.frontier, scratch.reach
    region = elements.region[e]
    frontier[0], reach[0] = e, 0.0
    scratch.element_stamp[e] = stamp
    count, winner = 1, np.int64(-1)
    best = np.inf
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
            v = np.int64(elements.node[e, k])
            offset = mapped(map_, minus(x, xy(position, v)))
            distance = dot(offset, offset)
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
            start, end = xy(position, elements.node[e, (k + 1) % 3]), xy(position, elements.node[e, (k + 2) % 3])
            distance = squared_distance_to_segment(mapped(map_, minus(end, start)), mapped(map_, minus(x, start)))
            distance = max(distance, entered)
            if known:
                reach[waiting] = min(reach[waiting], distance)
            elif distance <= best:
                scratch.element_stamp[across] = stamp
                frontier[count], reach[count] = across, distance
                count += 1
    return winner, best


@inner_kernel
def find_winner(mesh, v, x, map_, region, scratch):
    position, elements, star, constraints = mesh.position, mesh.elements, mesh.star, mesh.constraints
    while True:
        nearest = closest_neighbour(position, elements, star, constraints.inner, v, x, region)
        if nearest == v:
            break
        v = nearest
    e = containing_element(position, elements, star, constraints, v, x, region, scratch)
    winner, squared = nearest_visible(position, elements, e, x, map_, scratch)
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
        x, own = xy(points, t), region[t]
        v = np.int64(start_nodes[t])
        if t % STRETCH > 0 and region[t - 1] == own:
            v = nearer(position, v, np.int64(winners[t - 1]), x)
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
                winner, best = int(node[e, 1]), distance
            distance = dot(c, c)
            if distance < best or (distance == best and node[e, 2] < winner):
                winner, best = int(node[e, 2]), distance
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
                    winner, best = int(node[f, j]), distance
                p = mapped(map_, from_to(x, position, node[e, (k + 1) % 3]))
                q = mapped(map_, from_to(x, position, node[e, (k + 2) % 3]))
                # in f = (w, q, p) the edge pw is opposite to q, and wq to p
                if cuts(p, w, cross(p, w), best):
                    crossed[count, 0], crossed[count, 1] = f, (j + 1) % 3
                    count += 1
                if cuts(w, q, cross(w, q), best):
                    crossed[count, 0], crossed[count, 1] = f, (j + 2) % 3
                    count += 1
        if found:
            winners[t], distances[t] = winner, np.sqrt(best)
        else:
            winner, distance = find_winner(mesh, v, x, map_, own, scratch)
            winners[t], distances[t] = winner, distance


@inner_kernel
def nearer(position, v, other, x):
    return other if squared_distance(position, other, x) < squared_distance(position, v, x) else v


@inner_kernel
def cuts(p, q, side, best):
    edge = minus(q, p)
    length = dot(edge, edge)
    return 0.0 < -dot(p, edge) < length and side * side < best * length
