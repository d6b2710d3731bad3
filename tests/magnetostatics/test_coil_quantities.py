"""Flux linkage, inductance, force and torque of coils in space, and forces on bodies beside coils."""

import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.magnet_solids import blocks

from kohonen_adapt.magnetostatics import Coil, FluxLinkage, Force, MagneticScalarPotential, Material, Torque

MU0 = 4e-7 * np.pi
AIR, IRON = Material(), Material(1000.0)
ORIGIN, AXIS = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
HALF = np.array([0.0, 0.25, 0.5, 0.75, 1.1, 1.5, 2.0])
T = np.r_[-HALF[:0:-1], HALF]
RACETRACK = Coil.racetrack(ORIGIN, AXIS, 2.0, 1.6, 0.4, (0.2, 0.8), 1000.0)
BLOCK = ((-0.5, -0.5, -0.25), (0.5, 0.5, 1.1))


def box(x=T, y=T, z=T, block=BLOCK):
    return blocks([x, y, z], {"block": block})


GRID = np.linspace(-2.0, 2.0, 5)
COARSE = box(GRID, GRID, GRID, ((-1.0, -1.0, -1.0), (0.0, 0.0, 0.0)))


def problem(material, coils=None, **arguments):
    coils = {"winding": RACETRACK} if coils is None else coils
    arguments = {"potential": {"outer": 0.0}} | arguments
    return MagneticScalarPotential({"block": material, "air": AIR}, coils=coils, **arguments)


def in_air(coil, **arguments):
    return problem(AIR, {"winding": coil}, **arguments).solve(COARSE)


# --- in free space -----------------------------------------------------------------------------------------------


def test_the_inductance_of_a_brooks_coil():
    """1.6994e-6 H/m times the mean radius: Grover, Inductance Calculations, 1946; the section is square."""
    coil = Coil.circular(ORIGIN, (0.0, 1.0, 1.0), 0.75, (0.5, 0.5), 3.0)
    assert in_air(coil).inductance("winding", turns=100) == pytest.approx(1.6994e-6 * 0.75 * 100**2, rel=3e-5)


# --- beside magnets, whose magnetisation is known ----------------------------------------------------------------


@pytest.mark.parametrize("space", ["scalar", "vector"])
def test_a_magnet_is_a_coil_on_its_surface(space):
    """Ampere's equivalence: linkage, force and torque of the winding, and the torque on the block by the same."""
    magnet = Material(remanence=(0.0, 0.0, 1.0))
    (x, y, low), (_, _, high) = BLOCK
    path = [[x, -x, -x, x], [y, y, -y, -y], [0.5 * (low + high)] * 4]
    sheet = Coil(path, 1e-3, high - low, (high - low) / MU0)
    tilted = replace(RACETRACK, path=RACETRACK.path + [[0.2], [0.0], [-0.1]])
    one, two = problem(magnet, {"winding": tilted}), problem(AIR, {"winding": tilted, "sheet": sheet})
    if space == "vector":
        one, two = one.vector_potential, two.vector_potential
    of_magnet, of_coil, centre = (
        one.solve(box()),
        two.solve(box(T[::4], T[::4], T[::4], ((0.0,) * 3, (2.0,) * 3))),
        (0.0, 1.0, 0.0),
    )
    assert of_magnet.flux_linkage("winding") == pytest.approx(of_coil.flux_linkage("winding"), rel=1e-4)
    force, torque = of_coil.force("winding"), of_coil.torque("winding", centre)
    np.testing.assert_allclose(of_magnet.force("winding"), force, atol=2e-3 * np.abs(force).max())
    np.testing.assert_allclose(of_magnet.torque("winding", centre), torque, atol=2e-3 * np.abs(torque).max())


def test_planes_of_symmetry_leave_a_part_of_the_coil():
    magnet, coils = Material(remanence=(0.0, 0.0, 1.0)), {"winding": RACETRACK}
    whole = problem(magnet, coils).solve(box())
    mesh = box(HALF, HALF, T, ((0.0, 0.0, -0.25), (0.5, 0.5, 1.1)))
    far, planes = dict.fromkeys(("x+", "y+", "z-", "z+"), 0.0), {"x-": "parallel", "y-": "parallel"}
    quarter = problem(magnet, coils, potential=far, symmetry=planes).solve(mesh)
    assert 4.0 * quarter.flux_linkage("winding") == pytest.approx(whole.flux_linkage("winding"), rel=1e-5)
    np.testing.assert_allclose(4.0 * quarter.force("winding"), whole.force("winding"), rtol=1e-3, atol=0.01)
    assert quarter.inductance("winding", 2) == pytest.approx(quarter.flux_linkage("winding", 2) / 500.0)
    with pytest.raises(ValueError, match=r"^the force on 'winding' has no component along \(1.0, 0.0, 0.0\)"):
        problem(magnet, coils, potential=far, symmetry=planes, goal=Force("winding", (1.0, 0.0, 0.0))).check(mesh)


# --- beside iron -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fields():
    return {order: replace(problem(IRON), order=order).solve(box()) for order in (1, 2)}


@pytest.fixture(scope="module")
def beside_iron(fields):
    return fields[2]


GOALS = [
    Force("winding", AXIS),
    Force("block", AXIS),
    Force(("block", "winding"), AXIS),
    Torque("winding", (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
    Torque("block", (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
    FluxLinkage({"winding": 10}),
]


@pytest.mark.parametrize("goal", GOALS, ids=lambda goal: type(goal).__name__)
@pytest.mark.parametrize("order", [1, 2])
def test_goals_and_their_derivatives(goal, order, fields):
    field = fields[order]
    change = np.random.default_rng(0).normal(size=field.unknown.size)
    source, load = goal.derivative(field)
    slope = np.sum(field.point_volumes * load * field.elements.gradient_at_points(change))
    ends = [goal(replace(field, unknown=field.unknown + step * change)) for step in (1e-4, -1e-4)]
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-5)
    assert not source.any()


@pytest.mark.parametrize("goal", [GOALS[0], GOALS[-1]], ids=["force", "linkage"])
def test_goal_errors_point_to_the_exact_value(goal, fields):
    given, field = problem(IRON, goal=goal), fields[1]
    value, exact = goal(field), goal(fields[2])
    assert abs(value + given.goal_error(field) - exact) < 0.6 * abs(value - exact)
    assert np.sum(given.indicators(field.mesh, field) ** 2) >= abs(given.goal_error(field))


# --- refused -----------------------------------------------------------------------------------------------------


def test_an_outer_boundary_that_is_not_far():
    message = "quantities of the coil 'winding' need the potential 0 on the far boundary, which is all of the outer"
    for potential in ({}, {"z-": 0.0}, {"outer": 3.0}):
        with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
            problem(IRON, potential=potential, goal=FluxLinkage({"winding": 1})).check(box())
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        problem(IRON, potential={}).vector_potential.solve(box()).force("winding")


def test_names_and_turns(beside_iron):
    with pytest.raises(ValueError, match=r"^'block' is no coil of the problem; its coils are 'winding'\.$"):
        beside_iron.flux_linkage("block")
    with pytest.raises(ValueError, match=r"^turns of 'winding' must be a finite number other than 0; got 0\.$"):
        beside_iron.inductance("winding", turns=0)
    still = problem(AIR, {"winding": replace(RACETRACK, ampere_turns=0.0)}).solve(box())
    with pytest.raises(ValueError, match=r"^the coil 'winding' carries no current"):
        still.inductance("winding")
    with pytest.raises(ValueError, match=r"^subdomain 'coil' is not in the mesh"):
        beside_iron.force("coil")
