"""Tetrahedra that hold points, and values of a solution there."""

import inspect

import numpy as np
import pytest
from helpers.solids import box
from helpers.tetrahedra import comb, fichera, generic_cube, hollow, slit, thrown, turned
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.mesh.locate import TESSELLATIONS, Locator, walk_to_elements
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization


def graded(n, power=8.0):
    """A cube whose cells grow from one corner, the largest many thousand times as long as the least."""
    ticks = np.linspace(0.0, 1.0, n + 1) ** power
    return MeshTet.init_tensor(ticks, ticks, ticks)


BUILDS = {
    "cube": lambda: box(4),
    "five": lambda: MeshTet().refined(1),
    "bad": lambda: thrown(box(5), 1),
    "delaunay": lambda: thrown(generic_cube(4), 2, worst=1e-4),
    "comb": lambda: thrown(comb(5), 3),
    "hole": lambda: thrown(hollow(6), 4),
    "fichera": lambda: turned(fichera(2), 0),
    "slit": lambda: thrown(slit(4), 5),
    "graded": lambda: graded(5),
    "thin": lambda: MeshTet(np.array([[1e-6], [1.0], [1e3]]) * box(4).p, box(4).t),
    "apart": lambda: MeshTet(np.hstack([box(2).p, box(2).p + 5]), np.hstack([box(2).t, box(2).t + 27])),
    "far": lambda: thrown(box(4), 6).translated((1e6, -1e6, 1e6)),
}


def shares(mesh, x):
    """Barycentric coordinates of every point in every element, (4, elements, points)."""
    corners = mesh.p[:, mesh.t].transpose(2, 1, 0)
    matrix = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    three = np.einsum("eij,enj->ien", matrix, x.T[None] - corners[:, 0][:, None])
    return np.concatenate([1 - three.sum(axis=0, keepdims=True), three])


def points_around(mesh, number=400, seed=0):
    """Half of them in the box around the mesh and beyond, half close to its nodes."""
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    rng = np.random.default_rng(seed)
    anywhere = (low + (high - low) * rng.uniform(-0.1, 1.1, (number // 2, 3))).T
    near = rng.integers(mesh.t.shape[1], size=number // 2)
    spread = 2.0 * rng.dirichlet(np.ones(4), number // 2).T - 0.25
    return np.hstack([anywhere, np.einsum("dkn,kn->dn", mesh.p[:, mesh.t[:, near]], spread)])


@pytest.mark.parametrize("kind", BUILDS)
def test_points_are_found_in_the_element_that_holds_them_and_nowhere_else(kind):
    mesh = BUILDS[kind]()
    x = points_around(mesh)
    depth = shares(mesh, x).min(axis=0)
    found = ka.find_elements(mesh, x)
    clear = np.abs(depth.max(axis=0)) > 1e-8
    assert clear.sum() > 390
    np.testing.assert_array_equal(found[clear] >= 0, depth.max(axis=0)[clear] > 0)
    inside = np.flatnonzero(found >= 0)
    assert depth[found[inside], inside].min() > -1e-9
    assert 50 < len(inside) < 390


@pytest.mark.parametrize("kind", BUILDS)
def test_nodes_and_middles_of_edges_and_faces_lie_in_the_mesh(kind):
    mesh = BUILDS[kind]()
    x = np.hstack([mesh.p, mesh.p[:, mesh.edges].mean(axis=1), mesh.p[:, mesh.facets].mean(axis=1)])
    if kind == "far":  # where coordinates have six digits less, middles on the outline may be outside by these
        x = np.hstack([mesh.p, mesh.p[:, mesh.t].mean(axis=1)])
    found = ka.find_elements(mesh, x)
    assert found.min() >= 0
    assert np.min(shares(mesh, x).min(axis=0)[found, np.arange(len(found))]) > -1e-9


@pytest.mark.parametrize("kind", BUILDS)
def test_linear_functions_are_reproduced_and_outside_there_is_nan(kind):
    mesh = BUILDS[kind]()
    x = points_around(mesh)
    size = np.ptp(mesh.p, axis=1)[:, None]
    linear = lambda x: 2.0 + np.array([-3.0, 0.5, 1.0]) @ ((x - mesh.p[:, :1]) / size)  # noqa: E731
    values = ka.interpolate(mesh, linear(mesh.p), x)
    np.testing.assert_array_equal(np.isnan(values), ka.find_elements(mesh, x) < 0)
    inside = ~np.isnan(values)
    np.testing.assert_allclose(values[inside], linear(x[:, inside]), atol=1e-8)


def test_values_are_those_of_barycentric_coordinates():
    mesh = generic_cube(4, 3)
    values = np.random.default_rng(0).random(mesh.p.shape[1])
    x = np.random.default_rng(1).random((3, 500))
    element = ka.find_elements(mesh, x)
    by_hand = np.sum(shares(mesh, x)[:, element, np.arange(500)] * values[mesh.t[:, element]], axis=0)
    np.testing.assert_allclose(ka.interpolate(mesh, values, x), by_hand, rtol=1e-9)


def test_nodal_values_come_back_at_the_nodes():
    for build in BUILDS.values():
        mesh = build()
        values = np.random.default_rng(0).random(mesh.p.shape[1])
        single = np.unique(mesh.p, axis=1, return_counts=True, return_inverse=True)
        alone = single[2][single[1].ravel()] == 1  # both banks of a slit are the same place
        np.testing.assert_allclose(ka.interpolate(mesh, values, mesh.p)[alone], values[alone], rtol=1e-9, atol=1e-9)


def test_points_at_infinity_and_without_a_place_are_outside():
    bad = [[np.nan, 0.5, 0.5], [0.5, np.inf, 0.5], [0.5, 0.5, -np.inf], [1e300, 0.5, -1e300], [np.nan] * 3]
    x = np.array([*bad, [0.5, 0.4, 0.3]]).T
    found = ka.find_elements(box(3), x)
    assert found[:5].tolist() == [-1] * 5 and found[5] >= 0
    assert np.isnan(ka.interpolate(box(3), np.ones(64), x)).tolist() == [True] * 5 + [False]


@pytest.mark.parametrize("exponent", [-60, -30, 30, 60])
def test_location_does_not_depend_on_the_size_of_the_mesh(exponent):
    mesh = thrown(fichera(2), 1)
    x = points_around(mesh)
    scaled = MeshTet(mesh.p * 2.0**exponent, mesh.t)
    np.testing.assert_array_equal(ka.find_elements(scaled, x * 2.0**exponent), ka.find_elements(mesh, x))


def test_the_order_and_number_of_points_do_not_matter():
    """Points are sorted, shared out to threads and searched in parts; each finds what it finds alone."""
    mesh = thrown(box(5), 2)
    x = np.random.default_rng(0).uniform(-0.05, 1.05, (3, 20_000))
    found = ka.find_elements(mesh, x)
    back = np.random.default_rng(1).permutation(x.shape[1])
    np.testing.assert_array_equal(ka.find_elements(mesh, x[:, back]), found[back])
    np.testing.assert_array_equal(ka.find_elements(mesh, x[:, :50]), found[:50])
    assert ka.find_elements(mesh, np.empty((3, 0))).shape == (0,)


@pytest.mark.parametrize("kind", ["cube", "comb", "slit", "hole"])
@pytest.mark.parametrize("across_regions", [False, True])
def test_a_walk_from_any_element_ends_where_a_search_does(kind, across_regions):
    mesh = BUILDS[kind]()
    tet, rng = Tetrahedralization.of(mesh.with_subdomains({"low": lambda x: x[2] < 0.45})), np.random.default_rng(0)
    points, region = tet.centroids(), tet.elements.region
    assert region.max() > 0
    start = rng.permutation(len(points)).astype(np.int32)
    if not across_regions:
        start = np.array([rng.choice(np.flatnonzero(region == own)) for own in region], dtype=np.int32)
    np.testing.assert_array_equal(walk_to_elements(tet, points, start, across_regions), np.arange(len(points)))


def test_what_no_element_holds_is_said_to_be_in_one_nearby():
    tet = Tetrahedralization.of(box(8))
    found = walk_to_elements(
        tet, np.array([[1.0 + 1e-6, 0.53, 0.32]]), np.array([0], dtype=np.int32), across_regions=False
    )
    assert tet.centroids()[found[0]] == pytest.approx([1.0, 0.53, 0.32], abs=0.15)


def test_rows_that_are_not_in_use_hold_no_point():
    """Loops that take elements away leave rows between those in use."""
    tet, x = Tetrahedralization.of(thrown(box(3), 0)), np.random.default_rng(0).random((500, 3))
    found = Locator(tet).find(x)
    count = len(tet.elements.node)
    row = np.random.default_rng(1).permutation(2 * count)[:count].astype(np.int32)
    node, neighbour, region, patch = (np.full((2 * count, *each.shape[1:]), -1, np.int32) for each in tet.elements)
    node[row], region[row] = tet.elements.node, tet.elements.region
    neighbour[row] = np.where(tet.elements.neighbour < 0, -1, row[tet.elements.neighbour])
    tet.set_arrays(tet.position, tet.elements._replace(node=node, neighbour=neighbour, region=region, patch=patch))
    np.testing.assert_array_equal(Locator(tet).find(x), row[found])


MESH = box(3)
REFUSED = [
    (np.ones(162), np.zeros((3, 1)), r"values must have shape \(nodes,\) = \(64,\); got \(162,\)\."),
    (1j * np.ones(64), np.zeros((3, 1)), r"values must be real numbers; got complex128\..*"),
    (np.ones(64), np.zeros((2, 5)), r"x must have shape \(3, n\); got \(2, 5\)\."),
    (np.ones(64), np.zeros(3), r"x must have shape \(3, n\); got \(3,\)\."),
]


@pytest.mark.parametrize(("values", "x", "message"), REFUSED)
def test_shapes_for_interpolation(values, x, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        ka.interpolate(MESH, values, x)


@pytest.mark.parametrize("name", ["walk_each", "count_in_cells", "fill_cells", "find", "barycentric"])
def test_kernels_of_both_kinds_take_the_same_arguments(name):
    loops = [getattr(kind.locating, name) for kind in TESSELLATIONS.values()]
    assert len({str(inspect.signature(interpreted(loop))) for loop in loops}) == 1 < len(loops)
