"""Smooth a mesh by sweeps that are weighted with a density.

Chen and Xu, "Optimal Delaunay triangulations", J. Comput. Math. 22 (2004); Chen and Holst, "Efficient mesh optimization
schemes based on optimal Delaunay triangulations", Comput. Methods Appl. Mech. Engrg. 200 (2011).
"""

import numpy as np

from kohonen_adapt.kernels.arrays import FREE, HELD, OWN, PAIRED
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import gone_along, nearest_parameter, point_at, way_along, within_reach
from kohonen_adapt.kernels.triangle.geometry import may_move, slide_pair

RELAXATION = 0.85  # full steps overshoot where the density changes within an element
HALVINGS = 3  # a refused step is tried again at a half, a quarter, an eighth


@kernel
def sweep(position, elements, star, constraints, weight, circumcentres, floor, order, deep, which):
    """Move nodes to the weighted mean of the centres of the elements around them, as far as the guard lets them.

    x <- sum |K| w_K c_K / sum |K| w_K over the star, with weights w_K = rho_K^2 and c_K the circumcentre, or where
    nothing flips the barycentre: a circumcentre far outside a stretched element would only tear at it. Of the nodes in
    `order` those move for which `deep` is as `which` says.
    """
    for node in order:
        v = np.int64(node)
        if deep[v] != which or constraints.kind[v] == HELD:
            continue
        x, y, mass = centre_mean(position, star, weight, circumcentres, v)
        if constraints.kind[v] == FREE:
            step_towards(position, star, v, x, y, floor)
            continue
        chains, chain, parameter = constraints.chains, np.int64(constraints.chain[v, OWN]), constraints.parameter[v]
        way = way_along(chains, chain, parameter, nearest_parameter(chains, chain, x, y, parameter))
        if not chains.flags[chain, PAIRED]:
            slide_along_chain(position, elements, star, constraints, v, RELAXATION * way, floor)
            continue
        w = np.int64(constraints.twins.partner[v])
        if w > v:  # each pair once
            chain = np.int64(constraints.chain[w, OWN])
            x, y, mass_there = centre_mean(position, star, weight, circumcentres, w)
            way_there = way_along(chains, chain, parameter, nearest_parameter(chains, chain, x, y, parameter))
            way = (mass * way + mass_there * way_there) / (mass + mass_there)
            slide_both_along_chains(position, elements, star, constraints, v, RELAXATION * way, floor)


@inner_kernel
def centre_mean(position, star, weight, circumcentres, v):
    """Weighted mean of the circumcentres or else of the barycentres of the star of v, and the sum of the weights."""
    if circumcentres:
        return circumcentre_mean(position, star, weight, v)
    return barycentre_mean(position, star, weight, v)


@inner_kernel
def circumcentre_mean(position, star, weight, v):
    """Weighted mean of the circumcentres of the star of v; |K| c_K needs no division, so flat elements do no harm."""
    x, y = position[v, 0], position[v, 1]
    total, mean_x, mean_y = 0.0, 0.0, 0.0
    for k in range(star.start[v], star.start[v + 1]):
        a, b, w = star.ahead[k], star.behind[k], weight[star.element[k]]
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        aa, bb = ax * ax + ay * ay, bx * bx + by * by
        total += w * 2.0 * (ax * by - ay * bx)
        mean_x += w * (by * aa - ay * bb)
        mean_y += w * (ax * bb - bx * aa)
    return x + mean_x / total, y + mean_y / total, total


@inner_kernel
def barycentre_mean(position, star, weight, v):
    """Weighted mean of the barycentres of the star of v."""
    x, y = position[v, 0], position[v, 1]
    total, mean_x, mean_y = 0.0, 0.0, 0.0
    for k in range(star.start[v], star.start[v + 1]):
        a, b = star.ahead[k], star.behind[k]
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        w = weight[star.element[k]] * (ax * by - ay * bx)
        total += w
        mean_x += w * (ax + bx) / 3.0
        mean_y += w * (ay + by) / 3.0
    return x + mean_x / total, y + mean_y / total, total


@inner_kernel
def step_towards(position, star, v, x, y, floor):
    """Move a free node to (x, y), or half as far until the guard agrees."""
    dx, dy = RELAXATION * (x - position[v, 0]), RELAXATION * (y - position[v, 1])
    for _ in range(HALVINGS + 1):
        if may_move(position, star, v, position[v, 0] + dx, position[v, 1] + dy, floor):
            position[v, 0] += dx
            position[v, 1] += dy
            return
        dx, dy = 0.5 * dx, 0.5 * dy


@inner_kernel
def slide_along_chain(position, elements, star, constraints, v, way, floor):
    """Move a node that far along its chain, or half as far until the guard agrees."""
    chains, chain = constraints.chains, np.int64(constraints.chain[v, OWN])
    for _ in range(HALVINGS + 1):
        parameter = gone_along(chains, chain, constraints.parameter[v], way)
        x, y = point_at(chains, chain, parameter)
        if within_reach(position, elements, star, chains, chain, v, x, y) and may_move(position, star, v, x, y, floor):
            constraints.parameter[v] = parameter
            position[v, 0], position[v, 1] = x, y
            return
        way *= 0.5


@inner_kernel
def slide_both_along_chains(position, elements, star, constraints, v, way, floor):
    """Move a node and its partner that far along their chains, or half as far until both guards agree."""
    for _ in range(HALVINGS + 1):
        parameter = gone_along(constraints.chains, constraints.chain[v, OWN], constraints.parameter[v], way)
        if slide_pair(position, elements, star, constraints, v, parameter, floor):
            return
        way *= 0.5
