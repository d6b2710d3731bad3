"""Layers of elements across thin subdomains: counted by a search of our own, between sides that the geometry tells."""

import re

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import area_of, centres, inset
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.magnetostatics import Magnetostatics, Material


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


def level_of(mesh, layers):
    """How many edges every node is from the first side of the gap, (n,)."""
    return MovableMesh.of(mesh, Rules(layers={"gap": layers})).triangulation.elements.level


def test_ends_of_gaps_are_no_sides():
    for mesh in (poles(3), sector(3), teeth(3), pockets(3)):
        level = level_of(mesh, 3)
        gap, low, high = (mesh.t[:, mesh.subdomains[name]] for name in ("gap", "low", "high"))
        sides = [np.intersect1d(gap, low), np.intersect1d(gap, high)]
        assert {tuple(np.unique(level[side])) for side in sides} == {(0,), (3,)}
        ends = np.setdiff1d(np.intersect1d(gap, mesh.boundary_nodes()), np.concatenate(sides))
        assert {1, 2} <= set(level[ends])


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


def test_the_map_keeps_layers_without_the_quality_rule():
    mesh = poles()
    som = KohonenMap(mesh, min_quality=None, layers={"gap": 2})
    som.train(lambda number, rng: (rng.uniform([[0.0], [0.31]], [[1.0], [0.4]], (2, number)), None), seed=1)
    assert layers_of(som.mesh) == 2
