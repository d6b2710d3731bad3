"""A metric as an array, a function or a file, in relocation and in the map."""

import meshio
import numpy as np
import pytest
from helpers.mesh_files import two_rooms
from helpers.meshes import square
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree
from skfem import MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli

LESSONS = ka.Schedule((ka.Stage(2, 3, 0.3), ka.Stage(0, 3, (0.3, 0.05))))
LONG = np.diag([1.0, 36.0])  # edges six times as long along x as along y


def everywhere(mesh, tensor):
    return np.tile(tensor, (mesh.nelements, 1, 1))


def stretch(mesh):
    """Mean extent of edges along x over the extent along y, 1.15 for equilateral triangles."""
    along, across = np.abs(mesh.p[:, mesh.facets[0]] - mesh.p[:, mesh.facets[1]]).mean(axis=1)
    return along / across


def mapped(mesh, tensor):
    """The mesh in coordinates in which the tensor is the identity."""
    return MeshTri(np.linalg.cholesky(tensor).T @ mesh.p, mesh.t)


@pytest.mark.parametrize("form", ["array", "function", "sizes"])
def test_edges_are_long_where_the_metric_has_them_long(form):
    mesh = square(24)
    metric = {
        "array": everywhere(mesh, LONG),
        "function": lambda x: np.tile(LONG, (x.shape[1], 1, 1)),
        "sizes": ka.density_from_sizes(mesh, everywhere(mesh, 1e6 * LONG)),
    }
    moved = ka.relocate(mesh, metric[form], topology="recycle")
    assert moved.nvertices == mesh.nvertices
    assert stretch(moved) > 4.0 * stretch(mesh)
    assert np.mean(ka.quality(mapped(moved, LONG))) > 1.5 * np.mean(ka.quality(mapped(mesh, LONG)))


def test_new_layers_have_the_tensors_of_the_elements_that_they_split():
    mesh = MeshTri.init_tensor(np.linspace(0, 1, 9), [0.0, 0.4, 0.5, 1.0])
    mesh = mesh.with_subdomains({"gap": lambda x: (x[1] > 0.4) & (x[1] < 0.5)})
    moved = ka.relocate(mesh, everywhere(mesh, LONG), layers={"gap": 2}, topology="recycle")
    inside = [np.sum((each.p[1] > 0.401) & (each.p[1] < 0.499)) for each in (mesh, moved)]
    assert moved.nvertices == mesh.nvertices and inside[0] == 0 < inside[1]
    assert stretch(moved) > 1.4 * stretch(mesh)


def write_metric(folder, mesh, tensor):
    """The mesh with names for Gmsh, and a metric as a solution of Mmg, with its mesh beside it."""
    ka.write_mesh(folder / "named.msh", mesh)
    meshio.Mesh(mesh.p.T, [("triangle", mesh.t.T)]).write(folder / "m.mesh")
    row = f"{tensor[0, 0]} {tensor[0, 1]} {tensor[1, 1]}\n"
    head = f"MeshVersionFormatted 2\nDimension 2\nSolAtVertices\n{mesh.nvertices}\n1 3\n"
    (folder / "m.sol").write_text(f"{head}{row * mesh.nvertices}End\n")


@pytest.mark.parametrize("option", ["--sizes", "--density"])
def test_a_solution_of_mmg_moves_the_nodes_of_a_mesh_with_names(tmp_path, option):
    mesh = two_rooms().refined(2)
    write_metric(tmp_path, mesh, LONG[::-1, ::-1])
    words = ["relocate", "named.msh", option, "m.sol", "--topology", "recycle", "-o", "better.msh"]
    assert cli.main([str(tmp_path / word) if "." in word else word for word in words] + ["--quiet"]) == 0
    better = ka.read_mesh(tmp_path / "better.msh")
    assert better.nvertices == mesh.nvertices
    assert set(better.subdomains) == set(mesh.subdomains) and set(better.boundaries) == set(mesh.boundaries)
    assert stretch(better) < 0.3 * stretch(mesh)


@pytest.mark.parametrize("topology", ["flip", "fixed"])
@pytest.mark.parametrize("mesh", [square(8), MeshTet().refined(2)], ids=["plane", "space"])
def test_a_round_metric_is_none_in_the_map(mesh, topology):
    dim = len(mesh.p)
    points = np.random.default_rng(0).random((dim, 500)) ** 2
    maps = (
        ka.KohonenMap(mesh, topology=topology),
        ka.KohonenMap(mesh, topology=topology, metric=everywhere(mesh, np.eye(dim))),
    )
    errors = [som.train(points, LESSONS) for som in maps]
    assert errors[0] == errors[1]
    assert_array_equal(maps[0].mesh.p, maps[1].mesh.p)


@pytest.mark.parametrize(
    "mesh",
    [pytest.param(square(12), id="plane"), pytest.param(MeshTet().refined(2), id="space", marks=pytest.mark.slow)],
)
def test_the_map_learns_in_the_metric_as_in_coordinates_in_which_it_is_round(mesh):
    """Medians of quality and distance agree, which the Euclidean map in these coordinates does not reach."""
    dim, kind, measured = len(mesh.p), type(mesh), []
    scale = np.diag([4.0, 1.0, 1.0][:dim])
    long, metric = kind(scale @ mesh.p, mesh.t), everywhere(mesh, np.linalg.inv(scale) ** 2)
    for seed in range(5):
        points = np.random.default_rng(seed).random((dim, 600)) ** 2
        for each, own, there in ((mesh, None, np.eye(dim)), (long, metric, scale), (long, None, scale)):
            som = ka.KohonenMap(each, metric=own)
            som.train(there @ points, LESSONS, seed=seed)
            back = kind(np.linalg.inv(there) @ som.mesh.p, som.mesh.t)
            measured.append((ka.quality(back).mean(), cKDTree(back.p.T).query(points.T)[0].mean()))
    in_round, in_metric, euclidean = np.median(np.reshape(measured, (5, 3, 2)), axis=0)
    assert_allclose(in_metric, in_round, rtol=0.1)
    assert euclidean[0] < 0.85 * in_round[0]
