"""Files of tetrahedra: volumes and surfaces as groups, both ways, and what no mesh can be made of."""

import logging

import meshio
import numpy as np
import pytest
import skfem
from helpers.mesh_files import (
    SUFFIXES,
    assert_same,
    drawings,
    drawn_by_gmsh,
    gmsh,
    gmsh_session,
    in_front,
    needs_gmsh,
    sizes,
    two_boxes,
)
from numpy.testing import assert_array_equal
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt import read_groups, read_mesh, write_mesh
from kohonen_adapt.mesh.measures import area, signed_area


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_reversed_elements_are_turned_on_both_ways(tmp_path, suffix):
    mesh, path = two_boxes(), tmp_path / f"mesh{suffix}"
    write_mesh(path, MeshTet(mesh.p, mesh.t[[0, 1, 3, 2]], mesh.boundaries, mesh.subdomains))
    file = meshio.read(path, "vtu" if suffix == ".vtu" else "gmsh")
    tetrahedra = file.cells_dict["tetra"]
    assert np.all(signed_area(MeshTet(file.points.T, tetrahedra.T)) > 0)
    assert len(np.unique(np.sort(tetrahedra, axis=1), axis=0)) == mesh.nelements  # MSH 2.2 lists some twice
    back = read_mesh(path)
    assert_array_equal(np.sort(back.t, axis=0), np.sort(mesh.t, axis=0))
    assert in_front(back, "wall") == in_front(mesh, "wall")
    meshio.Mesh(file.points, {"tetra": tetrahedra[:, [1, 0, 2, 3]]}).write(tmp_path / "reverse.vtu")
    assert np.all(signed_area(read_mesh(tmp_path / "reverse.vtu")) > 0)


def test_scikit_fem_reads_ours_and_we_what_it_saves(tmp_path):
    mesh = two_boxes()
    write_mesh(tmp_path / "ours.vtu", mesh)
    write_mesh(tmp_path / "ours.msh", mesh)
    mesh.save(tmp_path / "theirs.vtu")
    assert_same(skfem.Mesh.load(tmp_path / "ours.vtu"), mesh)
    back = read_mesh(tmp_path / "theirs.vtu")
    assert_same(back, mesh)
    assert in_front(back, "wall") == in_front(mesh, "wall")
    assert in_front(skfem.Mesh.load(tmp_path / "ours.msh"), "wall") == in_front(mesh, "wall")


BOXES = """
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1}; Box(2) = {1, 0, 0, 1, 1, 1}; Rectangle(101) = {0.25, 0.25, 0.5, 0.5, 0.5};
BooleanFragments{ Volume{1, 2}; Delete; }{ Surface{101}; Delete; }
left() = Volume In BoundingBox{-0.1, -0.1, -0.1, 1.1, 1.1, 1.1};
right() = Volume In BoundingBox{0.9, -0.1, -0.1, 2.1, 1.1, 1.1};
wall() = Surface In BoundingBox{0.9, -0.1, -0.1, 1.1, 1.1, 1.1};
sheet() = Surface In BoundingBox{0.2, 0.2, 0.4, 0.8, 0.8, 0.6};
floor() = Surface In BoundingBox{-0.1, -0.1, -0.1, 2.1, 1.1, 0.1};
origin() = Point In BoundingBox{-0.1, -0.1, -0.1, 0.1, 0.1, 0.1};
Mesh.MeshSizeMin = 0.5; Mesh.MeshSizeMax = 0.5;
"""

NAMED = """
Physical Volume("iron core", 7) = {left()}; Physical Volume(8) = {right()};
Physical Volume("all", 3) = {left(), right()};
Physical Surface("wall", 7) = {wall()}; Physical Surface("sheet", 5) = {-sheet(0)}; Physical Surface(9) = {floor()};
Physical Point("origin", 4) = {origin()};
"""


drawn = drawings(BOXES, dimension=3)


def test_groups_of_a_drawing(drawn, tmp_path):
    path = drawn(NAMED)
    mesh, groups = read_mesh(path), read_groups(path)
    volumes, surfaces = {"iron core": 1.0, "region_8": 1.0, "all": 2.0}, {"wall": 1.0, "sheet": 0.25, "boundary_9": 2.0}
    assert sizes(mesh) == [volumes, surfaces]
    assert np.all(signed_area(mesh) > 0) and mesh.is_valid()
    assert groups.names[3, 7] == "iron core" and groups.names[2, 7] == "wall" and groups.names[3, 8] == "region_8"
    assert groups.places["origin"].tolist() == mesh.p[:, groups.held(mesh)].tolist()
    write_mesh(tmp_path / "again.msh", mesh, groups=groups)
    again = read_groups(tmp_path / "again.msh")
    assert again.names == groups.names and again.version == groups.version
    assert_same(read_mesh(tmp_path / "again.msh"), mesh)


def test_the_direction_of_surfaces_is_kept(drawn, tmp_path):
    """A surface with a minus sign turns, and what we write has the directions of what we read."""
    up, down = (read_mesh(drawn(NAMED.replace("-sheet", sign + "sheet"))) for sign in ("", "-"))
    heights = [np.mean([place[5] for place in in_front(mesh, "sheet")]) for mesh in (up, down)]
    assert heights[0] < 0.5 < heights[1] or heights[1] < 0.5 < heights[0]
    write_mesh(tmp_path / "again.msh", down)
    assert in_front(read_mesh(tmp_path / "again.msh"), "sheet") == in_front(down, "sheet")


def test_groups_of_lines_are_left_out(drawn, caplog):
    mesh = read_mesh(drawn('Physical Volume("all", 1) = {left(), right()}; Physical Curve("rim", 2) = {1};'))
    assert sizes(mesh) == [{"all": 2.0}, {}]
    assert "are left out of a mesh of tetrahedra: ['rim']." in caplog.text


def test_what_is_drawn_and_no_mesh_of_tetrahedra_is_refused(drawn):
    with pytest.raises(ValueError, match=r"in the xy-plane; z runs from 0 to 1 in '.*'\. For a solid, mesh the volume"):
        read_mesh(drawn(NAMED, dimension=2))
    with pytest.raises(
        ValueError, match=r"tetrahedra of four nodes, or of ten; '.*' has some of another order.*-order 2"
    ):
        read_mesh(drawn(NAMED, order=3))
    with pytest.raises(ValueError, match=r"triangles that are faces of tetrahedra; \d+ of '.*' are not, one near \("):
        read_mesh(drawn('Physical Volume("a", 1) = {left()}; Physical Surface("b", 2) = {floor()};'))


def test_what_was_read_is_said(tmp_path, caplog):
    mesh = two_boxes(1)
    write_mesh(tmp_path / "mesh.msh", MeshTet(mesh.p, mesh.t, None, {"low": mesh.subdomains["low"]}))
    with caplog.at_level(logging.INFO):
        ka.read_mesh(tmp_path / "mesh.msh")
    assert "27 nodes, 48 tetrahedra, subdomains ['low'], boundaries []; 0 unused nodes dropped." in caplog.text
    assert "50 % of the volume of" in caplog.text and "is in no volume group: give it one." in caplog.text


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_straight_edges_of_second_order_are_read_as_their_ends(tmp_path, suffix):
    write_mesh(tmp_path / f"mesh{suffix}", skfem.MeshTet2.from_mesh(two_boxes(1)))
    assert type(read_mesh(tmp_path / f"mesh{suffix}")) is MeshTet


@needs_gmsh
def test_a_drawn_torus_of_second_order_keeps_its_volume(tmp_path):
    text = 'SetFactory("OpenCASCADE"); Torus(1) = {0, 0, 0, 1, 0.3}; Physical Volume("body") = {1};'
    options = [("Mesh.MeshSizeMax", 0.25)]
    mesh = read_mesh(drawn_by_gmsh(tmp_path / "torus.msh", text, dimension=3, order=2, options=options))
    assert type(mesh) is skfem.MeshTet2
    assert area(mesh).sum() == pytest.approx(2.0 * np.pi**2 * 0.09, rel=2e-3)
    write_mesh(tmp_path / "again.msh", mesh)
    with gmsh_session() as model:
        gmsh.open(str(tmp_path / "again.msh"))
        assert list(model.mesh.getElementTypes()) == [11]
        gmsh.write(str(tmp_path / "by_gmsh.msh"))
    assert_array_equal(read_mesh(tmp_path / "by_gmsh.msh").p, mesh.p)


def test_tetrahedra_that_disagree_on_an_edge_are_refused(tmp_path):
    mesh = skfem.MeshTet2.from_mesh(MeshTet())
    nodes = np.vstack([mesh.t, mesh.nvertices + mesh.t2e]).T
    nodes[0, [4, 5]] = nodes[0, [5, 4]]
    meshio.Mesh(mesh.p.T, [("tetra10", nodes)]).write(tmp_path / "mesh.vtu")
    with pytest.raises(ValueError, match="have different nodes inside one edge; write the mesh again"):
        read_mesh(tmp_path / "mesh.vtu")
