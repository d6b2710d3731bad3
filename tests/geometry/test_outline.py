"""Outlines: nodes slide on them, corners stay occupied, and neurons jump around them."""

from itertools import product

import numpy as np
import pytest
from helpers.meshes import comb, inset, junction, l_shape, length_of, named, peak, slit, square
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Rules, Schedule, Stage
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, OTHER

MUCH = Schedule((Stage(2, 4, 0.5), Stage(0, 4, 0.5)), sweeps=3)
SQUARE_CORNERS = {(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)}


def places(mesh, nodes=slice(None)):
    return set(zip(*mesh.p[:, nodes].tolist(), strict=True))


def kinds(mesh, pinned=()):
    """FREE, SLIDING or HELD per node, and which of the held may leave their corner to another node."""
    constraints = MovableMesh.of(mesh, Rules(pinned=pinned)).constraints
    return constraints.kind, (constraints.kind == HELD) & (constraints.chain[:, OTHER] >= 0)


def trained_once(mesh, x, rate=1.0, **options):
    som = KohonenMap(mesh, **{"topology": "fixed", "min_quality": 0.0, **options})
    som.train(np.array(x)[:, None], Schedule((Stage(0, 1, rate),)))
    return som.mesh


def on_side(mesh, axis, value):
    return int(np.sum(mesh.p[axis] == value))


def test_corners_of_polygons_are_held_and_nodes_between_them_slide():
    mesh = inset(8)
    kind, jumps = kinds(mesh)
    core = {(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)}
    assert places(mesh, kind == HELD) == SQUARE_CORNERS | core
    assert np.array_equal(jumps, kind == HELD)
    at_core = np.max(np.abs(mesh.p - 0.5), axis=0) == 0.25
    at_frame = np.max(np.abs(mesh.p - 0.5), axis=0) == 0.5
    assert_array_equal(kind != FREE, at_core | at_frame)


def test_junctions_changes_of_name_and_loose_ends_are_corners():
    mesh = junction(8)
    kind, jumps = kinds(mesh)
    assert places(mesh, kind == HELD) == SQUARE_CORNERS | {(0.5, 0.5), (0.0, 0.5), (1.0, 0.5), (0.5, 1.0)}
    assert places(mesh, jumps) == SQUARE_CORNERS

    mesh = named(8)
    kind, jumps = kinds(mesh)
    # interfaces end at x = 1/2 and y = 1/4, the crack (y = 3/4) meets the seam and ends loose at 1/4 and 3/4
    meetings = {(0.5, 0.0), (0.5, 1.0), (0.0, 0.25), (1.0, 0.25), (0.5, 0.25), (0.5, 0.75)}
    assert places(mesh, kind == HELD) == SQUARE_CORNERS | meetings | {(0.25, 0.75), (0.75, 0.75)}
    assert places(mesh, jumps) == SQUARE_CORNERS


def test_a_change_of_name_in_the_middle_of_a_side_is_a_corner():
    mesh = square(8)
    mesh = mesh.with_boundaries({"half": mesh.facets_satisfying(lambda x: (x[1] == 0.0) & (x[0] < 0.5))})
    kind, jumps = kinds(mesh)
    assert places(mesh, kind == HELD) == SQUARE_CORNERS | {(0.5, 0.0)}
    assert places(mesh, jumps) == SQUARE_CORNERS | {(0.5, 0.0)}


def test_the_tip_of_a_slit_is_a_corner():
    mesh = slit(8, tip=0.75)
    kind, _ = kinds(mesh)
    assert {(0.75, 0.5), (0.0, 0.5)} | SQUARE_CORNERS == places(mesh, kind == HELD)
    assert np.sum(kind == HELD) == 7  # the mouth is there twice


@pytest.mark.parametrize(("turn", "corners"), [(2e-6, 5), (1e-9, 4)])
def test_a_turn_above_a_millionth_is_a_corner(turn, corners):
    mesh = square(8)
    mesh = MeshTri(mesh.p + np.array([[0.0], [1.0]]) * turn * np.abs(mesh.p[0] - 0.5) * (mesh.p[1] == 0.0), mesh.t)
    kind, _ = kinds(mesh)
    assert np.sum(kind == HELD) == corners


def test_small_turns_that_add_up_are_kept_node_by_node():
    angle = 5e-5 * np.linspace(-1, 1, 101) ** 2  # no circle: the turns change
    bow = np.stack([np.linspace(0, 1, 101), np.cumsum(np.tan(angle)) / 100])
    ticks = np.linspace(0, 1, 101)
    mesh = MeshTri.init_tensor(ticks, np.linspace(0, 0.02, 3))
    p = mesh.p.copy()
    p[1] += np.interp(p[0], bow[0], bow[1])
    mesh = MeshTri(p, mesh.t)
    result = ka.relocate(mesh, peak(mesh, 0.5, 0.01), schedule=MUCH, min_quality=0.0)
    edge = np.isin(np.arange(p.shape[1]), mesh.boundary_nodes()) & (p[0] > 0) & (p[0] < 1)
    assert_array_equal(result.p[:, edge], p[:, edge])


@pytest.mark.parametrize("build", [lambda: square(8), lambda: inset(8), lambda: l_shape(4), lambda: comb(10)])
def test_nodes_on_lines_along_an_axis_keep_that_coordinate_to_the_bit(build):
    mesh = build()
    density = peak(mesh, *mesh.p[:, mesh.boundary_nodes()[3]])
    result = ka.relocate(mesh, density, schedule=MUCH)
    lines = {tuple(line) for line in outline_lines(mesh)}
    assert {tuple(line) for line in outline_lines(result)} == lines
    assert np.any(result.p != mesh.p)


def outline_lines(mesh):
    """(axis, coordinate) of every outer and interface facet; they must all lie along an axis."""
    facets = [mesh.boundary_facets()]
    for rows in (mesh.subdomains or {}).values():
        facets.append(np.flatnonzero(np.bincount(mesh.t2f[:, rows].ravel(), minlength=mesh.facets.shape[1]) == 1))
    for a, b in mesh.p[:, mesh.facets[:, np.concatenate(facets)]].transpose(2, 1, 0):
        axis = 0 if a[0] == b[0] else 1
        assert a[axis] == b[axis]
        yield axis, float(a[axis])


def cornered():
    """A square of 2 x 2 cells; the corner (0, 0) has two elements, and (1, 0) one."""
    mesh = square(2)
    count = np.bincount(mesh.t.ravel())
    return (
        mesh
        if count[np.all(mesh.p == 0, axis=0)][0] == 2
        else MeshTri(np.array([[1.0], [0]]) + [[-1], [1]] * mesh.p, mesh.t)
    )


def node_at(mesh, x, y):
    return int(np.flatnonzero((mesh.p[0] == x) & (mesh.p[1] == y))[0])


def test_the_jump_around_a_corner():
    mesh = cornered()
    corner, follower = node_at(mesh, 0, 0), node_at(mesh, 0, 0.5)
    result = trained_once(mesh, (0.2, 0.05))  # its winner is the corner, and the lower side is nearer than the left
    assert result.p[:, corner].tolist() == [0.2, 0.0]
    assert result.p[:, follower].tolist() == [0.0, 0.0]
    assert on_side(result, 0, 0.0) == on_side(mesh, 0, 0.0) - 1
    assert on_side(result, 1, 0.0) == on_side(mesh, 1, 0.0) + 1
    others = np.setdiff1d(np.arange(9), [corner, follower])
    assert_array_equal(result.p[:, others], mesh.p[:, others])
    assert_array_equal(result.t, mesh.t)
    assert ka.quality(result).min() > 0


@pytest.mark.parametrize(("x", "rate", "place"), [((0.05, 0.2), 1.0, [0.0, 0.2]), ((0.2, 0.05), 0.25, [0.05, 0.0])])
def test_it_jumps_onto_the_nearer_side_by_the_share_of_the_learning_rate(x, rate, place):
    mesh = cornered()
    assert trained_once(mesh, x, rate=rate).p[:, node_at(mesh, 0, 0)].tolist() == place


def test_corners_of_interfaces_jump_too():
    mesh = inset(8)
    ear = np.bincount(mesh.t[:, mesh.subdomains["core"]].ravel())[node_at(mesh, 0.25, 0.25)] == 1
    mesh = MeshTri([[float(ear)], [0]] + [[1 - 2 * ear], [1]] * mesh.p, mesh.t, None, mesh.subdomains)
    mesh.p[1, node_at(mesh, 0.125, 0.25)] = 0.2  # else the element at the follower would become flat
    corner, follower = node_at(mesh, 0.25, 0.25), node_at(mesh, 0.25, 0.375)
    result = trained_once(mesh, (0.3, 0.26))  # from within the core
    assert result.p[:, corner].tolist() == [0.3, 0.25]
    assert result.p[:, follower].tolist() == [0.25, 0.25]
    result = trained_once(mesh, (0.3, 0.24))  # from the air
    assert result.p[:, corner].tolist() == [0.3, 0.25]
    for name, rows in result.subdomains.items():
        assert_array_equal(rows, mesh.subdomains[name])


def test_jumps_change_the_number_of_nodes_per_side_and_not_the_geometry():
    stages = [ka.Stage(8, 1, 0.2, points_per_neuron=0.13), *(ka.Stage(radius, 3, 0.3) for radius in (4, 2, 1))]
    mesh = square(16).with_boundaries({"floor": lambda x: x[1] == 0.0, "top": lambda x: x[1] == 1.0})
    for topology in ("fixed", "flip"):
        options = {"topology": topology, "schedule": ka.Schedule(stages)}
        results = [ka.relocate(mesh, peak(mesh, 0.5, 0.0, 1e4), seed=seed, **options) for seed in range(3)]
        assert max(on_side(result, 1, 0.0) for result in results) > 17
        for result, name in product(results, ("floor", "top")):
            ends = result.p[:, result.facets[:, result.boundaries[name]]]
            assert len(np.unique(ends[1])) == 1
            assert len(result.boundaries[name]) == on_side(result, 1, ends[1, 0, 0]) - 1
            assert length_of(result, result.boundaries[name]) == pytest.approx(1.0, rel=1e-14)


def test_a_jump_at_a_junction_by_hand():
    """The neuron in the junction goes right, its left neighbour takes its place, and the element between them, too."""
    mesh = junction(4)
    numbers = {tuple(x): v for v, x in enumerate(mesh.p.T.tolist())}
    middle, left, up = (numbers[place] for place in [(0.5, 0.5), (0.25, 0.5), (0.5, 0.75)])
    ear = np.sort([middle, left, up]).tolist()
    assert ear in mesh.t[:, mesh.subdomains["left"]].T.tolist()
    result = trained_once(mesh, (0.6, 0.51), rate=0.5, topology="flip")
    assert_allclose(result.p[:, [middle, left]], [[0.55, 0.5], [0.5, 0.5]])
    assert ear in result.t[:, result.subdomains["right"]].T.tolist()
    assert len(result.subdomains["right"]) == len(mesh.subdomains["right"]) + 1
