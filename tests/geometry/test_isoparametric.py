"""Sides on curves are bent to them, and no element is folded over by that however hostile the arc."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import disk, square
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt import Rules, quality
from kohonen_adapt.geometry.plane.midsides import MIN_JACOBIAN, jacobian_coefficients
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.curved import (
    corners_of,
    determinant_coefficients,
    midside_offsets,
    offsets_of_sides,
    with_midside_offsets,
)
from kohonen_adapt.mesh.measures import area, signed_area

UNIT = ka.Arc((0.0, 0.0), 1.0)


def bent(mesh, **rules):
    return MovableMesh.of(mesh, Rules(**rules), curved=True).mesh()


def shares_kept(mesh):
    """Least Bernstein coefficient of every element over the determinant of the straight one, (nelements,)."""
    coefficients = determinant_coefficients(mesh.p[:, mesh.t], midside_offsets(mesh))
    return (coefficients / (2.0 * signed_area(mesh))).min(axis=0)


def on_rim(mesh):
    """How far the mid-side nodes of the rim are from the origin."""
    return np.hypot(*mesh.p[:, mesh.nvertices :][:, mesh.boundary_facets()])


def belt(angles, inner, outer, twist):
    """Two rings of triangles, inside and outside the polygon of these angles on the unit circle, which is named."""
    count = len(angles)
    radii = [np.full(count, inner), np.ones(count), np.full(count, outer)]
    shift = twist * np.append(np.diff(angles), angles[0] + 2.0 * np.pi - angles[-1])
    places = [
        r * np.array([np.cos(a), np.sin(a)])
        for r, a in zip(radii, (angles + shift, angles, angles + shift), strict=True)
    ]
    node = np.arange(2 * count)
    after = np.where((node + 1) % count, node + 1, node + 1 - count)
    lower = np.where(node < count, np.stack([node, after, after + count]), np.stack([node, after, node + count]))
    upper = np.where(
        node < count, np.stack([node, after + count, node + count]), np.stack([after, after + count, node + count])
    )
    mesh = MeshTri(np.hstack(places), np.hstack([lower, upper]))
    ring = np.flatnonzero(np.all(mesh.facets // count == 1, axis=0))
    return MeshTri(mesh.p, mesh.t, {"ring": ring}, {"inside": np.flatnonzero(np.any(mesh.t < count, axis=0))})


gaps = st.lists(st.floats(0.05, 1.0), min_size=4, max_size=9)


@examples(60)
@given(gaps, st.floats(0.2, 0.99), st.floats(1.001, 3.0), st.floats(0.0, 0.9))
def test_hostile_arcs_between_thin_triangles_fold_nothing_over(gaps, inner, outer, twist):
    angles = 2.0 * np.pi * np.cumsum(gaps) / np.sum(gaps)
    mesh = belt(angles, inner, outer, twist)
    centre = np.hypot(*mesh.p[:, mesh.t].mean(axis=1))
    assume(np.max(np.diff(angles, append=angles[0] + 2.0 * np.pi)) < 2.6 and np.min(quality(mesh)) > 0.02)
    assume(abs(area(mesh).sum() - area_between(mesh, len(angles))) < 1e-9 and centre.min() > 0.0)
    curved = bent(mesh, curves={"ring": UNIT})
    kept = shares_kept(curved)
    assert kept.min() > MIN_JACOBIAN - 1e-9
    ka.quality(curved)  # refuses what is folded over
    off, ring = offsets_of_sides(curved), curved.boundaries["ring"]
    whole = offsets_of_sides(with_midside_offsets(mesh, to_circle(mesh)))[:, ring]
    part = np.sum(off[:, ring] * whole, axis=0) / np.sum(whole**2, axis=0)
    assert_allclose(off[:, ring], part * whole, atol=1e-12)
    held = part < 1.0 - 1e-9
    assert np.all(part > 0.0)
    beside = kept[mesh.f2t[:, ring]].min(axis=0)
    assert_allclose(beside[held], MIN_JACOBIAN, rtol=1e-9)  # no more than needed: one curved side an element


def area_between(mesh, count):
    """Between the innermost and the outermost polygon, where no element lies on another."""
    inside, _, outside = (mesh.p[:, k * count : (k + 1) * count] for k in range(3))
    return polygon(outside) - polygon(inside)


def polygon(p):
    x, y = p
    return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)


def to_circle(mesh):
    """The displacements that bring the middles of facets to the unit circle."""
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    return middle / np.hypot(*middle) - middle


@examples(60)
@given(st.lists(st.floats(0.05, 1.0), min_size=3, max_size=9), st.integers(0, 8))
def test_elements_with_two_and_three_sides_on_an_arc_are_not_folded_over(gaps, first):
    """A fan from one corner of a polygon: its outermost triangles have two sides on the circle, one alone three."""
    angles = 2.0 * np.pi * np.cumsum(gaps) / np.sum(gaps)
    assume(np.max(np.diff(angles, append=angles[0] + 2.0 * np.pi)) < 2.6)
    k = (np.arange(len(gaps)) + first) % len(gaps)
    mesh = MeshTri(np.stack([np.cos(angles), np.sin(angles)]), np.stack([np.full(len(gaps) - 2, k[0]), k[1:-1], k[2:]]))
    mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()})
    assume(np.min(quality(mesh)) > 0.01)
    curved = bent(mesh, curves={"rim": UNIT})
    assert shares_kept(curved).min() > MIN_JACOBIAN - 1e-9
    ka.quality(curved)
    assert area(mesh).sum() < area(curved).sum() < np.pi + 0.5  # coarse ones bulge beyond the circle


def test_good_elements_are_not_held_back():
    """Of quality 0.3 beside facets of 15 degrees, of 0.6 beside 30: whatever their shape, on either side."""
    for degrees, least in ((15.0, 0.3), (30.0, 0.6)):
        half = np.radians(0.5 * degrees)
        x, y = np.meshgrid(
            np.linspace(-1.5, 1.5, 200), np.append(np.linspace(-2, -0.01, 200), np.linspace(0.01, 2, 200))
        )
        corners = np.stack(
            [np.stack([x.ravel(), y.ravel()], axis=1), *(np.full((x.size, 2), [s, 0.0]) for s in (-0.5, 0.5))], axis=1
        )
        off = np.zeros_like(corners)
        off[:, 0, 1] = 0.5 * np.tan(0.5 * half)
        doubled = jacobian_coefficients(corners, np.zeros_like(off))[:, 0]
        edges = corners - np.roll(corners, 1, axis=1)
        good = 2.0 * np.sqrt(3.0) * np.abs(doubled) / np.sum(edges**2, axis=(1, 2)) >= least
        assert (jacobian_coefficients(corners, off) / doubled[:, None])[good].min() > MIN_JACOBIAN


def test_middles_are_on_the_curve_and_only_there_off_their_chords():
    mesh = disk(5, 1.0)
    curved = bent(mesh)
    assert type(curved) is MeshTri2
    assert_allclose(on_rim(curved), 1.0, atol=1e-15)
    off = offsets_of_sides(curved)
    off[:, curved.boundary_facets()] = 0.0
    assert np.abs(off).max() < 1e-15
    assert_array_equal(corners_of(curved).p, mesh.p)


def test_where_nothing_is_curved_a_mesh_stays_straight():
    mesh = square(3)
    assert type(bent(mesh)) is MeshTri
    assert type(ka.relocate(MeshTri2.from_mesh(mesh), np.ones(mesh.nelements))) is MeshTri
    assert type(MovableMesh.of(disk(4, 1.0), Rules()).mesh()) is MeshTri


@pytest.mark.parametrize("curved", [None, True, False])
def test_second_order_comes_back_unless_straight_sides_are_asked_for(curved):
    mesh = bent(disk(4, 1.0))
    back = MovableMesh.of(mesh, Rules(), curved).mesh()
    assert type(back) is (MeshTri if curved is False else MeshTri2)
    if curved is not False:
        assert_allclose(back.p, mesh.p, atol=1e-12)


def test_a_mesh_that_is_folded_over_comes_back_whole():
    """As coarse meshes of second order by Gmsh are: the curves of such sides are good, and they are bent anew."""
    mesh = belt(np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False), 0.6, 1.1, 0.2)
    folded = with_midside_offsets(
        mesh, np.where(np.isin(np.arange(mesh.facets.shape[1]), mesh.boundaries["ring"]), to_circle(mesh), 0.0)
    )
    with pytest.raises(ValueError, match="must not invert elements"):
        ka.quality(folded)
    moved = ka.relocate(folded, np.ones(folded.nelements))
    assert type(moved) is MeshTri2 and shares_kept(moved).min() > MIN_JACOBIAN - 1e-9
