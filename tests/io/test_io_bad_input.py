"""What is refused when meshes are read and written, and in which words."""

import numpy as np
import pytest
import skfem
from helpers.mesh_files import SUFFIXES
from skfem import MeshTri

from kohonen_adapt import read_mesh, write_mesh


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"read_mesh expected a mesh file; there is none at '.*no\.msh'\."):
        read_mesh(tmp_path / "no.msh")


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("mesh.stl", r"gmsh 'mesh\.stl' -save -o NEW"),
        ("mesh.exo", r"meshio convert 'mesh\.exo' NEW\.vtu"),
        ("core.geo", r"gmsh -2 'core\.geo' -o NEW\.msh"),
        ("mesh.fem", r"analyse it there, and read the solution, the \.ans file beside it\."),
        ("mesh.ele", r"numpy\.loadtxt and skfem\.MeshTri\(p, t\) make a mesh\."),
        ("mesh", r"skfem\.MeshTri\(p, t\)"),
    ],
)
def test_unknown_suffix(tmp_path, name, remedy):
    with pytest.raises(ValueError, match=rf"ends in \.msh, \.msh2, \.vtu, .*; got '{name}'\. .*{remedy}"):
        read_mesh(tmp_path / name)
    with pytest.raises(ValueError, match="write_mesh expected a file name that ends in"):
        write_mesh(tmp_path / "mesh.stl", MeshTri())


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


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("\n0.5 0.5 0\n", "\nnan 0.5 0\n", r"expected finite .* a node at \[nan.*\], number 7 of 9 in"),
        ("\n0.5 0.5 0\n", "\nhalf 0.5 0\n", "is not a complete Gmsh file: a section of numbers has other text"),
        ("\n2 1 2 8\n1 1 ", "\n2 1 2 8\n1 77 ", "an element has node 77, which does not exist"),
        ("\n2 1 2 8\n", "\n2 1 99 8\n", "element type 99 is unknown"),
    ],
)
def test_damage(tmp_path, old, new, said):
    write_mesh(tmp_path / "mesh.msh", MeshTri().refined(1))
    text = (tmp_path / "mesh.msh").read_text()
    assert old in text
    (tmp_path / "mesh.msh").write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=said):
        read_mesh(tmp_path / "mesh.msh")


def test_vtu_that_is_none(tmp_path):
    (tmp_path / "mesh.vtu").write_text("<VTKFile>")
    with pytest.raises(ValueError, match=r"read_mesh expected a VTU file; '.*' cannot be read: no element found"):
        read_mesh(tmp_path / "mesh.vtu")


def test_vtu_of_other_elements(tmp_path):
    skfem.MeshQuad().save(tmp_path / "mesh.vtu")
    with pytest.raises(ValueError, match=r"expected triangles only; .* has 1 quadrilateral elements"):
        read_mesh(tmp_path / "mesh.vtu")


@pytest.mark.parametrize("mesh", [skfem.MeshQuad(), skfem.MeshHex(), skfem.MeshTri1DG()])
def test_write_refuses_other_meshes(tmp_path, mesh):
    with pytest.raises(ValueError, match=r"mesh must be a skfem\.MeshTri, MeshTri2, MeshTet or MeshTet2; got Mesh"):
        write_mesh(tmp_path / "mesh.msh", mesh)


def test_write_refuses_an_empty_mesh(tmp_path):
    empty = MeshTri(np.empty((2, 0)), np.empty((3, 0), dtype=int), validate=False)
    with pytest.raises(ValueError, match="mesh must have at least one element; got an empty mesh"):
        write_mesh(tmp_path / "mesh.msh", empty)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"point_data": {"u": np.zeros(3)}}, r"point_data 'u' must have shape \(4,\).*; got \(3,\)"),
        ({"point_data": {"u": np.zeros((2, 4))}}, r"point_data 'u' must have shape \(4,\).*; got \(2, 4\)"),
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


@pytest.mark.parametrize("name", ["", 'a"b', "a\nb", "a\tb"])
def test_write_refuses_names_that_gmsh_cannot_read(tmp_path, name):
    mesh = MeshTri(MeshTri().p, MeshTri().t, None, {name: np.array([0])})
    with pytest.raises(ValueError, match="the name of a subdomain must be printable text without a double quote"):
        write_mesh(tmp_path / "mesh.msh", mesh)


def test_write_refuses_names_that_gmsh_cuts_off(tmp_path):
    with pytest.raises(
        ValueError, match="the name of a boundary must have at most 127 bytes, because Gmsh cuts longer names; got 'aaa"
    ):
        write_mesh(tmp_path / "mesh.msh", MeshTri().with_boundaries({"a" * 128: lambda x: x[0] == 0}))


def test_write_refuses_sets_outside_the_mesh(tmp_path):
    mesh = MeshTri(MeshTri().p, MeshTri().t, None, {"a": np.array([0, 2])})
    with pytest.raises(ValueError, match="subdomain 'a' must have indices from 0 to 1; got 0 to 2"):
        write_mesh(tmp_path / "mesh.msh", mesh)


def test_names_that_the_file_needs(tmp_path):
    with pytest.raises(ValueError, match="cell_data 'region' has a name that write_mesh reserves for the mesh"):
        write_mesh(tmp_path / "mesh.vtu", MeshTri(), cell_data={"region": [1.0, 2.0]})
