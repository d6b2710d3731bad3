"""Sides on curves are bent to them, and no element is folded over by that however hostile the arc."""

import numpy as np
import pytest
from helpers.examples import examples
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from skfem import MeshTri, MeshTri2

import kohonen_adapt as ka
from kohonen_adapt import Rules, quality
from kohonen_adapt.geometry.plane.midsides import MIN_JACOBIAN
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.curved import (
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
