"""Reading and writing meshes: every trap of Gmsh files, names to the letter, coordinates to the bit."""

import logging
from contextlib import contextmanager
from pathlib import Path

import meshio
import numpy as np
import pytest
import skfem
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from skfem import MeshTri, MeshTri2

from kohonen_adapt.io import read_mesh, write_mesh
from kohonen_adapt.quality import area

try:
    import gmsh
except (ImportError, OSError) as error:  # the wheel needs system libraries
    gmsh = None
    WHY_NOT = f"gmsh cannot be imported: {error}"
else:
    WHY_NOT = ""

needs_gmsh = pytest.mark.skipif(gmsh is None, reason=WHY_NOT)
SUFFIXES = [".msh", ".msh2", ".vtu"]


@contextmanager
def gmsh_session():
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        yield gmsh.model
    finally:
        gmsh.finalize()


def two_rooms():
    """Two squares side by side with an interface, a group over both, a part without a name."""
    mesh = MeshTri.init_tensor(np.linspace(0, 2, 9), np.linspace(0, 1, 5) / 3)
    mesh = mesh.with_subdomains(
        {
            "left": lambda x: x[0] < 1,
            "right side": lambda x: x[0] > 1,
            "low": lambda x: (x[1] < 0.15) & (x[0] < 1.5),
        }
    )
    return mesh.with_boundaries(
        {
            "outer": lambda x: (x[0] == 0) | (x[0] == 2),
            "floor": lambda x: x[1] == 0,
            "wall and floor": lambda x: (x[1] == 0) | (x[0] == 0),
            "interface": lambda x: x[0] == 1,
        },
        boundaries_only=False,
    )


def assert_same(mesh, other):
    assert type(mesh) is MeshTri
    assert_array_equal(mesh.p, other.p)
    assert_array_equal(mesh.t, other.t)
    for got, wanted in ((mesh.subdomains, other.subdomains), (mesh.boundaries, other.boundaries)):
        assert (got is None) == (wanted is None)
        assert set(got or ()) == set(wanted or ())
        for name in wanted or ():
            assert_array_equal(got[name], np.sort(np.asarray(wanted[name])))


# ------------------------------------------------------------------------------------------------- round trips


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_keeps_everything(tmp_path, suffix):
    mesh = two_rooms()
    write_mesh(tmp_path / f"mesh{suffix}", mesh)
    back = read_mesh(tmp_path / f"mesh{suffix}")
    assert_same(back, mesh)
    assert area(back)[back.subdomains["low"]].sum() == area(mesh)[mesh.subdomains["low"]].sum()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_without_names(tmp_path, suffix):
    mesh = MeshTri().refined(2)
    write_mesh(tmp_path / f"mesh{suffix}", mesh)
    assert_same(read_mesh(tmp_path / f"mesh{suffix}"), mesh)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_of_one_triangle(tmp_path, suffix):
    mesh = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]]))
    write_mesh(tmp_path / f"mesh{suffix}", mesh.with_subdomains({"all": np.array([0])}))
    assert_same(read_mesh(tmp_path / f"mesh{suffix}"), mesh.with_subdomains({"all": np.array([0])}))


NAMES = st.dictionaries(
    st.text(min_size=1, max_size=20).filter(
        lambda name: name.isprintable() and '"' not in name and name[:5] != "gmsh:"
    ),
    st.sets(st.integers(0, 31)),
    max_size=6,
)


@settings(max_examples=40, deadline=None)
@given(subdomains=NAMES, boundaries=NAMES, seed=st.integers(0, 2**32 - 1), suffix=st.sampled_from(SUFFIXES))
def test_any_names_on_any_sets_come_back(tmp_path_factory, subdomains, boundaries, seed, suffix):
    mesh = MeshTri().refined(2)
    # Digits to the last: spread over magnitudes, and off the round numbers of a grid.
    shift = np.random.default_rng(seed).uniform(-0.05, 0.05, mesh.p.shape)
    mesh = MeshTri(
        (mesh.p + shift) * 10.0 ** (seed % 13 - 6),
        mesh.t,
        {name: np.array(sorted(items), dtype=np.int32) for name, items in boundaries.items()} or None,
        {name: np.array(sorted(items), dtype=np.int32) for name, items in subdomains.items()} or None,
    )
    path = tmp_path_factory.mktemp("names") / f"mesh{suffix}"
    write_mesh(path, mesh)
    assert_same(read_mesh(path), mesh)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_more_names_than_an_integer_has_bits(tmp_path, suffix):
    mesh = MeshTri().refined(3)
    mesh = mesh.with_subdomains({f"name {k}": np.arange(k, 128) for k in range(80)})
    write_mesh(tmp_path / f"mesh{suffix}", mesh)
    assert_same(read_mesh(tmp_path / f"mesh{suffix}"), mesh)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_writing_leaves_the_mesh_and_the_data_alone(tmp_path, suffix):
    mesh, values = two_rooms(), np.linspace(0.0, 1.0, 64)
    before = {name: np.array(items) for name, items in mesh.subdomains.items()}
    data = {"field": values}
    write_mesh(tmp_path / f"mesh{suffix}", mesh, cell_data=data)
    assert_same(mesh, two_rooms())
    assert before.keys() == mesh.subdomains.keys() and data.keys() == {"field"}
    assert_array_equal(values, np.linspace(0.0, 1.0, 64))


def test_scale(tmp_path):
    mesh = two_rooms()
    write_mesh(tmp_path / "mesh.msh", mesh)
    assert_array_equal(read_mesh(tmp_path / "mesh.msh", scale=1e-3).p, 1e-3 * mesh.p)


def test_sets_of_gmsh_itself_are_not_written(tmp_path):
    mesh = MeshTri().with_subdomains({"gmsh:bounding_entities": np.array([0]), "all": np.array([0, 1])})
    write_mesh(tmp_path / "mesh.msh", mesh)
    assert set(read_mesh(tmp_path / "mesh.msh").subdomains) == {"all"}


def test_an_empty_set_keeps_its_name_and_is_reported(tmp_path, caplog):
    mesh = MeshTri().with_subdomains({"none": np.array([], dtype=np.int32), "all": np.array([0, 1])})
    write_mesh(tmp_path / "mesh.msh", mesh)
    assert "subdomain 'none' is empty: Gmsh will not show it." in caplog.messages
    assert len(read_mesh(tmp_path / "mesh.msh").subdomains["none"]) == 0
    assert "group 'none' has no triangle in the mesh." in caplog.messages


@pytest.mark.parametrize("suffix", [".msh", ".vtu"])
def test_scikit_fem_reads_the_same_names(tmp_path, suffix):
    mesh = two_rooms()
    write_mesh(tmp_path / f"mesh{suffix}", mesh)
    other = skfem.Mesh.load(tmp_path / f"mesh{suffix}")
    for name, items in mesh.subdomains.items():
        assert area(other)[other.subdomains[name]].sum() == pytest.approx(area(mesh)[items].sum(), rel=1e-12)
    for name, items in mesh.boundaries.items():
        assert len(other.boundaries[name]) == len(items)


def test_fields_for_paraview(tmp_path):
    mesh = two_rooms()
    vector = np.vstack([np.arange(64.0), np.full(64, 1 / 3)])
    write_mesh(tmp_path / "mesh.vtu", mesh, point_data={"A z": mesh.p[0] / 3}, cell_data={"B": vector, "e": vector[0]})
    file = meshio.vtu.read(tmp_path / "mesh.vtu")
    assert_array_equal(file.points, np.column_stack([mesh.p.T, np.zeros(45)]))
    assert_array_equal(file.point_data["A z"], mesh.p[0] / 3)
    assert_array_equal(file.cell_data["e"][0], vector[0])
    assert_array_equal(file.cell_data["B"][0], np.column_stack([*vector, np.zeros(64)]))
    region = file.cell_data["region"][0]
    assert len(np.unique(region)) == 4  # left, right, and each of them low


@needs_gmsh
@pytest.mark.parametrize("suffix", [".msh", ".msh2"])
def test_fields_for_gmsh(tmp_path, suffix):
    mesh = two_rooms()
    vector = np.vstack([np.arange(64.0), np.full(64, 1 / 3)])
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, mesh, point_data={"A z": mesh.p[0] / 3}, cell_data={"B": vector})
    with gmsh_session():
        gmsh.open(str(path))
        nodal, elementwise = (gmsh.view.getHomogeneousModelData(view, 0) for view in gmsh.view.getTags())
    assert (nodal[0], elementwise[0]) == ("NodeData", "ElementData")
    assert_array_equal(nodal[1], np.arange(1, 46))
    assert_array_equal(nodal[2], mesh.p[0] / 3)
    assert_array_equal(elementwise[1], np.arange(1, 65))
    assert_array_equal(elementwise[2], np.column_stack([*vector, np.zeros(64)]).ravel())


# ---------------------------------------------------------------------------------------------- Gmsh reads it back


def groups_in_gmsh(path):
    """Distinct elements of every physical group as Gmsh has them after reading: {(dimension, name): rows of nodes}."""
    groups = {}
    with gmsh_session() as model:
        gmsh.open(str(path))
        for dimension, tag in model.getPhysicalGroups():
            nodes = []
            for entity in model.getEntitiesForPhysicalGroup(dimension, tag):
                _, _, rows = model.mesh.getElements(dimension, entity)
                nodes += [row.reshape(-1, dimension + 1) for row in rows]
            rows = np.sort(np.concatenate(nodes), axis=1)
            groups[dimension, model.getPhysicalName(dimension, tag)] = np.unique(rows, axis=0)
    return groups


def assert_gmsh_has(path, mesh):
    groups = groups_in_gmsh(path)
    wanted = {(2, name): mesh.t[:, items] for name, items in mesh.subdomains.items()}
    wanted |= {(1, name): mesh.facets[:, items] for name, items in mesh.boundaries.items()}
    assert groups.keys() == wanted.keys()
    for key, nodes in wanted.items():
        assert_array_equal(groups[key], np.unique(1 + np.sort(nodes.T, axis=1), axis=0))


@needs_gmsh
@pytest.mark.parametrize("suffix", [".msh", ".msh2"])
def test_gmsh_reads_the_same_groups(tmp_path, suffix):
    write_mesh(tmp_path / f"mesh{suffix}", two_rooms())
    assert_gmsh_has(tmp_path / f"mesh{suffix}", two_rooms())


@needs_gmsh
@pytest.mark.parametrize(
    "name", ["with space", " led and trailed ", "ü π 磁", "it's", "a\\b", "$Nodes", "$End", "a" * 127, "1"]
)
@pytest.mark.parametrize("suffix", [".msh", ".msh2"])
def test_gmsh_and_we_read_hostile_names(tmp_path, name, suffix):
    path = tmp_path / f"mesh{suffix}"
    mesh = MeshTri().refined(1)
    mesh = mesh.with_subdomains({name: np.arange(3)}).with_boundaries({name: lambda x: x[0] == 0})
    write_mesh(path, mesh)
    assert_same(read_mesh(path), mesh)
    assert_gmsh_has(path, mesh)


@needs_gmsh
@pytest.mark.parametrize("suffix", [".msh", ".msh2"])
def test_gmsh_saves_what_it_read_from_us(tmp_path, suffix):
    """Through Gmsh and back: also that every node is where Gmsh keeps it when it saves only what is in a group."""
    write_mesh(tmp_path / f"mesh{suffix}", two_rooms())
    with gmsh_session():
        gmsh.open(str(tmp_path / f"mesh{suffix}"))
        gmsh.write(str(tmp_path / "again.msh"))
    back = read_mesh(tmp_path / "again.msh")
    assert back.p.shape == (2, 45) and back.t.shape == (3, 64)
    for name, items in two_rooms().subdomains.items():
        assert area(back)[back.subdomains[name]].sum() == pytest.approx(area(two_rooms())[items].sum(), rel=1e-12)


# ---------------------------------------------------------------------------- traps of files that Gmsh has written


RECTANGLES = """
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {2, 0, 0};
Point(4) = {0, 1, 0}; Point(5) = {1, 1, 0}; Point(6) = {2, 1, 0}; Point(7) = {0.5, 0.5, 0};
Line(1) = {1, 2}; Line(2) = {2, 5}; Line(3) = {5, 4}; Line(4) = {4, 1};
Line(5) = {2, 3}; Line(6) = {3, 6}; Line(7) = {6, 5};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Curve Loop(2) = {5, 6, 7, -2}; Plane Surface(2) = {2};
Mesh.MeshSizeMin = 0.4; Mesh.MeshSizeMax = 0.4;
"""

FORMATS = [("2.2", False), ("2.2", True), ("4.1", False), ("4.1", True)]


@pytest.fixture(params=FORMATS, ids=["22 text", "22 binary", "41 text", "41 binary"])
def drawn(request, tmp_path):
    """A function that meshes the two rectangles with the groups it is given, and returns the file."""
    if gmsh is None:
        pytest.skip(WHY_NOT)

    def draw(groups, options=(), dimension=2, order=1):
        version, binary = request.param
        (tmp_path / "drawing.geo").write_text(RECTANGLES + groups + "\n")
        with gmsh_session() as model:
            gmsh.open(str(tmp_path / "drawing.geo"))
            for name, value in [("Mesh.MshFileVersion", float(version)), ("Mesh.Binary", binary), *options]:
                gmsh.option.setNumber(name, value)
            model.mesh.generate(dimension)
            model.mesh.setOrder(order)
            gmsh.write(str(tmp_path / "drawing.msh"))
        return tmp_path / "drawing.msh"

    return draw


def areas(mesh):
    return {name: round(float(area(mesh)[items].sum()), 9) for name, items in (mesh.subdomains or {}).items()}


def lengths(mesh):
    ends = mesh.p[:, mesh.facets]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]))
    return {name: round(float(length[items].sum()), 9) for name, items in (mesh.boundaries or {}).items()}


ALL = 'Physical Surface("iron", 7) = {1}; Physical Surface("air", 8) = {2};'


def test_groups_of_a_drawing(drawn):
    mesh = read_mesh(drawn(ALL + 'Physical Curve("outer", 7) = {1, 5, 6, 7, 3, 4};'))
    assert areas(mesh) == {"iron": 1.0, "air": 1.0}
    assert lengths(mesh) == {"outer": 6.0}
    assert mesh.is_valid()


def test_trap_1_lines_and_surfaces_of_the_same_number(drawn):
    mesh = read_mesh(drawn('Physical Surface("iron", 1) = {1, 2}; Physical Curve("outer", 1) = {4};'))
    assert areas(mesh) == {"iron": 2.0}
    assert lengths(mesh) == {"outer": 1.0}


def test_lines_and_surfaces_of_the_same_name(drawn):
    mesh = read_mesh(drawn('Physical Surface("part", 1) = {1, 2}; Physical Curve("part", 2) = {4};'))
    assert areas(mesh) == {"part": 2.0}
    assert lengths(mesh) == {"part": 1.0}


def test_trap_2_a_surface_in_two_groups(drawn):
    mesh = read_mesh(drawn(ALL + 'Physical Surface("both", 9) = {1, 2}; Physical Surface("again", 3) = {2};'))
    assert areas(mesh) == {"iron": 1.0, "air": 1.0, "both": 2.0, "again": 1.0}
    assert area(mesh).sum() == pytest.approx(2.0)
    assert len(np.unique(np.sort(mesh.t, axis=0), axis=1).T) == mesh.t.shape[1]


def test_a_line_in_two_groups(drawn):
    mesh = read_mesh(drawn(ALL + 'Physical Curve("a", 1) = {1, 5}; Physical Curve("b", 2) = {5, 6};'))
    assert lengths(mesh) == {"a": 2.0, "b": 2.0}


def test_trap_3_groups_without_names(drawn):
    mesh = read_mesh(drawn("Physical Surface(4) = {1}; Physical Surface(5) = {2}; Physical Curve(4) = {1, 2};"))
    assert areas(mesh) == {"region_4": 1.0, "region_5": 1.0}
    assert lengths(mesh) == {"boundary_4": 2.0}


def test_an_element_in_two_groups_without_names(drawn):
    mesh = read_mesh(drawn("Physical Surface(4) = {1}; Physical Surface(5) = {1, 2};"))
    assert areas(mesh) == {"region_4": 1.0, "region_5": 2.0}


def test_trap_4_no_line_group(drawn, caplog):
    mesh = read_mesh(drawn(ALL))
    assert areas(mesh) == {"iron": 1.0, "air": 1.0}
    assert mesh.boundaries is None
    assert not caplog.records


def test_no_group_at_all(drawn, caplog):
    mesh = read_mesh(drawn(""))
    assert mesh.subdomains is None and mesh.boundaries is None
    assert area(mesh).sum() == pytest.approx(2.0)
    assert not caplog.records


def test_trap_5_no_sets_of_gmsh(drawn):
    assert set(read_mesh(drawn(ALL)).subdomains) == {"iron", "air"}


def test_trap_6_interior_lines(drawn):
    mesh = read_mesh(drawn(ALL + 'Physical Curve("interface", 3) = {2};'))
    assert lengths(mesh) == {"interface": 1.0}
    assert np.all(mesh.f2t[1, mesh.boundaries["interface"]] >= 0)


def test_reversed_groups(drawn):
    mesh = read_mesh(drawn('Physical Surface("all", 1) = {-1, 2}; Physical Curve("turned", 2) = {-4, 1};'))
    assert areas(mesh) == {"all": 2.0}
    assert lengths(mesh) == {"turned": 2.0}


def test_trap_7_quadrilaterals(drawn):
    path = drawn(ALL + "Recombine Surface {1};")
    with pytest.raises(
        ValueError, match=r"expected triangles only; '.*' has .* quadrilateral elements, .* triangle elem"
    ):
        read_mesh(path)


def test_trap_8_partly_tagged_surfaces_leave_a_hole(drawn, caplog):
    path = drawn('Physical Surface("air", 2) = {2}; Physical Curve("outer", 1) = {4, 5}; Physical Point("p", 1) = {7};')
    with caplog.at_level(logging.INFO):
        mesh = read_mesh(path)
    assert areas(mesh) == {"air": 1.0} and area(mesh).sum() == pytest.approx(1.0)
    assert lengths(mesh) == {"outer": 1.0}
    assert_array_equal(np.unique(mesh.t), np.arange(mesh.p.shape[1]))
    assert "lines of" in caplog.text and "are no side of a triangle: left out." in caplog.text
    assert "unused nodes dropped." in caplog.text and "; 0 unused" not in caplog.text
    if b"4.1" in path.read_bytes()[:20]:
        assert "has no triangles for surface 1 of its geometry: the mesh has holes there." in caplog.text


def test_trap_8_coverage(drawn, caplog):
    path = drawn('Physical Surface("air", 2) = {2};', options=[("Mesh.SaveAll", 1)])
    mesh = read_mesh(path)
    assert area(mesh).sum() == pytest.approx(2.0)
    if b"4.1" in path.read_bytes()[:20]:  # in 2.2, Gmsh forgets the groups when it saves all
        assert areas(mesh) == {"air": 1.0}
        assert f"50 % of the area of '{path}' is in no surface group: give it one." in caplog.messages


def test_trap_9_second_order_triangles_are_read_as_their_corners(drawn):
    groups = ALL + 'Physical Curve("outer", 7) = {1, 5, 6, 7, 3, 4};'
    mesh, straight = read_mesh(drawn(groups, order=2)), read_mesh(drawn(groups))
    assert type(mesh) is MeshTri
    assert_same(mesh, straight)


def test_trap_10_scale(drawn):
    mesh = read_mesh(drawn(ALL), scale=1e-3)
    assert mesh.p.max() == pytest.approx(2e-3, rel=1e-12)
    assert areas(mesh) == {"iron": 1e-6, "air": 1e-6}


def test_nodes_and_triangles_are_those_that_meshio_finds(drawn):
    path = drawn(ALL)
    file, mesh = meshio.gmsh.read(path), read_mesh(path)
    assert_array_equal(np.unique(mesh.p.T, axis=0), np.unique(file.points[:, :2], axis=0))
    centres = file.points[file.cells_dict["triangle"]].mean(axis=1)[:, :2]
    assert_array_equal(np.sort(mesh.p[:, mesh.t].mean(axis=1)[0]), np.sort(centres[:, 0]))


def test_a_mesh_of_lines_or_volumes_is_refused(drawn):
    with pytest.raises(ValueError, match=r"expected triangles; .* has .* line elements, .*Mesh in two dimensions"):
        read_mesh(drawn("", dimension=1))
    with pytest.raises(ValueError, match=r"expected a plane mesh; .* has .* 3D elements"):
        read_mesh(drawn("Extrude {0, 0, 1} { Surface{1, 2}; }", dimension=3))


def test_a_drawing_in_another_plane_is_refused(drawn):
    with pytest.raises(ValueError, match="expected a drawing in the xy-plane; z runs from 0 to 1 in"):
        read_mesh(drawn("Rotate {{1, 0, 0}, {0, 0, 0}, Pi/2} { Surface{1, 2}; }"))


def test_parameters_of_nodes_are_passed_over(drawn):
    path = drawn(ALL, options=[("Mesh.SaveParametric", 1)])
    if b"4.1" in path.read_bytes()[:20]:
        with_parameters = read_mesh(path)
        assert_same(with_parameters, read_mesh(drawn(ALL)))
    else:
        with pytest.raises(ValueError, match=r"section \$Nodes is missing"):
            read_mesh(path)


def test_partitions_are_refused(drawn):
    path = drawn(ALL)
    text = path.read_bytes().replace(b"$Nodes", b"$PartitionedEntities\n$EndPartitionedEntities\n$Nodes", 1)
    path.write_bytes(text)
    with pytest.raises(ValueError, match="it is partitioned"):
        read_mesh(path)


def test_a_file_cut_short_anywhere_is_refused(drawn):
    whole = (path := drawn(ALL + 'Physical Curve("outer", 7) = {1};')).read_bytes()
    end = whole.index(b"$EndElements") - 4
    for length in np.linspace(0, end, 60).astype(int):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r"is not a complete Gmsh file|expected a Gmsh file"):
            read_mesh(path)


# -------------------------------------------------------------------------------------------------- bad input


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"read_mesh expected a mesh file; there is none at '.*no\.msh'\."):
        read_mesh(tmp_path / "no.msh")


@pytest.mark.parametrize("name", ["mesh.stl", "mesh"])
def test_unknown_suffix(tmp_path, name):
    with pytest.raises(ValueError, match=rf"expected a file name that ends in \.msh, \.msh2, \.vtu; got '{name}'"):
        read_mesh(tmp_path / name)
    with pytest.raises(ValueError, match="write_mesh expected a file name that ends in"):
        write_mesh(tmp_path / name, MeshTri())


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_scale_must_be_positive(tmp_path, scale):
    with pytest.raises(ValueError, match="scale must be a positive number, 1e-3 for a drawing in millimetres; got"):
        read_mesh(tmp_path / "mesh.msh", scale=scale)


@pytest.mark.parametrize("content", [b"", b"solid", b"$MeshFormat\n", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"])
def test_no_gmsh_file(tmp_path, content):
    (tmp_path / "mesh.msh").write_bytes(content)
    with pytest.raises(ValueError, match=r"expected a Gmsh file|is not a complete Gmsh file: section \$"):
        read_mesh(tmp_path / "mesh.msh")


def test_other_versions_are_refused_with_the_remedy(tmp_path):
    (tmp_path / "mesh.msh").write_text("$MeshFormat\n4 0 8\n$EndMeshFormat\n")
    with pytest.raises(
        ValueError, match=r"expected MSH 2.2 or 4.1 with numbers of 8 bytes; .* is MSH 4 with 8 bytes. Conv"
    ):
        read_mesh(tmp_path / "mesh.msh")


def damaged(tmp_path, old, new):
    write_mesh(tmp_path / "mesh.msh", MeshTri().refined(1))
    text = (tmp_path / "mesh.msh").read_text()
    assert old in text
    (tmp_path / "mesh.msh").write_text(text.replace(old, new, 1))
    return tmp_path / "mesh.msh"


def test_coordinates_that_are_not_finite(tmp_path):
    with pytest.raises(ValueError, match=r"expected finite coordinates; .* has a node at \[nan"):
        read_mesh(damaged(tmp_path, "\n0.5 0.5 0\n", "\nnan 0.5 0\n"))


def test_words_among_the_numbers(tmp_path):
    with pytest.raises(ValueError, match="is not a complete Gmsh file: a section of numbers holds something else"):
        read_mesh(damaged(tmp_path, "\n0.5 0.5 0\n", "\nhalf 0.5 0\n"))


def test_a_node_that_is_not_there(tmp_path):
    with pytest.raises(ValueError, match="an element has node 77, which is not there"):
        read_mesh(damaged(tmp_path, "$Elements\n1 8 1 8\n2 1 2 8\n1 1 ", "$Elements\n1 8 1 8\n2 1 2 8\n1 77 "))


def test_an_unknown_element_type(tmp_path):
    with pytest.raises(ValueError, match="element type 99 is unknown"):
        read_mesh(damaged(tmp_path, "\n2 1 2 8\n", "\n2 1 99 8\n"))


def test_vtu_that_is_none(tmp_path):
    (tmp_path / "mesh.vtu").write_text("<VTKFile>")
    with pytest.raises(ValueError, match="expected a VTU file; meshio cannot read"):
        read_mesh(tmp_path / "mesh.vtu")


def test_vtu_of_other_elements(tmp_path):
    skfem.MeshQuad().save(tmp_path / "mesh.vtu")
    with pytest.raises(ValueError, match=r"expected triangles only; .* has 1 quadrilateral elements"):
        read_mesh(tmp_path / "mesh.vtu")
    skfem.MeshTet().save(tmp_path / "mesh.vtu")
    with pytest.raises(ValueError, match=r"expected a plane mesh; .* 3D elements"):
        read_mesh(tmp_path / "mesh.vtu")


@pytest.mark.parametrize("mesh", [skfem.MeshQuad(), MeshTri2(), skfem.MeshTet(), skfem.MeshTri1DG()])
def test_write_refuses_other_meshes(tmp_path, mesh):
    with pytest.raises(TypeError, match=r"mesh must be a skfem\.MeshTri; got Mesh"):
        write_mesh(tmp_path / "mesh.msh", mesh)


def test_write_refuses_an_empty_mesh(tmp_path):
    empty = MeshTri(np.empty((2, 0)), np.empty((3, 0), dtype=int), validate=False)
    with pytest.raises(ValueError, match="mesh must have at least one element; got an empty mesh"):
        write_mesh(tmp_path / "mesh.msh", empty)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"point_data": {"u": np.zeros(3)}}, r"point_data 'u' must have shape \(4,\); got \(3,\)"),
        ({"point_data": {"u": np.zeros((2, 4))}}, r"point_data 'u' must have shape \(4,\); got \(2, 4\)"),
        ({"cell_data": {"u": np.zeros((2, 3))}}, r"cell_data 'u' must have shape \(2,\) or \(2, 2\); got \(2, 3\)"),
        ({"cell_data": {"u": [1.0, np.nan]}}, "cell_data 'u' must be finite; 1 of its 2 values are not"),
        ({"point_data": {"u": [0.0, np.inf, 0, 0]}}, "point_data 'u' must be finite; 1 of its 4 values are not"),
        ({"cell_data": {'u"': [1.0, 2.0]}}, "name of a cell_data must be printable text without a double quote"),
    ],
)
def test_write_refuses_bad_fields(tmp_path, suffix, data, message):
    with pytest.raises(ValueError, match=message):
        write_mesh(tmp_path / f"mesh{suffix}", MeshTri(), **data)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["", 'a"b', "a\nb", "a\tb", 3])
def test_write_refuses_names_that_gmsh_cannot_read(tmp_path, name):
    mesh = MeshTri(MeshTri().p, MeshTri().t, None, {name: np.array([0])})
    with pytest.raises(ValueError, match="the name of a subdomain must be printable text without a double quote"):
        write_mesh(tmp_path / "mesh.msh", mesh)


def test_write_refuses_names_that_gmsh_cuts_off(tmp_path):
    with pytest.raises(ValueError, match="the name of a boundary may have 127 bytes, more Gmsh cuts off; got 'aaa"):
        write_mesh(tmp_path / "mesh.msh", MeshTri().with_boundaries({"a" * 128: lambda x: x[0] == 0}))


def test_write_refuses_sets_outside_the_mesh(tmp_path):
    mesh = MeshTri(MeshTri().p, MeshTri().t, None, {"a": np.array([0, 2])})
    with pytest.raises(ValueError, match="subdomain 'a' must have indices from 0 to 1; got 0 to 2"):
        write_mesh(tmp_path / "mesh.msh", mesh)


def test_names_that_the_file_needs(tmp_path):
    with pytest.raises(ValueError, match="cell_data 'region' has a name that write_mesh needs for the mesh"):
        write_mesh(tmp_path / "mesh.vtu", MeshTri(), cell_data={"region": [1.0, 2.0]})


# ----------------------------------------------------------------------------------------- whole or not at all


def test_a_missing_folder(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"cannot write 'mesh\.msh': there is no folder '.*nowhere'. Create it"):
        write_mesh(tmp_path / "nowhere" / "mesh.msh", MeshTri())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path, suffix, monkeypatch):
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, MeshTri())
    before = path.read_bytes()

    def full(*args):
        raise OSError(28, "No space left on device", "draft")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OSError, match="No space left on device") as caught:
        write_mesh(path, two_rooms())
    assert caught.value.filename == str(path)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == before


def test_paths_may_be_strings(tmp_path):
    write_mesh(str(tmp_path / "mesh.MSH"), MeshTri())
    assert_same(read_mesh(str(tmp_path / "mesh.MSH")), MeshTri())
    assert Path(tmp_path / "mesh.MSH").read_text().startswith("$MeshFormat\n4.1 0 8\n")


# --------------------------------------------------------------------------------------------------- the example


EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize(("name", "low", "high"), [("c_core", 800, 1000), ("c_core_fine", 2700, 3300)])
def test_the_c_core(name, low, high):
    mesh = read_mesh(EXAMPLES / f"{name}.msh")
    assert low <= mesh.p.shape[1] <= high
    assert set(mesh.subdomains) == {"iron", "magnet", "air"} and set(mesh.boundaries) == {"outer"}
    assert_array_equal(np.sort(np.concatenate(list(mesh.subdomains.values()))), np.arange(mesh.t.shape[1]))
    assert_array_equal(mesh.boundaries["outer"], mesh.boundary_facets())
