"""Parameters and points of many nodes on curve segments.

The parameter of a point is its arc length from the beginning of the segment, approximately so on splines.
"""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.arrays import AT_X, AT_Y, OWN, ROUND, SLIDING, STRAIGHT, TABLED, Chains, Constraints
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.triangle.chains import look_up, nearest_parameter

__all__ = ["find_parameters", "parameters_of", "points_on", "signed_distances"]


def find_parameters(position: Floats, constraints: Constraints, node: Ints, first: Ints, last: Ints) -> None:
    chains, nearest = constraints.chains, interpreted(nearest_parameter)
    for c, (begin, end) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        sliding = node[begin:end][constraints.kind[node[begin:end]] == SLIDING]
        if chains.shape[c] == STRAIGHT:
            (ux, uy), (tx, ty) = (position[sliding] - chains.origin[c]).T, chains.direction[c]
            constraints.parameter[sliding] = np.clip(ux * tx + uy * ty, 0.0, chains.length[c])
            continue
        near = 0.0
        for v in sliding:
            near = nearest(chains, c, *position[v], near)
            constraints.parameter[v] = near


def parameters_of(position: Floats, constraints: Constraints, chain: Ints, node: Ints) -> Floats:
    """Return the parameters of nodes on curve segments, shape (k,).

    A node that does not slide on the segment is the nearer of its two ends.
    """
    chains = constraints.chains
    slides = (constraints.kind[node] == SLIDING) & (constraints.chain[node, OWN] == chain)
    start, end = (np.sum((position[node] - point[chain]) ** 2, axis=1) for point in (chains.origin, ends_of(chains)))
    return np.where(slides, constraints.parameter[node], np.where(end < start, chains.length[chain], 0.0))


def ends_of(chains: Chains) -> Floats:
    end = chains.origin + chains.length[:, None] * chains.direction
    is_round, is_tabled = chains.shape == ROUND, chains.shape == TABLED
    half = 0.5 * (chains.curvature * chains.length)[is_round]
    chord = 2.0 * np.sin(half) / chains.curvature[is_round]
    (tx, ty), sine, cosine = chains.direction[is_round].T, np.sin(half), np.cos(half)
    distance = np.stack([cosine * tx - sine * ty, sine * tx + cosine * ty], axis=1)
    end[is_round] = chains.origin[is_round] + chord[:, None] * distance
    end[is_tabled] = chains.knot[chains.row[1:][is_tabled] - 1, AT_X : AT_Y + 1]
    return end


def signed_distances(chains: Chains, chain: Ints, start: Floats, end: Floats) -> Floats:
    distance, length = end - start, chains.length[chain]
    wraps = chains.closed[chain] & (np.abs(distance) > 0.5 * length)
    return np.where(wraps, distance - np.copysign(length, distance), distance)


def points_on(constraints: Constraints, chain: Ints, parameter: Floats) -> Floats:
    along = constraints._replace(chain=np.stack([chain, chain], axis=1).astype(np.int32), parameter=parameter)
    points = np.empty((len(chain), 2))
    look_up(along, np.arange(len(chain)), points)
    return points
