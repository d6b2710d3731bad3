"""The map of a mesh of tetrahedra: what it learns, and what it keeps."""

import numpy as np
import pytest
from helpers.solids import box

from kohonen_adapt import KohonenMap, Schedule, Stage
from kohonen_adapt.kernels.tetrahedron.entries import SPACE
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.som.training_points import ElementDensity


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0.1, 0.5], [0.1, 1.5], [0.1, 0.5]], r"1 do not, point 1 at \(0\.5, 1\.5, 0\.5\)"),
        ([[0.1], [0.1]], r"points must have shape \(3, n\); got \(2, 1\)"),
        (np.zeros((3, 0)), "at least one training point"),
    ],
)
def test_points_that_no_element_holds_are_refused(points, message):
    with pytest.raises(ValueError, match=message):
        KohonenMap(box(2)).train(points)


def test_what_is_for_triangles_only_is_refused():
    with pytest.raises(ValueError, match="rounds of transport, which are for triangles only"):
        KohonenMap(box(2)).train(np.full((3, 1), 0.4), Schedule((Stage(1, 1, 0.1),), rounds=1))


def test_loops_are_compiled_for_the_types_of_the_table():
    KohonenMap(box(2)).train(np.full((3, 1), 0.4), Schedule((Stage(1, 1, 0.1),)))
    mesh = Tetrahedralization.of(box(2))
    ElementDensity(mesh, np.ones(len(mesh.elements.node))).draw(10, np.random.default_rng(0))
    for entry in SPACE["space map"]:
        assert entry.loop.signatures == [entry.types], entry.name
