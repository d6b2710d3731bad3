"""Random points in triangles and tetrahedra."""

from kohonen_adapt.kernels.numba.compilation import kernel


@kernel
def draw_points(position, node, order, cumulated, random, points, element):
    """Draw one random point per interval of equal mass.

    `cumulated` holds the cumulative masses of elements in `order`. `random` (k, d + 1) holds uniform numbers, for the
    position in the interval and in the element. The unit square or cube is folded into the element for a uniform
    distribution (Rocchini and Cignoni, J. Graph. Tools 5, 2000).
    """
    number = points.shape[0]
    corners = node.shape[1]
    at = 0
    mass = cumulated[-1] / number
    for t in range(number):
        level = (t + random[t, 0]) * mass
        while at < order.shape[0] - 1 and cumulated[at] < level:
            at += 1
        e = order[at]
        u = random[t, 1]
        v = random[t, 2]
        w = random[t, 3] if corners == 4 else 0.0
        if u + v > 1.0:
            u, v = 1.0 - u, 1.0 - v
        if v + w > 1.0:
            v, w = 1.0 - w, 1.0 - u - v
        elif u + v + w > 1.0:
            u, w = 1.0 - v - w, u + v + w - 1.0
        a, b, c, d = node[e, 0], node[e, 1], node[e, 2], node[e, corners - 1]
        for k in range(points.shape[1]):
            start = position[a, k]
            points[t, k] = start + u * (position[b, k] - start) + v * (position[c, k] - start)
            points[t, k] += w * (position[d, k] - start)
        element[t] = e
