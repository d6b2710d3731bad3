"""A space-filling curve, and training points drawn along it."""

from kohonen_adapt.kernels.compilation import kernel

BITS = 20  # per coordinate


@kernel
def hilbert_keys(points, origin, size, keys):
    """How far along Hilbert's curve through the square at `origin` of this size every point lies, (n,) int64."""
    cells = 1 << BITS
    for t in range(points.shape[0]):
        x = min(cells - 1, max(0, int((points[t, 0] - origin[0]) / size * cells)))
        y = min(cells - 1, max(0, int((points[t, 1] - origin[1]) / size * cells)))
        key, half = 0, cells >> 1
        while half > 0:
            right, upper = 1 if x & half else 0, 1 if y & half else 0
            key = 4 * key + ((3 * right) ^ upper)
            x, y = x & (half - 1), y & (half - 1)
            if upper == 0:
                if right == 1:
                    x, y = half - 1 - x, half - 1 - y
                x, y = y, x
            half >>= 1
        keys[t] = key


@kernel
def draw_points(position, node, order, cumulated, random, points, element):
    """One random point in each of as many stretches of equal mass, in the elements in the given order.

    `cumulated` sums the masses up in that order; `random` (k, 3) has numbers from 0 to 1 for the place in the stretch
    and in the element, which is filled evenly.
    """
    number, at = points.shape[0], 0
    share = cumulated[-1] / number
    for t in range(number):
        level = (t + random[t, 0]) * share
        while at < order.shape[0] - 1 and cumulated[at] < level:
            at += 1
        e, u, v = order[at], random[t, 1], random[t, 2]
        if u + v > 1.0:
            u, v = 1.0 - u, 1.0 - v
        a, b, c = node[e, 0], node[e, 1], node[e, 2]
        for k in range(points.shape[1]):
            points[t, k] = (
                position[a, k] + u * (position[b, k] - position[a, k]) + v * (position[c, k] - position[a, k])
            )
        element[t] = e
