"""Arcs and curves: what is taken for one, and that nodes slide on it without leaving or shrinking it."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import circle, closed, peak, ring, shells, square, with_lines
from helpers.own_curves import Ellipse
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import HELD, ROUND, SLIDING

HUNDRED = np.deg2rad(100.0)
TOPOLOGIES = pytest.mark.parametrize("topology", ["fixed", "flip", "recycle"])


def outline_of(mesh, **options):
    return MovableMesh.of(mesh, Rules(**options)).outline


def circles(mesh, **options):
    """Centre, radius and whether it is closed, of every round chain, (r, 4), sorted."""
    chains = outline_of(mesh, **options).constraints.chains
    is_round = chains.shape == ROUND
    radius, direction = 1 / chains.curvature[is_round], chains.direction[is_round]
    centre = chains.origin[is_round] + radius[:, None] * np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    rows = np.column_stack([centre, np.abs(radius), chains.closed[is_round]])
    return rows[np.lexsort(np.round(rows, 6).T)]


def strip(along, layers=3):
    """A mesh between a curve, points (2, n) named curve, and the same curve moved by (0, 1)."""
    n = along.shape[1]
    flat = MeshTri.init_tensor(np.arange(n, dtype=float), np.linspace(0, 1, layers + 1))
    number = flat.p[0].astype(int)
    mesh = MeshTri(along[:, number] + flat.p[1] * np.array([[0.0], [1.0]]), flat.t)
    first = np.flatnonzero(flat.p[1] == 0)
    return with_lines(mesh, {"curve": first[np.argsort(number[first])]})


def sector(n, layers, angle=HUNDRED):
    """Part of an annulus; its arcs, named inner and outer, turn both ways, and its straight sides are named sides."""
    flat = MeshTri.init_tensor(np.linspace(0, angle, n + 1), np.linspace(0.5, 1.0, layers + 1))
    mesh = MeshTri(flat.p[1] * np.stack([np.cos(flat.p[0]), np.sin(flat.p[0])]), flat.t)
    order = np.argsort(flat.p[0])
    lines = {name: order[flat.p[1, order] == radius] for name, radius in (("inner", 0.5), ("outer", 1.0))}
    first, last = (np.flatnonzero(flat.p[0] == end) for end in (0.0, angle))
    return with_lines(mesh, {**lines, "begin": first, "end": last})


# --- what is recognised ---


def rounded(corner, radius, fillet, side):
    """A convex polygon (n,) of complex numbers as points, and the rounded corners' centres.

    Every corner has a radius, 0 for a sharp one, and so many facets on its fillet and on the side after it.
    """
    points, centres = [], []
    way = np.roll(corner, -1) - corner
    way /= np.abs(way)
    turn = np.angle(way / np.roll(way, 1))
    cut = radius * np.tan(turn / 2)
    for k, after in enumerate(np.roll(np.arange(len(corner)), -1)):
        centres.append(corner[k] + (cut[k] + 1j * radius[k]) * way[k])
        angle = turn[k] * (np.arange(fillet[k]) / fillet[k] - 1.0)
        start, end = corner[k] + cut[k] * way[k], corner[after] - cut[after] * way[k]
        points += [centres[k] - 1j * radius[k] * way[k] * np.exp(1j * angle)] * bool(radius[k])
        points.append(start + (end - start) * np.arange(side[k]) / side[k])
    return np.concatenate(points), np.array(centres)


@st.composite
def drawings(draw):
    """Corners of a polygon around the origin, and radii and numbers of facets as `rounded` takes them."""
    count = draw(st.integers(3, 7))
    rows = [st.sampled_from([0.0, 0.1, 0.15, 0.2]), st.integers(5, 20), st.integers(1, 20)]
    columns = [draw(st.lists(each, min_size=count, max_size=count)) for each in rows]
    return np.exp(2j * np.pi * np.arange(count) / count), *map(np.array, columns)


@examples(40)
@given(drawings(), st.integers(-20, 20), st.integers(0, 2**32 - 1))
def test_a_drawing_of_lines_and_arcs_is_recognised_as_drawn(drawing, power, seed):
    """Whatever the numbers of its nodes, its size, its place and the way round that arcs are seen."""
    rng = np.random.default_rng(seed)
    corner, radius, fillet, side = drawing
    number, unit, turn = rng.permutation(len(corner)), 2.0**power, np.exp(1j * seed)
    place = turn * (number[0] + 2j)
    points, centres = rounded(corner, radius, fillet, side)
    rows = [scale * np.stack([points.real, points.imag]) for scale in (0.5, 1.0)]
    plain = shells(rows, 2)
    z = unit * (place + turn * (plain.p[0] + 1j * plain.p[1]))
    order = rng.permutation(len(z))
    mesh = MeshTri(np.stack([z.real, z.imag])[:, order], np.argsort(order)[plain.t])
    is_round = radius > 0.0
    drawn = [unit * np.append(place + turn * scale * c, scale * r) for scale in (0.5, 1.0)
             for c, r in zip(centres[is_round], radius[is_round], strict=True)]  # fmt: skip
    drawn = np.array(drawn).reshape(-1, 2)
    found = circles(mesh)
    found = found[np.lexsort(np.round(found[:, 2::-1] / unit, 6).T)]
    wanted = np.column_stack([drawn[:, 0].real, drawn[:, 0].imag, drawn[:, 1].real, np.zeros(len(drawn))])
    wanted = wanted[np.lexsort(np.round(wanted[:, 2::-1] / unit, 6).T)]
    assert_allclose(found, wanted, atol=1e-11 * unit)
    assert np.sum(outline_of(mesh).constraints.kind == HELD) == 2 * (len(corner) + is_round.sum())


def with_noise(mesh, share, seed=0):
    """The mesh with the nodes moved towards its centre or away, by up to that share of their distance."""
    return MeshTri(mesh.p * (1 + share * np.random.default_rng(seed).uniform(-1, 1, mesh.p.shape[1])), mesh.t)


@pytest.mark.parametrize(("noise", "arcs"), [(6e-4, 2), (5e-3, 0)])
def test_nodes_within_a_thousandth_of_a_circle_are_taken_for_it(noise, arcs):
    assert all(len(circles(with_noise(ring(n, 2), noise, seed))) == arcs for n in (12, 40, 200) for seed in range(3))


def test_what_was_recognised_is_in_the_log(caplog):
    with caplog.at_level("DEBUG", logger="kohonen_adapt"):
        outline_of(sector(20, 2))
        outline_of(ring(40, 2))
    assert sorted(message for message in caplog.messages if message.startswith("recognised")) == [
        "recognised a circle of radius 0.5 about (0, 0), 40 nodes",
        "recognised a circle of radius 1 about (0, 0), 40 nodes",
        "recognised an arc of 100 degrees of radius 0.5 about (0, 0), 21 nodes",
        "recognised an arc of 100 degrees of radius 1 about (0, 0), 21 nodes",
    ]


def spiral(n, growth, angle):
    turn = np.linspace(0.4, angle, n)
    return (1 + growth * turn) * np.stack([-np.cos(turn), -np.sin(turn)])


NOT_ROUND = {
    "five nodes": lambda: strip(spiral(5, 0.0, 1.5)),
    "eight sides": lambda: ring(8, 2),
    "turns of 36 degrees": lambda: ring(10, 2),
    "ellipse": lambda: shells([s * np.array([[2.0], [1.0]]) * circle(24) for s in (0.5, 1)], 2),
    "nearly a circle": lambda: shells([s * np.array([[1.01], [1.0]]) * circle(60) for s in (0.5, 1)], 2),
    "spiral": lambda: strip(spiral(24, 0.2, 2.7)),
    "wave": lambda: strip(np.stack([np.linspace(0, 1, 60), 0.1 * np.sin(np.linspace(0, 9, 60))])),
}


@pytest.mark.parametrize("kind", NOT_ROUND)
def test_nodes_of_what_is_no_circle_stay_bit_for_bit(kind):
    mesh = NOT_ROUND[kind]()
    assert len(circles(mesh)) == 0
    kept = outline_of(mesh).constraints.kind == HELD
    rim = np.isin(np.arange(mesh.p.shape[1]), mesh.boundary_nodes())
    bent = kept & rim
    assert np.sum(bent) >= 8
    x, y = mesh.p[:, np.flatnonzero(bent)[3]]
    result = ka.relocate(mesh, peak(mesh, x, y, 300, 0.3))
    assert np.array_equal(result.p[:, bent], mesh.p[:, bent])
    assert np.any(result.p != mesh.p)


def wanderer(mesh, number):
    """A density with a peak somewhere on the outer outline, elsewhere in every call."""
    rng = np.random.default_rng(number)
    return peak(mesh, *mesh.p[:, rng.choice(mesh.boundary_nodes())], 10 ** rng.uniform(0, 4), rng.uniform(0.05, 0.5))


# --- given curves ---


class Wave:
    """y = 0.1 sin(6 x)."""

    def project(self, x):
        t = x[0].copy()
        for _ in range(30):
            y, slope, bend = 0.1 * np.sin(6 * t), 0.6 * np.cos(6 * t), -3.6 * np.sin(6 * t)
            t = t - (t - x[0] + (y - x[1]) * slope) / (1 + slope**2 + (y - x[1]) * bend)
        return np.stack([t, 0.1 * np.sin(6 * t)])


def ellipse_mesh(n=48):
    rows = [s * np.array([[2.0], [1.0]]) * circle(n, 0.01) for s in (0.5, 1.0)]
    return with_lines(shells(rows, 4), {"inner": closed(np.arange(n)), "outer": closed(np.arange(4 * n, 5 * n))})


def wavy():
    x = np.linspace(0, 1, 31)
    return strip(np.stack([x, 0.1 * np.sin(6 * x)]), 10)


def crooked():
    mesh = square(12).with_boundaries({"floor": lambda x: x[1] == 0.0})
    p = mesh.p.copy()
    p[1] += 2e-4 * (p[1] == 0) * np.sin(40 * p[0])
    return MeshTri(p, mesh.t, mesh.boundaries)


GIVEN = {
    "ellipses": (ellipse_mesh, lambda mesh: {"inner": Ellipse(1.0, 0.5), "outer": Ellipse(2.0, 1.0)}),
    "graph": (wavy, lambda mesh: {"curve": Wave()}),
    "line": (crooked, lambda mesh: {"floor": ka.Line((0.0, 0.0), (1.0, 0.0))}),
    "circle": (lambda: with_noise_and_names(ring(30, 4)), lambda mesh: {"outer": ka.Arc((0.0, 0.0), 1.0)}),
    "arc of few": (lambda: sector(4, 2), lambda mesh: {"outer": ka.Arc((0.0, 0.0), 1.0)}),
    "spline": (wavy, lambda mesh: {"curve": ka.Spline.through(mesh, "curve")}),
    "closed splines": (ellipse_mesh, lambda mesh: {name: ka.Spline.through(mesh, name) for name in ("inner", "outer")}),
}


def with_noise_and_names(mesh):
    return MeshTri(with_noise(mesh, 3e-4).p, mesh.t, mesh.boundaries)


@pytest.mark.slow
@TOPOLOGIES
@pytest.mark.parametrize("kind", GIVEN)
def test_after_any_number_of_calls_nodes_are_on_the_curve_that_was_given(kind, topology):
    build, curves_for = GIVEN[kind]
    mesh = build()
    curves, size, seen = curves_for(mesh), np.ptp(mesh.p), 0
    kind_of = outline_of(mesh, curves=curves).constraints.kind
    ends = {tuple(x) for x in mesh.p[:, kind_of == HELD].T}
    for number in range(6):
        mesh = ka.relocate(mesh, wanderer(mesh, number), topology=topology, seed=number, curves=curves)
        if number in (0, 2, 5):
            outline = outline_of(mesh, curves=curves)
            own, sliding = outline.constraints.own_chain, outline.constraints.kind == SLIDING
            assert list(outline.curves) == list(curves)
            for which, curve in enumerate(curves.values()):
                x = mesh.p[:, sliding & (own >= 0) & (outline.curve_index[own] == which)]
                seen += x.shape[1]
                assert np.abs(curve.project(x) - x).max(initial=0.0) < 1e-12 * size
            assert {tuple(x) for x in mesh.p[:, outline.constraints.kind == HELD].T} >= ends
    assert seen >= 6


class Answer:
    """A curve that answers what it is told to."""

    def __init__(self, answer):
        self.answer = answer

    def project(self, x):
        return self.answer(x)


# --- bad input ---


@pytest.mark.parametrize(
    ("curves", "text"),
    [
        (
            {"outer": Answer(lambda x: x[:, 1:])},
            r"project of the curve of boundary 'outer' must return finite points of shape \(2, 25\); "
            r"got shape \(2, 24\), 0 coordinates not finite\.",
        ),
        (
            {"outer": Answer(lambda x: np.where(x[0] > 0.5, np.nan, x))},
            r"must return finite points of shape \(2, 25\); got shape \(2, 25\), 20 coordinates not finite\.",
        ),
        (
            {"outer": ka.Arc((0, 0), 1.1)},
            r"the nodes of boundary 'outer' must lie on the curve given for it, within 0\.001 of its size, 2 "
            r"in units of the mesh; the one at \(.*, .*\) is 0\.1 away\.",
        ),
        (
            {"outer": Answer(lambda x: np.round(x, 3))},
            r"project of the curve of boundary 'outer' must tell its points apart; it has a corner\.",
        ),
    ],
)
def test_bad_curves_are_refused(curves, text):
    mesh = ring(24, 2)
    for use in (lambda: KohonenMap(mesh, curves=curves), lambda: ka.relocate(mesh, np.ones(96), curves=curves)):
        with pytest.raises(ValueError, match=text):
            use()


def test_two_curves_for_the_same_facets_are_refused():
    mesh = ring(24, 2)
    mesh = mesh.with_boundaries({"part": mesh.boundaries["outer"][:5]})
    curve = ka.Arc((0.0, 0.0), 1.0)
    with pytest.raises(ValueError, match="boundaries 'outer' and 'part' share facets, so they cannot both"):
        KohonenMap(mesh, curves={"outer": curve, "part": curve})


class RightAngle:
    """The axes x >= 0 and y >= 0."""

    def project(self, x):
        return np.where(x[0] >= x[1], [x[0], 0 * x[0]], [0 * x[1], x[1]])


def test_a_corner_of_a_given_curve_is_held_and_divides_it():
    mesh = square(8).with_boundaries({"angle": lambda x: (x[0] == 0) | (x[1] == 0)})
    outline = outline_of(mesh, curves={"angle": RightAngle()})
    assert outline.constraints.kind[np.all(mesh.p == 0, axis=0)] == HELD
    assert np.sum(outline.curve_index == 0) == 2
    for number in range(5):
        mesh = ka.relocate(mesh, peak(mesh, 0.2, 0.0), seed=number, curves={"angle": RightAngle()})
        assert np.sum(np.all(mesh.p == 0, axis=0)) == 1
        assert np.all(mesh.p[:, mesh.facets[:, mesh.boundaries["angle"]]].min(axis=0) == 0)
