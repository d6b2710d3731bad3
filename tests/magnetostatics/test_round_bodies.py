"""Bodies that turn, with bores of few nodes: these stay round where that is told, else the remedy is named."""

import numpy as np
from helpers.meshes import ring
from helpers.tensor_meshes import sector

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material, Torque

BORE = 0.01
ROTOR, AIR = Material(remanence=(1.0, 0.0)), Material()


def rotor_mesh(around=10):
    """A magnet around a bore in air, all of them polygons."""
    mesh = ring(around, 6, BORE, 0.05)
    rotor = np.hypot(*mesh.p)[mesh.t].max(axis=0) < 0.0301
    return mesh.with_subdomains({"rotor": np.flatnonzero(rotor), "air": np.flatnonzero(~rotor)})


def problem(**more):
    return Magnetostatics({"rotor": ROTOR, "air": AIR}, potential={"outer": lambda x: x[0], "inner": 0.0}, **more)


def grown(mesh, problem, **more):
    outputs = {"torque": lambda field: field.torque("rotor")}
    return ka.adapt(mesh, problem, passes=3, target_nodes=6 * mesh.nvertices, outputs=outputs, **more)


def off_bore(mesh, name="inner"):
    """How far nodes of the bore are off its circle, relatively, and their number."""
    nodes = np.unique(mesh.facets[:, mesh.boundaries[name]])
    return np.max(np.abs(np.hypot(*mesh.p[:, nodes]) / BORE - 1.0)), len(nodes)


def test_the_bore_of_a_body_whose_torque_is_the_goal_stays_round():
    result = grown(rotor_mesh(), problem(goal=Torque("rotor")))
    assert result.error is None
    off, nodes = off_bore(result.mesh)
    assert off < 1e-9
    assert nodes > 10


def test_a_torque_that_chords_spoil_names_the_curve():
    result = grown(rotor_mesh(), problem())
    remedy = (
        "If nodes have left an arc with too few nodes to be recognised, adapt with "
        'curves={"inner": ka.Arc((0, 0), 0.01)}.'
    )
    assert remedy in str(result.error)
    again = grown(rotor_mesh(), problem(), curves={"inner": ka.Arc((0, 0), 0.01)})
    assert again.error is None
    assert off_bore(again.mesh)[0] < 1e-9


def test_the_bore_of_a_pole_stays_round():
    """Five nodes, as those of all its arcs; the curves are known by one another."""
    names = {"rotor": (0.01, 0.02, 0.0, np.pi / 4), "steel": (0.03, 0.04, 0.0, np.pi / 4)}
    mesh = sector(np.linspace(BORE, 0.04, 7), np.linspace(0.0, np.pi / 4, 5), names)
    pole = Magnetostatics(
        {"rotor": ROTOR, "steel": Material(1000.0), "air": AIR},
        potential={"outer": 0.0, "bore": 0.0},
        antiperiodic=[("right", "left")],
    )
    assert len(mesh.boundaries["bore"]) == 4
    result = grown(mesh, pole)
    assert result.error is None
    off, nodes = off_bore(result.mesh, "bore")
    assert off < 1e-9
    assert nodes > 5
