"""Slow twins of what the map does in meshes of tetrahedra, in plain Python and without shared code."""

import numpy as np

from helpers.alternatives import rings
from helpers.boxes import qualities

INSIDE, ON_PATCH, ON_RIDGE = 3, 2, 1


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
        worst = qualities(self.position, star).min()
        self.position[v] = before + way
        after = qualities(self.position, star).min()
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
