"""Circles that are one: a rotor that is turned in its stator, and Kelvin discs for all that is outside, exactly."""

from pathlib import Path

import numpy as np
import pytest
from helpers.curved_meshes import on_circles, with_midsides
from helpers.meshes import apart, disk, ring
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.cases import case_of
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.mesh.measures import area

MU0 = 4e-7 * np.pi
RINGS = 16


def with_magnet(mesh, radius, at=0.0):
    """The mesh with a round magnet about (at, 0), in air."""
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    inside = np.hypot(x - at, y) < radius
    return mesh.with_subdomains({"magnet": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})


def rim_named(mesh):
    return mesh.with_boundaries({"rim": mesh.boundary_facets()})


# --- a magnet in a uniform field ---------------------------------------------------------------------------------


def machine(at=0.0):
    """A rotor, a round magnet in a disc of air about (at, 0), and a stator of air about the origin."""
    rotor = rim_named(disk(RINGS, 0.02)).translated((at, 0.0))
    return with_magnet(apart(rotor, ring(6 * RINGS, 24, inner=0.02, outer=0.08)), 0.01, at)


def problem(mesh, pair, order=2):
    """In a field of 1 T along x, the magnet of a moment of 1 A m^2 per metre along x: torque is minus sin(angle)."""
    moment = Material(remanence=(MU0 / area(mesh)[mesh.subdomains["magnet"]].sum(), 0.0))
    return Magnetostatics(
        {"magnet": moment, "air": Material()}, {"1 outer": lambda x: x[1]}, periodic=[pair], order=order
    )


def torque(mesh, pair, order=2):
    return problem(mesh, pair, order).solve(mesh).torque("magnet")


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("step", [0, -8, 8, -40])
def test_a_rotor_turns_by_the_angle_of_its_pair(step, curved, order):
    """+0.5 at -30 degrees (step -8); matched by whatever fits it was -0.9987."""
    angle, mesh = 2 * np.pi * step / (6 * RINGS), machine()
    mesh = with_midsides(mesh, on_circles) if curved else mesh
    found = torque(mesh, ("0 rim", "1 inner", ka.Rotation(angle)), order)
    assert found == pytest.approx(-np.sin(angle), abs=5e-4 if curved else 0.005)
    assert torque(mesh, ("1 inner", "0 rim", ka.Rotation(-angle)), order) == pytest.approx(found, abs=1e-9)


def test_pairs_of_a_problem_have_their_motions():
    pairs = [("a", "b", ka.Translation((1.0, 0.0))), ("c", "d")]
    it = Magnetostatics({"air": Material()}, periodic=pairs[:1], antiperiodic=pairs[1:])
    assert it.pairs == tuple(pairs)
    message = "the third entry of a pair in antiperiodic must be a kohonen_adapt.Rotation, Translation or Reflection"
    with pytest.raises(ValueError, match=message):
        Magnetostatics({"air": Material()}, antiperiodic=[("a", "b", 0.5)])


def test_a_case_names_motions():
    entry = lambda **motion: [["a", "b", motion]]  # noqa: E731
    case = {
        "mesh": "m",
        "materials": {"air": {}},
        "potential": {"e": 0.0},
        "periodic": entry(motion="rotation", angle=0.1, centre=[1, 0]),
        "antiperiodic": [["c", "d", {"motion": "reflection", "point": [0.0, 0.0], "normal": [1.0, 0.0]}]],
        "adapt": {"periodic": entry(motion="translation", vector=[1.0, 2.0])},
    }
    read = case_of(case, Path())
    assert read.problem.periodic == (("a", "b", ka.Rotation(0.1, (1.0, 0.0))),)
    assert read.problem.antiperiodic == (("c", "d", ka.Reflection((0.0, 0.0), (1.0, 0.0))),)
    assert read.adapt["periodic"] == [("a", "b", ka.Translation((1.0, 2.0)))]


# --- Kelvin discs ------------------------------------------------------------------------------------------------

APART = 0.05


def with_kelvin_disc(rings):
    """A round magnet of 10 mm in a disc of air of 20 mm, and the mirror image of that disc beside it, all of air.

    There r stands for 400 mm^2 / r. It is in two halves, and "far" is the line between them, through infinity.
    """
    one = rim_named(disk(rings, 0.02))
    other = rim_named(MeshTri(np.array([[APART], [0.0]]) + one.p * [[-1.0], [1.0]], one.t))
    mesh = with_magnet(apart(one, other), 0.01)
    far = mesh.facets_satisfying(lambda x: (np.abs(x[1]) < 1e-9) & (x[0] > 0.5 * APART))
    return mesh.with_boundaries({**mesh.boundaries, "far": far})


MIRROR = ka.Reflection(point=(0.5 * APART, 0.0), normal=(1.0, 0.0))
DIPOLE = {"magnet": Material(remanence=(1.2, 0.0)), "air": Material()}


@pytest.mark.parametrize(
    ("motion", "sign"),
    [
        (MIRROR, 1.0),
        (MIRROR, -1.0),
        (ka.Translation((APART, 0.0)), 1.0),
        (ka.Rotation(np.pi, (0.5 * APART, 0.0)), -1.0),
    ],
)
def test_a_kelvin_disc_is_all_that_is_outside(motion, sign):
    """A long cylinder magnetised across has Br / 2 inside, and A = Br a^2 y / (2 r^2) outside, in the image linear.

    "far" is where that is zero anyhow.
    """
    mesh = with_kelvin_disc(16)
    kind = "periodic" if sign > 0 else "antiperiodic"
    it = Magnetostatics(DIPOLE, {"far": 0.0}, **{kind: [("0 rim", "1 rim", motion)]})
    field = it.solve(mesh)
    x = 0.004 * np.array([[0.0, 1.0, 0.0, -1.0], [0.1, 0.0, 1.0, -1.0]])
    np.testing.assert_allclose(field.flux_density_at(x)[0], 0.6, rtol=0.005)
    np.testing.assert_allclose(field.flux_density_at(x)[1], 0.0, atol=0.005 * 0.6)
    beyond = np.array([[0.0, 0.01, -0.01], [0.015, 0.01, -0.005]])
    upside_down = -1.0 if isinstance(motion, ka.Rotation) else 1.0
    exact = sign * upside_down * 0.6 * 0.01**2 * beyond[1] / 0.02**2
    np.testing.assert_allclose(field.potential_at(beyond + [[APART], [0.0]]), exact, rtol=0.01, atol=1e-9)
    # Inside B = Br / 2 and outside as much energy again as between: int nu |B - Br|^2 / 2 = Br^2 pi a^2 / (4 mu0)
    assert field.energy == pytest.approx(1.2**2 * np.pi * 0.01**2 / (4 * MU0), rel=0.02)
    assert np.linalg.norm(it.indicators(mesh, field)) < 0.1 * it.energy_norm(mesh, field)
