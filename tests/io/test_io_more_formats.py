"""Sets, surfaces and integers of cells that stand for groups, and the ways from and to other formats."""

import logging

import meshio
import numpy as np
import pytest
from helpers.mesh_files import assert_same, gmsh, gmsh_session, needs_gmsh, two_boxes, two_rooms
from helpers.small_files import BY_HAND, SQUARE
from numpy.testing import assert_array_equal
from skfem import MeshTet, MeshTri

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


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("mfem.mesh", "1 2 0 1 2", "1 2 0 1 9", "a mesh of MFEM; .* an element has a node that does not exist"),
        ("mfem.mesh", "vertices", "nodes", "save the mesh without curved sides and refinement"),
        ("mfem.mesh", "1 2 0 1 2", "1 3 0 1 2 3", "quadrilateral"),
        ("freefem.msh", "4 2 2", "4 2 3", "a mesh of FreeFEM; .* announces 32 numbers and has 29"),
        ("freefem.msh", "1 2 7", "1 9 7", "an element has a node that does not exist"),
        ("ucd.inp", "1 3 4", "1 3 9", "cannot be read"),
    ],
)
def test_their_damage(tmp_path, name, old, new, said):
    (tmp_path / name).write_text(BY_HAND[name].replace(old, new, 1))
    with pytest.raises(ValueError, match=said) as refused:
        ka.read_mesh(tmp_path / name)
    assert "\n" not in str(refused.value)


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


@needs_gmsh
def test_what_gmsh_saves_without_groups_or_in_its_first_format(tmp_path):
    with gmsh_session() as model:
        occ = model.occ
        occ.addBox(0, 0, 0, 1, 1, 1)
        occ.synchronize()
        model.addPhysicalGroup(2, [1], name="side")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        model.mesh.generate(3)
        gmsh.write(str(tmp_path / "surface.msh"))
        gmsh.option.setNumber("Mesh.MshFileVersion", 1.0)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        gmsh.write(str(tmp_path / "first.msh"))
        gmsh.write(str(tmp_path / "all.med"))
    with gmsh_session() as model:
        gmsh.open(str(tmp_path / "first.msh"))
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(tmp_path / "new.msh"))
    with pytest.raises(ValueError, match="a Gmsh file") as refused:
        ka.read_mesh(tmp_path / "first.msh")
    assert str(refused.value).endswith("It is MSH 1: gmsh 'first.msh' -save -format msh41 -o NEW.msh")
    wanted = ka.read_mesh(tmp_path / "new.msh")
    assert isinstance(wanted, MeshTet)
    pytest.importorskip("h5py")
    mesh = ka.read_mesh(tmp_path / "all.med")
    assert mesh.nelements == wanted.nelements and set(mesh.boundaries) == {"side"} and mesh.subdomains is None


@needs_gmsh
def test_a_solid_of_which_gmsh_saved_a_surface_needs_a_group_for_its_volume(tmp_path):
    for name, group in (("surface.msh", ()), ("solid.msh", [1])):
        with gmsh_session() as model:
            model.occ.addSphere(0, 0, 0, 1)
            model.occ.synchronize()
            model.addPhysicalGroup(2, [1], name="skin")
            if group:
                model.addPhysicalGroup(3, group, name="ball")
            model.mesh.generate(3)
            gmsh.write(str(tmp_path / name))
    with pytest.raises(ValueError, match="give the volume a physical group, too"):
        ka.read_mesh(tmp_path / "surface.msh")
    assert set(ka.read_mesh(tmp_path / "solid.msh").boundaries) == {"skin"}


@needs_gmsh
@pytest.mark.parametrize("suffix", [".med", ".inp", ".mesh", ".su2", ".vtk"])
def test_a_refusal_to_write_names_the_way_to_the_format(tmp_path, suffix):
    if suffix == ".med":
        pytest.importorskip("h5py")
    mesh = two_rooms()
    with pytest.raises(ValueError, match=rf"Write 'm\.msh' and convert it: gmsh 'm\.msh' -save -o 'm\{suffix}'"):
        ka.write_mesh(tmp_path / f"m{suffix}", mesh)
    ka.write_mesh(tmp_path / "m.msh", mesh)
    with gmsh_session():
        gmsh.open(str(tmp_path / "m.msh"))
        gmsh.write(str(tmp_path / f"m{suffix}"))
    back = ka.read_mesh(tmp_path / f"m{suffix}")
    assert back.nelements == mesh.nelements and back.boundaries


def test_a_refusal_to_write_xdmf_names_meshio(tmp_path):
    pytest.importorskip("h5py")
    mesh = MeshTri().refined(2).with_boundaries({"left": lambda x: x[0] == 0.0})
    with pytest.raises(ValueError, match=r"Write 'm\.vtu' and convert it: meshio convert 'm\.vtu' 'm\.xdmf'"):
        ka.write_mesh(tmp_path / "m.xdmf", mesh)
    ka.write_mesh(tmp_path / "m.vtu", mesh)
    meshio.vtu.read(tmp_path / "m.vtu").write(tmp_path / "m.xdmf")
    assert_same(ka.read_mesh(tmp_path / "m.xdmf"), ka.read_mesh(tmp_path / "m.vtu"))
