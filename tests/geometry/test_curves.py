"""Curves: the nearest point is nearest, to rounding; a spline through a boundary is the geometry of its mesh."""

import numpy as np
import pytest
import skfem
from helpers.curved_meshes import annulus
from helpers.examples import examples
from helpers.meshes import circle
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import CubicSpline
from skfem import MeshTri

from kohonen_adapt import Arc, Line, Spline
from kohonen_adapt.geometry.plane.polylines import polylines_of


def dense(points, closed, count=20_001):
    """Points all along the spline by scipy alone, with another parameter and unit."""
    points = np.append(points, points[:, :1], axis=1) if closed else points
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=1))))
    spline = CubicSpline(length, points.T, bc_type="periodic" if closed else "not-a-knot")
    return spline(np.linspace(0.0, length[-1], count)).T


def distance(x, y):
    return np.hypot(*(np.asarray(x) - y))


COORDINATE = st.floats(-1e3, 1e3, allow_subnormal=False)
POINT = st.tuples(COORDINATE, COORDINATE)


@st.composite
def some_curves(draw):
    """A curve of any kind, its size, and points near and far."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    centre = rng.normal(size=(2, 1)) * draw(st.sampled_from([0.0, 1.0, 1e2]))
    kind = draw(st.sampled_from(["line", "arc", "open", "closed", "pieces"]))
    points = centre + rng.normal(size=(2, draw(st.integers(2 if kind == "open" else 3, 12))))
    x = centre + rng.normal(size=(2, 40)) * draw(st.sampled_from([0.3, 1.0, 10.0]))
    return kind, points, x


def made(kind, points):
    if kind == "line":
        return Line(points[:, 0], points[:, 1])
    if kind == "arc":
        return Arc(points[:, 0], abs(float(points[0, 1])))
    if kind == "pieces":
        return Spline.of_pieces([(points, True), (points[:, :2] + points[:, 2:3], False)])
    return Spline(points, closed=kind == "closed")


@examples(60)
@given(some_curves(), st.integers(-20, 20))
def test_projections_stay_scale_by_powers_of_two_and_every_point_goes_its_own_way(case, power):
    kind, points, x = case
    before = points.copy(), x.copy()
    curve, unit = made(kind, points), 2.0**power
    once = curve.project(x)
    size = np.abs(points).max() + np.abs(once).max()
    assert np.abs(curve.project(once) - once).max() <= 1e-14 * size
    assert_array_equal(made(kind, unit * points).project(unit * x), unit * once)
    assert_array_equal(once[:, ::7], curve.project(x[:, ::7]))
    assert_array_equal(points, before[0])
    assert_array_equal(x, before[1])
    assert curve.project(np.empty((2, 0))).shape == (2, 0)


@examples(60)
@given(some_curves())
def test_no_point_of_a_spline_is_nearer(case):
    """Also for points as good as equally far from two places, and splines with sharp bends."""
    kind, points, x = case
    if kind in ("line", "arc"):
        kind = "open"
    found = made(kind, points).project(x)
    along = [dense(points, kind != "open")]
    if kind == "pieces":
        along.append(dense(points[:, :2] + points[:, 2:3], False))
    along = np.concatenate(along, axis=1)
    nearest = np.array([distance(along, each[:, None]).min() for each in x.T])
    size, largest = np.ptp(along, axis=1).max(), max(np.abs(along).max(), np.abs(x).max())
    # Coordinates are rounded, here and by `dense`, by parts of the largest of them, however small the curve is.
    rounding = 16 * np.finfo(float).eps * largest
    assert np.all(distance(found, x) <= nearest + 1e-14 * (size + nearest) + rounding)
    off = np.array([distance(along, each[:, None]).min() for each in found.T])
    assert np.all(off <= np.hypot(*np.diff(along[:, :20_001], axis=1)).max())


@examples(100)
@given(POINT, POINT, POINT)
def test_the_foot_on_a_line_is_on_it_and_the_way_there_is_square_to_it(start, end, x):
    along = np.subtract(end, start)
    length = np.hypot(*along)
    if length < 1e-3:
        return
    foot = Line(start, end).project(np.reshape(x, (2, 1)))[:, 0]
    scale = length + distance(start, x)
    assert abs(along[0] * (foot - start)[1] - along[1] * (foot - start)[0]) <= 1e-13 * length * (scale + 1e3)
    assert abs(np.dot(along, foot - x)) <= 1e-13 * length * (scale + 1e3)


def test_an_arc_takes_points_along_rays_from_its_centre():
    arc = Arc((3.0, -1.0), 2.0)
    x = np.random.default_rng(0).normal(size=(2, 1000))
    found = arc.project(x) - [[3.0], [-1.0]]
    off = x - [[3.0], [-1.0]]
    assert_allclose(np.hypot(*found), 2.0, rtol=1e-15)
    assert_allclose(found, 2.0 * off / np.hypot(*off), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Line((0, 0), (0, 0)), r"start and end of a Line must be two different points; got \(0\.0, 0\.0\) twi"),
        (lambda: Line((0, 0, 0), (1, 1)), r"start of a Line must be two finite numbers \(x, y\); got \(0, 0, 0\)"),
        (lambda: Arc((0, np.nan), 1.0), r"centre of an Arc must be two finite numbers \(x, y\); got \(0, nan\)"),
        (lambda: Arc((0, 0), 0.0), r"radius of an Arc must be a positive number; got 0\.0"),
        (lambda: Spline(np.zeros((3, 5))), r"points of a Spline must have shape \(2, n\); got \(3, 5\)"),
        (
            lambda: Spline([[1.0, np.nan, 0], [0, np.nan, np.inf]]),
            "of a Spline must be finite; 2 of 3 points are",
        ),
        (lambda: Spline([[1.0], [0.0]]), "an open Spline must have at least 2 points; got 1"),
        (lambda: Spline([[1.0, 2.0], [0.0, 0.0]], closed=True), "a closed Spline must have at least 3 points; got 2"),
        (
            lambda: Spline([[0.0, 1, 1, 2], [0, 3, 3, 0]]),
            r"from the next; points 1 and 2 are both at \(1\.0, 3\.0\)",
        ),
        (
            lambda: Spline(circle(9)[:, [*range(9), 0]], closed=True),
            r"9 and 0 are both at .* Leave one of them out",
        ),
        (lambda: Spline.of_pieces([]), "a Spline must have at least one piece; got none"),
    ],
)
def test_what_is_no_curve(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("curve", [Line((0, 0), (1, 0)), Arc((0, 0), 1.0), Spline([[0.0, 1.0], [0.0, 0.0]])])
def test_what_cannot_be_projected(curve):
    for x in (np.zeros(2), np.zeros((3, 4)), np.zeros((1, 2, 2))):
        with pytest.raises(ValueError, match=r"x must have shape \(2, n\); got \("):
            curve.project(x)
    with pytest.raises(ValueError, match="x must be finite; 1 of 3 points are not"):
        curve.project([[0.0, np.nan, 1.0], [0.0, 0.0, 1.0]])


# Through boundaries of meshes


def is_piece(spline, number, points):
    """Whether a piece goes through just these points, whichever way round and wherever it begins."""
    return {tuple(point) for point in spline.pieces[number].T} == {tuple(point) for point in np.asarray(points).T}


def test_a_loop_without_a_corner_is_closed():
    mesh = annulus(24)
    spline = Spline.through(mesh, "outer")
    assert spline.closed == (True,)
    assert is_piece(spline, 0, mesh.p[:, np.unique(mesh.facets[:, mesh.boundaries["outer"]])])
    assert repr(spline) == "<Spline of 1 piece through 24 points>"
    x = 3.0 * circle(997)
    assert_allclose(np.hypot(*spline.project(x)), 1.5, rtol=2e-5)


@examples(60)
@given(st.sets(st.integers(0, 55), min_size=1), st.integers(0, 2**32 - 1), st.sampled_from([2, 3]))
def test_pieces_hold_every_segment_once_and_are_cut_at_corners_only(facets, seed, columns):
    mesh = MeshTri().refined(2)
    rng = np.random.default_rng(seed)
    position = mesh.p + rng.uniform(-0.02, 0.02, mesh.p.shape)
    segments = rng.permuted(mesh.facets.T[rng.permutation(sorted(facets))], axis=1)
    if columns == 3:
        segments = np.column_stack([segments[:, 0], mesh.p.shape[1] + np.arange(len(segments)), segments[:, 1]])
        position = np.append(position, position[:, segments[:, [0, 2]]].mean(axis=2), axis=1)
    lines = polylines_of(segments, position)
    walked = [np.append(line.nodes, line.nodes[:1]) if line.closed else line.nodes for line in lines]
    pairs = np.sort(np.concatenate([np.stack([walk[:-1], walk[1:]], axis=1) for walk in walked]), axis=1)
    wanted = np.sort(np.concatenate([segments[:, k : k + 2] for k in range(columns - 1)]), axis=1)
    assert_array_equal(pairs[np.lexsort(pairs.T)], wanted[np.lexsort(wanted.T)])
    inside = np.concatenate([walk[1:] if line.closed else walk[1:-1] for walk, line in zip(walked, lines, strict=True)])
    for node, count in zip(*np.unique(wanted, return_counts=True), strict=True):
        beside = wanted[np.any(wanted == node, axis=1)].sum(axis=1) - node
        way = (position[:, beside] - position[:, [node]])[0] + 1j * (position[:, beside] - position[:, [node]])[1]
        goes_on = count == 2 and abs(np.angle(-way[1] / way[0])) < np.radians(35.0)
        assert np.sum(inside == node) == goes_on


def test_boundaries_that_have_no_curve():
    mesh = annulus(12)
    with pytest.raises(ValueError, match="boundary 'rim' is not in the mesh; it has 'inner', 'in"):
        Spline.through(mesh, "rim")
    with pytest.raises(ValueError, match="boundary 'rim' is not in the mesh; it has none"):
        Spline.through(MeshTri(), "rim")
    with pytest.raises(ValueError, match="boundary 'none' has no facets, so there is no curve through their nodes"):
        Spline.through(MeshTri(mesh.p, mesh.t, {"none": np.array([], dtype=int)}), "none")
    with pytest.raises(ValueError, match=r"mesh must be a skfem\.MeshTri or MeshTri2; got MeshQuad1"):
        Spline.through(skfem.MeshQuad(), "left")
