"""The polish of nonlinear material: tables of laws, stars against slow twins, and a functional that never rises."""

import numpy as np
import pytest
from helpers.meshes import perturbed, square
from helpers.steel import STEEL
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt.kernels.functionals import Laws, energy_density
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.triangle.polish.descend import descend_nodes
from kohonen_adapt.kernels.triangle.polish.flips import descend_flips
from kohonen_adapt.magnetostatics import Arctan, Brauer, Froehlich, Magnetostatics, Material, Table
from kohonen_adapt.polishing.energy_tables import tabulated

energy_density = interpreted(energy_density)

LAWS = {
    "Brauer": Brauer(100.0, 10.0, 1.8),
    "Froehlich": Froehlich(4000.0, 2.1),
    "Arctan": Arctan(2000.0, 1.9),
    "Table": Table(STEEL),
}
each_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
TABLE = 1e-10  # of an energy: what tables leave out


class Straight:
    """H = c b: linear material that is given as a law."""

    def __init__(self, coefficient):
        self.coefficient = coefficient

    def field_strength(self, b):
        return self.coefficient * b

    def slope(self, b):
        return self.coefficient + 0.0 * b

    def energy(self, b):
        return 0.5 * self.coefficient * b**2


# --- tables ----------------------------------------------------------------------------------------------------


@each_law
@pytest.mark.parametrize("largest", [1e-3, 1.0, 2.0, 5.0])
def test_tables_hold_energies_and_their_rates(law, largest):
    tables = tabulated([law], largest)
    laws = Laws(np.zeros(1, dtype=np.int32), tables.first, tables.energy)
    b = largest * np.concatenate([np.geomspace(1e-8, 1.0, 300), np.linspace(0.1, 1.5, 3001)])
    energy, rate, bend = np.array([energy_density(laws, 0, s) for s in b**2]).T
    whole = float(law.energy(np.float64(largest)))
    # a step that a table of points bends in is the exception; what counts is what they sum up to
    assert_allclose(energy, law.energy(b), rtol=100 * TABLE, atol=TABLE * whole)
    assert abs(np.sum(energy - law.energy(b))) < TABLE * np.sum(law.energy(b))
    assert_allclose(rate, law.field_strength(b) / (2 * b), rtol=1e-4)
    assert np.all(rate + 2 * b**2 * bend > 0.0)  # the field strength rises


class Falling(Straight):
    """Beyond 1 / 2 of what the solution has."""

    def field_strength(self, b):
        return b * np.where(b < 0.5, 1.0, 0.3)

    def energy(self, b):
        return np.where(b < 0.5, 0.5 * b**2, 0.15 * b**2 + 0.0875)


class Halved(Straight):
    """An energy that somebody forgot the half of."""

    def energy(self, b):
        return 2.0 * super().energy(b)


class Single(Straight):
    """One number for all b."""

    def energy(self, b):
        return 1.0


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (Falling(1.0), r"a field strength that increases with b, and an energy .*; .* violates this near b = 0\.49"),
        (
            Halved(1.0),
            "laws of Ritz must have a field strength that increases with b, and an energy that is the integral of",
        ),
        (Straight(-1.0), "must have a field strength that increases with b"),
        (Straight(np.nan), "laws of Ritz must be finite up to b = "),
        (
            Single(1.0),
            r"must return arrays of the shape of b, .*; .* returned \(\d+,\) as field strength and \(\) as energy\.",
        ),
    ],
)
def test_wrong_laws_are_refused(law, message):
    with pytest.raises(ValueError, match=message):
        tabulated([law], 1.0)


@pytest.mark.parametrize(
    ("laws", "message"),
    [
        (Straight(1.0), "laws of Ritz must be a sequence with None or a law per region number; got <"),
        ([None], "laws of Ritz must have None or a law for each of 2 region numbers; got 1"),
        (
            [None, 1000.0],
            r"laws\[1\] of Ritz must be None or have the methods field_strength\(b\) and energy",
        ),
    ],
)
def test_what_is_no_law_is_refused(laws, message):
    with pytest.raises(ValueError, match=message):
        ka.Ritz(np.zeros(4), np.zeros(4, dtype=bool), 1.0, region=[0, 1], laws=laws)


# --- magnetostatics --------------------------------------------------------------------------------------------


def blocks(n, seed=None):
    """A block of iron beside a conductor in a square of air; their sides are among those of 16 n squares."""
    mesh = square(n)
    mesh = mesh.with_subdomains(
        {
            "iron": lambda x: (np.abs(x[0] - 0.375) < 0.125) & (np.abs(x[1] - 0.5) < 0.25),
            "coil": lambda x: (np.abs(x[0] - 0.6875) < 0.0625) & (np.abs(x[1] - 0.5) < 0.125),
        }
    )
    rest = np.setdiff1d(np.arange(mesh.t.shape[1]), np.concatenate(list(mesh.subdomains.values())))
    mesh = mesh.with_subdomains({"air": rest}).with_boundaries({"outer": lambda x: x[0] > -1})
    return mesh if seed is None else perturbed(mesh, seed)


def problem_of(iron, current_density=3e7):
    coil = Material(current_density=current_density)
    return Magnetostatics({"iron": iron, "coil": coil, "air": Material()}, {"outer": 0.0}, order=1)


def test_nonlinear_material_compiles_nothing_that_linear_has_not():
    mesh, compiled = blocks(16), (descend_nodes, descend_flips)
    ka.polish(mesh, problem_of(Material(1000.0)), sweeps=1)
    before = [len(kernel.signatures) for kernel in compiled]
    ka.polish(mesh, problem_of(Material(bh=STEEL)), sweeps=1)
    assert [len(kernel.signatures) for kernel in compiled] == before
