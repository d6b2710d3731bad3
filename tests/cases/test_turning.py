"""A case turns a subdomain with the magnets in it."""

import dataclasses
import tomllib

import numpy as np
import pytest
from helpers.meshes import centres, circle, shells
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.cases import case_of, fitting_mesh
from kohonen_adapt.magnetostatics import halbach

NODES = 36  # on a circle: a step is 10 degrees
CASE = """
mesh = "machine.msh"
[materials]
magnet = {permeability = 1.05, remanence = [0.0, 1.2]}
air = {}
coil = {}
[potential]
outer = 0.0
[turn]
rotor = 0.0
[adapt]
passes = 0
[outputs]
linkage = {quantity = "flux_linkage", coil = "coil"}
torque = {quantity = "torque", body = "magnet"}
"""


def machine():
    """A round magnet in air, turning with the air up to a ring; "coil" are two sides of a coil, at 3 and 9 o'clock."""
    rings = shells([radius * circle(NODES) for radius in (0.1, 1.0)], 9)
    fan = np.stack([np.full(NODES, -1), np.arange(NODES), np.roll(np.arange(NODES), -1)])
    mesh = MeshTri(np.hstack([np.zeros((2, 1)), rings.p]), 1 + np.hstack([fan, rings.t]))
    return mesh.with_boundaries({"outer": lambda x: np.hypot(*x) > 0.98}).with_subdomains(
        {
            "rotor": lambda x: np.hypot(*x) < 0.5,
            "magnet": lambda x: np.hypot(*x) < 0.3,
            "air": lambda x: (np.hypot(*x) > 0.3) & ~in_coil(x),
            "coil": in_coil,
        }
    )


def in_coil(x):
    return (np.hypot(*x) > 0.8) & (np.hypot(*x) < 0.9) & (np.abs(np.arctan2(x[1], x[0]) - 0.17) < 0.3)


@pytest.fixture
def folder(tmp_path):
    ka.write_mesh(tmp_path / "machine.msh", machine())
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path


def case_in(folder, **changes):
    return case_of({**tomllib.loads(CASE), **changes}, folder)


def solved(case):
    mesh = fitting_mesh(case)
    return mesh, case.problem.solve(mesh)


@pytest.mark.parametrize("degrees", [10.0, 90.0, -130.0])
def test_the_magnet_turns_with_its_subdomain(degrees, folder):
    """The mesh turned by whole steps is the mesh that it was, so the whole field turns, to rounding."""
    (_, before), (mesh, after) = (solved(case_in(folder, turn={"rotor": angle})) for angle in (0.0, degrees))
    turn = ka.Rotation(np.radians(degrees)).matrix[:, :2]
    x = np.array([[0.1, 0.45, 0.02, 0.7], [0.05, 0.02, -0.3, -0.1]])
    assert_allclose(after.flux_density_at(turn @ x), turn @ before.flux_density_at(x), rtol=0, atol=1e-12)
    assert after.energy == pytest.approx(before.energy, rel=1e-12)
    assert mesh.subdomains.keys() == {"rotor", "magnet", "air", "coil"}


@pytest.mark.parametrize("vector", ["remanence", "coercivity"])
def test_vectors_of_every_kind_turn(vector, folder):
    pattern = {"pattern": "halbach", "magnitude": 1.0, "pole_pairs": 2}
    turned = {"turn": {"rotor": 90.0}}
    case = case_in(folder, materials={"magnet": {vector: pattern}, "air": {}, "coil": {}}, **turned)
    field, x = getattr(case.problem.materials["magnet"], vector), np.array([[0.1, 0.2], [0.05, -0.1]])
    before = halbach(1.0, 2)(x)
    assert_allclose(field(np.stack([-x[1], x[0]])), [-before[1], before[0]], atol=1e-15)
    case = case_in(folder, **turned)
    assert_allclose(case.problem.materials["magnet"].remanence, (-1.2, 0.0), atol=1e-15)
    assert case.problem.materials["air"] == case.base_problem.materials["air"]


def test_a_case_without_turn_does_not_look_at_its_mesh(tmp_path):
    case = case_in(tmp_path, turn={})
    assert case.problem is case.base_problem


@pytest.mark.parametrize(
    ("turn", "said"),
    [
        ({"rotor": 5.0}, r"turn.rotor: angle must be whole steps .* \(10 degrees\) each"),
        ({"rotr": 0.0}, "turn.rotr: subdomain 'rotr' is not in the mesh"),
        ({"coil": 10.0}, "turn.coil: what turns and the rest must meet on circles"),
        ({"parts": ["rotor", "coils"], "degrees": 10.0}, "turn: subdomain 'coils' is not in the mesh"),
        ({"parts": ["rotor"]}, "turn.degrees is missing; it is required."),
        ({"parts": ["rotor"], "rotor": 10.0}, "'turn.rotor' is not a key of a case"),
        ({"parts": "rotor", "degrees": 10.0}, r"turn.parts must be \[text in quotes, ...\]"),
        ({"rotor": "10"}, "turn.rotor must be a finite number; got '10'. Write it without quotes."),
    ],
)
def test_what_cannot_turn(turn, said, folder):
    with pytest.raises(ValueError, match=said):
        fitting_mesh(case_in(folder, turn=turn))


def test_a_magnet_turns_as_a_whole(folder):
    mesh = machine()
    ka.write_mesh(folder / "machine.msh", mesh.with_subdomains({"rotor": lambda x: np.hypot(*x) < 0.2}))
    with pytest.raises(ValueError, match="the magnet 'magnet' must turn as a whole or not at all"):
        _ = case_in(folder, turn={"rotor": 10.0}).problem


def sector():
    """A quarter of the machine, from "right" to "left", without a name for all that turns."""
    mesh = machine()
    mesh = mesh.restrict(np.flatnonzero((centres(mesh) > 0.0).all(axis=0)))
    mesh = mesh.with_boundaries({"right": lambda x: x[1] < 1e-9, "left": lambda x: x[0] < 1e-9})
    x = centres(mesh)
    air, inner = mesh.subdomains["air"], np.flatnonzero(np.hypot(*x) < 0.5)
    names = {"outer_air": np.setdiff1d(air, inner), "inner_air": np.intersect1d(air, inner)}
    names |= {name: mesh.subdomains[name] for name in ("magnet", "coil")}
    return MeshTri(mesh.p, mesh.t, _boundaries=mesh.boundaries, _subdomains=names)


def of_sector(folder, degrees, **changes):
    materials = {name: {} for name in ("coil", "inner_air", "outer_air")}
    materials["magnet"] = {"remanence": {"pattern": "halbach", "magnitude": 1.0, "pole_pairs": 2}}
    turn = {"parts": ["magnet", "inner_air"], "degrees": degrees}
    changes = {"antiperiodic": [["right", "left"]], "materials": materials, "turn": turn, **changes}
    return case_in(folder, **changes)


@pytest.mark.parametrize("degrees", [10.0, -30.0, 80.0])
def test_a_rotor_turns_out_of_a_sector(degrees, folder):
    """The pole turns by whole steps, and what leaves the sector is that of the next pole with the other sign."""
    ka.write_mesh(folder / "machine.msh", sector())
    (_, before), (mesh, after) = (solved(of_sector(folder, angle)) for angle in (0.0, degrees))
    assert mesh.boundaries.keys() == {"outer", "right", "left"}
    named = np.concatenate([np.asarray(rows) for rows in mesh.boundaries.values()])
    assert_array_equal(np.sort(named), np.sort(mesh.boundary_facets()))
    assert after.energy == pytest.approx(before.energy, rel=1e-10)
    radius, angle = np.array([0.2, 0.42, 0.47, 0.61, 0.75]), np.radians([33.0, 51.0, 46.0, 22.0, 67.0])
    turned_back = angle - np.radians(degrees)
    poles = np.where(radius < 0.5, 0, np.floor(turned_back / (0.5 * np.pi)))  # the rotor leaves the sector
    there = np.where(radius < 0.5, angle + np.radians(degrees), angle)
    here = np.where(radius < 0.5, angle, turned_back - poles * 0.5 * np.pi)
    now, then = (
        field.flux_density_at(radius * np.stack([np.cos(at), np.sin(at)]))
        for field, at in ((after, there), (before, here))
    )
    turn = there - here
    then = (-1.0) ** poles * np.stack(
        [np.cos(turn) * then[0] - np.sin(turn) * then[1], np.sin(turn) * then[0] + np.cos(turn) * then[1]]
    )
    assert_allclose(now, then, rtol=0, atol=1e-9)


def test_a_rotor_turns_out_of_a_sector_with_sides_only(folder):
    ka.write_mesh(folder / "machine.msh", sector())
    with pytest.raises(ValueError, match="turn: the angle turns it out of the mesh, which is a sector without a pair"):
        fitting_mesh(of_sector(folder, 10.0, antiperiodic=[]))


def test_a_group_of_points_stays(folder):
    """Others find it by its place, and a node that has turned is elsewhere."""
    mesh = machine()
    mesh.doflocs[:, 1] += 0.01
    groups = ka.read_groups(folder / "machine.msh")
    for point in (0, 1):  # the middle, and a node that turns
        points = {7: mesh.p[:, [point]]}
        ka.write_mesh(folder / "machine.msh", mesh, groups=dataclasses.replace(groups, points=points))
        case = case_in(folder, turn={"rotor": 10.0})
        if point == 0:
            assert case.pins(fitting_mesh(case)) == [0]
        else:
            with pytest.raises(ValueError, match="turn must not move groups of points"):
                fitting_mesh(case)
