"""A mesh of tetrahedra taken apart: what its nodes may do, and every name back whatever has become of its arrays."""

import numpy as np
import pytest
from helpers.solids import (
    two_regions,
)
from test_movable import assert_same_state, kept

from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import ON_PATCH


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
