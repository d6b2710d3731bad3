"""What holds for every result of every mover, on random meshes with random names, densities and options."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.meshes import area_of, areas_of, length_of, square, without_flat_elements
from helpers.movers import movers_with
from helpers.random_solids import cut
from helpers.scalar_problems import Scalar
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import Delaunay
from skfem import MeshTri
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt import Schedule, Stage
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.recycling import recycle_nodes
from kohonen_adapt.som.training_points import density_of

SCHEDULES = [
    None,
    Schedule(()),
    Schedule((), sweeps=4),
    Schedule.paper((1, 2, 1)),
    Schedule((Stage(2, 2, 1.0, neighbourhood="flat"), Stage(0, 2, (1.0, 0.3))), sweeps=2),
]


@st.composite
def cases(draw):
    """A mesh of any shape, and how it is to be relocated."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    coarse = draw(st.sampled_from([cells, scattered]))(rng)
    if draw(st.booleans()):
        coarse = cut(coarse, rng)
    mesh = named_at_random(coarse, rng) if draw(st.booleans()) else coarse.refined(1)
    density = 10 ** (rng.random(mesh.t.shape[1]) * draw(st.sampled_from([0, 1, 3, 6])))
    pinned = rng.integers(0, mesh.p.shape[1], draw(st.integers(0, 3))).tolist()
    if mesh.boundaries and draw(st.booleans()):
        pinned.append("a")
    options = {
        "topology": draw(st.sampled_from(["fixed", "flip", "recycle"])),
        "min_quality": draw(st.sampled_from([0.0, 0.1, 0.3, 0.6])),
        "schedule": draw(st.sampled_from(SCHEDULES)),
        "pinned": pinned,
        "seed": draw(st.integers(0, 1000)),
    }
    return mesh, density, options


def cells(rng):
    """Some cells of a grid, turned, sheared and cut in halves: holes, pinches and parts that hang together nowhere."""
    mesh = square(5)
    gone = np.flatnonzero(np.repeat(rng.random(25) < rng.uniform(0, 0.4), 2))
    quads = np.floor(5 * mesh.p[:, mesh.t].mean(axis=1)).T @ [5, 1]
    mesh = mesh.remove_elements(np.flatnonzero(np.isin(quads, gone // 2)))
    turn = rng.uniform(0, 2 * np.pi)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    stretch = np.array([[1, rng.uniform(-0.5, 0.5)], [0, rng.uniform(0.3, 3)]])
    matrix = rotation @ stretch if rng.random() < 0.5 else np.eye(2)
    return MeshTri(matrix @ mesh.p, mesh.t)


def scattered(rng):
    """A part of a triangulation of random points, slivers included: the outline turns at every node."""
    p = rng.random((2, rng.integers(6, 30)))
    mesh = without_flat_elements(p, Delaunay(p.T).simplices.T)
    worth = (ka.quality(mesh) > 1e-3) & (rng.random(mesh.t.shape[1]) < rng.uniform(0.5, 1.2))
    worth[np.argmax(ka.quality(mesh))] = True
    return mesh.remove_elements(np.flatnonzero(~worth))


def named_at_random(coarse, rng):
    """The mesh refined once, with overlapping subdomains and boundaries of whole facets of the coarse one."""
    groups = {name: np.flatnonzero(rng.random(coarse.t.shape[1]) < share) for name, share in (("a", 0.5), ("b", 0.3))}
    if rng.random() < 0.5:
        groups["empty"] = np.array([], dtype=np.int64)
    del groups["a"]
    mesh = coarse.with_subdomains(groups).refined(1)
    return mesh.with_boundaries({name: facets_at_random(coarse, mesh, rng) for name in ("a", "c", "sided")})


def facets_at_random(coarse, mesh, rng):
    """The halves of some facets of the coarse mesh, each with a side or all without."""
    chosen = np.flatnonzero(rng.random(coarse.facets.shape[1]) < rng.uniform(0, 0.5))
    middle = coarse.p.shape[1] + chosen
    rows = np.flatnonzero(np.isin(mesh.facets, middle).any(axis=0) & (mesh.facets.min(axis=0) < coarse.p.shape[1]))
    if rng.random() < 0.5:
        return rows
    return OrientedBoundary(rows, np.where(mesh.f2t[1, rows] >= 0, rng.integers(0, 2, len(rows)), 0))


MOVERS = movers_with(Scalar(source=1.0), [[2.0, 0.5], [0.5, 0.7]])


@pytest.mark.parametrize("mover", MOVERS)
@examples(80)
@given(cases())
def test_area_outline_names_orientation_and_quality_are_kept(mover, case):
    mesh, density, options = case
    before = ka.quality(mesh).min()
    given_arrays = copied(mesh, density)
    result = MOVERS[mover](mesh, density, options)

    assert copied(mesh, density) == given_arrays
    ours, given = ((m.p, m.t, *named_rows(m)) for m in (result, mesh))
    assert not any(np.shares_memory(*pair) for pair in zip(ours, given, strict=True))
    assert result.p.shape == mesh.p.shape
    assert ka.quality(result).min() >= min(options["min_quality"], before) * (1 - 1e-9)
    old, new = Triangulation.of(mesh), Triangulation.of(result)
    assert areas_of(new).min() > 0
    areas_of_regions = [np.sort(np.bincount(each.elements.region, areas_of(each))) for each in (old, new)]
    assert_allclose(*areas_of_regions, rtol=1e-12, atol=rounding(mesh) * size_of(mesh))
    if options["topology"] == "fixed":
        assert np.array_equal(old.elements.region, new.elements.region)
    names_are_kept(mesh, result)
    outline_is_kept(mesh, result, mesh.boundary_facets(), result.boundary_facets())
    if options["topology"] == "fixed":
        assert np.array_equal(result.t, mesh.t)
    pinned = [entry for entry in options["pinned"] if entry != "a"]
    if "a" in options["pinned"]:
        pinned += np.unique(mesh.facets[:, np.asarray(mesh.boundaries["a"])]).tolist()
    if options["topology"] == "recycle":  # which gives them other numbers
        assert set(map(tuple, mesh.p[:, pinned].T.tolist())) <= set(map(tuple, result.p.T.tolist()))
    else:
        assert np.array_equal(result.p[:, pinned], mesh.p[:, pinned])


def named_rows(mesh):
    return [np.asarray(rows) for sets in (mesh.subdomains, mesh.boundaries) for _, rows in sorted((sets or {}).items())]


def copied(mesh, density):
    """The bytes of all arrays that are given."""
    return [array.tobytes() for array in (mesh.p, mesh.t, density, *named_rows(mesh))]


@pytest.mark.parametrize("mover", ["relocate", "polish"])
@examples(30)
@given(cases(), st.sampled_from([-20, -3, 20]))
def test_a_mesh_scaled_by_a_power_of_two_gives_the_scaled_mesh_exactly_and_a_seed_the_same_bits(mover, case, k):
    mesh, density, options = case
    plain, again, scaled = (MOVERS[mover](m, density, options) for m in (mesh, mesh, mesh.scaled(2.0**k)))
    assert (plain.p.tobytes(), plain.t.tobytes()) == (again.p.tobytes(), again.t.tobytes())
    assert_array_equal(scaled.p, plain.p * 2.0**k)
    assert_array_equal(scaled.t, plain.t)


@examples(90)
@given(cases(), st.integers(1, 80))
def test_growth_keeps_every_node_and_all_that_lines_and_regions_are(case, more):
    mesh, density, options = case
    before = ka.quality(mesh).min()
    rules = ka.Rules(options["topology"], options["min_quality"], options["pinned"]).guarded()
    movable = MovableMesh.of(mesh, rules)
    wanted = density_of(movable.triangulation, density).at_nodes()
    done = recycle_nodes(movable, wanted, mesh.nvertices + more, pairs=False)

    result = movable.mesh()
    movable.restore(movable.state())  # which refuses numbers of what is not there
    assert done.collapses == 0 and done.splits == result.nvertices - mesh.nvertices <= more
    assert np.array_equal(result.p[:, : mesh.nvertices], mesh.p)
    assert areas_of(Triangulation.of(result)).min() > 0
    assert ka.quality(result).min() >= min(options["min_quality"], before) * (1 - 1e-9)
    names_are_kept(mesh, result)
    outline_is_kept(mesh, result, mesh.boundary_facets(), result.boundary_facets())


def names_are_kept(mesh, result):
    """Same names, same areas, same lines, same sides."""
    assert (result.subdomains is None) == (mesh.subdomains is None)
    assert (result.boundaries is None) == (mesh.boundaries is None)
    assert list(result.subdomains or {}) == list(mesh.subdomains or {})
    assert set(result.boundaries or {}) == set(mesh.boundaries or {})
    for name, rows in (mesh.subdomains or {}).items():
        assert abs(area_of(result, result.subdomains[name]) - area_of(mesh, rows)) <= 1e-12 * area_of(mesh)
    for name, rows in (mesh.boundaries or {}).items():
        kept = result.boundaries[name]
        outline_is_kept(mesh, result, rows, kept)
        assert isinstance(kept, OrientedBoundary) == isinstance(rows, OrientedBoundary)
        if isinstance(rows, OrientedBoundary):
            atol = 1e-12 * max(1.0, size_of(mesh)) ** 2
            assert_allclose(weighted_normal(result, kept), weighted_normal(mesh, rows), atol=atol)


def size_of(mesh):
    """The largest coordinate, too: it is what is rounded."""
    return np.abs(mesh.p).max()


def rounding(mesh):
    """How far a node may be from where it should be: some last digits of the largest coordinate."""
    return 200 * np.finfo(float).eps * size_of(mesh)


def outline_is_kept(mesh, result, rows, kept):
    """The facets kept have the total length of the given ones, and each lies on one of them."""
    length, number = length_of(mesh, rows), len(np.asarray(kept)) + len(np.asarray(rows))
    assert abs(length_of(result, kept) - length) <= 1e-12 * length + number * rounding(mesh)
    a, b = mesh.p[:, mesh.facets[:, np.asarray(rows)]].transpose(1, 2, 0)
    off = result.p[:, result.facets[:, np.asarray(kept)]].reshape(2, -1).T[:, None] - a
    along = np.clip(np.sum(off * (b - a), axis=2) / np.sum((b - a) ** 2, axis=1), 0, 1)
    far = np.linalg.norm(off - along[..., None] * (b - a), axis=2)
    assert np.all(far.min(axis=1, initial=np.inf) < rounding(mesh))


def weighted_normal(mesh, rows):
    """Sums over facets of their normal out of the side they name, plain and weighted with place: (6,)."""
    a, b = mesh.p[:, mesh.facets[:, np.asarray(rows)]].transpose(1, 0, 2)
    element = mesh.f2t[rows.ori, np.asarray(rows)]
    normal = np.array([b[1] - a[1], a[0] - b[0]])
    away = 0.5 * (a + b) - mesh.p[:, mesh.t[:, element]].mean(axis=1)
    normal *= np.sign(np.sum(normal * away, axis=0))
    return np.concatenate(
        [normal.sum(axis=1), (normal * 0.5 * (a[0] + b[0])).sum(axis=1), (normal * (a + b)[1]).sum(axis=1)]
    )
