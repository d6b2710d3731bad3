"""The mid-side nodes of a `MeshTri2` tell its curves: nothing of them is lost, and nodes slide on them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import ROUND, STRAIGHT, TABLED
from kohonen_adapt.mesh.curved import with_midside_offsets


def star(corners, middles):
    """Triangles between the origin, half-way rings and an outline (2, n), whose facets have these mid-side nodes."""
    count = corners.shape[1]
    node = np.arange(count)
    after = (node + 1) % count
    centre, inner, outer = np.full(count, 2 * count), node, node + count
    rows = [(centre, inner, after), (inner, after, outer), (after, after + count, outer)]
    mesh = MeshTri(np.hstack([0.5 * corners, corners, np.zeros((2, 1))]), np.hstack([np.stack(row) for row in rows]))
    off, rim = np.zeros((2, mesh.facets.shape[1])), mesh.boundary_facets()
    low, high = mesh.facets[:, rim] - count
    off[:, rim] = middles[:, np.where(high == low + 1, low, high)] - mesh.p[:, mesh.facets[:, rim]].mean(axis=1)
    return with_midside_offsets(mesh.with_boundaries({"rim": rim}), off)


def along(curve, count):
    """A star whose outline has corners and mid-side nodes at equal steps of a function of 0 to 1."""
    points = curve(np.arange(2 * count) / (2 * count))
    return star(points[:, ::2], points[:, 1::2])


def ellipse(share):
    return np.stack([2.0 * np.cos(2.0 * np.pi * share), np.sin(2.0 * np.pi * share)])


def off_ellipse(x):
    return np.abs(np.hypot(0.5 * x[0], x[1]) - 1.0)


def stadium(share):
    """Two half circles of radius 1 and the tangents between them, of length 3 each; corners of the mesh at joints."""
    at = share * (2.0 * np.pi + 6.0)
    right, left = np.clip(at, 0.0, np.pi), np.clip(at - np.pi - 3.0, 0.0, np.pi)
    top, bottom = np.clip(at - np.pi, 0.0, 3.0), np.clip(at - 2.0 * np.pi - 3.0, 0.0, 3.0)
    angle = right + left - 0.5 * np.pi
    return np.stack([np.cos(angle) + 1.5 - top + bottom, np.sin(angle)])


def stadium_mesh(round_, straight):
    """With so many facets on each half circle and on each line."""
    length, parts = 2.0 * np.pi + 6.0, []
    for start, extent, facets in (
        (0, np.pi, round_),
        (np.pi, 3, straight),
        (np.pi + 3, np.pi, round_),
        (2 * np.pi + 3, 3, straight),
    ):
        parts.append((start + extent * np.arange(2 * facets) / (2 * facets)) / length)
    points = stadium(np.concatenate(parts))
    return star(points[:, ::2], points[:, 1::2])


def wave(share):
    """A closed curve with bends both ways."""
    angle = 2.0 * np.pi * share
    return (1.0 + 0.15 * np.cos(3.0 * angle)) * np.stack([np.cos(angle), np.sin(angle)])


OUTLINES = {
    "circle of three facets": lambda: along(lambda share: 0.5 * ellipse(share) * [[1.0], [2.0]], 3),
    "circle": lambda: along(lambda share: 0.5 * ellipse(share) * [[1.0], [2.0]], 12),
    "ellipse": lambda: along(ellipse, 12),
    "stadium": lambda: stadium_mesh(4, 3),
    "wave": lambda: along(wave, 15),
    "drop": lambda: along(lambda share: np.stack([np.sin(np.pi * share) - 0.3, np.sin(2.0 * np.pi * share)]), 9),
}


def movable(mesh, **rules):
    return MovableMesh.of(mesh, Rules(**rules))


@pytest.mark.parametrize("name", OUTLINES)
def test_a_mesh_that_does_not_move_comes_back(name):
    mesh = OUTLINES[name]()
    back = movable(mesh).mesh()
    assert type(back) is MeshTri2
    assert_allclose(back.p, mesh.p, atol=1e-12)
    assert_array_equal(back.t, mesh.t)


@pytest.mark.parametrize(
    ("name", "shapes"),
    [
        ("circle of three facets", [ROUND]),
        ("circle", [ROUND]),
        ("ellipse", [TABLED]),
        ("wave", [TABLED]),
        ("stadium", [ROUND, STRAIGHT, ROUND, STRAIGHT]),
    ],
)
def test_outlines_are_arcs_and_lines_where_they_can_be_and_splines_elsewhere(name, shapes):
    chains = movable(OUTLINES[name]()).constraints.chains
    assert sorted(chains.shape) == sorted(shapes)
    assert_allclose(np.abs(chains.curvature[chains.shape == ROUND]), 1.0, rtol=1e-12)


def test_nodes_slide_and_middles_stay_on_the_curve():
    for name, distance, bound in (
        ("circle", lambda x: np.abs(np.hypot(*x) - 1.0), 1e-12),
        ("stadium", lambda x: np.abs(np.hypot(np.maximum(np.abs(x[0]) - 1.5, 0.0), x[1]) - 1.0), 1e-12),
        ("ellipse", off_ellipse, 2e-3),
    ):
        mesh = OUTLINES[name]()
        moved = ka.relocate(mesh, lambda x: 1.0 / (0.1 + (x[0] - 0.7) ** 2 + x[1] ** 2), min_quality=0.1)
        rim = moved.boundaries["rim"]
        assert type(moved) is MeshTri2 and moved.p.shape == mesh.p.shape
        assert np.ptp(moved.p[:, mesh.facets[0, rim]] - mesh.p[:, mesh.facets[0, rim]]) > 0.05
        assert distance(moved.p[:, moved.nvertices :][:, rim]).max() < bound
        assert distance(moved.p[:, moved.facets[0, rim]]).max() < bound


def test_a_given_curve_comes_first():
    mesh = along(ellipse, 12)
    spline = ka.Spline(ellipse(np.arange(24) / 24), closed=True)
    assert movable(mesh, curves={"rim": spline}).outline.curve_index[0] == 0
    with pytest.raises(ValueError, match=r"the nodes of boundary 'rim' must lie on the curve given for it"):
        movable(mesh, curves={"rim": ka.Arc((0.0, 0.0), 1.0)})


def test_periodic_sides_cannot_be_splines():
    mesh = along(ellipse, 12)
    rim = mesh.boundary_facets()
    right = rim[mesh.p[0, mesh.facets[:, rim]].mean(axis=0) > 0.0]
    named = MeshTri2(mesh.p, mesh.t, _boundaries={"right": right, "left": np.setdiff1d(rim, right)})
    with pytest.raises(ValueError, match=r"its pieces must be straight or arcs .* or draw its midside nodes to"):
        movable(named, periodic=[("right", "left", ka.Rotation(np.pi))])
