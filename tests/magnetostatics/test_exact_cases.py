"""Known numbers of planar magnetostatics: the inductance of a coaxial cable, and the exponents of iron corners."""

import numpy as np
import pytest
from helpers.meshes import disk
from scipy.optimize import brentq
from skfem import Basis, ElementTriP1, MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

MU0 = 4e-7 * np.pi


def coax_mesh(rings):
    """A core of 0.25 mm in a sheath from 0.76 to 0.99 mm: rings shifted onto these circles; `rings` a multiple of 4."""
    mesh = disk(rings, 1.0)
    radius = np.hypot(*mesh.p)
    moved = np.interp(radius, [0.0, 0.25, 0.75, 1.0], [0.0, 0.25e-3, 0.76e-3, 0.99e-3])
    mesh = MeshTri(mesh.p * moved / np.where(radius > 0, radius, 1.0), mesh.t)
    middle = radius[mesh.t].mean(axis=0)
    parts = {"core": middle < 0.25, "gap": (middle > 0.25) & (middle < 0.75), "sheath": middle > 0.75}
    mesh = mesh.with_subdomains({name: np.flatnonzero(inside) for name, inside in parts.items()})
    return mesh.with_boundaries({"rim": lambda x: np.hypot(*x) > 0.95e-3})


COAX = Magnetostatics(
    dict.fromkeys(("core", "gap", "sheath"), Material()),
    potential={"rim": 0.0},
    ampere_turns={"core": 1.0, "sheath": -1.0},
)
COAX_INDUCTANCE = 2.923978157561e-7 / 1.25663706212e-6 * MU0


def test_a_coaxial_cable_has_its_inductance():
    rings = (8, 16, 32)
    found = np.array([2.0 * COAX.solve(coax_mesh(number)).energy for number in rings])
    errors = np.abs(found / COAX_INDUCTANCE - 1)
    assert errors[-1] < 0.002
    assert 1.8 < -np.polyfit(np.log(rings), np.log(errors), 1)[0] < 2.2


EXPONENTS = {10.0: 0.731692, 100.0: 0.673921, 1000.0: 0.667401}


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


@pytest.mark.parametrize("permeability", EXPONENTS)
def test_uniform_meshes_converge_as_the_corner_of_the_iron_lets_them(permeability):
    corner, counts, errors = Corner(permeability), (8, 16, 32), []
    assert corner.exponent == pytest.approx(EXPONENTS[permeability], abs=5e-7)
    problem = Magnetostatics(corner.materials, potential={"rim": corner.potential})
    for n in counts:
        mesh = corner.mesh(n)
        errors.append(corner.error(mesh, problem.solve(mesh)))
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(corner.exponent, abs=0.03)


def test_adapting_the_cable_beats_a_uniform_mesh_of_as_many_nodes():
    """scikit-fem's example 35 finds 2.9059561564e-7 H/m with 688 nodes; both are below the exact one."""
    result = ka.adapt(coax_mesh(12), COAX, target_nodes=688)
    assert result.mesh.p.shape[1] == 688
    assert 2.9059561564e-7 / 2.923978157561e-7 < 2.0 * result.solution.energy / COAX_INDUCTANCE < 1.0
