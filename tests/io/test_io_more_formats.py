"""Sets, surfaces and integers of cells that stand for groups, and the ways from and to other formats."""

import logging

import meshio
import numpy as np
import pytest
from helpers.mesh_files import drawn_by_gmsh, needs_gmsh, two_boxes
from helpers.small_files import BY_HAND, SQUARE
from numpy.testing import assert_array_equal
from skfem import MeshTet

import kohonen_adapt as ka


def ends(mesh, name):
    """Pairs of ends of the facets of a boundary, in units of half the square."""
    return {
        frozenset(map(tuple, (2 * mesh.p[:, facet]).T.astype(int).tolist()))
        for facet in mesh.facets[:, mesh.boundaries[name]].T
    }


BOTTOM, RIGHT, TOP, LEFT = (
    frozenset(each) for each in (((0, 0), (2, 0)), ((2, 0), (2, 2)), ((2, 2), (0, 2)), ((0, 2), (0, 0)))
)
DIAGONAL = {frozenset({(0, 0), (1, 1)}), frozenset({(2, 2), (1, 1)})}  # between iron and air


@pytest.mark.parametrize(
    ("text", "sides"),
    [
        ("*NSET, NSET=a\n1, 4\n", {LEFT}),
        ("*NSET, NSET=a, GENERATE\n1, 3, 1\n", {BOTTOM, RIGHT}),
        ("*Nset, nset=a\n1, 2, 3,\n4\n", {BOTTOM, RIGHT, TOP, LEFT}),
        ("*NSET, NSET=a\n1, 3, 5\n", DIAGONAL),
        ("*SURFACE, NAME=a\n12, S1\n", {RIGHT}),
        ("** a comment\n*SURFACE, TYPE=ELEMENT, NAME=a\n11, S1\n** another\n22, S1\n", {BOTTOM, LEFT}),
        ("*Surface, name=a, type=element\nIron, s1\n", {BOTTOM, RIGHT}),
        ("*ELSET, ELSET=ends\n12, 22\n*SURFACE, NAME=a\nends, S1\n", {RIGHT, LEFT}),
        ("*SURFACE, NAME=a\n22, E2\n", {frozenset({(0, 0), (1, 1)})}),
    ],
)
def test_node_sets_and_surfaces_of_abaqus_are_boundaries(tmp_path, caplog, text, sides):
    (tmp_path / "m.inp").write_text(SQUARE + text)
    mesh = ka.read_mesh(tmp_path / "m.inp")
    assert ends(mesh, "a") == sides and not caplog.records
    assert {"iron", "air"} <= mesh.subdomains.keys()


def test_sets_that_are_no_sides_are_left_out_in_one_warning(tmp_path, caplog):
    more = "*NSET, NSET=all\n1, 2, 3, 4, 5\n*NSET, NSET=load\n5\n"
    more += "*SURFACE, NAME=skin\niron, SPOS\n*NSET, NSET=fixed\n1, 4\n"
    (tmp_path / "m.inp").write_text(SQUARE + more)
    mesh = ka.read_mesh(tmp_path / "m.inp")
    assert set(mesh.boundaries) == {"fixed"}
    (said,) = [record.getMessage() for record in caplog.records]
    assert "the sets 'all', 'load', 'skin' of" in said and "are left out" in said


def test_sides_of_tetrahedra(tmp_path):
    """S1 to S4 of a corner of the unit cube, as CalculiX numbers them."""
    nodes = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4, ELSET=body\n7, 1, 2, 3, 4\n"
    surfaces = "".join(f"*SURFACE, NAME=f{k}\n7, S{k}\n" for k in range(1, 5))
    (tmp_path / "m.inp").write_text(f"{nodes}{surfaces}*NSET, NSET=flat\n1, 2, 3\n")
    mesh = ka.read_mesh(tmp_path / "m.inp")
    assert isinstance(mesh, MeshTet)
    faces = {name: set(mesh.facets[:, rows].ravel().tolist()) for name, rows in mesh.boundaries.items()}
    assert faces == {"f1": {0, 1, 2}, "f2": {0, 1, 3}, "f3": {1, 2, 3}, "f4": {0, 2, 3}, "flat": {0, 1, 2}}


def vtk(folder, suffix, **arrays):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    cells = [("triangle", np.array([[0, 1, 2], [0, 2, 3]])), ("line", np.array([[0, 1], [1, 2]]))]
    data = {name: [np.array(values[:2]), np.array(values[2:])] for name, values in arrays.items()}
    meshio.Mesh(points, cells, cell_data=data).write(folder / f"m{suffix}")
    return ka.read_mesh(folder / f"m{suffix}")


@pytest.mark.parametrize("suffix", [".vtk", ".vtu"])
@pytest.mark.parametrize("name", ["mat_id", "material", "region", "anything"])
def test_integers_of_cells_of_any_name_are_groups(tmp_path, caplog, suffix, name):
    mesh = vtk(tmp_path, suffix, **{name: [3, 7, 3, 0]}, height=[0.1, 0.2, 0.3, 0.4])
    assert {each: rows.tolist() for each, rows in mesh.subdomains.items()} == {"region_3": [0], "region_7": [1]}
    assert set(mesh.boundaries) == {"boundary_3"} and not caplog.records


def test_zero_is_a_region_beside_others(tmp_path):
    assert set(vtk(tmp_path, ".vtu", material=[0, 1, 0, 0]).subdomains) == {"region_0", "region_1"}
    assert vtk(tmp_path, ".vtu", material=[0, 0, 0, 0]).subdomains is None


def test_integers_that_are_left_out_are_reported_in_one_warning(tmp_path, caplog):
    mesh = vtk(tmp_path, ".vtu", material=[1, 2, 5, 5], owner=[8, 8, 9, 9], cell=[11, 12, 13, 14])
    assert set(mesh.subdomains) == {"region_1", "region_2"}
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "the integers 'owner' of the cells of" in caplog.text and "'material' is read as groups" in caplog.text
    caplog.clear()
    assert vtk(tmp_path, ".vtu", rank=[1, 2, 5, 5], owner=[8, 8, 9, 9]).subdomains is None
    assert "'owner', 'rank'" in caplog.text and "because several may be groups" in caplog.text


@pytest.mark.parametrize("name", BY_HAND)
def test_formats_of_other_programs(tmp_path, name):
    (tmp_path / name).write_text(BY_HAND[name])
    mesh = ka.read_mesh(tmp_path / name)
    assert_array_equal(mesh.p, [[0, 1, 1, 0], [0, 0, 1, 1]])
    assert {each: rows.tolist() for each, rows in mesh.subdomains.items()} == {"region_1": [0], "region_4": [1]}
    assert {each: ends(mesh, each) for each in mesh.boundaries} == {"boundary_7": {BOTTOM}, "boundary_8": {RIGHT}}


def test_netgen(tmp_path):
    mesh = two_boxes()
    cells = [("tetra", mesh.t.T), ("triangle", mesh.facets[:, mesh.facets_satisfying(lambda x: x[2] == 0.0)].T)]
    numbers = [1 + np.isin(np.arange(mesh.nelements), np.arange(20)), np.full(len(cells[1][1]), 3)]
    meshio.netgen.write(
        tmp_path / "m.vol",
        meshio.Mesh(mesh.p.T, cells, cell_data={"netgen:index": numbers}, field_data={"core": [2, 3], "floor": [3, 2]}),
    )
    back = ka.read_mesh(tmp_path / "m.vol")
    assert back.nelements == mesh.nelements and len(back.subdomains["core"]) == 20
    assert len(back.boundaries["floor"]) == len(cells[1][1])


BOX = """SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 1}; Mesh.MeshSizeMax = 0.5;
Physical Surface("side") = {1:6};
"""


@needs_gmsh
def test_a_solid_of_which_gmsh_saved_a_surface_needs_a_group_for_its_volume(tmp_path):
    surface, solid = (
        drawn_by_gmsh(tmp_path / f"{name}.msh", BOX + more, dimension=3)
        for name, more in (("surface", ""), ("solid", 'Physical Volume("box") = {1};'))
    )
    with pytest.raises(ValueError, match="give the volume a physical group, too"):
        ka.read_mesh(surface)
    assert set(ka.read_mesh(solid).boundaries) == {"side"}


@needs_gmsh
def test_what_gmsh_saves_without_groups_or_in_its_first_format(tmp_path):
    versions = {"first.msh": 1.0, "new.msh": 4.1, "all.med": 4.1}
    first, new, med = (
        drawn_by_gmsh(tmp_path / name, BOX, version, dimension=3, options=[("Mesh.SaveAll", 1)])
        for name, version in versions.items()
    )
    with pytest.raises(ValueError, match=r"a Gmsh file.*It is MSH 1: gmsh 'first.msh' -save -format msh41 -o NEW.msh$"):
        ka.read_mesh(first)
    wanted = ka.read_mesh(new)
    assert isinstance(wanted, MeshTet)
    pytest.importorskip("h5py")
    mesh = ka.read_mesh(med)
    assert mesh.nelements == wanted.nelements and set(mesh.boundaries) == {"side"} and mesh.subdomains is None
