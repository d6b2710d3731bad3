"""Second-order files: meshes with bent sides in and out, and curves through the midside nodes."""

import logging

import meshio
import numpy as np
import pytest
from helpers.curved_meshes import RADII, annulus, curved_annulus, on_circles
from helpers.mesh_files import assert_same, gmsh, gmsh_session, needs_gmsh
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import Delaunay
from skfem import Basis, ElementTriP2, MeshTri, MeshTri2

from kohonen_adapt import Spline, read_curves, read_mesh, write_mesh
from kohonen_adapt.mesh.curved import corners_of

COUNT = 24


def renumbered(path):
    """A file of MSH 2.2 with gaps in the numbers of its nodes, which stand in the opposite order."""
    lines = [line.split() for line in path.read_text().split("\n")]
    first, last = lines.index(["$Nodes"]) + 2, lines.index(["$EndNodes"])
    lines[first:last] = [[str(3 * int(number)), *place] for number, *place in lines[last - 1 : first - 1 : -1]]
    first, last = lines.index(["$Elements"]) + 2, lines.index(["$EndElements"])
    lines[first:last] = [[*row[:5], *(str(3 * int(node)) for node in row[5:])] for row in lines[first:last]]
    path.write_text("\n".join(map(" ".join, lines)))
    return path


@pytest.fixture(params=[".msh", ".msh2"])
def curved_file(request, tmp_path):
    """A file of the annulus with its middles on the circles."""
    write_mesh(tmp_path / f"ring{request.param}", curved_annulus(COUNT))
    return tmp_path / f"ring{request.param}"


def around(radius, count=997):
    angle = np.linspace(0.0, 2.0 * np.pi, count)
    return radius * np.stack([np.cos(angle), np.sin(angle)])


def test_nodes_have_any_numbers_in_any_order(tmp_path):
    write_mesh(tmp_path / "ring.msh2", curved_annulus(COUNT))
    assert_same(read_mesh(renumbered(tmp_path / "ring.msh2")), curved_annulus(COUNT))


@pytest.mark.parametrize("scale", [1.0, 1e-3, 2.0**-20])
def test_the_curves_hold_the_mid_side_nodes_and_are_nearer_to_the_circles_than_chords(curved_file, scale, caplog):
    path, mesh = curved_file, annulus(COUNT)
    with caplog.at_level(logging.INFO):
        curves = read_curves(path, read_mesh(path, scale=scale), scale=scale)
    assert set(curves) == set(RADII)
    assert "'inner': <Spline of 1 piece through 48 points>" in caplog.text
    for name, radius in RADII.items():
        facets = mesh.boundaries[name]
        nodes = scale * np.hstack([mesh.p[:, np.unique(mesh.facets[:, facets])], on_circles(mesh, facets)])
        assert curves[name].closed == (True,) and curves[name].pieces[0].shape == nodes.shape
        assert np.abs(curves[name].project(nodes) - nodes).max() <= 1e-15 * 2 * radius * scale
        x = around(1.1 * radius)
        found = curves[name].project(scale * x) / scale, Spline.through(mesh, name).project(x)
        curved, chords = (np.abs(np.hypot(*each) - radius).max() for each in found)
        assert curved < chords / 12.0


def test_names_given_after_reading_have_their_curves(curved_file):
    """An arc of the rim, one inside, arcs and a spoke in one name, and a name without a facet."""
    read = read_mesh(curved_file).with_boundaries(
        {
            "right half": lambda x: (np.hypot(*x) > 1.4) & (x[0] > 0.0),
            "upper interface": lambda x: (np.abs(np.hypot(*x) - 1.0) < 0.02) & (x[1] > 0.0),
            "all": lambda x: (np.hypot(*x) > 1.45) | ((x[1] == 0.0) & (x[0] > 0.0)),
            "none": lambda x: x[0] > 9.0,
        },
        boundaries_only=False,
    )
    curves = read_curves(curved_file, read)
    assert set(curves) == {*RADII, "right half", "upper interface", "all"}
    assert curves["right half"].closed == curves["upper interface"].closed == (False,)
    assert curves["upper interface"].pieces[0].shape == (2, COUNT + 1)
    assert np.abs(np.hypot(*curves["upper interface"].project(around(0.97))) - 1.0).max() < 1e-5
    rim, spoke = sorted(curves["all"].pieces, key=lambda points: -points.shape[1])
    assert rim.shape == (2, 2 * COUNT + 1) and spoke.shape == (2, 5)
    assert_allclose(curves["all"].project([[0.8], [0.1]]), [[0.8], [0.0]], rtol=0, atol=1e-15)


def test_a_file_with_straight_sides_only_has_no_curves(tmp_path):
    path = tmp_path / "straight.msh"
    write_mesh(path, MeshTri2.from_mesh(annulus(COUNT)))
    assert read_curves(path, read_mesh(path)) == {}
    assert type(read_mesh(path)) is MeshTri


def test_corners_are_told_by_the_curves_and_not_by_their_chords(tmp_path):
    """Eight facets turn by 45 degrees each; the circle through their middles does not."""
    path = tmp_path / "coarse.msh"
    write_mesh(path, curved_annulus(8))
    assert read_curves(path, read_mesh(path))["outer"].closed == (True,)
    assert Spline.through(annulus(8), "outer").closed == (False,) * 8


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("ring.vtu", r"expected a file name that ends in \.msh, \.msh2; got 'ring\.vtu'"),
        (
            "first.msh",
            r"read_curves expected triangles of one order from 2 to 5, .*; '.*first\.msh' has none\. Mesh with "
            r"Mesh\.ElementOrder = 2, or use the nodes of the mesh: Spline\.through\(mesh, name\)",
        ),
    ],
)
def test_files_without_curves_are_refused(name, said, tmp_path):
    write_mesh(tmp_path / name, annulus(COUNT))
    with pytest.raises(ValueError, match=said):
        read_curves(tmp_path / name, annulus(COUNT))


def test_a_file_of_both_orders_is_refused(tmp_path, caplog):
    path = tmp_path / "both.msh2"
    write_mesh(path, curved_annulus(COUNT))
    lines = path.read_text().split("\n")
    first = lines.index("$Elements") + 2
    words = lines[first].split()
    assert words[1] == "9"
    lines[first] = " ".join([words[0], "2", *words[2:8]])
    path.write_text("\n".join(lines))
    assert read_mesh(path).t.shape == annulus(COUNT).t.shape
    assert "has triangles of several orders: all sides are read as straight" in caplog.text
    with pytest.raises(ValueError, match=r"expected triangles of one order from 2 to 5, .* has other elements, too"):
        read_curves(path, read_mesh(path))


def filled(mesh):
    """Another mesh of the corners, with triangles in the hole and names on their sides."""
    p = corners_of(mesh).p
    other = MeshTri(p, np.ascontiguousarray(Delaunay(p.T).simplices.T))
    return other.with_boundaries({"new": lambda x: np.hypot(*x) < 0.3}, boundaries_only=False)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda mesh: mesh.refined(1),
            r"returns, with 72 nodes; got one with \d+\. Read the curves before the mesh is",
        ),
        (lambda mesh: mesh.scaled(1e-3), r"returns at this scale; a node is off by 0\.499 times the size of the mesh"),
        (lambda mesh: mesh.translated((1e-9, 0.0)), r"returns at this scale; a node is off by 3\.33e-10 times"),
        (filled, r"returns; \d+ facets of its boundaries are not sides of triangles in the file\. Read the curves"),
        (lambda mesh: MeshTri(), "returns, with 72 nodes; got one with 4"),
        (lambda mesh: "mesh", r"mesh must be a skfem\.MeshTri or MeshTri2; got str"),
    ],
)
def test_another_mesh_is_refused(curved_file, change, message):
    with pytest.raises(ValueError, match=message):
        read_curves(curved_file, change(read_mesh(curved_file)))


def test_rounding_is_no_other_mesh(curved_file):
    read = corners_of(read_mesh(curved_file))
    noise = np.random.default_rng(0).uniform(-1e-14, 1e-14, read.p.shape)
    assert set(read_curves(curved_file, MeshTri(read.p + noise, read.t, read.boundaries))) == set(RADII)


def test_a_middle_that_is_not_finite_is_refused(tmp_path):
    mesh, path = annulus(COUNT), tmp_path / "ring.msh2"
    write_mesh(path, curved_annulus(COUNT))
    place = " ".join(map(repr, curved_annulus(COUNT).p[:, -1].tolist()))
    assert f" {place} 0" in path.read_text()
    path.write_text(path.read_text().replace(f" {place} 0", " nan 0 0", 1))
    said = r" expected finite coordinates; '.*ring\.msh2' has a midside node at \[ *nan"
    for name, read in (("read_mesh", read_mesh), ("read_curves", lambda path: read_curves(path, mesh))):
        with pytest.raises(ValueError, match=name + said):
            read(path)


def test_point_data_are_of_all_nodes_or_of_corners(tmp_path):
    mesh = curved_annulus(COUNT)
    solution = Basis(mesh, ElementTriP2()).project(lambda x: x[0] ** 2)
    write_mesh(tmp_path / "ring.vtu", mesh, point_data={"all": solution, "corners": mesh.p[0, : mesh.nvertices]})
    found = meshio.vtu.read(tmp_path / "ring.vtu")
    assert [block.type for block in found.cells] == ["triangle6"]
    assert_array_equal(found.point_data["all"], solution)
    assert_array_equal(found.point_data["corners"][mesh.nvertices :], mesh.p[0, mesh.facets].mean(axis=0))
    nodes = found.cells[0].data
    chords = found.points[nodes[:, [[0, 1], [1, 2], [2, 0]]]].mean(axis=2)
    assert np.linalg.norm(found.points[nodes[:, 3:]] - chords, axis=2).max() < 0.02  # no other side's


@needs_gmsh
@pytest.mark.parametrize("suffix", [".msh", ".msh2"])
def test_gmsh_reads_bent_sides_with_the_same_groups(tmp_path, suffix):
    mesh = curved_annulus(COUNT)
    write_mesh(tmp_path / f"ring{suffix}", mesh)
    with gmsh_session() as model:
        gmsh.open(str(tmp_path / f"ring{suffix}"))
        assert set(model.mesh.getElementTypes()) == {8, 9}
        names = {(dim, model.getPhysicalName(dim, tag)): tag for dim, tag in model.getPhysicalGroups()}
        assert names.keys() == {(1, name) for name in mesh.boundaries} | {(2, name) for name in mesh.subdomains}
        _, coordinates = model.mesh.getNodesForPhysicalGroup(1, names[1, "outer"])
        assert_allclose(np.hypot(*coordinates.reshape(-1, 3)[:, :2].T), RADII["outer"], rtol=1e-15)
        assert len(coordinates) == 3 * 2 * COUNT
        gmsh.write(str(tmp_path / "again.msh"))
    again = read_mesh(tmp_path / "again.msh")
    assert type(again) is MeshTri2
    assert_allclose(np.sort(again.p[:, again.nvertices :]), np.sort(mesh.p[:, mesh.nvertices :]), atol=1e-15)
