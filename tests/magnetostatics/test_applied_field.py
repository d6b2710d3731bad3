"""Currents in space as an applied field: a loop above a ball, rings that link a coil, and what no mesh may do to it."""

import numpy as np
import pytest
from helpers.magnet_solids import LoopAndBall, blocks, nested_balls
from helpers.sheets import MU0
from scipy.spatial.transform import Rotation

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import (
    Force,
    MagneticScalarPotential,
    Material,
    Torque,
    apparent_inductance,
    arkkio_torque,
    energy_inductance,
    lorentz_force,
    lorentz_torque,
)

pytestmark = pytest.mark.filterwarnings("ignore:.*removed in 1.2:DeprecationWarning")

magpylib = pytest.importorskip("magpylib", reason="magpylib knows the field of a loop; it is in the test extra")

AIR = Material()
RADIUS, HEIGHT, CURRENT = 1.5, 1.0, 100.0
QUARTER_TURN = Rotation.from_euler("x", 90, degrees=True)


def loop(position=(0.0, 0.0, HEIGHT), radius=RADIUS, **arguments):
    return magpylib.current.Circle(diameter=2.0 * radius, current=CURRENT, position=position, **arguments)


def energy_of(field, rows, difference):
    """``int |difference|^2`` over some elements."""
    return np.sum(field.elements.volumes[rows] * np.sum(difference**2, axis=0))


def slope_of(function, x, step=1e-5):
    ways = step * np.eye(3)[:, :, None]
    return np.stack([(function(x + ways[k]) - function(x - ways[k])) / (2.0 * step) for k in range(3)])


@pytest.fixture(scope="module")
def solved():
    exact = LoopAndBall(RADIUS, HEIGHT, CURRENT, 1000.0)
    problem = MagneticScalarPotential(
        {"ball": Material(1000.0), "air": AIR}, {"outer": exact.reduced}, applied_field=loop()
    )
    return exact, problem, [problem.solve(nested_balls(cells, rim=4.0)) for cells in (3, 5)]


def test_a_loop_above_a_permeable_ball(solved):
    """First order of what the ball adds outside, and better of H in it, where nothing is left of the loop's field."""
    exact, _, fields = solved
    outside, inside = [], []
    for field in fields:
        x = field.mesh.p[:, field.mesh.t].mean(axis=1)
        air, ball = (field.mesh.subdomains[name] for name in ("air", "ball"))
        wanted, found = slope_of(exact.reduced, x[:, air]), field.elements.gradient(field.potential)[:, air]
        outside.append(np.sqrt(energy_of(field, air, found - wanted) / energy_of(field, air, wanted)))
        wanted = -slope_of(exact.inside, x[:, ball])
        difference = field.field_strength[:, ball] - wanted
        inside.append(np.sqrt(energy_of(field, ball, difference) / energy_of(field, ball, wanted)))
    assert np.log(outside[0] / outside[1]) / np.log(5 / 3) > 0.9
    assert np.log(inside[0] / inside[1]) / np.log(5 / 3) > 1.2 and inside[1] < 0.12


def test_force_beside_a_wire(solved):
    """The shell around the ball keeps away from elements that the wire goes through."""
    exact, _, (_, field) = solved
    current = field.drive.current_density > 0.0
    angle = np.linspace(0.0, 2.0 * np.pi, 2000)
    wire = np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), np.full(angle.shape, HEIGHT)])
    met = np.unique(ka.find_elements(field.mesh, wire))
    beside = np.isin(field.mesh.t, field.mesh.t[:, met]).any(axis=0)
    assert current[met].all() and not current[~beside].any()
    force = field.force("ball")
    assert force[2] == pytest.approx(exact.force(), rel=0.05)
    assert np.abs(force[:2]).max() < 0.02 * force[2]


TOUCHES = (
    r"^subdomain 'ball' touches 'air' where the current of the applied_field runs, and the force is computed from the "
    r"field in air without current: give the coil in coils, or mesh the coil as a volume of air of its own, with air "
    r"between it and the body\.$"
)
NEAR = {"applied_field": loop((0.0, 0.0, 0.03), 1.05)}


@pytest.mark.parametrize("goal", [Force("ball", (0.0, 0.0, 1.0)), Torque("ball", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))])
def test_a_goal_where_a_coil_reaches_into_the_air_at_the_body_is_refused_before_the_solve(goal, solved):
    near = MagneticScalarPotential({"ball": AIR, "air": AIR}, {"outer": 0.0}, **NEAR, goal=goal)
    mesh, steps = solved[2][1].mesh, []
    with pytest.raises(ValueError, match=TOUCHES):
        near.check(mesh)
    with pytest.raises(ValueError, match=TOUCHES):
        ka.adapt(mesh, near, progress=lambda number, step: steps.append(step))
    assert steps == ["solve"]  # the first thing that `solve` does is to look


def test_forces_on_currents_are_for_the_plane(solved):
    field = solved[2][0]
    for ask in (lorentz_force, lorentz_torque, lambda field, body: arkkio_torque(field, body, (0.0, 0.0))):
        with pytest.raises(ValueError, match=r"are for meshes of triangles, whose materials carry the currents\. In s"):
            ask(field, "air")
    for ask in (apparent_inductance, energy_inductance):
        with pytest.raises(
            ValueError, match=r"on meshes of triangles\. In space .* use field\.flux_linkage\(name, turns\)"
        ):
            ask(field, {"air": 10})


def test_one_field_said_in_several_ways(solved):
    mesh, half = solved[2][0].mesh, [loop(), loop()]
    for part in half:
        part.current = 0.5 * CURRENT
    ways = loop(), half, magpylib.Collection(loop()), lambda x: loop().getH(x.T).T
    parts = {"ball": Material(50.0), "air": AIR}, {"outer": 0.0}
    one, *others = (MagneticScalarPotential(*parts, applied_field=way).solve(mesh).potential for way in ways)
    for other in others:
        np.testing.assert_allclose(other, one, atol=1e-9 * np.abs(one).max())


def ring(half=False):
    """A square ring of iron in the plane z = 0, or its half with x below 0."""
    t = np.linspace(-2.0, 2.0, 9)
    mesh = blocks([t[:5] if half else t, t, t], {})
    x, y, z = mesh.p[:, mesh.t].mean(axis=1)
    wide = np.maximum(np.abs(x), np.abs(y))
    iron = (np.abs(z) < 0.5) & (wide > 0.5) & (wide < 1.5)
    return mesh.with_subdomains({"ring": np.flatnonzero(iron), "air": np.flatnonzero(~iron)})


COIL = loop((-1.0, 0.0, 0.03), 0.83, orientation=QUARTER_TURN)  # around the leg of the ring at x < 0
STEEL = {"ring": Material(1000.0), "air": AIR}


def test_a_closed_ring_around_a_current():
    """H along the ring adds up to the ampere-turns of the coil, at any permeability."""
    mesh = ring()
    one, other = (
        MagneticScalarPotential({"ring": Material(mu), "air": AIR}, {"outer": 0.0}, applied_field=COIL).solve(mesh)
        for mu in (1e3, 1e8)
    )
    along = np.array(
        [[-1.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0, 0.0], [-1.0, 0.0, 1.0, 1.0, 1.0, 0.0, -1.0, -1.0], [0.0] * 8]
    )
    b = [np.linalg.norm(field.flux_density_at(along[:, 1::2] + 1e-3), axis=0) for field in (one, other)]
    np.testing.assert_allclose(b[1] / 1e5, b[0], rtol=0.05)
    ends = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0], [0.0] * 4]) + 1e-3
    t, total = (np.arange(2000) + 0.5) / 2000, 0.0
    for start, end in zip(ends.T, np.roll(ends, -1, axis=1).T, strict=True):
        h = one.flux_density_at(start[:, None] + np.outer(end - start, t)) / (1e3 * MU0)
        total += (end - start) @ h.mean(axis=1)
    assert abs(total) == pytest.approx(CURRENT, rel=1e-4)


def test_a_current_through_iron_is_refused():
    through = loop((-1.0, 0.0, 0.03), 0.2, orientation=QUARTER_TURN)
    with pytest.raises(
        ValueError, match=r"^a current of .* A of the applied_field passes through iron, .* 'ring'; keep"
    ):
        MagneticScalarPotential(STEEL, {"outer": 0.0}, applied_field=through).solve(ring())


def test_what_is_not_finite_is_refused(solved):
    mesh = solved[2][0].mesh
    problem = MagneticScalarPotential(
        {"ball": Material(10.0), "air": AIR}, applied_field=lambda x: np.full(x.shape, np.nan)
    )
    with pytest.raises(ValueError, match=r"applied_field must be finite; it is not at .* points, first"):
        problem.solve(mesh)
