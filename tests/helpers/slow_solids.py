"""Slow twins of what the map does in meshes of tetrahedra, in plain Python and without shared code."""

from itertools import combinations

import numpy as np

from helpers.alternatives import rings

INSIDE, ON_PATCH, ON_RIDGE = 3, 2, 1


def quality(position, node):
    """12 (3 V)^(2/3) / (sum of squared edges) of elements (m, 4), with the sign of the volume."""
    corners = position[node]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    squares = sum(np.sum((corners[:, i] - corners[:, j]) ** 2, axis=1) for i, j in combinations(range(4), 2))
    return np.sign(volume) * 12 * np.abs(3 * volume) ** (2 / 3) / squares


class SlowSolidMap:
    """Equation 1 of the paper with the guard; nodes slide in planes (normals) and along lines (directions)."""

    def __init__(self, position, node, number, place, normals, directions, floor):
        self.position, self.node, self.number, self.place = position.copy(), node, number, place
        self.normals, self.directions, self.floor = normals, directions, floor
        self.refused = 0

    def move(self, v, x, step):
        """A guarded step of a share of the way, as far as a node's freedom has it."""
        before, way = self.position[v].copy(), step * (x - self.position[v])
        if self.number[v] == ON_PATCH:
            n = self.normals[self.place[v]]
            way = way - way @ n * n
        elif self.number[v] == ON_RIDGE:
            a = self.directions[self.place[v]]
            way = way @ a * a
        elif self.number[v] != INSIDE:
            return
        star = self.node[(self.node == v).any(axis=1)]
        worst = quality(self.position, star).min()
        self.position[v] = before + way
        after = quality(self.position, star).min()
        if after <= 0 or after < min(self.floor, worst):
            self.position[v] = before
            self.refused += 1

    def present(self, x, rate, strength):
        """One training point; returns the distance to its winner, the nearest of all nodes."""
        distance = np.linalg.norm(self.position - x, axis=1)
        nearby = rings(self.node, int(np.argmin(distance)), len(strength) - 1)
        for ring, share in zip(nearby, strength, strict=True):
            for v in ring:
                self.move(v, x, rate * share)
        return distance.min()
