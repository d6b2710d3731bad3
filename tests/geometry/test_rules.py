"""The rules for nodes: what they refuse on their own, and against the names of a mesh."""

import inspect
from dataclasses import fields

import numpy as np
import pytest
from helpers.meshes import inset, square
from helpers.solids import box

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.rules import (
    TOPOLOGIES,
    check_for,
    checked_curves,
    checked_layers,
    checked_pairs,
    pinned_nodes,
)
from kohonen_adapt.geometry.space.movable_solid import MovableSolid


def test_edges_flip_unless_the_topology_is_fixed():
    assert [topology for topology in TOPOLOGIES if not Rules(topology).flips] == ["fixed"]


@pytest.mark.parametrize("topology", ["Recycle", "Flip", "", None, 3])
def test_topologies(topology):
    with pytest.raises(ValueError, match=rf"^topology must be 'fixed', 'flip' or 'recycle'; got {topology!r}\.$"):
        Rules(topology)


@pytest.mark.parametrize("min_quality", [-0.1, 1.0, 2, np.nan, np.inf, "a", "Auto", True])
def test_min_qualities(min_quality):
    with pytest.raises(ValueError, match=rf"^min_quality must be 'auto' or from 0 to below 1; got {min_quality!r}\.$"):
        Rules(min_quality=min_quality)


def test_what_keeps_a_quality_has_one_to_keep():
    unchecked = Rules(min_quality=None)
    message = r"^min_quality must be 'auto' or a number here; only KohonenMap works unchecked\. Got None\.$"
    with pytest.raises(ValueError, match=message):
        unchecked.guarded()


FRONT_DOORS = [ka.relocate, ka.adapt, ka.polish, ka.KohonenMap]


@pytest.mark.parametrize("front_door", FRONT_DOORS)
def test_front_doors_take_the_defaults_of_the_rules(front_door):
    """But `adapt`, which recycles, and asks its problem for pairs."""
    own = {"topology", "periodic"} if front_door is ka.adapt else set()
    known = inspect.signature(front_door).parameters
    for each in fields(Rules):
        assert each.name in own or known[each.name].default == each.default


ONE_DIMENSION = {
    r"surfaces are for tetrahedra; a boundary in the plane may be given one of the curves\.": (
        2,
        "surfaces",
        {"rim": 0},
    ),
    r"curves are for triangles; a boundary of tetrahedra may be given one of the surfaces\.": (3, "curves", {"rim": 0}),
    r"periodic must be left out for tetrahedra; it is for triangles only\.": (3, "periodic", [("left", "right")]),
    r"layers must be left out for tetrahedra; it is for triangles only\.": (3, "layers", {"coil": 2}),
}


@pytest.mark.parametrize("message", ONE_DIMENSION)
def test_rules_for_other_cells(message):
    dimension, name, value = ONE_DIMENSION[message]
    rules, mesh = Rules(**{name: value}), [square(2), box(1)]
    with pytest.raises(ValueError, match=f"^{message}$"):
        (MovableMesh if dimension == 2 else MovableSolid).of(mesh[dimension - 2], rules)
    check_for(rules, 5 - dimension)


@pytest.mark.parametrize("pinned", [3, None, 1.5])
def test_pins_that_are_no_sequence(pinned):
    with pytest.raises(ValueError, match=rf"^pinned must be a sequence of node numbers and names; got {pinned!r}\.$"):
        Rules(pinned=pinned)


def test_iterators_are_gone_through_as_often_as_need_be():
    rules = Rules(pinned=iter([3, "rim"]), periodic=(pair for pair in [("left", "right")]))
    assert (rules.pinned, rules.periodic) == ((3, "rim"), (("left", "right"),))
    mesh, nodes = square(4), [3, 5]
    once = Rules(pinned=map(int, nodes))
    for _ in range(2):
        assert np.flatnonzero(MovableMesh.of(mesh, once).outline.pinned).tolist() == nodes


PINNED = [
    (["coil"], r"pinned name 'coil' is not in the mesh; its boundaries and subdomains are: 'air', 'core', 'floor'\."),
    ("coil", r"pinned name 'coil' is not in the mesh; its boundaries and subdomains are: 'air', 'core', 'floor'\."),
    ([25], r"pinned nodes must be from 0 to 24; got 25\."),
    ([-1], r"pinned nodes must be from 0 to 24; got -1\."),
    ([1.0], r"pinned must hold node numbers and names; got 1\.0\."),
    ([True], r"pinned must hold node numbers and names; got True\."),
    (np.ones(25, dtype=bool), r"pinned must hold node numbers and names; got np\.True_\."),
]


def with_floor():
    return inset(4).with_boundaries({"floor": lambda x: x[1] == 0.0})


@pytest.mark.parametrize(("pinned", "message"), PINNED)
def test_pins_that_a_mesh_does_not_have(pinned, message):
    mesh = with_floor()
    with pytest.raises(ValueError, match=f"^{message}$"):
        pinned_nodes(mesh, pinned)
    with pytest.raises(ValueError, match=f"^{message}$"):
        MovableMesh.of(mesh, Rules(pinned=pinned))


def test_pins_by_number_and_by_name():
    mesh = with_floor()
    core = np.unique(mesh.t[:, mesh.subdomains["core"]]).tolist()
    floor = np.flatnonzero(mesh.p[1] == 0.0).tolist()
    assert np.flatnonzero(pinned_nodes(mesh, "floor")).tolist() == floor
    assert np.flatnonzero(pinned_nodes(mesh, ["core", 24, np.int32(0)])).tolist() == sorted({*core, 0, 24})
    assert not pinned_nodes(mesh, ()).any()


def test_pins_on_a_mesh_without_names():
    message = r"^pinned name 'coil' is not in the mesh; its boundaries and subdomains are: none\.$"
    with pytest.raises(ValueError, match=message):
        pinned_nodes(square(4), ["coil"])


def test_a_pinned_name_that_is_both_a_boundary_and_a_subdomain():
    mesh = inset(4).with_boundaries({"core": lambda x: x[1] == 0.0})
    message = r"^pinned name 'core' is both a boundary and a subdomain; rename one of them\.$"
    with pytest.raises(ValueError, match=message):
        pinned_nodes(mesh, ["core"])
    assert MovableMesh.of(mesh, Rules()).mesh().boundaries.keys() == {"core"}


def test_curves_are_of_boundaries_and_can_project():
    mesh, line = with_floor(), ka.Line((0.0, 0.0), (1.0, 0.0))
    assert checked_curves(mesh, None) == {}
    assert checked_curves(mesh, {"floor": line}) == {"floor": line}
    refused = {
        r"curves must map names of boundaries to curves; got list\.": [("floor", line)],
        r"curves has 'core', which is no boundary of the mesh; its boundaries are: 'floor'\.": {"core": line},
        r"the curve of boundary 'floor' must be a kohonen_adapt\.Line, .*; got 3\.": {"floor": 3},
    }
    for message, curves in refused.items():
        with pytest.raises(ValueError, match=f"^{message}$"):
            checked_curves(mesh, curves)


def test_pairs_are_of_boundaries_and_each_is_in_one():
    mesh = square(4).with_boundaries({"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 1.0})
    assert checked_pairs(mesh, ()) == []
    assert checked_pairs(mesh, [["left", "right"]]) == [("left", "right", None)]
    refused = {
        r"periodic must hold pairs of names of boundaries, as \[\('left', 'right'\)\]; got 'l'\.": "lr",
        r"periodic has 'top', which is no boundary of the mesh; its boundaries are: 'left', 'right'\.": [
            ("left", "top")
        ],
        r"boundary 'left' is in periodic twice; it can have one partner only\.": [("left", "left")],
    }
    for message, periodic in refused.items():
        with pytest.raises(ValueError, match=f"^{message}$"):
            checked_pairs(mesh, periodic)


def test_layers_are_of_subdomains_and_are_counted():
    mesh = inset(4)
    assert checked_layers(mesh, None) == {}
    assert checked_layers(mesh, {"core": np.int64(2)}) == {"core": 2}
    refused = {
        r"layers must map names of subdomains to numbers of layers; got str\.": "core",
        r"layers has 'rim', which is no subdomain of the mesh; its subdomains are: 'air', 'core'\.": {"rim": 1},
        r"layers of subdomain 'core' must be an integer >= 1; got 0\.": {"core": 0},
        r"layers of subdomain 'core' must be an integer >= 1; got True\.": {"core": True},
    }
    for message, layers in refused.items():
        with pytest.raises(ValueError, match=f"^{message}$"):
            checked_layers(mesh, layers)
