"""Hostile files: a reader gives what is there, or a ValueError or OSError of one line that names the file.

No crash, no hang, no memory beyond a multiple of the file by chance, and no entity of another file is opened.
"""

import os
import tracemalloc
import warnings
from contextlib import suppress
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import pytest
from helpers.examples import examples
from helpers.hostile_files import raw_vtu, spoilt
from helpers.mesh_files import assert_same, of_meshio, two_rooms
from helpers.places import names_in
from helpers.processes import python
from helpers.small_files import ABAQUS, BY_HAND, GMSH, GRID, SQUARE, SU2, disc, written
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.cases import read_case
from kohonen_adapt.magnetostatics import read_bh
from kohonen_adapt.mesh.validity import check_mesh

PATIENCE = 20_000  # ms: none of these files takes a tenth of a second; a loop without end does
MEMORY = 120 * 2**20  # bytes: the files have some ten kilobytes
LONGEST = 1000  # characters of a message


def refused_or_read(reader, path, *arguments):
    """What a reader gives, or None where it refuses as it may."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return reader(path, *arguments)
        except (ValueError, OSError) as error:
            said = str(error)
            assert str(path) in said and "\n" not in said and len(said) < LONGEST
            return None


def within_memory(read):
    tracemalloc.start()
    try:
        read()
        assert tracemalloc.get_traced_memory()[1] < MEMORY
    finally:
        tracemalloc.stop()


CASE = """mesh = "m.msh"
scale = 1e-3
periodic = [["left", "right"]]
[materials.iron]
bh = [[1.0, 500.0], [1.9, 2e4], [2.2, 2e5]]
[materials."the air"]
permeability = 1.0
[potential]
outer = 0.0
[adapt]
passes = 4
layers = {gap = 2}
pinned = ["iron", 3]
[outputs.f]
quantity = "force"
body = "iron"
component = "x"
"""
TEXTS = {
    **BY_HAND,
    "case.toml": CASE,
    "steel.csv": "B, H\n# measured\n1.0, 500\n1.5, 3000\n1.9, 20000\n2.2, 200000\n",
    "f.pos": 'View "f" {\nST(0,0,0,1,0,0,0,1,0){1,2,3};\nST(1,0,0,1,1,0,0,1,0){1,2,3};\n};\n',
    "f.sol": "MeshVersionFormatted 2\n\nDimension 2\n\nSolAtVertices\n4\n2 1 3\n" + 4 * "0.5 4 0 1e2\n" + "\nEnd\n",
    "abaqus.inp": ABAQUS,
    "sets.inp": f"{SQUARE}*NSET, NSET=a\n1, 4\n*SURFACE, NAME=b\niron, S1\n12, E2\n",
    "su2.su2": SU2,
    "femm.ans": disc()[2],
    **{f"elmer/{name}": text for name, text in GRID.items()},
}
BINARY = ["41.msh", "22.msh", "binary_41.msh", "binary_22.msh", "our.vtu", "text.vtu", "plain.vtu", "raw.vtu"]
SEEDS = [*BINARY, "binary.vtk", "text.vtk", "meshio.mesh", *TEXTS]


def seeds(folder):
    """Return the content of every good file by its name in `SEEDS`, some of them written by `write_mesh` and meshio."""
    mesh = two_rooms()
    fields = {"point_data": {"n": mesh.p[0]}, "cell_data": {"e": np.arange(64.0)}}
    for name, suffix in (("41.msh", ".msh"), ("22.msh", ".msh2"), ("our.vtu", ".vtu")):
        ka.write_mesh(folder / f"seed{suffix}", mesh, **fields)
        (folder / f"seed{suffix}").rename(folder / name)
    content = of_meshio(mesh, cell_data={"e": [np.arange(64.0)]})
    tags = {name: [np.ones(64, np.int32)] for name in ("gmsh:physical", "gmsh:geometrical")}
    dimensions = {"gmsh:dim_tags": np.tile([2, 1], (mesh.nvertices, 1))}
    for version, data, name in (("gmsh22", {}, "binary_22.msh"), ("gmsh", dimensions, "binary_41.msh")):
        meshio.write(folder / name, of_meshio(mesh, point_data=data, cell_data=tags), version, binary=True)
    meshio.vtu.write(folder / "text.vtu", content, binary=False)
    meshio.vtu.write(folder / "plain.vtu", content, compression=None)
    (folder / "raw.vtu").write_bytes(raw_vtu())
    for binary, name in ((True, "binary.vtk"), (False, "text.vtk")):
        meshio.vtk.write(folder / name, content, binary=binary)
    meshio.medit.write(folder / "meshio.mesh", meshio.Mesh(mesh.p.T, content.cells))
    binaries = {file.name: file.read_bytes() for file in folder.iterdir()}
    return binaries | {name: text.encode() for name, text in TEXTS.items()}


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return seeds(tmp_path_factory.mktemp("seeds"))


def read_by_all(path):
    """Read a file by every function that takes its suffix, fields on the mesh of the file if there is one."""
    if path.suffix in OTHERS:
        return refused_or_read(OTHERS[path.suffix], path)
    mesh = None if path.suffix in (".pos", ".sol") else refused_or_read(ka.read_mesh, path)
    if path.suffix in (".msh", ".vtu"):
        refused_or_read(ka.read_groups, path)
    other = MeshTri() if path.suffix == ".sol" else two_rooms()
    for name in FIELDS.get(path.suffix, ()):
        refused_or_read(ka.read_field, path, usable(mesh) or other, name)
    if path.suffix == ".msh":  # on the mesh of the good files, as what came of the file may be no mesh to work with
        refused_or_read(ka.read_curves, path, two_rooms())


def usable(mesh):
    """Return the mesh, or None if it is no mesh to work with."""
    with suppress(ValueError), np.errstate(all="ignore"):
        check_mesh(mesh)
        return mesh


FIELDS = {".msh": "en", ".vtu": "en", ".vtk": "e", ".pos": "f", ".sol": ["solution 1", "solution 2"]}
OTHERS = {".toml": read_case, ".csv": read_bh}


@pytest.mark.parametrize("name", SEEDS)
@examples(50, deadline=PATIENCE, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_spoilt_files(good, tmp_path_factory, name, data):
    folder, in_folder = tmp_path_factory.mktemp("spoilt"), name.startswith("elmer/")
    path = folder / Path(name).name
    if in_folder:
        written(folder, GRID)
    path.write_bytes(data.draw(spoilt(good[name])))
    within_memory(lambda: read_by_all(folder if in_folder else path))


def special(kind, folder, suffix):
    """The path of something that is no plain file."""
    path = folder / f"it{suffix}"
    if kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "loop":
        path.symlink_to(path)
    elif kind == "folder":
        path.mkdir()
    return path


READERS = {
    "mesh": (ka.read_mesh, ".msh"),
    "vtu": (ka.read_mesh, ".vtu"),
    "groups": (ka.read_groups, ".msh"),
    "curves": (lambda path: ka.read_curves(path, two_rooms()), ".msh"),
    "field": (lambda path: ka.read_field(path, two_rooms(), "f"), ".vtu"),
    "bh": (read_bh, ".csv"),
    "case": (read_case, ".toml"),
}


@pytest.mark.parametrize("kind", ["device", "pipe", "loop", "folder", "nothing"])
@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_plain_file_is_not_opened(reader, kind, tmp_path):
    read, suffix = READERS[reader]
    path = special(kind, tmp_path, suffix)
    with pytest.raises(FileNotFoundError) as refusal:
        read(path)
    assert str(path) in str(refusal.value)


LAUGHS = '<!DOCTYPE VTKFile [<!ENTITY a "ha">{}]>'.format(
    "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(12))
)
OUTSIDE = '<!DOCTYPE VTKFile [<!ENTITY m SYSTEM "file:///etc/passwd">]>'


def entities(types, encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?>{types}<VTKFile type="UnstructuredGrid">&m;</VTKFile>'
    return text.encode(encoding)


TRAPS = [
    *(partial(entities, types, encoding) for types in (LAUGHS, OUTSIDE) for encoding in ("utf-8", "utf-16")),
    lambda: raw_vtu().replace(b"Points>", b"Point>"),
    lambda: f"<VTKFile>{'<a>' * 100_000}{'</a>' * 100_000}</VTKFile>".encode(),
]


@pytest.mark.parametrize("content", TRAPS)
def test_traps_of_vtu(content, tmp_path):
    (tmp_path / "m.vtu").write_bytes(content())
    with pytest.raises(ValueError, match="cannot be read: "):
        within_memory(lambda: ka.read_mesh(tmp_path / "m.vtu"))


LIMITED = """
import resource, sys, skfem, kohonen_adapt as ka
now = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (now + 2**31, resource.RLIM_INFINITY))
for path in sys.argv[1:]:
    try:
        ka.read_field(path, skfem.MeshTri(), 'f') if path.endswith('.pos') else ka.read_mesh(path)
    except ValueError as error:
        print(error)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc to know the memory of a process")
def test_files_that_do_not_fit_into_memory(tmp_path):
    """In a process that may have two gigabytes more than it has after its imports."""
    paths = [tmp_path / name for name in ("m.msh", "m.vtu", "f.pos")]
    for path in paths:
        path.write_bytes(b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n")
        os.truncate(path, 2**36)  # takes no space: nothing but holes
    done = python("-c", LIMITED, *paths)
    assert done.stdout == "".join(f"'{path}' does not fit into memory.\n" for path in paths)


@pytest.mark.parametrize(
    ("name", "content", "size", "said"),
    [
        ("m.msh", b"", 2**40, r"expected a Gmsh file; '.*' has no section \$MeshFormat"),
        ("m.toml", b"a." * 5_000_000 + b"b = 1", 10_000_005, "a case has at most 1000000 bytes; this has 10000005"),
    ],
)
def test_a_large_file_is_not_read(name, content, size, said, tmp_path):
    with (tmp_path / name).open("wb") as stream:
        stream.write(content)
        stream.truncate(size)
    with pytest.raises(ValueError, match=said):
        within_memory(lambda: (read_case if name == "m.toml" else ka.read_mesh)(tmp_path / name))


def test_an_entity_in_thousands_of_groups(tmp_path):
    """Two hundred kilobytes that stand for forty million memberships."""
    groups, elements = (range(1, 1 + count) for count in (2000, 20_000))
    text = GMSH.replace("1 0 1 1 0\n$End", f"1 0 {len(groups)} {' '.join(map(str, groups))} 0\n$End")
    rows = "\n".join(f"{number} 1 2 3" for number in elements)
    (tmp_path / "m.msh").write_text(text.replace("2 1 2 1\n1 1 2 3", f"2 1 2 {len(elements)}\n{rows}"))
    with pytest.raises(ValueError, match="it has elements in more groups than a mesh of its size can need"):
        within_memory(lambda: ka.read_mesh(tmp_path / "m.msh"))


@pytest.mark.parametrize(
    "options",
    [
        {"binary": False},
        {"compression": None},
        {"compression": None, "header_type": "UInt64"},
        {"compression": "lzma"},
        {"header_type": "UInt64"},
    ],
    ids=str,
)
def test_every_form_of_vtu(options, tmp_path):
    mesh, path = two_rooms(), tmp_path / "m.vtu"
    field = np.arange(64.0) / 3
    meshio.vtu.write(path, of_meshio(mesh, cell_data={"e": [field]}), **options)
    back = ka.read_mesh(path)
    rtol = 1e-10 if options.get("binary") is False else 0.0  # meshio writes eleven digits
    assert_allclose(back.p, mesh.p, rtol=rtol)
    assert_array_equal(back.t, mesh.t)
    assert_allclose(ka.read_field(path, mesh, "e"), field, rtol=rtol)


@pytest.mark.parametrize("version", [b"0.1", b"2.2"])
def test_raw_data_as_paraview_appends_it(version, tmp_path):
    """Of version 2.2 as VTK 9.4 and ParaView 5.13 write it: meshio refuses it, but triangles are in it as they were."""
    path = tmp_path / "m.vtu"
    path.write_bytes(raw_vtu().replace(b'version="0.1"', b'version="%s"' % version))
    mesh = ka.read_mesh(path)
    assert_same(mesh, type(mesh)(np.array([[0.0, 1, 0, 1], [0, 0, 1, 1]]), np.array([[0, 1], [1, 3], [2, 2]])))
    assert_array_equal(ka.read_field(path, mesh, "e"), [1.5, 2.5])
    assert names_in(tmp_path) == ["m.vtu"]


def test_points_that_come_again(tmp_path):
    """One for each corner that it is, of programs with discontinuous elements, is the same node to a field."""
    piece = (
        '<Piece NumberOfPoints="6" NumberOfCells="2"><Points><DataArray type="Float64" NumberOfComponents="3">'
        "0 0 0 1 0 0 0 1 0 1 0 0 1 1 0 0 1 0</DataArray></Points><Cells>"
        '<DataArray type="Int32" Name="connectivity">0 1 2 3 4 5</DataArray><DataArray type="Int32" Name="offsets">3 6'
        '</DataArray><DataArray type="UInt8" Name="types">5 5</DataArray></Cells>'
        '<CellData><DataArray type="Float32" Name="e">1.5 2.5</DataArray></CellData></Piece>'
    )
    grid = '<VTKFile type="UnstructuredGrid"><UnstructuredGrid>{}</UnstructuredGrid></VTKFile>'
    (tmp_path / "m.vtu").write_text(grid.format(piece))
    assert ka.read_mesh(tmp_path / "m.vtu").p.shape == (2, 6)
    (tmp_path / "one.vtu").write_bytes(raw_vtu())
    assert_array_equal(ka.read_field(tmp_path / "m.vtu", ka.read_mesh(tmp_path / "one.vtu"), "e"), [1.5, 2.5])
    (tmp_path / "m.vtu").write_text(grid.format(2 * piece))
    with pytest.raises(ValueError, match="it has 2 pieces instead of one: merge them, in ParaView by Merge"):
        ka.read_mesh(tmp_path / "m.vtu")
