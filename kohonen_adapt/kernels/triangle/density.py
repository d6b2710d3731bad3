"""Look densities up where nodes are now, weigh elements with them, and draw training points from them."""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.locate import depth_in_element, side_of_edge, walk


class Sites(NamedTuple):
    """A node has one site for every region it touches: the density may differ from region to region."""

    start: np.ndarray  # (n + 1,) int32: the sites of node v stand in rows start[v] to start[v + 1]
    region: np.ndarray  # (s,) int32
    element: np.ndarray  # (s,) int32: the element of the density's own mesh that holds the node, in that region
    factor: np.ndarray  # (s,) density^(2/3), so that the product over an element's corners is its density squared


@kernel
def count_sites(elements, star, start):
    """Sum up the number of regions that every node touches to row starts."""
    start[0] = 0
    for v in range(star.start.shape[0] - 1):
        count = 0
        for k in range(star.start[v], star.start[v + 1]):
            if first_of_region(elements, star, v, k):
                count += 1
        start[v + 1] = start[v] + count


@inner_kernel
def first_of_region(elements, star, v, k):
    """Whether row k is the first of the star of v with its region."""
    region = elements.region[star.element[k]]
    for j in range(star.start[v], k):
        if elements.region[star.element[j]] == region:
            return False
    return True


@kernel
def fill_sites(elements, star, sites):
    """List the regions of every node, each with an element to start a search from."""
    for v in range(star.start.shape[0] - 1):
        s = sites.start[v]
        for k in range(star.start[v], star.start[v + 1]):
            if first_of_region(elements, star, v, k):
                sites.region[s] = elements.region[star.element[k]]
                sites.element[s] = star.element[k]
                s += 1


@kernel
def average_at_sites(area, density, elements, star, log_density):
    """Average densities at the corners of elements, by area and per region; gives their logarithm."""
    for e in range(elements.node.shape[0]):
        region = elements.region[e]
        for corner in range(3):
            v = elements.node[e, corner]
            mass, total = 0.0, 0.0
            for k in range(star.start[v], star.start[v + 1]):
                other = star.element[k]
                if elements.region[other] == region:
                    mass += area[other] * density[other]
                    total += area[other]
            log_density[e, corner] = np.log(mass / total)


@inner_kernel
def factor_in_region(sites, v, region):
    """Factor of node v as seen from one of its regions."""
    first = sites.start[v]
    for s in range(first + 1, sites.start[v + 1]):
        if sites.region[s] == region:
            return sites.factor[s]
    return sites.factor[first]


@kernel
def update_factors(position, first, last, sites, base_position, base, log_density):
    """Look the density up at the sites of some nodes in the mesh it belongs to: linear in its logarithm, by region."""
    for v in range(first, last):
        for s in range(sites.start[v], sites.start[v + 1]):
            x, y = position[v, 0], position[v, 1]
            e = nearest_element(base_position, base, sites.element[s], x, y)
            sites.element[s] = e
            total, value = 0.0, 0.0
            for k in range(3):
                share = max(0.0, side_of_edge(base_position, base.node, e, k, x, y))
                total += share
                value += share * log_density[e, k]
            sites.factor[s] = np.exp(2.0 / 3.0 * value / total)


@kernel
def multiply_factors(elements, sites, weight):
    """Compute the square of the geometric mean of the densities at the corners of every element."""
    for e in range(elements.node.shape[0]):
        weight[e] = 1.0
        for k in range(3):
            weight[e] *= factor_in_region(sites, elements.node[e, k], elements.region[e])


@inner_kernel
def nearest_element(position, elements, e, x, y):
    """The element of e's region that holds (x, y); where a concave outline blocks the walk, the best that it came by.

    From there the walk goes on through whichever neighbour holds the point deepest.
    """
    e, inside = walk(position, elements, e, x, y)
    depth = depth_in_element(position, elements.node, e, x, y)
    while not inside:
        onward = e
        for k in range(3):
            across = elements.neighbour[e, k]
            if across >= 0 and elements.region[across] == elements.region[e]:
                other = depth_in_element(position, elements.node, across, x, y)
                if other > depth:
                    onward, depth = across, other
        if onward == e:
            break
        e = onward
    return e


@kernel
def draw_points(position, node, order, cumulated, random, points, element):
    """Draw a random point in each of as many stretches of equal mass, in the elements in the given order.

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
