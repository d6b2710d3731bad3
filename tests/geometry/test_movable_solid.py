"""A mesh of tetrahedra taken apart: what its nodes may do, and every name back whatever has become of its arrays."""

import numpy as np
import pytest
from helpers.boxes import check as check_arrays
from helpers.solids import (
    boundary_facts,
    box,
    cut,
    element_facts,
    extruded,
    l_shape,
    neighbours,
    scramble,
    two_regions,
    volumes,
)
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTet, MeshTri
from test_movable import assert_same_state, kept

from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, ON_PATCH, ON_RIDGE, WAITS
from kohonen_adapt.kernels.tetrahedron.swap import swap_waiting

MESHES = {"box": box, "L": l_shape, "two regions": two_regions, "sheet": cut}
each_mesh = pytest.mark.parametrize("build", MESHES.values(), ids=MESHES)


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("position", lambda a: a[:, :2], r"position is an array \(125, 2\) of float64"),
        ("position", lambda a: a.astype(np.float32), r"position is an array \(125, 3\) of float32"),
        ("tetrahedra.node", lambda a: a + 1, "tetrahedra.node has numbers from 1 to 125"),
        (
            "tetrahedra.node",
            lambda a: np.where(a == 124, np.int32(-1), a),
            "tetrahedra.node has elements without all of their corner",
        ),
        ("tetrahedra.neighbour", lambda a: a + len(a), "tetrahedra.neighbour has numbers from 383 to 767"),
        ("tetrahedra.region", lambda a: a + 2, "tetrahedra.region has numbers from 2 to 3"),
        ("tetrahedra.patch", lambda a: a + 20, "tetrahedra.patch has numbers from 19 to"),
        ("freedom.number", lambda a: a + np.int8(1), "freedom.number has numbers from 1 to 4"),
        ("freedom.place", lambda a: a + 40, "freedom.place has numbers from 39 to"),
        ("freedom.pinned", lambda a: a[1:], r"freedom.pinned is an array \(124,\) of bool"),
        ("freedom.place", None, "there is no array freedom.place"),
    ],
)
def test_what_cannot_be_a_state_is_refused_and_nothing_changed(name, change, said):
    solid = MovableSolid.of(two_regions(4), Rules())
    before, state = kept(solid), kept(solid)
    if change is None:
        del state[name]
    else:
        state[name] = change(state[name])
    with pytest.raises(ValueError, match=f"^{said}"):
        solid.restore(state)
    assert_same_state(solid.state(), before)


@each_mesh
def test_elements_are_positive_and_know_their_neighbours(build):
    mesh = build()
    mesh = MeshTet(mesh.p, mesh.t[[1, 0, 2, 3]])
    tet = MovableSolid.of(mesh, Rules()).tetrahedralization
    assert_allclose(tet.volumes(), np.abs(volumes(mesh)), rtol=1e-13)
    assert_array_equal(tet.elements.neighbour, neighbours(tet.elements.node))
    assert_allclose(tet.centroids(), mesh.p[:, mesh.t].mean(axis=1).T, rtol=1e-14)


def test_the_parts_of_one_plane_that_carry_different_names_are_patches_of_their_own():
    solid = MovableSolid.of(two_regions(4), Rules())
    top = np.flatnonzero(solid.patches.names["top"])
    part = np.flatnonzero(solid.patches.names["part"])
    assert set(part) < set(top) and len(top) == 2
    assert len(np.flatnonzero(solid.patches.names["left"])) == 2  # of the lower half and of the upper one
    wall = np.flatnonzero(solid.patches.names["wall"])
    assert len(wall) == 1
    sides = solid.surfaces.meets[np.any(solid.surfaces.meets == wall, axis=1)]
    assert np.all(np.sum(sides >= 0, axis=1) == 3)  # the wall and the sides below and above it
    x, number, place = solid.tetrahedralization.position, solid.freedom.number, solid.freedom.place
    on_wall = (x[:, 2] == 0.5) & np.all((x[:, :2] > 0.0) & (x[:, :2] < 1.0), axis=1)
    assert np.all(number[on_wall] == ON_PATCH) and np.all(place[on_wall] == wall)


def test_a_sheet_in_a_region_ends_in_a_ridge_of_its_own():
    solid = MovableSolid.of(cut(4), Rules())
    (sheet,) = np.flatnonzero(solid.patches.names["sheet"])
    alone = np.flatnonzero(np.all(solid.surfaces.meets == [sheet, -1, -1, -1], axis=1))
    x = solid.tetrahedralization.position
    rim = np.all(x[:, [0, 2]] == 0.5, axis=1) & (x[:, 1] > 0.0) & (x[:, 1] < 1.0)
    assert len(alone) == 1
    assert np.all(solid.freedom.number[rim] == ON_RIDGE) and np.all(solid.freedom.place[rim] == alone)


def test_a_node_in_which_patches_touch_is_held():
    cubes = box(2)
    middle = cubes.p[:, cubes.t].mean(axis=1) < 0.5
    mesh = cubes.with_subdomains({"one": np.flatnonzero(middle.all(axis=0) | ~middle.any(axis=0))})
    solid = MovableSolid.of(mesh, Rules())
    (centre,) = np.flatnonzero(np.all(cubes.p == 0.5, axis=0))
    assert solid.freedom.number[centre] == HELD


def test_edges_in_which_five_patches_meet_hold_their_nodes():
    angle = 2 * np.pi * np.arange(5) / 5
    flat = MeshTri(
        np.hstack([np.zeros((2, 1)), np.stack([np.cos(angle), np.sin(angle)])]),
        np.stack([np.zeros(5, dtype=int), 1 + np.arange(5), 1 + (np.arange(5) + 1) % 5]),
    )
    number = np.tile(np.arange(5), 9)
    mesh = extruded(flat, 3).with_subdomains({f"wedge {k}": np.flatnonzero(number == k) for k in range(5)})
    solid = MovableSolid.of(mesh, Rules())
    axis = np.all(solid.tetrahedralization.position[:, :2] == 0.0, axis=1)
    assert np.all(solid.freedom.number[axis] == HELD)
    assert element_facts(solid.mesh()) == element_facts(mesh)


@each_mesh
@pytest.mark.parametrize("seed", range(2))
def test_other_numbers_lose_no_name(build, seed):
    mesh = build()
    solid = MovableSolid.of(mesh, Rules())
    scramble(solid, seed)
    again = solid.mesh()
    assert not np.array_equal(again.p, mesh.p)
    assert np.all(volumes(again) > 0.0)
    assert again.is_valid()
    if mesh.boundaries:
        assert boundary_facts(again) == boundary_facts(mesh)
    assert element_facts(again) == element_facts(mesh)


def test_pinned_nodes_are_held_and_known():
    solid = MovableSolid.of(two_regions(4), Rules(pinned=["wall", 0]))
    on_wall = solid.tetrahedralization.position[:, 2] == 0.5
    assert np.all(solid.freedom.number[on_wall] == HELD) and np.all(solid.freedom.pinned[on_wall])
    assert solid.freedom.pinned.sum() == on_wall.sum() + 1
    assert not solid.held_nodes.all()
    assert MovableSolid.of(box(1), Rules()).held_nodes.all()


@each_mesh
def test_rows_put_in_order_are_the_same_mesh(build):
    """With the same elements waiting, and room for as many more."""
    solid = MovableSolid.of(build(), Rules())
    scramble(solid)
    found = []
    for ordered in (False, True):
        opened = OpenSolid.of(solid, np.ones(solid.nnodes))
        while np.count_nonzero(opened.queue.waiting) > solid.nnodes // 2:
            swap_waiting(opened.mesh, opened.queue, 1.0, 0.0, 1)
        if ordered:
            opened.renumber()
            n, m = len(opened.nodes()), len(opened.elements())
            assert opened.nodes()[-1] == n - 1 and opened.elements()[-1] == m - 1
        check_arrays(opened.mesh)
        corners = opened.mesh.position[opened.mesh.elements.node[opened.queue.waiting == WAITS]]
        copy, height = solid.copy(), opened.mesh.pool.height.tolist()
        old = opened.mesh.origins.old[opened.write_back(copy, renumbered=True)]
        found.append((copy.mesh(), height, sorted(corners.tolist()), old.tolist()))
    (one, *facts), (other, *again) = found
    assert (one.p.tobytes(), one.t.tobytes()) == (other.p.tobytes(), other.t.tobytes()) and facts == again
    if one.boundaries:
        assert boundary_facts(one) == boundary_facts(other)
