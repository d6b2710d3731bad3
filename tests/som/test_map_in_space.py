"""The map of a mesh of tetrahedra: what it learns, and what it keeps."""

import numpy as np
import pytest
from helpers.solids import box, volumes
from numpy.testing import assert_array_equal
from scipy.spatial import cKDTree
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Schedule, Stage
from kohonen_adapt.kernels.tetrahedron.entries import SPACE
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.som.training_points import ElementDensity, FunctionDensity

NOTHING = 1e-300  # a learning rate that moves no node


def one(radius, rate, neighbourhood="flat"):
    return Schedule((Stage(radius, 1, rate, neighbourhood=neighbourhood),))


def points_of(mesh, number, seed):
    """Random points in random elements, many of them in a few."""
    rng = np.random.default_rng(seed)
    weight = rng.random(mesh.t.shape[1]) ** 6
    element = rng.choice(mesh.t.shape[1], number, p=weight / weight.sum())
    return np.einsum("ke,dke->de", rng.dirichlet(np.ones(4), number).T, mesh.p[:, mesh.t[:, element]])


def extent(mesh):
    """Total area of every boundary and total volume of every subdomain."""
    a, b, c = mesh.p[:, mesh.facets].transpose(1, 2, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    found = {name: area[np.asarray(rows)].sum() for name, rows in (mesh.boundaries or {}).items()}
    whole = {name: np.abs(volumes(mesh))[rows].sum() for name, rows in (mesh.subdomains or {}).items()}
    return {**found, **whole, "skin": area[mesh.boundary_facets()].sum(), "all": np.abs(volumes(mesh)).sum()}


@pytest.mark.parametrize("high", [(1, -1, 1), (-1, 1, -1)])
def test_corners_at_the_foot_of_a_column_do_not_fold_the_mesh_over(high):
    """The face that a node leaves behind there must not end under the shelf that the column stands on."""
    mesh = MeshTet.init_tensor(*[np.linspace(0, 2, 5)] * 3)
    x = (mesh.p[:, mesh.t].mean(axis=1) - 1.0) * np.array(high)[:, None]
    mesh = mesh.restrict(np.flatnonzero((x[2] < 0) | ((x[0] < 0) & (x[1] < 0))))
    schedule = Schedule((Stage(1, 3, (1.0, 0.3)),))
    for seed in range(4):
        density = 10 ** (3 * np.random.default_rng(seed).random(mesh.t.shape[1]))
        found = ka.relocate(mesh, density, topology="fixed", min_quality=0.0, schedule=schedule, seed=seed)
        assert np.any(found.p != mesh.p) and extent(found) == pytest.approx(extent(mesh), rel=1e-12)


def test_the_error_is_the_mean_distance_to_the_nearest_nodes_and_falls():
    mesh, points = box(5), np.random.default_rng(0).random((3, 400)) ** 2
    mean = cKDTree(mesh.p.T).query(points.T)[0].mean()
    som = KohonenMap(mesh, topology="fixed")
    assert som.train(points, Schedule((Stage(0, 2, NOTHING),))) == pytest.approx([mean] * 2, rel=1e-13)
    assert_array_equal(som.mesh.p, mesh.p)
    for topology in ("fixed", "flip"):
        som = KohonenMap(mesh, topology=topology, min_quality=0.1)
        errors = som.train(points, Schedule.paper())
        assert len(errors) == 18
        assert errors[-1] < 0.9 * mean
        assert cKDTree(som.mesh.p.T).query(points.T)[0].mean() < 0.9 * mean


def test_without_a_guard_elements_overlap():
    mesh, points = box(4), 0.3 + 0.1 * np.random.default_rng(4).random((3, 60))
    som = KohonenMap(mesh, topology="fixed", min_quality=None)
    som.train(points, Schedule((Stage(2, 3, 0.9, neighbourhood="flat"),)))
    assert np.any(np.sign(volumes(som.mesh)) != np.sign(volumes(mesh)))


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


def test_points_of_a_density_come_in_proportion_and_along_the_curve():
    mesh = Tetrahedralization.of(box(3))
    values = np.random.default_rng(0).uniform(0.0, 3.0, len(mesh.elements.node))
    number = 60_000
    shown = ElementDensity(mesh, values).draw(number, np.random.default_rng(1))
    wanted = number * values / values.sum()
    assert np.abs(np.bincount(shown.element, minlength=len(values)) - wanted).max() <= 2
    steps = np.linalg.norm(np.diff(shown.points[::200], axis=0), axis=1)
    assert steps.mean() < 0.3  # 0.66 between random points of a cube
    drawn = FunctionDensity(mesh, lambda x: x[0] ** 2).draw(number, np.random.default_rng(1)).points
    assert drawn[:, 0].mean() == pytest.approx(0.75, abs=0.01)
    assert drawn[:, 1:].mean() == pytest.approx(0.5, abs=0.01)
    with pytest.raises(ValueError, match="zero everywhere"):
        FunctionDensity(mesh, lambda x: 0.0 * x[0])


def test_loops_are_compiled_for_the_types_of_the_table():
    KohonenMap(box(2)).train(points_of(box(2), 10, 0), one(1, 0.1))
    mesh = Tetrahedralization.of(box(2))
    ElementDensity(mesh, np.ones(len(mesh.elements.node))).draw(10, np.random.default_rng(0))
    for entry in SPACE["space map"]:
        assert entry.loop.signatures == [entry.types], entry.name
