"""Fields from views of Gmsh and lists of GetDP: the same numbers as from VTU, whatever the form."""

import numpy as np
import pytest
from helpers.cases import run_command
from helpers.mesh_files import SUFFIXES, as_list, two_boxes, two_rooms
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka


def ramp(mesh):
    """A field per node, and the means of it per element."""
    nodal = 1.0 + mesh.p[0] + 2.0 * mesh.p[1]
    return nodal, nodal[mesh.t].mean(axis=0)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("mesh", [two_rooms(), two_boxes(1)], ids=["plane", "space"])
def test_fields_come_back_by_place(tmp_path, suffix, mesh):
    rng, path = np.random.default_rng(0), tmp_path / f"f{suffix}"
    node, element = rng.permutation(mesh.nvertices), rng.permutation(mesh.nelements)
    other = type(mesh)(mesh.p[:, node], np.argsort(node)[mesh.t][:, element])
    nodal, cellwise = ramp(mesh)
    cells = {"e": cellwise[element], "v": np.stack([cellwise] * 2)[: len(mesh.p)]}
    ka.write_mesh(
        path, other, point_data={"n": nodal[node]}, cell_data=cells if len(mesh.p) == 2 else {"e": cells["e"]}
    )
    assert_array_equal(ka.read_field(path, mesh, "e"), cellwise)
    assert_allclose(ka.read_field(path, mesh, "n"), cellwise, rtol=1e-14)
    with pytest.raises(ValueError, match=r"has no field 'x'; its fields are: .*'e', 'n'"):
        ka.read_field(path, mesh, "x")
    if len(mesh.p) == 2:
        with pytest.raises(ValueError, match=r"'v' of '.*' must be one real number or a tensor per .* element; got 3"):
            ka.read_field(path, mesh, "v")
    with pytest.raises(
        ValueError, match=r"expected a field on the mesh, of 4 nodes and 2 triangles; '.*' has \d+ and "
    ):
        ka.read_field(path, MeshTri(), "e")


@pytest.mark.parametrize(("mesh", "kind"), [(two_rooms(), "ST"), (two_boxes(1), "SS")], ids=["plane", "space"])
def test_lists_of_elements(tmp_path, mesh, kind):
    """A view of vectors beside those of numbers does no harm."""
    values, cellwise = ramp(mesh)[0][mesh.t].T, ramp(mesh)[1]
    lists = [as_list(mesh, values, "f", kind), as_list(mesh, values + 1.0, "g", kind)]
    vectors = as_list(mesh, np.repeat(values, 3, axis=1), "b", kind.replace("S", "V", 1))
    (tmp_path / "f.pos").write_text("".join([*lists, vectors]))
    assert_allclose(ka.read_field(tmp_path / "f.pos", mesh, "f"), cellwise, rtol=1e-14)
    assert_allclose(ka.read_field(tmp_path / "f.pos", mesh, "g"), cellwise + 1.0, rtol=1e-14)


ROOMS = two_rooms()
VALUES = ramp(ROOMS)[0][ROOMS.t].T
LIST, VECTORS = as_list(ROOMS, VALUES), as_list(ROOMS, np.repeat(VALUES, 3, axis=1), "b", "VT")
ELSEWHERE = as_list(ROOMS.translated((1.0, 0.0)), VALUES, "g")
OTHER_LISTS = [  # text, field, and what is said
    (as_list(ROOMS, VALUES[:, [0, 1, 2] * 2]), "f", "must have triangles of 9 coordinates and 3 values, one step"),
    (LIST + LIST, "f", "has 2 fields or steps 'f'; write one only"),
    (LIST + ELSEWHERE, "f", "has views on different triangles; write each view to its own file"),
    ('View "f" {\n};', "f", r"expected a field on the mesh, of 45 nodes and 64 triangles; .* 0 and 0"),
    (LIST + VECTORS, "b", r"'b' of '.*' must be one real number or a tensor .*; got 3 components\. Write a "),
    ("something", "f", r"expected a Gmsh file; '.*' has no section \$MeshFormat"),
    ('View "p" {\nSP(0,0,0){1};\n};', "p", r"the view 'p' of '.*' has 'SP'\. Write it on triangles alone"),
    ('View "p" {\nSL(0,0,0,1,0,0){1,2};VT2(0){1};\n};', "p", r"has 'SL', 'VT2'\. Write it on triangles alone"),
]


@pytest.mark.parametrize(("text", "name", "said"), OTHER_LISTS)
def test_lists_that_do_not_fit(tmp_path, text, name, said):
    (tmp_path / "f.pos").write_text(text)
    with pytest.raises(ValueError, match=said):
        ka.read_field(tmp_path / "f.pos", ROOMS, name)


def test_where_data_is_for_a_part_only_there_are_no_numbers(tmp_path):
    mesh = two_rooms()
    ka.write_mesh(tmp_path / "f.msh", mesh, cell_data={"f": np.ones(64)})
    text = (tmp_path / "f.msh").read_text().replace("\n1\n64\n1 1.0\n", "\n1\n63\n")
    (tmp_path / "f.msh").write_text(text)
    assert_array_equal(np.isnan(ka.read_field(tmp_path / "f.msh", mesh, "f")), np.arange(64) == 0)


def test_one_meaning_only():
    for options in ([], ["--density", "a.vtu:a", "--sizes", "a.vtu:a"]):
        with pytest.raises(SystemExit):
            run_command("relocate", "m.msh", "--out", "o.msh", *options)


def test_fields_in_other_files(tmp_path):
    (tmp_path / "f.inp").write_text("")
    with pytest.raises(ValueError, match=r"read_field expected a file name that ends in \.vtu, \.vtk, \.xdmf, \.med, "):
        ka.read_field(tmp_path / "f.inp", two_rooms(), "f")
