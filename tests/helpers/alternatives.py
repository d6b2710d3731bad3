"""Slow twins: the same things said in plain Python, without a clever order, kernels or shared code."""

import math

import numpy as np


def nearest_node(position, x, candidates=None):
    """The nearest of the candidates by looking at each, ties to the lowest number; and its distance."""
    numbers = np.arange(len(position)) if candidates is None else np.unique(candidates)
    distance = np.sqrt(((position[numbers] - x) ** 2).sum(axis=1))
    return int(numbers[np.argmin(distance)]), float(distance.min())


def distance_to_segment(a, b, x):
    """From the point x to the segment from a to b."""
    share = np.clip(np.dot(x - a, b - a) / np.dot(b - a, b - a), 0.0, 1.0)
    return math.dist(x, a + share * (b - a))


def flooded(position, node, neighbour, region, holder, x, radius):
    """Elements reached from the holder, within its region, by crossing edges that meet the disc around x."""
    reached, waiting = {holder}, [holder]
    while waiting:
        e = waiting.pop()
        for k in range(3):
            across = neighbour[e, k]
            if across < 0 or across in reached or region[across] != region[e]:
                continue
            a, b = position[node[e, k - 2]], position[node[e, k - 1]]
            if distance_to_segment(a, b, x) <= radius * (1 + 1e-12):
                reached.add(across)
                waiting.append(across)
    return reached


def canonical_winner(position, node, neighbour, region, holder, x):
    """The nearest node of an element that the flood of the disc through that node reaches; None where none counts."""
    distance = np.sqrt(((position - x) ** 2).sum(axis=1))
    for v in np.lexsort([np.arange(len(position)), distance]):
        reached = flooded(position, node, neighbour, region, holder, x, distance[v])
        if any(v in node[e] for e in reached):
            return int(v), float(distance[v])
    return None


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


def rings(node, region, winner, radius, number):
    """Lists of nodes 0, 1, ... `radius` edges away from the winner, within a region and its outline."""
    inside = node[region == number]
    found, seen = [[winner]], {winner}
    for _ in range(radius):
        ring = {int(v) for u in found[-1] for row in inside[(inside == u).any(axis=1)] for v in row} - seen
        found.append(sorted(ring))
        seen |= ring
    return found


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
        nearby = rings(self.node, self.region, winner, len(strength) - 1, number)
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


def functional(position, node, data, values, laws=None):
    """int c/2 |grad u|^2 - f u - g . grad u, the sum over elements; `data` (m, 4) holds c, f and the two parts of g.

    `laws` (m,) holds None, or the law whose energy stands in place of c/2 |grad u|^2.
    """
    corners, nodal, (c, f, *g) = position[node], values[node], data.T
    planes = np.dstack([corners, np.ones(nodal.shape)])
    gradient = np.linalg.solve(planes, nodal[..., None])[:, :2, 0].T
    area = 0.5 * cross((corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T)
    stored = c / 2 * np.sum(gradient**2, axis=0)
    laws = [None] * len(node) if laws is None else laws
    for law in {id(law): law for law in laws if law is not None}.values():
        rows = np.array([each is law for each in laws])
        stored[rows] = law.energy(np.hypot(*gradient[:, rows]))
    return float(area @ (stored - f * nodal.mean(axis=1) - np.sum(g * gradient, axis=0)))


def size_of_functional(position, node, data, values, laws=None):
    """How large the parts of the functional are: they may cancel, and what is rounded is they."""
    stored = functional(position, node, data * [1.0, 0.0, 0.0, 0.0], values, laws)
    return stored + abs(functional(position, node, data, values, laws) - stored)


def ritz_solution(position, node, data, values, fixed):
    """The values that minimise the functional with the fixed ones kept: dense, from the hat functions."""
    n = len(position)
    matrix, load = np.zeros((n, n)), np.zeros(n)
    for (c, f, *g), corners in zip(data, node, strict=True):
        plane = np.column_stack([position[corners], np.ones(3)])
        hats = np.linalg.inv(plane)[:2]
        area = 0.5 * abs(np.linalg.det(plane))
        matrix[np.ix_(corners, corners)] += c * area * hats.T @ hats
        load[corners] += area * (f / 3 + np.array(g) @ hats)
    free = ~fixed
    solution = np.where(fixed, values, 0.0)
    solution[free] = np.linalg.solve(matrix[np.ix_(free, free)], (load - matrix @ solution)[free])
    return solution


def star_derivatives(position, node, data, values, v, laws=None):
    """Gradient and Hessian of the functional in the position and the value of node v: doubled area and turned gradient
    are affine in the three, and the rest is the chain rule. Of a law, c is the secant H / b; across the gradient it
    curves with that, along it with dH/db."""
    gradient, hessian = np.zeros(3), np.zeros((3, 3))
    for e in star_of(node, v):
        k = list(node[e]).index(v)
        a, b = node[e, k - 2], node[e, k - 1]
        (c, f, *g), edge = data[e], position[b] - position[a]
        doubled = cross(position[a] - position[v], position[b] - position[v])
        by_doubled = np.array([-edge[1], edge[0], 0.0])
        turned = values[v] * edge + values[a] * (position[v] - position[b]) + values[b] * (position[a] - position[v])
        by_turned = np.column_stack([(values[a] - values[b]) * np.eye(2), edge])
        total, by_total = values[[v, a, b]].sum(), np.array([0.0, 0.0, 1.0])
        mean = turned / doubled
        bent = by_turned - np.outer(mean, by_doubled)
        if laws is not None and laws[e] is not None:
            b, law = np.hypot(*mean), laws[e]
            c, along = law.field_strength(b) / b, bent.T @ mean / b
            gradient += 0.5 * (law.energy(b) - c / 2 * b**2) * by_doubled
            hessian += (law.slope(b) - c) / (2 * doubled) * np.outer(along, along)
        gradient += c / 4 * (2 * by_turned.T @ mean - mean @ mean * by_doubled)
        gradient -= f / 6 * (by_doubled * total + doubled * by_total)
        gradient -= 0.5 * (g[1] * by_turned[0] - g[0] * by_turned[1])
        hessian += c / (2 * doubled) * bent.T @ bent
        hessian -= f / 6 * (np.outer(by_doubled, by_total) + np.outer(by_total, by_doubled))
    return gradient, hessian


def slow_descent(position, node, data, values, axes, rates, floor, overstep, least, laws=None):
    """One sweep of energy descent: positions, values and the gain of the moves.

    `axes[v]` (2, k) spans where node v may go; `rates[v]` is the rate of a value given along that, None for one that is
    eliminated. Nodes without axes and without a rate only have their value improved. Where there is a law, values take
    one step of Newton's method at every place that is tried, from what the derivatives foretell.
    """
    laws = np.full(len(node), None) if laws is None else np.array(laws, dtype=object)
    position, values, gain = position.copy(), values.copy(), 0.0
    for v in range(len(position)):
        if axes[v] is None:
            continue
        star = star_of(node, v)
        span, k = axes[v], axes[v].shape[1]
        full = np.zeros((3, k + 1))
        full[:2, :k], full[2, k] = span, 1.0
        if rates[v] is not None:
            full = np.vstack([span, np.full((1, k), rates[v])])
        curved = any(law is not None for law in laws[star]) and rates[v] is None

        def star_functional(star=star):
            return functional(position, node[star], data[star], values, laws[star])

        def newton(parts, v=v):
            """The first of these parts of a step of the value that is no loss."""
            value, before = values[v], star_functional()
            g, h = star_derivatives(position, node, data, values, v, laws)
            for part in parts:
                values[v] = value - part * g[2] / h[2, 2]
                if star_functional() <= before:
                    return
            values[v] = value

        gradient, hessian = star_derivatives(position, node, data, values, v, laws)
        full_hessian = hessian
        gradient, hessian = full.T @ gradient, full.T @ hessian @ full
        before, own, worst = position[v].copy(), values[v], worst_quality(position, node, star)

        def settle(v=v):
            """The least functional of the star where v is now, its value settled."""
            if rates[v] is None:
                newton((1.0,))
            return star_functional()

        value_slope, mixed, stiffness = gradient[-1], hessian[-1, :k], hessian[-1, -1]
        if rates[v] is None:
            gradient = gradient[:k] - hessian[:k, k] * gradient[k] / hessian[k, k]
            hessian = hessian[:k, :k] - np.outer(hessian[:k, k], hessian[k, :k]) / hessian[k, k]
        if curved:
            now = star_functional() - 0.5 * value_slope**2 / stiffness
            newton((1.0, 0.5, 0.25, 0.125))
        else:
            now = settle()
        settled = values[v]
        curvature, principal = np.linalg.eigh(hessian)
        if np.abs(curvature).max(initial=0.0) > 1e-12 * np.abs(full_hessian).max():
            curvature = np.maximum(np.abs(curvature), least * np.abs(curvature).max())
            step = -overstep * principal @ (principal.T @ gradient / curvature)
            for part in (1.0, 0.5, 0.25, 0.125):
                position[v] = before + part * span @ step
                after = worst_quality(position, node, star)
                if after > 0 and after >= min(floor, worst):
                    values[v] = own if rates[v] is None else own + rates[v] * part * step[0]
                    if curved:
                        values[v] -= (value_slope + part * mixed @ step) / stiffness
                    lowered = now - settle()
                    if lowered > 0:
                        gain += lowered
                        break
                position[v], values[v] = before, settled
    return position, values, gain
