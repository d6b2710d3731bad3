"""Meshes of balls and blocks in air for magnets in space, and fields that are known there."""

from itertools import pairwise

import numpy as np
from scipy.special import eval_gegenbauer, eval_legendre
from skfem import MeshTet

from helpers.meshes import disk
from helpers.sheets import MU0
from helpers.solids import extruded


def nested_balls(cells, rim=2.0):
    """A ball of radius 1 in a ball of air: a cube with its shells blown up, so many cells deep each."""
    t = np.linspace(-1.0, 1.0, 4 * cells + 1)
    cube = MeshTet.init_tensor(t, t, t)
    shell, length = np.abs(cube.p).max(axis=0), np.linalg.norm(cube.p, axis=0)
    radius = np.where(shell < 0.5, 2.0 * shell, rim ** (2.0 * shell - 1.0))
    mesh = MeshTet(cube.p / np.where(length > 0.0, length, 1.0) * radius, cube.t)
    inside = shell[cube.t].max(axis=0) <= 0.5
    mesh = mesh.with_subdomains({"ball": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})
    return mesh.with_boundaries({"outer": lambda x: np.linalg.norm(x, axis=0) > 0.5})


def blocks(axes, parts):
    """A box of cells along three axes, with blocks in it, ((x, y, z), (x, y, z)) each, and air around them."""
    mesh = MeshTet.init_tensor(*axes)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    regions = {name: np.all([(m > a) & (m < b) for m, a, b in zip(middle, *ends, strict=True)], axis=0)
               for name, ends in parts.items()}  # fmt: skip
    regions["air"] = ~np.any([np.zeros(mesh.nelements, dtype=bool), *regions.values()], axis=0)
    mesh = mesh.with_subdomains({name: np.flatnonzero(where) for name, where in regions.items()})
    ends = {f"{'xyz'[k]}{sign}": (k, at) for k in range(3) for sign, at in (("-", axes[k][0]), ("+", axes[k][-1]))}
    sides = {name: (lambda x, k=k, at=at: np.abs(x[k] - at) < 1e-9) for name, (k, at) in ends.items()}
    return mesh.with_boundaries({"outer": lambda x: np.full(x.shape[1], True), **sides})


def graded(marks, step, far, layers):
    """Coordinates: even steps between marks, growing ones to some distance beyond the outermost."""
    inner = [np.linspace(a, b, max(1, round((b - a) / step)) + 1)[:-1] for a, b in pairwise(marks)]
    beyond = step * (np.geomspace(1.0, 1.0 + far / step, layers + 1)[1:] - 1.0)
    return np.concatenate([marks[0] - beyond[::-1], *inner, marks[-1:], marks[-1] + beyond])


def dipole(x, strength):
    """Potential and field strength of ``strength z / r^3`` at points."""
    r, z = np.linalg.norm(x, axis=0), x[2]
    field = strength * 3.0 * z * x / r**5
    field[2] -= strength / r**3
    return strength * z / r**3, field


class LoopAndBall:
    """A loop around the z axis above a permeable ball of radius 1 about the origin, by a series."""

    def __init__(self, radius, height, current, permeability, terms=40):
        k, distance = np.arange(terms), np.hypot(radius, height)
        share = eval_gegenbauer(k, 1.5, height / distance) / distance ** (k + 3)
        # The field of the loop is -grad of sum_n own[n] r^n P_n near the origin.
        self.n, self.own = k + 1, -0.5 * current * radius**2 * share / (k + 1)
        self.reply = -self.own * self.n * (permeability - 1) / (self.n * permeability + self.n + 1)
        self.within = self.own * (2 * self.n + 1) / (self.n * permeability + self.n + 1)
        self.permeability, self.radius, self.height, self.current = permeability, radius, height, current

    def reduced(self, x):
        """The potential that the ball adds outside."""
        return self._sum(self.reply, x, -self.n - 1.0)

    def inside(self, x):
        """The total potential in the ball."""
        return self._sum(self.within, x, self.n.astype(float))

    def force(self):
        """Along z on the ball: the loop is pulled the other way by what the ball adds there."""
        at, step = np.array([[self.radius], [0.0], [self.height]]), 1e-5
        sideways = -(self.reduced(at + step * np.eye(3)[:, :1]) - self.reduced(at - step * np.eye(3)[:, :1]))[0]
        return 2.0 * np.pi * self.radius * self.current * MU0 * sideways / (2.0 * step)

    def _sum(self, factor, x, power):
        r = np.linalg.norm(x, axis=0)
        along = x[2] / np.where(r > 0.0, r, 1.0)
        return sum(c * r**p * eval_legendre(n, along) for c, p, n in zip(factor, power, self.n, strict=True))


def bar():
    """A round bar in a round tube, the ends of both plane."""
    mesh = extruded(disk(6, 1.0), 3)
    inside = np.hypot(*mesh.p[:2, mesh.t].mean(axis=1)) < 0.5
    mesh = mesh.with_boundaries({"outer": lambda x: np.hypot(*x[:2]) > 0.9})
    return mesh.with_subdomains({"ball": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})


CUBOIDS = {
    "a": ((-0.010, -0.010, -0.005), (0.010, 0.010, 0.005)),
    "b": ((-0.006, -0.010, 0.010), (0.014, 0.010, 0.020)),
}
MARKS = ([-0.010, -0.006, 0.010, 0.014], [-0.010, 0.010], [-0.005, 0.005, 0.010, 0.020])


def cuboids(step, far=0.06, layers=None):
    """Two cuboids in air."""
    layers = layers or max(2, round(0.011 / step))
    return blocks([graded(each, step, far, layers) for each in MARKS], CUBOIDS)
