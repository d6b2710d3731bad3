"""Density weights of elements, and smoothing of a mesh with the weights.

Chen and Xu, "Optimal Delaunay triangulations", J. Comput. Math. 22 (2004); Chen and Holst, "Efficient mesh
optimization schemes based on optimal Delaunay triangulations", Comput. Methods Appl. Mech. Engrg. 200 (2011).
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.arrays import BY_QUALITY, BY_REACH, HALVINGS, MOVED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel, record
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, OWN, PAIRED
from kohonen_adapt.kernels.triangle.chains import (
    advanced_parameter,
    nearest_parameter,
    signed_distance,
    slide,
    slide_pair,
)
from kohonen_adapt.kernels.triangle.geometry import corner_of
from kohonen_adapt.kernels.triangle.guard import may_move
from kohonen_adapt.kernels.triangle.locate import (
    STRETCH,
    TOLERANCE,
    WALK,
    least_barycentric,
    nearer,
    side_of_edge,
    walk,
)
from kohonen_adapt.kernels.triangle.metric import factor_of_three, mapped, mapped_back
from kohonen_adapt.kernels.vectors import (
    cross,
    divided,
    dot,
    from_to,
    minus,
    plus,
    plus_times,
    put,
    times,
    turned,
    weighted,
    xy,
)

RELAXATION = 0.85  # full steps overshoot where the density changes within an element


@record
class Sites(NamedTuple):
    start: np.ndarray  # (n + 1,) int32: node v has the sites start[v] to start[v + 1]
    region: np.ndarray  # (s,) int32
    element: np.ndarray  # (s,) int32: element of the region in the base mesh that contains the node
    factor: np.ndarray  # (s,): density^(2/3), so that the product over the corners is the squared density of an element


@kernel
def count_sites(elements, star, start):
    start[0] = 0
    for v in range(star.start.shape[0] - 1):
        count = 0
        for k in range(star.start[v], star.start[v + 1]):
            if first_of_region(elements, star, v, k):
                count += 1
        start[v + 1] = start[v] + count


@inner_kernel
def first_of_region(elements, star, v, k):
    region = elements.region[star.element[k]]
    for j in range(star.start[v], k):
        if elements.region[star.element[j]] == region:
            return False
    return True


@kernel
def fill_sites(elements, star, sites):
    for v in range(star.start.shape[0] - 1):
        s = sites.start[v]
        for k in range(star.start[v], star.start[v + 1]):
            if first_of_region(elements, star, v, k):
                sites.region[s] = elements.region[star.element[k]]
                sites.element[s] = star.element[k]
                s += 1


@kernel
def average_at_sites(area, density, elements, star, first, last, log_density):
    """Set the logarithms of area-weighted mean densities at corners, shape (m, 3).

    Each mean is over the elements of a region around a node.
    """
    for v in range(first, last):
        for k in range(star.start[v], star.start[v + 1]):
            if not first_of_region(elements, star, v, k):
                continue
            region = elements.region[star.element[k]]
            mass = total = 0.0
            for j in range(k, star.start[v + 1]):
                e = star.element[j]
                if elements.region[e] == region:
                    mass += area[e] * density[e]
                    total += area[e]
            mean = np.log(mass / total)
            for j in range(k, star.start[v + 1]):
                e = np.int64(star.element[j])
                if elements.region[e] == region:
                    log_density[e, corner_of(elements.node, e, v)] = mean


@inner_kernel
def factor_in_region(sites, v, region):
    first = sites.start[v]
    for s in range(first + 1, sites.start[v + 1]):
        if sites.region[s] == region:
            return sites.factor[s]
    return sites.factor[first]


@kernel
def update_factors(position, first, last, sites, base_position, base, log_density):
    """Update the density factors of the nodes `first` to `last`.

    The logarithm of the density is linear on each element of the base mesh. The search for a node begins at the
    element of the previous node if nearer, except at every STRETCH-th node, where nodes may be divided among threads.
    """
    for v in range(first, last):
        for s in range(sites.start[v], sites.start[v + 1]):
            x, before = xy(position, v), np.int64(-1)
            if v % STRETCH > 0:
                before = np.int64(sites.element[sites.start[v] - 1])
            e = element_from(base_position, base, np.int64(sites.element[s]), before, x)
            sites.element[s] = e
            total, value = 0.0, 0.0
            for k in range(3):
                barycentric = max(0.0, side_of_edge(base_position, base.node, e, k, x))
                total += barycentric
                value += barycentric * log_density[e, k]
            sites.factor[s] = np.exp(2.0 / 3.0 * value / total)


@kernel
def multiply_factors(elements, sites, weight):
    for e in range(elements.node.shape[0]):
        weight[e] = 1.0
        for k in range(3):
            weight[e] *= factor_in_region(sites, elements.node[e, k], elements.region[e])


@inner_kernel
def element_from(position, elements, e, other, x):
    if other >= 0 and elements.region[other] == elements.region[e]:
        near = nearer(position, np.int64(elements.node[e, 0]), np.int64(elements.node[other, 0]), x)
        if near != elements.node[e, 0] and least_barycentric(position, elements.node, e, x) < -TOLERANCE:
            found, inside = walk(position, elements, other, x)
            if inside:
                return found
    return nearest_element(position, elements, e, x)


@inner_kernel
def nearest_element(position, elements, e, x):
    start, inside = np.int64(-1), False
    for _ in range(WALK):
        if inside or e == start:
            break
        start = e
        e, inside = walk(position, elements, e, x)
    depth = least_barycentric(position, elements.node, e, x)
    while not inside:
        onward = e
        for k in range(3):
            across = np.int64(elements.neighbour[e, k])
            if across >= 0 and elements.region[across] == elements.region[e]:
                other = least_barycentric(position, elements.node, across, x)
                if other > depth:
                    onward, depth = across, other
        if onward == e:
            break
        e = onward
    return e


@kernel
def sweep(mesh, shape, weight, circumcentres, floor, order, interior, which):
    """Move nodes to the weighted mean of the centres of their elements, guarded.

    x <- sum |K| w_K c_K / sum |K| w_K over the star, with the weights w_K = rho_K^2. The centre c_K is the circumcentre
    in the mean of the shapes (n, 3) of the corners, or the barycentre if no edge is flipped, because the circumcentre
    of a stretched element is far away. Only nodes of `order` with `interior` equal to `which` move. Returned are the
    numbers of nodes whose move the quality and the reach refused.
    """
    position, star, constraints = mesh.position, mesh.star, mesh.constraints
    by_quality, by_reach = 0, 0
    for node in order:
        v = np.int64(node)
        if interior[v] != which or constraints.kind[v] == HELD:
            continue
        x, mass = centre_mean(position, star, shape, weight, circumcentres, v)
        if constraints.kind[v] == FREE:
            by_quality += not step_towards(position, star, constraints.metric, v, x, floor)
            continue
        chains, chain = constraints.chains, np.int64(constraints.chain[v, OWN])
        parameter = constraints.parameter[v]
        distance = signed_distance(chains, chain, parameter, nearest_parameter(chains, chain, x, parameter))
        if chains.flags[chain, PAIRED]:
            w = np.int64(constraints.periodic.partner[v])
            if w < v:  # each pair once
                continue
            chain = np.int64(constraints.chain[w, OWN])
            x, mass_there = centre_mean(position, star, shape, weight, circumcentres, w)
            distance_there = signed_distance(chains, chain, parameter, nearest_parameter(chains, chain, x, parameter))
            distance = (mass * distance + mass_there * distance_there) / (mass + mass_there)
        cause = slide_along_chain(mesh, v, RELAXATION * distance, floor)
        by_quality += cause == BY_QUALITY
        by_reach += cause == BY_REACH
    return by_quality, by_reach


@inner_kernel
def centre_mean(position, star, shape, weight, circumcentres, v):
    x, total = xy(position, v), 0.0
    mean = (0.0, 0.0)  # |K| c_K needs no division, so flat elements do no harm
    for k in range(star.start[v], star.start[v + 1]):
        i, j, w = star.ahead[k], star.behind[k], weight[star.element[k]]
        a, b = from_to(x, position, i), from_to(x, position, j)
        if circumcentres:
            map_ = factor_of_three(shape, v, i, j)
            a, b = mapped(map_, a), mapped(map_, b)
            centre = mapped_back(map_, turned(weighted(dot(b, b), a, -dot(a, a), b)))
            total += w * 2.0 * cross(a, b)
            mean = plus_times(mean, w, centre)
        else:
            mass = w * cross(a, b)
            total += mass
            mean = plus(mean, divided(times(mass, plus(a, b)), 3.0))
    return plus(x, divided(mean, total)), total


@inner_kernel
def slide_along_chain(mesh, v, distance, floor):
    constraints = mesh.constraints
    chains, chain = constraints.chains, np.int64(constraints.chain[v, OWN])
    cause = MOVED
    for _ in range(HALVINGS + 1):
        parameter = advanced_parameter(chains, chain, constraints.parameter[v], distance)
        if chains.flags[chain, PAIRED]:
            cause = slide_pair(mesh, v, parameter, floor)
        else:
            cause = slide(mesh, v, parameter, floor)
        if cause == MOVED:
            break
        distance *= 0.5
    return cause


@inner_kernel
def step_towards(position, star, metric, v, x, floor):
    before = xy(position, v)
    step = times(RELAXATION, minus(x, before))
    for _ in range(HALVINGS + 1):
        there = plus(before, step)
        if may_move(position, star, metric, v, there, floor):
            put(position, v, there)
            return True
        step = times(0.5, step)
    return False
