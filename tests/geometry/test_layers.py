"""Layers of elements across thin subdomains: counted by a search of our own, between sides that the geometry tells."""

import re

import numpy as np
import pytest
from helpers.descents import descend
from helpers.examples import examples
from helpers.meshes import area_of, centres, inset
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.mesh.elements.polynomials import TrialFunction
from kohonen_adapt.polishing.functional import Functional


def grid(low, high, rows, length=3.0, width=0.3, columns=24):
    """Nodes of rows below 0, across a gap and above it, in so many columns."""
    y = [np.linspace(-low, 0, 5)[:-1], np.linspace(0, width, rows + 1), np.linspace(width, width + high, 5)[1:]]
    return MeshTri.init_tensor(np.linspace(0, length, columns + 1), np.concatenate(y))


def poles(rows=2):
    """A gap between two poles."""
    mesh = grid(1.0, 1.0, rows)
    y = centres(mesh)[1]
    return divided(mesh, (y > 0) & (y < 0.3), y < 0)


def teeth(rows=2):
    """A gap with slots that belong to it, each with a wall, a chamfer, a floor and a wall; the last is cut in half."""
    mesh = grid(1.0, 1.2, rows)
    x, y = centres(mesh)
    depth = np.clip(np.minimum(x % 1.0 - 0.5, 0.5) * 12.0, 0.0, 1.0) * 0.6
    return divided(mesh, (y > 0) & (y < 0.3 + depth), y < 0)


def pockets(rows=2):
    """A gap with pockets on both sides, which face each other."""
    mesh = grid(1.0, 1.0, rows)
    x, y = centres(mesh)
    depth = np.where(x % 1.0 > 0.5, 0.25, 0.0)
    return divided(mesh, (y > -depth) & (y < 0.3 + depth), y < 0)


def ring(rows=2, angle=2 * np.pi, columns=64):
    """A gap between two arcs or circles of radius 1 and 1.1."""
    radius = [np.linspace(0.6, 1.0, 5)[:-1], np.linspace(1.0, 1.1, rows + 1), np.linspace(1.1, 1.5, 5)[1:]]
    flat = MeshTri.init_tensor(np.arange(columns + 1), np.concatenate(radius))
    column = flat.p[0] % columns if angle > 6.28 else flat.p[0]
    turned = np.stack([np.cos(column * angle / columns), np.sin(column * angle / columns)]) * flat.p[1]
    _, first, number = np.unique(np.stack([column, flat.p[1]]), axis=1, return_index=True, return_inverse=True)
    mesh = MeshTri(turned[:, first], number.ravel()[flat.t])
    middle = flat.p[1, flat.t].mean(axis=0)
    return divided(mesh, (middle > 1.0) & (middle < 1.1), middle < 1.0)


def sector(rows=2):
    """A sector of a machine."""
    return ring(rows, np.pi / 4, 16)


def parts(rows=2):
    """Two gaps of one name, one twice as wide."""
    y = np.concatenate([np.linspace(0, 1, 4), np.linspace(1, 1.2, rows + 1), np.linspace(1.2, 2, 4)])
    y = np.unique(np.concatenate([y, np.linspace(2, 2.4, rows + 1), np.linspace(2.4, 3, 4)]).round(12))
    mesh = MeshTri.init_tensor(np.linspace(0, 3, 25), y)
    y = centres(mesh)[1]
    gap = ((y > 1) & (y < 1.2)) | ((y > 2) & (y < 2.4))
    return divided(mesh, gap, (y < 1) | (y > 2.4))


def divided(mesh, gap, low):
    """The mesh with a gap, what is on its one side, and what is on the other."""
    names = {"gap": gap, "low": low & ~gap, "high": ~low & ~gap}
    return mesh.with_subdomains({name: np.flatnonzero(mask) for name, mask in names.items()})


CASES = {"poles": poles, "teeth": teeth, "pockets": pockets, "ring": ring, "sector": sector, "parts": parts}


def layers_of(mesh, name="gap", one="low", other="high"):
    """Edges on the shortest way across a subdomain from one neighbour to another."""
    gap, start, goal = (mesh.t[:, mesh.subdomains[of]] for of in (name, one, other))
    return steps_between(gap, np.intersect1d(gap, start), np.intersect1d(gap, goal))


def steps_between(triangles, start, goal):
    """Edges of triangles on the shortest way from some nodes to others."""
    around, reached, goal, steps = {}, set(start.tolist()), set(goal.tolist()), 0
    for triangle in triangles.T.tolist():
        for node in triangle:
            around.setdefault(node, set()).update(triangle)
    while not reached & goal:
        reached = reached.union(*(around[node] for node in reached))
        steps += 1
    return steps


def thinning(mesh, seed=0):
    """A density of three narrow peaks: what is between them is to be thin."""
    rng = np.random.default_rng(seed)
    spots = mesh.p.min(axis=1)[:, None] + np.ptp(mesh.p, axis=1)[:, None] * rng.uniform(0, 1, (2, 3))
    squares = [((centres(mesh) - spot[:, None]) ** 2).sum(axis=0) for spot in spots.T]
    return 1.0 + 1e3 * sum(np.exp(-square / 0.02) for square in squares)


def again_and_again(mesh, topology, layers=None, seed=0, times=4):
    """Relocated after one density and another in turn."""
    for number in range(times):
        mesh = ka.relocate(mesh, thinning(mesh, seed + number % 2), topology=topology, layers=layers, seed=seed)
    return mesh


def current(mesh):
    """A magnetic circuit around a gap, with current on one side."""
    materials = {"low": Material(permeability=1000.0, current_density=1e6), "gap": Material()}
    return Magnetostatics({**materials, "high": Material(permeability=1000.0)}, potential={"outer": 0.0}, order=1)


def closed(mesh):
    return mesh.with_boundaries({"outer": mesh.boundary_facets()})


@given(st.sampled_from(sorted(CASES)), st.integers(1, 4), st.integers(0, 2**31), st.sampled_from(["flip", "recycle"]))
@examples(12)
def test_any_number_of_layers_is_kept_under_any_density(case, rows, seed, topology):
    mesh = CASES[case](rows)
    kept = again_and_again(mesh, topology, {"gap": rows}, seed, times=2)
    assert layers_of(mesh) == rows <= layers_of(kept)
    assert ka.quality(kept).min() >= min(0.3, ka.quality(mesh).min()) - 1e-12


@pytest.mark.parametrize("case", [poles, pockets, sector])
def test_more_layers_than_asked_for_may_thin_out_to_those(case):
    mesh = case(4)
    thinned = again_and_again(mesh, "recycle", {"gap": 2}, 1)
    assert 2 <= layers_of(thinned) < 4


@pytest.mark.parametrize(
    ("case", "rows", "wanted"),
    [*((case, 1, 2) for case in CASES.values()), (sector, 1, 3), (poles, 2, 4)],
)
def test_recycling_makes_the_layers_that_are_missing(case, rows, wanted):
    mesh = case(rows)
    made = ka.relocate(mesh, thinning(mesh), topology="recycle", layers={"gap": wanted})
    assert layers_of(mesh) == rows and layers_of(made) >= wanted
    assert made.p.shape == mesh.p.shape
    bound = 1e-2 if case in (ring, sector) else 1e-12  # of arcs, which facets shorten by their sagitta
    for name in mesh.subdomains:
        assert area_of(made, made.subdomains[name]) == pytest.approx(area_of(mesh, mesh.subdomains[name]), rel=bound)


@pytest.mark.parametrize("topology", ["recycle", "flip", "fixed"])
def test_adapt_makes_them_too_and_counts_their_nodes_as_new(topology):
    mesh = closed(poles(1))
    grows = {} if topology == "recycle" else {"target_nodes": mesh.p.shape[1] * 3 // 2}
    found = ka.adapt(mesh, current(mesh), layers={"gap": 2}, topology=topology, passes=2, **grows)
    assert all(layers_of(record.mesh) >= 2 for record in found.history)
    first, last = found.history[0], found.history[-1]
    assert np.array_equal(first.mesh.p[:, first.nodes >= 0], mesh.p)
    assert last.mesh.p.shape[1] == (grows["target_nodes"] if grows else mesh.p.shape[1])


def test_layers_are_made_on_both_sides_of_a_pair():
    mesh = sector(1)
    angle = np.angle(mesh.p[0] + 1j * mesh.p[1])
    sides = {name: closed_at(mesh, np.abs(angle - at) < 1e-9) for name, at in (("right", 0.0), ("left", np.pi / 4))}
    mesh = mesh.with_boundaries(sides)
    options = {"topology": "recycle", "periodic": [("right", "left")], "layers": {"gap": 2}}
    made = ka.relocate(mesh, thinning(mesh), **options)
    assert layers_of(made) == 2
    assert len(made.boundaries["right"]) == len(made.boundaries["left"]) >= len(mesh.boundaries["left"]) + 1
    assert layers_of(ka.relocate(made, thinning(mesh=made), **options)) >= 2


def closed_at(mesh, nodes):
    """The facets of the outer boundary between these nodes."""
    outer = mesh.boundary_facets()
    return outer[nodes[mesh.facets[:, outer]].all(axis=0)]


def test_the_polish_keeps_layers_that_it_would_lose():
    mesh = closed(poles())
    problem = current(mesh)
    field = problem.solve(mesh)

    def polished(layers):
        movable = MovableMesh.of(mesh, Rules(min_quality=0.05, layers=layers))
        ritz = problem.ritz(mesh, field)
        functional = Functional.of(ritz, movable)
        values, fixed = 1e3 * np.sin(40.0 * mesh.p[0] + 9.0 * mesh.p[1]), np.array(ritz.fixed)
        descend(movable, functional, TrialFunction(values, fixed, None), 20)
        return movable.mesh()

    assert layers_of(polished(None)) == 1
    assert layers_of(polished({"gap": 2})) == 2


@pytest.mark.parametrize("topology", ["fixed", "flip"])
def test_no_node_from_the_end_of_a_gap_jumps_into_its_side(topology):
    x, y = np.linspace(0, 2, 9), np.linspace(0, 0.5, 3)
    mesh = MeshTri.init_tensor(x, y).with_subdomains({"gap": np.arange(32)})

    def trained(layers, seed):
        som = KohonenMap(mesh, topology=topology, min_quality=0.02, layers=layers)
        som.train(lambda number, rng: (rng.uniform([[0.1], [0.0]], [[2.0], [0.02]], (2, number)), None), seed=seed)
        low, high = (np.flatnonzero(som.mesh.p[1] == level) for level in (0.0, 0.5))
        return steps_between(som.mesh.t, low, high)

    assert min(trained(None, seed) for seed in range(5)) == 1
    assert min(trained({"gap": 2}, seed) for seed in range(5)) == 2


@pytest.mark.parametrize("rows", [(2, 2), (3, 1)])
def test_bands_that_touch_keep_theirs(rows):
    low, high = rows
    mesh = grid(1.0, 1.0, low + high)
    y, cut = centres(mesh)[1], 0.3 * low / (low + high)
    names = {"low": y < 0, "rotor gap": (y > 0) & (y < cut), "stator gap": (y > cut) & (y < 0.3), "high": y > 0.3}
    mesh = mesh.with_subdomains({name: np.flatnonzero(mask) for name, mask in names.items()})
    kept = again_and_again(mesh, "recycle", {"rotor gap": low, "stator gap": high}, 1)
    assert layers_of(kept, "rotor gap", "low", "stator gap") >= low
    assert layers_of(kept, "stator gap", "rotor gap", "high") >= high
    lost = again_and_again(mesh, "recycle", seed=1)
    thin = layers_of(lost, "rotor gap", "low", "stator gap"), layers_of(lost, "stator gap", "rotor gap", "high")
    assert thin < rows


def test_sectors_that_touch_share_their_sides():
    mesh = poles()
    left = np.intersect1d(mesh.subdomains["gap"], np.flatnonzero(centres(mesh)[0] < 1.5))
    halves = {"left": left, "right": np.setdiff1d(mesh.subdomains["gap"], left)}
    mesh = mesh.with_subdomains(halves)
    assert layers_of(again_and_again(mesh, "recycle", {"left": 2, "right": 2}, 1)) >= 2
    assert layers_of(again_and_again(mesh, "recycle", {"gap": 2}, 1)) >= 2


def level_of(mesh, layers):
    """How many edges every node is from the first side of the gap, (n,)."""
    return MovableMesh.of(mesh, Rules(layers={"gap": layers})).triangulation.elements.level


def test_a_polygon_of_pieces_that_face_each_other_has_two_sides():
    mesh = ring(2, columns=8)  # every turn is a corner
    level = level_of(mesh, 2)
    radius = np.hypot(*mesh.p).round(9)
    assert [set(level[radius == r]) for r in (1.0, 1.05, 1.1)] == [{0}, {1}, {2}]


def test_a_gap_cut_askew_has_no_side_at_its_sharp_corner():
    straight = grid(1.0, 1.0, 2)
    y = centres(straight)[1]
    skewed = MeshTri(straight.p + np.outer([0.8, 0.0], straight.p[1]), straight.t)
    mesh = divided(skewed, (y > 0) & (y < 0.3), y < 0)
    level = level_of(mesh, 2)
    assert [set(level[np.isclose(mesh.p[1], height)]) for height in (0.0, 0.15, 0.3)] == [{0}, {1}, {2}]


def test_slots_wider_than_the_gap_belong_to_its_side():
    mesh = grid(1.0, 1.6, 2, width=0.15)
    x, y = centres(mesh)
    mouth, body = (x % 1.0 > 0.5) & (x % 1.0 < 0.75), (x % 1.0 > 0.25) & (y > 0.55) & (y < 1.35)
    mesh = divided(mesh, (y > 0) & ((y < 0.15) | body | mouth & (y < 0.55)), y < 0)
    level = level_of(mesh, 2)
    gap, low, high = (mesh.t[:, mesh.subdomains[name]] for name in ("gap", "low", "high"))
    assert {tuple(np.unique(level[np.intersect1d(gap, side)])) for side in (low, high)} == {(0,), (2,)}


def test_a_gap_with_round_ends_has_two_straight_sides():
    square = MeshTri.init_tensor(np.linspace(-3, 3, 33), np.linspace(-1, 1, 9))
    (x, y), beyond = square.p, np.maximum(np.abs(square.p[0]) - 2, 0)
    x = np.sign(x) * (np.minimum(np.abs(x), 2) + beyond * np.sqrt(1 - y**2 / 2))
    mesh = MeshTri(np.stack([x, y * np.sqrt(1 - beyond**2 / 2)]), square.t)
    level = level_of(mesh.with_subdomains({"gap": np.arange(mesh.nelements)}), 4)
    outer = np.isin(np.arange(mesh.p.shape[1]), mesh.boundary_nodes())
    straight = [outer & (np.abs(mesh.p[0]) <= 2) & (mesh.p[1] * sign > 0) for sign in (-1, 1)]
    assert {tuple(np.unique(level[side])) for side in straight} == {(0,), (4,)}
    assert {1, 2, 3} <= set(level[outer & (np.abs(mesh.p[0]) > 2.01)])


def test_ends_of_gaps_are_no_sides():
    for mesh in (poles(3), sector(3), teeth(3), pockets(3)):
        level = level_of(mesh, 3)
        gap, low, high = (mesh.t[:, mesh.subdomains[name]] for name in ("gap", "low", "high"))
        sides = [np.intersect1d(gap, low), np.intersect1d(gap, high)]
        assert {tuple(np.unique(level[side])) for side in sides} == {(0,), (3,)}
        ends = np.setdiff1d(np.intersect1d(gap, mesh.boundary_nodes()), np.concatenate(sides))
        assert {1, 2} <= set(level[ends])


@pytest.mark.parametrize("topology", ["flip", "recycle"])
def test_nothing_changes_in_one_layer_that_nothing_can_thin(topology):
    mesh = poles(1)
    one, none = (again_and_again(mesh, topology, layers, 1, times=1) for layers in ({"gap": 1}, None))
    assert np.array_equal(one.p, none.p) and np.array_equal(one.t, none.t)


def test_the_map_keeps_layers_without_the_quality_rule():
    mesh = poles()
    som = KohonenMap(mesh, min_quality=None, layers={"gap": 2})
    som.train(lambda number, rng: (rng.uniform([[0.0], [0.31]], [[1.0], [0.4]], (2, number)), None), seed=1)
    assert layers_of(som.mesh) == 2


def disc():
    mesh = MeshTri.init_circle(3)
    return mesh.with_subdomains({"disc": np.arange(mesh.nelements)})


def wedge():
    mesh = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.5]]), np.array([[0], [1], [2]])).refined(3)
    return mesh.with_subdomains({"wedge": np.arange(mesh.nelements)})


def touching():
    mesh = poles(4)
    left = np.intersect1d(mesh.subdomains["gap"], np.flatnonzero(centres(mesh)[0] < 1.5))
    return mesh.with_subdomains({"left": left, "right": np.setdiff1d(mesh.subdomains["gap"], left)})


FEW = (
    "subdomain 'gap' has 1 layer of elements between its sides near (0, 0.3); layers asks for {}: "
    "topology='recycle' and target_nodes make the others, up to 8; else refine it there first."
)
THICK = "subdomain '{}' must be thin"
BAD = {
    "too many": (poles, {"gap": 2}, FEW.format(2)),
    "a core": (lambda rows: inset(8), {"core": 1}, THICK.format("core")),
    "a disc": (lambda rows: disc(), {"disc": 1}, THICK.format("disc")),
    "a wedge": (lambda rows: wedge(), {"wedge": 1}, THICK.format("wedge")),
    "no element": (
        lambda rows: poles().with_subdomains({"nothing": np.array([], dtype=np.int64)}),
        {"nothing": 1},
        "subdomain 'nothing' has no elements, so it can have no layers; leave it out.",
    ),
    "too many side by side": (
        lambda rows: touching(),
        {"left": 2, "right": 3},
        "subdomains with layers touch so that not all can have theirs ('left', 'right'); ask for fewer of them.",
    ),
}


@pytest.mark.parametrize(("build", "layers", "message"), BAD.values(), ids=BAD)
def test_bad_layers_are_refused(build, layers, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        KohonenMap(build(1), layers=layers)


def test_every_call_that_cannot_make_layers_refuses_them():
    mesh = closed(poles(1))
    for call, wanted in (
        (lambda: ka.relocate(mesh, np.ones(mesh.nelements), layers={"gap": 2}), 2),
        (lambda: ka.adapt(mesh, current(mesh), layers={"gap": 2}, topology="fixed"), 2),
        (lambda: ka.relocate(mesh, np.ones(mesh.nelements), topology="recycle", layers={"gap": 9}), 9),
    ):
        with pytest.raises(ValueError, match=f"^{re.escape(FEW.format(wanted))}$"):
            call()
