"""What holds for every relocation of tetrahedra, on random bodies with random names, surfaces and options."""

import numpy as np
import pytest
from helpers.descents import descent_of
from helpers.examples import examples
from helpers.movers import movers_with
from helpers.parted import Load
from helpers.random_solids import flat_solids, round_solids
from helpers.solids import volumes
from hypothesis import given
from numpy.testing import assert_allclose
from skfem import Basis, ElementTetP2
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.polishing.polish import descend_and_recycle
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional


def exchanged(mesh, density, options):
    """By energy at order 2, of a random function."""
    rng, basis = np.random.default_rng(options["seed"]), Basis(mesh, ElementTetP2())
    fixed = np.isin(np.arange(basis.N), basis.get_dofs()) & (rng.random() < 0.5)
    values = np.where(fixed, 0.0, rng.normal(size=basis.N))
    solid = MovableSolid.of(mesh, Rules(options["topology"], options["min_quality"], options["pinned"]))
    plan = (2, 2) if options["topology"] == "recycle" else (2,)
    ritz = ka.Ritz(values, fixed, 1.0, source=1.0, order=2)
    assert descend_and_recycle(descent_of(solid, SolidFunctional.of(ritz, solid, mesh)), plan)[1] >= 0.0
    return solid.mesh()


MOVERS = movers_with(Load(), np.diag([4.0, 1.0, 0.5])) | {"order 2": exchanged}


@pytest.mark.parametrize("mover", MOVERS)
@examples(30)
@given(flat_solids())
def test_volume_outline_names_orientation_and_quality_are_kept(mover, case):
    mesh, density, options = case
    result = moved(mover, mesh, density, options)
    size = rounding(mesh) * np.ptp(mesh.p, axis=1).max() ** 2
    old, new = Tetrahedralization.of(mesh), Tetrahedralization.of(result)
    by_region = [np.sort(np.bincount(tet.elements.region[tet.used], tet.volumes())) for tet in (old, new)]
    assert_allclose(*by_region, rtol=1e-12, atol=size)
    for name, rows in (mesh.subdomains or {}).items():
        assert abs(volume_of(result, result.subdomains[name]) - volume_of(mesh, rows)) <= 1e-12 * volume_of(mesh) + size
    for name, rows in (mesh.boundaries or {}).items():
        faces_are_kept(mesh, result, rows, result.boundaries[name])
        if isinstance(rows, OrientedBoundary):
            atol = 1e-12 * max(1.0, np.abs(mesh.p).max()) ** 3
            assert_allclose(normals(result, result.boundaries[name]), normals(mesh, rows), atol=atol)
    faces_are_kept(mesh, result, mesh.boundary_facets(), result.boundary_facets())


@examples(12)
@given(round_solids())
def test_faces_stay_on_round_surfaces(case):
    mesh, surface, density, options = case
    result = moved("relocate", mesh, density, options)
    rows = result.boundaries["side"]
    x = result.p[:, np.unique(result.facets[:, rows])]
    assert np.abs(surface.project(x) - x).max() < 1e-12
    assert np.array_equal(np.union1d(rows, result.boundaries["a"]), result.boundary_facets())
    if len(mesh.boundaries["a"]):
        faces_are_flat = np.ptp(result.p[2][result.facets[:, result.boundaries["a"]]], axis=0)
        assert np.all(faces_are_flat == 0.0)
    assert abs(volume_of(result) - volume_of(mesh)) < 0.2 * volume_of(mesh)


def moved(mover, mesh, density, options):
    """The mesh with its nodes moved; and what holds on surfaces of any shape."""
    given_arrays = mesh.p.tobytes(), mesh.t.tobytes(), density.tobytes()
    result = MOVERS[mover](mesh, density, options)
    assert (mesh.p.tobytes(), mesh.t.tobytes(), density.tobytes()) == given_arrays
    assert result.p.shape == mesh.p.shape or mover == "order 2"
    euclidean = 0.02 if mover in ("metric", "adapt") else 0.2  # in a metric the quality is measured there
    floor = euclidean if options["min_quality"] == "auto" else options["min_quality"]
    assert ka.quality(result).min() >= min(floor, ka.quality(mesh).min()) * (1 - 1e-9)
    assert Tetrahedralization.of(result).volumes().min() > 0.0
    for kind in ("subdomains", "boundaries"):
        before, after = getattr(mesh, kind), getattr(result, kind)
        assert (after is None) == (before is None) and list(after or {}) == list(before or {})
        assert all(type(after[name]) is type(rows) for name, rows in (before or {}).items())
    if options["topology"] == "fixed":
        assert np.array_equal(result.t, mesh.t)
    pinned = [entry for entry in options["pinned"] if entry != "a"]
    if "a" in options["pinned"]:
        pinned += np.unique(mesh.facets[:, np.asarray(mesh.boundaries["a"])]).tolist()
    if options["topology"] == "recycle":  # which gives them other numbers
        assert set(map(tuple, mesh.p[:, pinned].T.tolist())) <= set(map(tuple, result.p.T.tolist()))
    else:
        assert np.array_equal(result.p[:, pinned], mesh.p[:, pinned])
    return result


def rounding(mesh):
    """How far a node may be from where it should be: some last digits of the largest coordinate."""
    return 200 * np.finfo(float).eps * np.abs(mesh.p).max()


def volume_of(mesh, rows=slice(None)):
    return np.abs(volumes(mesh))[rows].sum()


def corners_of(mesh, rows):
    """Corners of facets, (3, n, 3)."""
    return mesh.p[:, mesh.facets[:, np.asarray(rows)]].transpose(1, 2, 0)


def area_of(mesh, rows):
    a, b, c = corners_of(mesh, rows)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def faces_are_kept(mesh, result, rows, kept):
    """The facets kept have the total area of the given ones, and each lies on these."""
    area, number = area_of(mesh, rows), len(np.asarray(kept)) + len(np.asarray(rows))
    most = rounding(mesh)
    assert abs(area_of(result, kept) - area) <= 1e-12 * area + number * most * np.ptp(mesh.p, axis=1).max()
    a, b, c = corners_of(mesh, rows).astype(np.longdouble)  # for needles
    u, v = b - a, c - a
    uu, uv, vv = (np.sum(one * other, axis=1) for one, other in ((u, u), (u, v), (v, v)))
    points = np.unique(np.vstack([*(corners := corners_of(result, kept)), corners.mean(axis=0)]), axis=0)
    for x in points:
        xu, xv = (np.sum((x - a) * way, axis=1) for way in (u, v))
        random_points = np.array([vv * xu - uv * xv, uu * xv - uv * xu]) / (uu * vv - uv * uv)
        random_points = np.clip(np.vstack([1.0 - random_points.sum(axis=0), random_points]), 0.0, None)
        random_points /= random_points.sum(axis=0)
        off = x - (random_points[0, :, None] * a + random_points[1, :, None] * b + random_points[2, :, None] * c)
        assert np.sqrt(np.sum(off**2, axis=1)).min() < 10.0 * most


def normals(mesh, rows):
    """Sums over facets of their normal out of the side they name, plain and weighted with place."""
    a, b, c = corners_of(mesh, rows)
    middle = (a + b + c) / 3.0
    normal = 0.5 * np.cross(b - a, c - a)
    inside = mesh.p[:, mesh.t[:, mesh.f2t[rows.ori, np.asarray(rows)]]].mean(axis=1).T
    normal *= np.sign(np.sum(normal * (middle - inside), axis=1))[:, None]
    return np.concatenate([normal.sum(axis=0), (normal[:, :, None] * middle[:, None, :]).sum(axis=0).ravel()])
