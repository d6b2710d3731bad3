"""Smoothing of a mesh with weights of elements.

Chen and Xu, "Optimal Delaunay triangulations", J. Comput. Math. 22 (2004); Chen and Holst, "Efficient mesh
optimization schemes based on optimal Delaunay triangulations", Comput. Methods Appl. Mech. Engrg. 200 (2011).
"""

from kohonen_adapt.kernels.arrays import BY_QUALITY, BY_REACH, HALVINGS, MOVED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, OWN
from kohonen_adapt.kernels.triangle.chains import (
    advanced_parameter,
    nearest_parameter,
    signed_distance,
    slide,
    slide_pair,
)
from kohonen_adapt.kernels.triangle.guard import may_move
from kohonen_adapt.kernels.triangle.metric import factor_of_three, mapped_back
from kohonen_adapt.kernels.vectors import (
    cross,
    divided,
    dot,
    from_to,
    mapped,
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
    for v in order:
        if interior[v] != which or constraints.kind[v] == HELD:
            continue
        x, mass = centre_mean(position, star, shape, weight, circumcentres, v)
        if constraints.kind[v] == FREE:
            by_quality += not step_towards(position, star, constraints.metric, v, x, floor)
            continue
        chains = constraints.chains
        chain = constraints.chain[v, OWN]
        parameter = constraints.parameter[v]
        distance = signed_distance(chains, chain, parameter, nearest_parameter(chains, chain, x, parameter))
        if chains.paired[chain]:
            w = constraints.periodic.partner[v]
            if w < v:  # each pair once
                continue
            chain = constraints.chain[w, OWN]
            x, mass_there = centre_mean(position, star, shape, weight, circumcentres, w)
            distance_there = signed_distance(chains, chain, parameter, nearest_parameter(chains, chain, x, parameter))
            distance = (mass * distance + mass_there * distance_there) / (mass + mass_there)
        cause = slide_along_chain(mesh, v, RELAXATION * distance, floor)
        by_quality += cause == BY_QUALITY
        by_reach += cause == BY_REACH
    return by_quality, by_reach


@inner_kernel
def centre_mean(position, star, shape, weight, circumcentres, v):
    x = xy(position, v)
    total = 0.0
    mean = (0.0, 0.0)  # |K| c_K needs no division, so flat elements do no harm
    for k in rows_of(star, v):
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
    chains = constraints.chains
    chain = constraints.chain[v, OWN]
    cause = MOVED
    for _ in range(HALVINGS + 1):
        parameter = advanced_parameter(chains, chain, constraints.parameter[v], distance)
        if chains.paired[chain]:
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
