"""Coils of a problem with a scalar potential: their field, what they may not meet, and planes of symmetry."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.magnet_solids import blocks
from test_coil_quantities import AIR, AXIS, HALF, IRON, T
from test_coil_quantities import RACETRACK as COIL

from kohonen_adapt.magnetostatics import Coil, MagneticScalarPotential

PARTS = {"limb": ((-0.5, -0.5, -0.75), (0.5, 0.5, 0.75))}
QUADRATURE = 3e-8  # of rules along edges of iron, which have fewer points away from a coil than for a function


def box(x=T, y=T, z=T, parts=None):
    return blocks([x, y, z], PARTS if parts is None else parts)


def problem(coils=None, **arguments):
    arguments = {"potential": {"outer": 0.0}} | arguments
    coils = {"winding": COIL} if coils is None else coils
    return MagneticScalarPotential({"limb": IRON, "air": AIR}, coils=coils, **arguments)


@pytest.fixture(scope="module")
def whole():
    return problem().solve(box())


def test_a_coil_is_the_field_of_its_current(whole):
    mesh = box()
    same = problem({}, applied_field=COIL.field_strength).solve(mesh)
    np.testing.assert_allclose(whole.unknown, same.unknown, atol=QUADRATURE * np.abs(same.unknown).max())
    x = np.random.default_rng(0).uniform(-1.9, 1.9, (3, 50))
    size = np.abs(same.flux_density).max()
    np.testing.assert_allclose(whole.flux_density_at(x), same.flux_density_at(x), atol=QUADRATURE * size)


def test_an_image_is_a_coil_of_its_own():
    """Two coils to both sides of a plane, of the same or of opposite sense."""
    side = HALF
    mesh = box(x=side, parts={"limb": ((0.0, -0.25, -0.75), (0.5, 0.25, 0.75))})
    coils = {name: Coil.circular((x, 0.0, 0.0), AXIS, 0.3, (0.1, 0.2), current) for name, x, current in
             (("one", 1.2, 50.0), ("image", -1.2, 50.0))}  # fmt: skip
    problem(coils, symmetry={"x-": "parallel"}).check(mesh)
    with pytest.raises(
        ValueError, match=r"^the coil 'one' is not symmetric about the plane 'x-', to which the flux is n"
    ):
        problem(coils, symmetry={"x-": "normal"}).check(mesh)
    coils["image"] = replace(coils["image"], ampere_turns=-50.0)
    problem(coils, symmetry={"x-": "normal"}).check(mesh)
    with pytest.raises(
        ValueError, match=r"^the coil 'one' is not symmetric .*; give the whole coil, .*, or the coil and"
    ):
        problem({"one": coils["one"]}, symmetry={"x-": "parallel"}).check(mesh)


@pytest.mark.parametrize("shift", [(0.2, 0.0, 0.0), (0.0, -0.35, 0.0)])
def test_a_coil_that_meets_iron(shift):
    moved = replace(COIL, path=COIL.path + np.array(shift)[:, None])
    wide = {"limb": ((-0.75, -0.5, -0.75), (0.75, 0.5, 0.75))}
    with pytest.raises(ValueError, match=r"^the coil 'winding' meets 'limb', which is iron or a magnet, at \("):
        problem({"winding": moved}).solve(box(parts=wide))


def test_a_coil_that_leaves_the_mesh():
    wide = Coil.circular((0.0, 0.0, 0.0), AXIS, 1.95, (0.2, 0.4), 10.0)
    with pytest.raises(
        ValueError, match=r"^the coil 'winding' leaves the mesh at \(.*\), where .*; the mesh is from \(-2, -2, -2\) to"
    ):
        problem({"winding": wide}).check(box())


def test_coils_have_names():
    for given in ([COIL], {"winding": 3.0}, COIL):
        with pytest.raises(ValueError, match=r"^coils must map names to magnetostatics.Coil, as .*; got .*$"):
            problem(given)
    assert repr(COIL) == "<Coil: 1000 A around (0, 0, 1), section 0.2 x 0.8 m>"
