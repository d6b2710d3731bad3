"""Exact magnetic fields with their problems: a magnet of sheets, layers, and the corner of iron."""

import numpy as np
from scipy.optimize import brentq
from skfem import Basis, ElementTriP1, MeshTri

from helpers.sheets import MU0, rectangle_field, rectangle_potential
from helpers.tensor_meshes import box
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.mesh.measures import area

MAGNETISATION = 1e6  # A/m, of the magnets with exact fields
LAYERS = {"iron": Material(1000.0), "magnet": Material(1.05, remanence=(0.0, 1.2)), "air": Material()}
HALF = np.array([0.01, 0.005])


class Corner:
    """Iron in a right angle about the x axis and the field that is singular at its corner, odd in the angle.

    A = Im z^l in the iron and c Im w^l with w = -conj(z) outside: sin(l t) and c sin(l (pi - t)) times r^l.
    """

    def __init__(self, permeability):
        a, b = np.pi / 4, 3 * np.pi / 4
        meet = lambda x: permeability * np.sin(x * a) * np.cos(x * b) + np.sin(x * b) * np.cos(x * a)  # noqa: E731
        self.exponent = brentq(meet, 0.6, 0.99)
        self.outside = np.sin(self.exponent * a) / np.sin(self.exponent * b)
        self.materials = {"iron": Material(permeability), "air": Material()}

    def mesh(self, n):
        ticks = np.linspace(-1.0, 1.0, 2 * n + 1)
        plain = MeshTri.init_tensor(ticks, ticks)
        iron = np.all(plain.p[:, plain.t].mean(axis=1) > 0.0, axis=0)
        turn = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
        mesh = MeshTri(turn @ plain.p, plain.t).with_boundaries({"rim": lambda x: x[0] > -9}, boundaries_only=True)
        return mesh.with_subdomains({"iron": np.flatnonzero(iron), "air": np.flatnonzero(~iron)})

    def potential(self, x):
        z = x[0] + 1j * x[1]
        iron = np.abs(np.angle(z)) <= np.pi / 4 + 1e-9
        return np.where(iron, (z**self.exponent).imag, self.outside * ((-z.conj()) ** self.exponent).imag)

    def error(self, mesh, field):
        basis = Basis(mesh, ElementTriP1(), intorder=8)
        x = np.asarray(basis.global_coordinates())
        z, iron = x[0] + 1j * x[1], np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["iron"])[:, None]
        inside, beyond = (self.exponent * w ** (self.exponent - 1) for w in (z, -z.conj()))
        along_x = np.where(iron, inside.imag, -self.outside * beyond.imag)
        along_y = np.where(iron, inside.real, self.outside * beyond.real)
        off = field.flux_density[:, :, None] - np.stack((along_y, -along_x))
        return np.sqrt(np.sum(field.reluctivity[:, None] * np.sum(off**2, axis=0) * basis.dx))


def random_mesh(seed=0, cells=6):
    """The square (0, 3)^2 with nodes moved at random but on the lines x = 1 and x = 2, and its four sides by name."""
    mesh = MeshTri.init_tensor(np.linspace(0, 3, 3 * cells + 1), np.linspace(0, 3, 3 * cells + 1))
    shift = np.random.default_rng(seed).uniform(-0.25, 0.25, mesh.p.shape) / cells
    shift[:, mesh.boundary_nodes()] = 0.0
    shift[0, np.isin(mesh.p[0].round(9), (1.0, 2.0))] = 0.0
    sides = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 3 - 1e-9}
    sides |= {"bottom": lambda x: x[1] < 1e-9, "top": lambda x: x[1] > 3 - 1e-9}
    layers = {"iron": lambda x: x[0] < 1, "magnet": lambda x: (x[0] > 1) & (x[0] < 2), "air": lambda x: x[0] > 2}
    return MeshTri(mesh.p + shift, mesh.t).with_boundaries(sides).with_subdomains(layers)


def rectangle_mesh(n):
    """60 x 40 mm around the magnet of 20 x 10 mm, 2 n squares to 10 mm."""
    sides = {"magnet": (-HALF[0], HALF[0], -HALF[1], HALF[1])}
    return box(np.linspace(-0.03, 0.03, 12 * n + 1), np.linspace(-0.02, 0.02, 8 * n + 1), sides)


def sheet_potential(x):
    return rectangle_potential(x, (0.0, 0.0), HALF)


def sheet_field(x):
    return rectangle_field(x, (0.0, 0.0), HALF)


RECTANGLE = Magnetostatics(
    {"magnet": Material(remanence=(0.0, MU0 * MAGNETISATION)), "air": Material()},
    potential={"outer": sheet_potential},
    order=1,
)


def true_error(field, exact):
    """sqrt(int nu |B_h - B|^2) of linear material."""
    elements, symmetry = field.elements, field.symmetry
    found = symmetry.flux_density(elements.points, elements.gradient(field.values))
    squared = np.sum((found - exact(elements.points)) ** 2, axis=0)
    return np.sqrt(np.sum(elements.mean(squared) * area(field.mesh) * field.reluctivity))


def overrating(problem, mesh, field, exact):
    """The estimate over the true error."""
    return np.linalg.norm(problem.indicators(mesh, field)) / true_error(field, exact)


def smooth_potential(x):
    """A harmonic function."""
    return np.exp(3 * x[0]) * np.cos(3 * x[1])


def smooth_field(x):
    """B of that potential."""
    return 3 * np.exp(3 * x[0]) * np.stack((-np.sin(3 * x[1]), -np.cos(3 * x[1])))


def halbach_field(x):
    """B of a cylinder of one pole pair in free space, remanence 1 T: A = y ln(0.04 / r) in it, y ln 2 in the bore."""
    r = np.hypot(*x)
    along, inside = np.log(0.04 / np.clip(r, 0.02, 0.04)), (r > 0.02) & (r < 0.04)
    return np.stack([along - np.where(inside, (x[1] / r) ** 2, 0.0), np.where(inside, x[0] * x[1] / r**2, 0.0)])
