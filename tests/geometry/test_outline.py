"""Outlines: nodes slide on them, corners stay occupied, and neurons jump around them."""

from itertools import product

import numpy as np
import pytest
from helpers.meshes import inset, junction, length_of, named, peak, square
from numpy.testing import assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Rules, Schedule, Stage
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, OTHER

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


@pytest.mark.parametrize(("turn", "corners"), [(2e-6, 5), (1e-9, 4)])
def test_a_turn_above_a_millionth_is_a_corner(turn, corners):
    mesh = square(8)
    mesh = MeshTri(mesh.p + np.array([[0.0], [1.0]]) * turn * np.abs(mesh.p[0] - 0.5) * (mesh.p[1] == 0.0), mesh.t)
    kind, _ = kinds(mesh)
    assert np.sum(kind == HELD) == corners


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
