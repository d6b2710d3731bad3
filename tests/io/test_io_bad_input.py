"""What is refused when meshes are read and written, and in which words."""

import sys

import meshio
import numpy as np
import pytest
import skfem
from helpers.curved_meshes import curved_annulus
from helpers.mesh_files import SUFFIXES, two_boxes, two_rooms
from helpers.small_files import ABAQUS, BY_HAND, GMSH, GRID, SU2, disc, written
from skfem import MeshTri

from kohonen_adapt import read_curves, read_field, read_groups, read_mesh, write_mesh
from kohonen_adapt.io import Groups


@pytest.mark.parametrize(
    ("read", "what"),
    [
        (read_mesh, "mesh file"),
        (read_groups, "mesh file"),
        (lambda path: read_curves(path, MeshTri()), "mesh file"),
        (lambda path: read_field(path, MeshTri(), "f"), "file with a field"),
    ],
)
def test_missing_file(read, what, tmp_path):
    with pytest.raises(FileNotFoundError, match=rf"_\w+ expected a {what}; there is none at '.*no\.msh'\."):
        read(tmp_path / "no.msh")


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        *((f"mesh.{kind}", rf"gmsh 'mesh\.{kind}' -save -o NEW") for kind in ("stl", "unv", "cgns")),
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


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_scale_must_be_positive(tmp_path, scale):
    for read in (read_mesh, lambda path, scale: read_curves(path, MeshTri(), scale=scale)):
        with pytest.raises(ValueError, match="scale must be a positive number, 1e-3 for a drawing in millimetres; got"):
            read(tmp_path / "mesh.msh", scale=scale)


XDMF = (
    '<Xdmf Version="3.0"><Domain><Grid><Geometry GeometryType="XY"><DataItem Dimensions="3 2" Format="HDF">m.h5:/a'
    "</DataItem></Geometry></Grid></Domain></Xdmf>"
)
TEXTS = {
    **BY_HAND,
    "m.msh": GMSH,
    "m.inp": ABAQUS,
    "m.su2": SU2,
    "m.xdmf": XDMF,
    "femm.ans": disc()[2],
    **{f"elmer/{name}": text for name, text in GRID.items()},
}
NO_GMSH = r"expected a Gmsh file|is not a complete Gmsh file: section \$"
NO_INTEGER = "an integer is too large, or not finite"
BESIDE = "its data must be in a file in the same folder"
BEYOND = r"cannot be read: it (announces|has a set from) .* in [0-9]+ bytes\."
FEMM = "expected a solution of FEMM; '.*' cannot be read: "
REFUSED = [  # file, what of it is replaced or None for all, by what, and what is said
    ("m.msh", None, "$MeshFormat\n", NO_GMSH),
    ("m.msh", None, "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", NO_GMSH),
    ("m.msh", "4.1 0 8", "4 0 8", "expected MSH 2.2 or 4.1 with numbers of 8 bytes; .* is MSH 4 with 8 bytes. Conv"),
    ("m.msh", "\n0 1 0\n", "\nnan 1 0\n", r"expected finite .* a node at \[nan.*\], number 3 of 3 in"),
    ("m.msh", "\n0 1 0\n", "\nhalf 1 0\n", "is not a complete Gmsh file: a section of numbers has other text"),
    ("m.msh", "\n1 1 2 3\n", "\n1 77 2 3\n", "an element has node 77, which does not exist"),
    ("m.msh", "\n2 1 2 1\n", "\n2 1 99 1\n", "element type 99 is unknown"),
    ("m.msh", "\n2 1 2 1\n", "\n2 1 42 1\n", r"type 42 is unknown: mesh with an order \(Mesh.ElementOrder\)"),
    ("m.msh", "\n2 1 0 3\n", "\n2 1 0 2.5\n", "2.5 is not an integer"),
    ("m.msh", "\n2\n3\n", "\n2\nnan\n", NO_INTEGER),
    ("m.msh", "\n2 1 0 3\n", "\n2 1 0 1e300\n", NO_INTEGER),
    ("m.msh", '2 1 "all"', '2 99999999999 "all"', "a group has the number 99999999999"),
    ("m.msh", "\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n", "\n0 0 1 3\n", "it has elements and no nodes"),
    ("m.vtu", None, "<VTKFile>", "read_mesh expected a VTU file; '.*' cannot be read: no element found"),
    ("m.vtk", None, "# vtk DataFile Version 3.0\n\nASCII\nDATASET STRUCTURED_POINTS\n", "has no UNSTRUCTURED_GRID"),
    ("freefem.vtk", "POINTS 4 ", "POINTS 99999999999 ", BEYOND),
    ("m.mesh", None, "MeshVersionFormatted 2\nDimension 2\nVertices\n2\n0 0 0 zero one 0\n", "cannot be read"),
    ("one_line.mesh", "Vertices 4", "Vertices 99999999999", BEYOND),
    ("m.inp", None, ABAQUS + "*INCLUDE, INPUT=/etc/passwd\n", "it includes another file"),
    ("m.inp", None, ABAQUS + "*ELSET, ELSET=both\nsome\n", "it has a set of sets: list their elements"),
    ("m.inp", "1, 1, 2\n*", "1, 1, 9\n*", "cannot be read: "),
    ("m.inp", "1, 3, 2\n", "1, 2000000000, 1\n", BEYOND),
    ("m.su2", "5 0 2 3 1", "5 0 2 7 1", "an element has a node that does not exist"),
    ("m.su2", "NPOIN= 4", "POINTS= 4", "cannot be read: UnboundLocalError"),
    ("m.su2", "NPOIN= 4", "NPOIN= 99999999999", BEYOND),
    ("mfem.mesh", "1 2 0 1 2", "1 2 0 1 9", "a mesh of MFEM; .* an element has a node that does not exist"),
    ("mfem.mesh", "vertices", "nodes", "save the mesh without curved sides and refinement"),
    ("mfem.mesh", "1 2 0 1 2", "1 3 0 1 2 3", "quadrilateral"),
    ("freefem.msh", "4 2 2", "4 2 3", "a mesh of FreeFEM; .* announces 32 numbers and has 29"),
    ("freefem.msh", "1 2 7", "1 9 7", "an element has a node that does not exist"),
    ("ucd.inp", "1 3 4", "1 3 9", "cannot be read"),
    ("m.xdmf", "m.h5:/a", "../m.h5:/a", f"{BESIDE}; there is no file '../m.h5'"),
    ("m.xdmf", "m.h5:/a", "/dev/zero:/a", BESIDE),
    ("m.xdmf", "m.h5:/a", "none.h5:/a", BESIDE),
    ("m.xdmf", 'HDF">m.h5:/a', 'Binary">/dev/zero', "its data has the format 'Binary'; write it with HDF or XML"),
    ("femm.ans", "[Solution]", "[Problem]", rf"{FEMM}it has no \[Solution\]: analyse the model in FEMM"),
    ("femm.ans", "inches", "furlongs", f"{FEMM}its unit of length is 'furlongs'; FEMM has 'centimeters', 'inches', "),
    ("femm.ans", "[NumPoints] = 2", "[NumPoints] = 7000", f"{FEMM}it announces 7000 rows, but has "),
    ("femm.ans", "Labels] = 3", "Labels] = 2", f"{FEMM}a triangle is in a block that does not exist"),
    ("elmer/mesh.elements", "3 306 9 2 1 4 5 6", "3 404 9 2 1 4", "triangles only; .* 3 line .* 1 quadrilateral"),
    ("elmer/mesh.elements", "306 9 2 1 4 5 6", "808 9 2 1 4 9 2 1 4", "tetrahedra and triangles only; .* 1 hexahedron"),
    ("elmer/mesh.elements", "306 9 2 1 4 5 6", "999 9 2 1 4", "cannot be read: element type 999 is unknown"),
    ("elmer/mesh.elements", "306 9 2 1 4 5 6", "303 9 2 77", "an element has node 77, which does not exist"),
    ("elmer/mesh.elements", "306 9 2 1 4 5 6", "303 9 2", "cannot be read: "),
    ("elmer/mesh.nodes", None, "1 2 3\n", "cannot be read: "),
    ("elmer/mesh.nodes", None, None, "expected a mesh of Elmer; '.*' cannot be read: it has no file mesh.nodes"),
]


@pytest.mark.parametrize(("name", "old", "new", "said"), REFUSED)
def test_files_that_are_refused(tmp_path, name, old, new, said):
    if name == "m.xdmf":
        pytest.importorskip("h5py")
    if in_folder := name.startswith("elmer/"):
        written(tmp_path / "elmer", GRID)
    (tmp_path / name).unlink(missing_ok=True)
    if new is not None:
        assert old is None or old in TEXTS[name]
        (tmp_path / name).write_text(new if old is None else TEXTS[name].replace(old, new, 1))
    path = tmp_path / ("elmer" if in_folder else name)
    with pytest.raises(ValueError, match=said) as refused:
        read_mesh(path)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


NODES = {"tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8, "quad": 4}
MIXED = "expected tetrahedra and triangles only; .* 1 tetrahedron elem.*to_meshtet"


@pytest.mark.parametrize(
    ("kinds", "said"),
    [
        (["quad"], "expected triangles only; .* has 1 quadrilateral elements"),
        (["hexahedron"], "1 hexahedron elements"),
        (["wedge"], "prism elements"),
        *((["tetra", other], MIXED) for other in ("pyramid", "wedge", "hexahedron", "quad")),
    ],
)
def test_other_cells_are_refused(tmp_path, kinds, said):
    points = np.random.default_rng(0).uniform(size=(8, 3)) * [1, 1, kinds != ["quad"]]
    meshio.Mesh(points, [(kind, np.arange(NODES[kind])[None]) for kind in kinds]).write(tmp_path / "mesh.vtu")
    with pytest.raises(ValueError, match=said):
        read_mesh(tmp_path / "mesh.vtu")


def test_without_h5py_the_error_names_the_extra(tmp_path, monkeypatch):
    (tmp_path / "m.med").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ImportError, match=r'read_mesh needs h5py for a MED file: pip install "kohonen-adapt\[files\]"'):
        read_mesh(tmp_path / "m.med")


def named(*names, boundaries=None):
    return MeshTri(MeshTri().p, MeshTri().t, boundaries, {name: np.array([0]) for name in names} or None)


EMPTY = MeshTri(np.empty((2, 0)), np.empty((3, 0), dtype=int), validate=False)
OUTSIDE = MeshTri(MeshTri().p, MeshTri().t, None, {"a": np.array([0, 2])})
GRID_8 = MeshTri().refined(1)  # of 9 nodes and 8 triangles, as fields inside elements below
ZEROS, PLACES = {"u": np.zeros((10, 8))}, np.zeros((2, 80))
BAD_FIELDS = [
    ({"point_data": {"u": np.zeros(3)}}, r"point_data 'u' must have shape \(4,\).*; got \(3,\)"),
    ({"point_data": {"u": np.zeros((2, 4))}}, r"point_data 'u' must have shape \(4,\).*; got \(2, 4\)"),
    ({"cell_data": {"u": np.zeros((2, 3))}}, r"cell_data 'u' must have shape \(2,\) or \(2, 2\); got \(2, 3\)"),
    ({"cell_data": {"u": [1.0, np.nan]}}, "cell_data 'u' must be finite; 1 of its 2 values are not"),
    ({"point_data": {"u": [0.0, np.inf, 0, 0]}}, "point_data 'u' must be finite; 1 of its 4 values are not"),
    ({"cell_data": {'u"': [1.0, 2.0]}}, "name of a cell_data must be printable text without a double quote"),
]
OF_ORDERS = [  # shapes of fields inside elements
    (".vtu", {"u": (7, 8)}, r"'u' must have shape \(9,\), or \(k, 8\) with k = .* for the order p; got \(7, 8\)"),
    (".vtu", {"u": (8, 6)}, r"'u' must have shape \(9,\), or \(k, 8\)"),
    (".vtu", {"u": (6, 8), "v": (10, 8)}, r"must have one shape, that of one order; got \(6, 8\) and \(10, 8\)"),
    (".msh", {"u": (6, 8)}, r"'u' has values inside elements, for .vtu only; got 'm\.msh'"),
    ("", {"u": (6, 8)}, "'u' has values inside elements, for .vtu only; got 'm'. Write"),
]
WRITES = [  # suffix, mesh, data, and what is said
    *(
        (".msh", mesh, {}, r"mesh must be a skfem\.MeshTri, MeshTri2, MeshTet or MeshTet2; got Mesh")
        for mesh in (skfem.MeshQuad(), skfem.MeshHex(), skfem.MeshTri1DG())
    ),
    (".stl", MeshTri(), {}, "write_mesh expected a file name that ends in"),
    (".msh", EMPTY, {}, "mesh must have at least one element; got an empty mesh"),
    *((suffix, MeshTri(), data, said) for suffix in SUFFIXES for data, said in BAD_FIELDS),
    *(
        (".msh", named(name), {}, "the name of a subdomain must be printable text without a double quote")
        for name in ("", 'a"b', "a\nb", "a\tb")
    ),
    (
        ".msh",
        named(boundaries={"a" * 128: np.array([0])}),
        {},
        "the name of a boundary must have at most 127 bytes, because Gmsh cuts longer names; got 'aaa",
    ),
    (".msh", OUTSIDE, {}, "subdomain 'a' must have indices from 0 to 1; got 0 to 2"),
    (".vtu", MeshTri(), {"cell_data": {"region": [1, 2]}}, "'region' has a name that write_mesh reserves for the mesh"),
    ("", curved_annulus(12), {}, r"of Elmer is written with straight sides only; got a MeshTri2\. Write its cor"),
    ("", two_rooms(), {}, "groups must not overlap in Elmer; 'right side' and 'low' do"),
    ("", MeshTri(), {"cell_data": {"e": [1, 2]}}, "a mesh of Elmer holds no fields; write them to a file"),
    *(
        (suffix, GRID_8, {"point_data": {name: np.zeros(shape) for name, shape in fields.items()}}, said)
        for suffix, fields, said in OF_ORDERS
    ),
    (".vtu", GRID_8, {"point_data": {"u": np.full((6, 8), np.nan)}}, "point_data 'u'.*finite"),
    (".vtu", GRID_8, {"point_data": ZEROS, "positions": np.zeros((2, 9))}, r"\(2, k \* nelements\) = \(2, 80\)"),
    (".vtu", GRID_8, {"point_data": {"u": np.zeros(9)}, "positions": PLACES}, "but point_data has none"),
    (".vtu", curved_annulus(24), {"point_data": {"u": np.zeros(71)}}, r"'u' must have shape \(240,\); got \(71,\)"),
    *(
        (".msh", MeshTri(), {"groups": Groups({(2, number): "a"})}, "integers from 1 to 2147483647; 'a' has ")
        for number in (0, -3, 2**31, 1.5, "7", True)
    ),
]


@pytest.mark.parametrize(("suffix", "mesh", "data", "said"), WRITES)
def test_what_is_not_written_leaves_no_file(tmp_path, suffix, mesh, data, said):
    with pytest.raises(ValueError, match=said):
        write_mesh(tmp_path / f"m{suffix}", mesh, **data)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("suffix", "way"),
    [(".xdmf", "meshio convert 'm.vtu' 'm.xdmf'")]
    + [(suffix, f"gmsh 'm.msh' -save -o 'm{suffix}'") for suffix in (".med", ".inp", ".mesh", ".su2", ".vtk")],
)
@pytest.mark.parametrize("mesh", [two_rooms(), two_boxes(1)], ids=["plane", "space"])
def test_a_refusal_to_write_names_the_way_to_the_format(tmp_path, suffix, way, mesh):
    with pytest.raises(ValueError, match=rf"Write 'm\.\w+' and convert it: {way}"):
        write_mesh(tmp_path / f"m{suffix}", mesh)
