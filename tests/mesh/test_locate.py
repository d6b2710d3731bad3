"""Elements that hold points, and values of a solution there, in the plane and in space."""

import numpy as np
import pytest
from helpers import meshes, tetrahedra
from helpers.meshes import generic_square, perturbed, square
from helpers.solids import box
from helpers.tetrahedra import fichera, generic_cube, hollow, thrown, turned
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt.mesh.locate import elements_at, walk_to_elements
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation


def beside(mesh):
    """The mesh twice, far from one another."""
    return type(mesh)(np.hstack([mesh.p, mesh.p + 5]), np.hstack([mesh.t, mesh.t + mesh.p.shape[1]]))


def thin(mesh):
    return type(mesh)(np.geomspace(1e-6, 1e3, len(mesh.p))[:, None] * mesh.p, mesh.t)


def graded(n, power=8.0):
    """A cube whose cells grow from one corner, the largest many thousand times as long as the least."""
    ticks = np.linspace(0.0, 1.0, n + 1) ** power
    return MeshTet.init_tensor(ticks, ticks, ticks)


PLANE = {
    "square": square(7),
    "bad": perturbed(square(7), 1),
    "delaunay": generic_square(8),
    "comb": perturbed(meshes.comb(10), 2),
    "hole": perturbed(meshes.holed(9), 3),
    "inset": meshes.inset(8),
    "slit": perturbed(meshes.slit(8), 4),
    "thin": thin(square(6)),
    "apart": beside(square(2)),
}
SPACE = {
    "cube": box(4),
    "five": MeshTet().refined(1),
    "bad solid": thrown(box(5), 1),
    "delaunay solid": thrown(generic_cube(4), 2, worst=1e-4),
    "solid comb": thrown(tetrahedra.comb(5), 3),
    "hollow": thrown(hollow(6), 4),
    "fichera": turned(fichera(2), 0),
    "solid slit": thrown(tetrahedra.slit(4), 5),
    "graded": graded(5),
    "thin solid": thin(box(4)),
    "solids apart": beside(box(2)),
    "far": thrown(box(4), 6).translated((1e6, -1e6, 1e6)),
}
MESHES = PLANE | SPACE


def shares(mesh, x):
    """Barycentric coordinates of every point in every element, (dim + 1, elements, points)."""
    corners = mesh.p[:, mesh.t].transpose(2, 1, 0)
    matrix = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    others = np.einsum("eij,enj->ien", matrix, x.T[None] - corners[:, 0][:, None])
    return np.concatenate([1 - others.sum(axis=0, keepdims=True), others])


def points_around(mesh, number=400):
    """Half of them in the box around the mesh and beyond, half close to its nodes."""
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    rng = np.random.default_rng(0)
    anywhere = (low + (high - low) * rng.uniform(-0.1, 1.1, (number // 2, len(low)))).T
    near = rng.integers(mesh.t.shape[1], size=number // 2)
    corners = len(mesh.t)
    spread = 2.0 * rng.dirichlet(np.ones(corners), number // 2).T - 1.0 / corners
    return np.hstack([anywhere, np.einsum("dkn,kn->dn", mesh.p[:, mesh.t[:, near]], spread)])


@pytest.mark.parametrize("name", MESHES)
def test_points_are_found_in_the_element_that_holds_them_with_their_value_and_nowhere_else(name):
    mesh = MESHES[name]
    x = np.hstack([points_around(mesh), mesh.p, mesh.p[:, mesh.t if name == "far" else mesh.facets].mean(axis=1)])
    depth = shares(mesh, x).min(axis=0)
    clear = np.abs(depth.max(axis=0)) > 1e-8
    clear[400:] = True  # nodes and middles are in the mesh
    assert clear[:400].sum() > 390
    for search in (ka.find_elements, elements_at):
        found = search(mesh, x)
        assert_array_equal(found[clear] >= 0, depth.max(axis=0)[clear] > -1e-8)
        inside = np.flatnonzero(found >= 0)
        assert depth[found[inside], inside].min() > -1e-9
        assert 50 < np.sum(inside < 400) < 390
    linear = lambda x: 2.0 + [-3.0, 0.5, 1.0][: len(x)] @ ((x - mesh.p[:, :1]) / np.ptp(mesh.p, axis=1)[:, None])  # noqa: E731
    values = ka.interpolate(mesh, linear(mesh.p), x)
    assert_array_equal(np.isnan(values), ka.find_elements(mesh, x) < 0)
    assert_allclose(values[~np.isnan(values)], linear(x)[~np.isnan(values)], atol=1e-8)


def tessellated(mesh):
    return (Triangulation if len(mesh.p) == 2 else Tetrahedralization).of(mesh)


@pytest.mark.parametrize("name", ["square", "inset", "slit", "hole", "cube", "solid comb", "solid slit", "hollow"])
@pytest.mark.parametrize("across_regions", [False, True])
def test_a_walk_from_any_element_ends_where_a_search_does(name, across_regions):
    mesh = MESHES[name]
    low = mesh.p[-1, mesh.t].mean(axis=0) < 0.45
    tessellation = tessellated(mesh.with_subdomains({"low": np.flatnonzero(low)}))
    points, region = tessellation.centroids(), tessellation.elements.region
    assert region.max() > 0
    rng = np.random.default_rng(0)
    start = rng.permutation(len(points)).astype(np.int32)
    if not across_regions:
        start = np.array([rng.choice(np.flatnonzero(region == own)) for own in region], dtype=np.int32)
    found = walk_to_elements(tessellation, points, start, across_regions)
    assert_array_equal(found, np.arange(len(points)))


@pytest.mark.parametrize(
    ("mesh", "values", "x", "message"),
    [
        (square(4), np.ones(32), np.zeros((2, 1)), r"values must have shape \(nodes,\) = \(25,\); got \(32,\)\."),
        (square(4), 1j * np.ones(25), np.zeros((2, 1)), r"values must be real numbers; got complex128\..*"),
        (square(4), np.ones(25), np.zeros(2), r"x must have shape \(2, n\); got \(2,\)\."),
        (box(3), np.ones(64), np.zeros((2, 5)), r"x must have shape \(3, n\); got \(2, 5\)\."),
    ],
)
def test_shapes_for_interpolation(mesh, values, x, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        ka.interpolate(mesh, values, x)
