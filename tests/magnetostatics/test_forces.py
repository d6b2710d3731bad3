"""Forces and torques: exact answers, agreement of the methods, symmetries, and what has none."""

import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.meshes import area_of
from helpers.sheets import MU0, line_potential
from helpers.tensor_meshes import box, disk, equal_rings, sector, sewn
from scipy.spatial import cKDTree
from skfem import MeshTri

from kohonen_adapt.magnetostatics import Magnetostatics, Material, arkkio_torque, lorentz_force, lorentz_torque

pytestmark = pytest.mark.filterwarnings("ignore:.*removed in 1.2:DeprecationWarning")

AIR, IRON = Material(), Material(1000.0)


# --- exact ----------------------------------------------------------------------------------------------------------


def rate(sizes, errors):
    """Exponent of the fit errors ~ sizes^rate."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def test_force_on_a_wire_by_one_beyond_the_mesh():
    """Of second order on nested meshes, to the force between line currents."""
    wanted, errors, rings = MU0 * 1000.0**2 / (2 * np.pi * 0.03), [], (9, 18, 36)
    for number in rings:
        mesh = disk(equal_rings(number, 0.0225), {"wire": number // 9, "air": number})
        wire = Material(current_density=1000.0 / area_of(mesh, mesh.subdomains["wire"]))
        far = {"outer": lambda x: line_potential(x, (0.03, 0.0), 1000.0)}
        force = Magnetostatics({"wire": wire, "air": AIR}, potential=far, order=1).solve(mesh).force("wire")
        errors.append(abs(force[0] / wanted - 1.0))
        assert abs(force[1]) < 1e-9 * wanted
    assert errors[2] < 1e-4
    assert 1.8 < -rate(rings, errors) < 2.5


# --- theorems -------------------------------------------------------------------------------------------------------


# --- symmetries -----------------------------------------------------------------------------------------------------


def lifted(mesh):
    """A magnet over an iron bar."""
    magnet = Material(remanence=(0.0, 1.0))
    return Magnetostatics({"magnet": magnet, "bar": IRON, "air": AIR}, potential={"outer": 0.0}).solve(mesh)


def test_half_of_a_body_on_a_mirror_plane_has_half_of_its_force():
    sides = {"magnet": (0.0, 0.005, 0.001, 0.006), "bar": (0.0, 0.01, -0.006, -0.001)}
    half = box(np.linspace(0.0, 0.02, 21), np.linspace(-0.02, 0.02, 41), sides)
    there = {name: np.r_[rows, rows + half.t.shape[1]] for name, rows in half.subdomains.items()}
    mirrored = half.p * np.array([[-1.0], [1.0]])
    whole = sewn(np.hstack((half.p, mirrored)), np.hstack((half.t, half.t + half.p.shape[1])), there)
    # A = 0 on the plane x = 0 is what the symmetry of the magnet makes it.
    parts, entire = lifted(half), lifted(whole)
    for body in ("magnet", "bar"):
        np.testing.assert_allclose(2.0 * parts.force(body)[1], entire.force(body)[1], rtol=1e-8)
        assert parts.force(body)[0] == 0.0
        assert abs(entire.force(body)[0]) < 1e-8 * abs(entire.force(body)[1])


PITCH = np.pi / 2
RADII, ANGLES = np.linspace(0.01, 0.05, 41), np.linspace(0.0, PITCH, 31)
MACHINE = {
    "coil": (0.02, 0.03, 0.35, 0.85),
    "hub": (0.01, 0.02, 0.0, PITCH),
    "tooth": (0.035, 0.045, 0.1, 0.5),
    "yoke": (0.045, 0.05, 0.0, PITCH),
}
MACHINE_PARTS = {"coil": Material(current_density=1e7), "hub": IRON, "tooth": IRON, "yoke": IRON, "air": AIR}


def test_a_sector_has_its_share_of_the_torque():
    """A field that repeats after every quarter, cut out of the whole: body, air and iron are all cut by its sides."""
    apart = sector(RADII, np.linspace(0.0, 2 * np.pi, 121), MACHINE, PITCH)
    whole = sewn(apart.p, apart.t, apart.subdomains)
    field = Magnetostatics(MACHINE_PARTS, potential={"outer": 0.0}, order=1).solve(whole)
    quarter = sector(RADII, ANGLES, MACHINE)
    _, place = cKDTree(whole.p.T).query(quarter.p.T)
    part = Magnetostatics(MACHINE_PARTS, potential={"outer": 0.0, "bore": 0.0}, order=1).solve(quarter)
    part = replace(part, potential=field.potential[place])
    body = ["coil", "hub"]
    assert field.torque(body) < -0.1  # towards the tooth
    assert part.torque(body) == pytest.approx(field.torque(body) / 4, rel=1e-8)
    with pytest.raises(ValueError, match=r"lines of several directions; .* Extend the mesh beyond the boundary\."):
        part.force(body)


# --- refused --------------------------------------------------------------------------------------------------------


def refused(message, function, *arguments, **options):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        function(*arguments, **options)


TOUCHING = box(
    np.linspace(-0.02, 0.02, 41),
    np.linspace(-0.02, 0.02, 41),
    {"core": (-0.005, 0.0, -0.005, 0.005), "iron": (0.0, 0.005, 0.005, 0.01), "edge": (-0.02, -0.015, -0.02, -0.015)},
)


@pytest.mark.parametrize(
    "neighbour", [IRON, Material(current_density=1.0), Material(remanence=(0.0, 0.1)), Material(permeability=1.001)]
)
def test_a_body_that_touches_something_at_a_corner_is_refused(neighbour):
    parts = {"core": IRON, "iron": neighbour, "edge": IRON, "air": AIR}
    field = Magnetostatics(parts, potential={"outer": lambda x: x[0]}).solve(TOUCHING)
    message = (
        "subdomain 'core' touches 'iron', which is not air (permeability 1, no current, no remanence), and the force "
        "is computed from the field in the air around: leave air between them, or compute the force on both together."
    )
    refused(message, field.force, "core")
    refused(message, field.torque, "core")
    assert np.all(np.isfinite(field.force(["core", "iron"])))


PARTS = {"core": Material(current_density=1e6), "iron": IRON, "edge": IRON, "air": AIR}
FIELD = Magnetostatics(PARTS, potential={"outer": lambda x: x[0]}).solve(TOUCHING)


@pytest.mark.parametrize("body", [None, 3, [], ["core", 3], {"core"}])
def test_what_is_no_name(body):
    refused(f"a body is the name of a subdomain or a sequence of names; got {body!r}.", FIELD.force, body)


def test_unknown_and_empty_names():
    has = "'air', 'core', 'edge', 'iron'"
    refused(f"subdomain 'rotor' is not in the mesh; it has {has}.", FIELD.force, "rotor")
    refused(f"subdomain 'rotor' is not in the mesh; it has {has}.", FIELD.torque, ["core", "rotor"])
    empty = TOUCHING.with_subdomains({"none": np.array([], dtype=int)})
    field = Magnetostatics(PARTS, potential={"outer": 0.0}).solve(empty)
    refused("subdomain 'none' has no elements; name one that has.", field.force, "none")


def test_a_body_that_fills_the_mesh():
    message = (
        "subdomain 'air' + 'core' + 'iron' + 'edge' has no other elements around it; a force requires air around the "
        "body."
    )
    refused(message, FIELD.force, ["air", "core", "iron", "edge"])


def test_a_body_in_the_corner_of_the_mesh():
    refused(
        "the body lies on the outer boundary along lines of several directions; the force on a part of it can only be "
        "computed if a mirror plane cuts it. Extend the mesh beyond the boundary.",
        FIELD.force,
        "edge",
    )
    refused(
        "the body lies on the outer boundary elsewhere than on circles about the centre and on two straight sides "
        "through it; the torque on a part of a body can only be computed for a periodic sector. Extend the mesh.",
        FIELD.torque,
        "edge",
    )


def test_a_sector_whose_sides_differ():
    shifted = np.array(TOUCHING.p)
    shifted[0, (shifted[0] > -0.0199) & (shifted[0] < -0.0101) & (shifted[1] < -0.0199)] += 1e-4
    mesh = MeshTri(shifted, TOUCHING.t).with_subdomains(TOUCHING.subdomains).with_boundaries(TOUCHING.boundaries)
    field = Magnetostatics(PARTS, potential={"outer": 0.0}).solve(mesh)
    refused(
        "the two sides through the centre that cut the body have no nodes at the same radii; the torque on a part of "
        "it can only be computed for a periodic sector, with sides that are images of each other.",
        field.torque,
        "edge",
        centre=(-0.02, -0.02),
    )


@pytest.mark.parametrize("centre", [0.0, (0.0, 0.0, 0.0), (np.nan, 0.0), "ab", ("a", "b"), (1j, 0.0)])
def test_what_is_no_centre(centre):
    refused(f"centre must be a point (x, y) in m; got {centre!r}.", FIELD.torque, ["core", "iron"], centre)


def test_lorentz_needs_plain_currents():
    refused(
        "the coil 'air' carries no current; use field.force for the force on its material.", lorentz_force, FIELD, "air"
    )
    refused(
        "the coil ['core', 'iron'] is magnetic, so the Lorentz force is only a part; use field.force instead.",
        lorentz_torque,
        FIELD,
        ["core", "iron"],
    )


def test_arkkio_needs_a_ring_of_air():
    refused(
        "the ring 'core' must be air (permeability 1, no current, no remanence) in every element; it is not in "
        "100 of 3200. Name a ring of air around the rotor.",
        arkkio_torque,
        FIELD,
        "core",
    )
    mesh = disk(equal_rings(8, 0.02), {"rotor": 2, "gap": 4, "air": 8})
    field = Magnetostatics(dict.fromkeys(("rotor", "gap", "air"), AIR), potential={"outer": 0.0}).solve(mesh)
    with pytest.raises(ValueError, match=r"the ring 'gap' must be bounded by two circles about the centre \(0\.001, 0"):
        arkkio_torque(field, "gap", centre=(0.001, 0.0))
    with pytest.raises(
        ValueError, match=r"radii between 0\.005 and 0\.005 m\. Give its centre, or a subdomain that is a r"
    ):
        arkkio_torque(field, "rotor")
