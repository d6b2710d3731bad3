"""Slow twins: the same things said in plain Python, without a clever order, kernels or shared code."""

import math
from itertools import combinations

import numpy as np


def nearest_node(position, x, candidates=None):
    """The nearest of the candidates by looking at each, ties to the lowest number; and its distance."""
    numbers = np.arange(len(position)) if candidates is None else np.unique(candidates)
    distance = np.sqrt(((position[numbers] - x) ** 2).sum(axis=1))
    return int(numbers[np.argmin(distance)]), float(distance.min())


def distance_to_simplex(corners, x):
    """From the point x to the convex hull of independent corners: the nearest point lies within one of its faces."""
    best = np.inf
    for size in range(1, len(corners) + 1):
        for chosen in combinations(corners, size):
            base, span = chosen[0], np.array([c - chosen[0] for c in chosen[1:]]).reshape(-1, len(x))
            share = np.linalg.lstsq(span.T, x - base, rcond=None)[0]
            if np.all(share >= -1e-12) and share.sum() <= 1 + 1e-12:
                best = min(best, float(np.linalg.norm(base + share @ span - x)))
    return best


def flooded(position, node, neighbour, region, holder, x, radius):
    """Elements reached from the holder, within its region, by crossing facets that meet the ball around x."""
    reached, waiting = {holder}, [holder]
    while waiting:
        e = waiting.pop()
        for k in range(node.shape[1]):
            across = int(neighbour[e, k])
            if across < 0 or across in reached or region[across] != region[e]:
                continue
            if distance_to_simplex(position[np.delete(node[e], k)], x) <= radius * (1 + 1e-12):
                reached.add(across)
                waiting.append(across)
    return reached


def canonical_winner(position, node, neighbour, region, holder, x):
    """The nearest node of an element that the flood of the ball through that node reaches."""
    distance = np.linalg.norm(position - x, axis=1)
    for v in np.lexsort([np.arange(len(position)), distance]):
        reached = flooded(position, node, neighbour, region, holder, x, distance[v])
        if any(v in node[e] for e in reached):
            return int(v), float(distance[v])
    return None


def rings(node, winner, radius):
    """Lists of nodes 0, 1, ... `radius` edges away from the winner."""
    found, seen = [[winner]], {winner}
    for _ in range(radius):
        ring = {int(v) for u in found[-1] for v in node[(node == u).any(axis=1)].ravel()} - seen
        found.append(sorted(ring))
        seen |= ring
    return found


def holders(position, node, region, x, number):
    """Elements of a region that hold x; on an edge more than one."""
    found = []
    for e in np.flatnonzero(region == number):
        a, b, c = position[node[e]]
        sides = [cross(b - a, x - a), cross(c - b, x - b), cross(a - c, x - c)]
        if min(sides) >= -1e-12 * abs(cross(b - a, c - a)):
            found.append(int(e))
    return found


def cross(u, w):
    """Third component of the cross product."""
    return u[0] * w[1] - u[1] * w[0]


def star_of(node, v):
    """Elements around a node."""
    return np.flatnonzero((node == v).any(axis=1))


def worst_quality(position, node, elements):
    """Lowest signed quality of some counter-clockwise elements."""
    return min(signed_quality(*position[node[e]]) for e in elements)


def signed_quality(a, b, c):
    """4 sqrt(3) |K| / sum of squared edges, negative where the triangle runs clockwise."""
    squares = math.dist(a, b) ** 2 + math.dist(b, c) ** 2 + math.dist(c, a) ** 2
    return 2 * math.sqrt(3) * cross(b - a, c - a) / squares


class SlowMap:
    """Equation 1 of the paper with the guard, for nodes in the plane; nodes on outlines stay where they are."""

    def __init__(self, position, node, neighbour, region, movable, floor):
        self.position, self.node, self.neighbour, self.region = position.copy(), node, neighbour, region
        self.movable, self.floor = movable, floor
        self.stars = [star_of(node, v) for v in range(len(position))]
        self.refused = 0

    def winner(self, x, number):
        """The canonical winner of a point of a region."""
        holder = holders(self.position, self.node, self.region, x, number)[0]
        return canonical_winner(self.position, self.node, self.neighbour, self.region, holder, x)

    def move(self, v, x, step):
        """A guarded step of a share of the way."""
        before, worst = self.position[v].copy(), worst_quality(self.position, self.node, self.stars[v])
        self.position[v] = before + step * (x - before)
        after = worst_quality(self.position, self.node, self.stars[v])
        if after <= 0 or after < min(self.floor, worst):
            self.position[v] = before
            self.refused += 1

    def present(self, x, number, rate, strength):
        """One training point; returns the distance to its winner."""
        winner, distance = self.winner(x, number)
        nearby = rings(self.node[self.region == number], winner, len(strength) - 1)
        for ring, share in zip(nearby, strength, strict=True):
            for v in ring:
                if self.movable[v]:
                    self.move(v, x, rate * share)
        return distance


def circumcentre(a, b, c):
    """The point as far from all three corners."""
    matrix = 2 * np.array([b - a, c - a])
    return np.linalg.solve(matrix, np.array([b @ b - a @ a, c @ c - a @ a]))


def smoothing_target(position, node, weight, v, centre):
    """Mean of the centres of the elements around v, weighted with area times weight."""
    elements = star_of(node, v)
    masses = [weight[e] * cross(*(position[node[e]][1:] - position[node[e]][0])) for e in elements]
    return np.average([centre(*position[node[e]]) for e in elements], axis=0, weights=masses)


def slow_sweep(position, node, weight, axes, centre, share, floor):
    """One sweep over nodes in order; `axes[v]` are the coordinates that v may change. Returns the new positions."""
    position = position.copy()
    for v, free in axes.items():
        before, star = position[v].copy(), star_of(node, v)
        worst = worst_quality(position, node, star)
        way = np.zeros(2)
        way[free] = share * (smoothing_target(position, node, weight, v, centre) - before)[free]
        for part in (1.0, 0.5, 0.25, 0.125):
            position[v] = before + part * way
            after = worst_quality(position, node, star)
            if after > 0 and after >= min(floor, worst):
                break
            position[v] = before
    return position


def barycentre(a, b, c):
    """The mean of the corners."""
    return (a + b + c) / 3


def locally_delaunay(a, b, c, d):
    """Whether d lies outside the circle through the counter-clockwise a, b, c, or nearly on it."""
    centre = circumcentre(a, b, c)
    return math.dist(centre, d) >= math.dist(centre, a) * (1 - 1e-8)
