"""Files of other programs come in with the names they have: written by Gmsh, meshio and scikit-fem."""

import subprocess
import sys

import meshio
import numpy as np
import pytest
import skfem
from helpers.mesh_files import assert_same, gmsh, gmsh_session, in_front, needs_gmsh, two_rooms
from helpers.places import EXAMPLES
from helpers.small_files import ABAQUS, SU2
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt.mesh.measures import area

SUFFIXES = [".vtk", ".inp", ".mesh", ".su2", ".med"]
DRAWING = EXAMPLES / "actuator.geo"


def skip_without_h5py(suffix):
    if suffix in (".med", ".xdmf"):
        pytest.importorskip("h5py")


@pytest.fixture(scope="module")
def by_gmsh(tmp_path_factory):
    """The same mesh in every format."""
    folder = tmp_path_factory.mktemp("formats")
    with gmsh_session() as model:
        gmsh.open(str(DRAWING))
        model.mesh.generate(2)
        for suffix in (".msh", ".unv", ".cgns", *SUFFIXES):
            gmsh.write(str(folder / f"m{suffix}"))
    return folder


def both(folder, suffix):
    """The mesh of Gmsh, and that of a file in another format."""
    skip_without_h5py(suffix)
    return ka.read_mesh(folder / "m.msh"), ka.read_mesh(folder / f"m{suffix}")


@needs_gmsh
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_mesh_is_that_of_gmsh(by_gmsh, suffix):
    wanted, mesh = both(by_gmsh, suffix)
    assert_allclose(mesh.p, wanted.p, rtol=1e-12, atol=1e-12)
    assert_array_equal(mesh.t, wanted.t)


@needs_gmsh
@pytest.mark.parametrize("suffix", [".inp", ".su2", ".med"])
def test_names_that_the_format_has(by_gmsh, suffix):
    wanted, mesh = both(by_gmsh, suffix)
    for name, rows in wanted.boundaries.items():
        assert_array_equal(np.sort(mesh.boundaries[name]), np.sort(rows))
    if suffix == ".su2":  # it names boundaries only
        assert mesh.subdomains is None
        return
    for name, rows in wanted.subdomains.items():
        assert_array_equal(mesh.subdomains[name], np.sort(rows))


@needs_gmsh
@pytest.mark.parametrize("suffix", [".unv", ".cgns"])
def test_what_a_refusal_names_converts_with_all_names(by_gmsh, suffix):
    with pytest.raises(ValueError, match=rf"gmsh 'm{suffix}' -save -o NEW\.msh"):
        ka.read_mesh(by_gmsh / f"m{suffix}")
    with gmsh_session():
        gmsh.open(str(by_gmsh / f"m{suffix}"))
        gmsh.write(str(by_gmsh / "new.msh"))
    wanted, mesh = ka.read_mesh(by_gmsh / "m.msh"), ka.read_mesh(by_gmsh / "new.msh")
    for kind in ("subdomains", "boundaries"):
        sizes = [{name: len(rows) for name, rows in getattr(each, kind).items()} for each in (mesh, wanted)]
        assert sizes[0] == sizes[1]


@needs_gmsh
@pytest.mark.parametrize("suffix", [".vtk", ".mesh"])
def test_numbers_stand_for_names_that_the_format_has_not(by_gmsh, suffix):
    wanted, mesh = both(by_gmsh, suffix)
    assert all(name.startswith("region_") for name in mesh.subdomains)
    areas = [sorted(area(each)[rows].sum() for rows in each.subdomains.values()) for each in (mesh, wanted)]
    assert_allclose(*areas, rtol=1e-12)
    assert sum(map(len, mesh.boundaries.values())) >= sum(map(len, wanted.boundaries.values()))


def spaceless():
    """The names without spaces, which old VTK files cannot hold; with an orientation and a field."""
    mesh = two_rooms()
    names = [{name.replace(" ", "_"): rows for name, rows in s.items()} for s in (mesh.boundaries, mesh.subdomains)]
    mesh = skfem.MeshTri(mesh.p, mesh.t, *names)
    return mesh.with_boundaries({"around": mesh.facets_around("low")}, boundaries_only=False)


@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".xdmf"])
def test_what_scikit_fem_saves(suffix, tmp_path):
    skip_without_h5py(suffix)
    mesh = spaceless()
    nodal = 1.0 + mesh.p[0]
    mesh.save(tmp_path / f"m{suffix}", {"n": nodal}, {"e": [np.arange(64.0)]})
    back = ka.read_mesh(tmp_path / f"m{suffix}")
    assert_same(back, mesh)
    assert in_front(back, "around") == in_front(mesh, "around")
    assert_array_equal(ka.read_field(tmp_path / f"m{suffix}", mesh, "e"), np.arange(64.0))
    assert_allclose(ka.read_field(tmp_path / f"m{suffix}", mesh, "n"), nodal[mesh.t].mean(axis=0), rtol=1e-14)


@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".xdmf", ".med"])
def test_what_meshio_makes_of_a_gmsh_file(suffix, tmp_path):
    """As for FEniCS: the numbers of groups are data of cells."""
    skip_without_h5py(suffix)
    meshio.gmsh.read(DRAWING.with_name("getdp.msh")).write(tmp_path / f"m{suffix}")
    mesh, wanted = ka.read_mesh(tmp_path / f"m{suffix}"), ka.read_mesh(DRAWING.with_name("getdp.msh"))
    assert_array_equal(mesh.p, wanted.p)
    for name, rows in wanted.subdomains.items():
        assert_array_equal(mesh.subdomains[name], rows)
    assert_array_equal(mesh.boundaries["boundary_200"], wanted.boundaries["boundary_200"])


def test_sets_of_abaqus(tmp_path):
    """The first block has none, and two have the same, of which meshio makes the set of other elements."""
    (tmp_path / "m.inp").write_text(ABAQUS)
    mesh = ka.read_mesh(tmp_path / "m.inp")
    assert {name: rows.tolist() for name, rows in mesh.subdomains.items() if len(rows)} == {
        "all of it": [0, 1],
        "some": [1],
    }
    assert mesh.p[1, mesh.facets[:, mesh.boundaries["some"]]].ravel().tolist() == [0.0, 0.0]


def test_markers_of_su2(tmp_path, capsys):
    """Two of which meshio would give the same number, and it would print that it gives any."""
    (tmp_path / "m.su2").write_text(SU2)
    mesh = ka.read_mesh(tmp_path / "m.su2")
    assert {name: len(rows) for name, rows in mesh.boundaries.items()} == {"wall": 1, "1": 1, "far field": 2}
    assert capsys.readouterr() == ("", "")


HUGE = {
    "m.vtk": "# vtk DataFile Version 3.0\ntitle 20261231\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 99999999999 float\n",
    "m.mesh": "MeshVersionFormatted 2\nDimension 2\nVertices\n99999999999\n0 0 0\n",
    "m.su2": SU2.replace("NPOIN= 4", "NPOIN= 99999999999"),
    "m.inp": ABAQUS.replace("1, 3, 2\n", "1, 2000000000, 1\n"),
}


@pytest.mark.parametrize("name", HUGE)
def test_counts_beyond_the_file(name, tmp_path):
    (tmp_path / name).write_text(HUGE[name])
    with pytest.raises(ValueError, match=r"cannot be read: it (announces|has a set from) .* in [0-9]+ bytes\."):
        ka.read_mesh(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("m.vtk", "# vtk DataFile Version 3.0\n\nASCII\nDATASET STRUCTURED_POINTS\n", "has no UNSTRUCTURED_GRID"),
        ("m.inp", ABAQUS + "*INCLUDE, INPUT=/etc/passwd\n", "it includes another file"),
        ("m.inp", ABAQUS + "*ELSET, ELSET=both\nsome\n", "it has a set of sets: list their elements"),
        ("m.inp", ABAQUS.replace("1, 1, 2\n*", "1, 1, 9\n*"), "cannot be read: "),
        ("m.su2", SU2.replace("5 0 2 3 1", "5 0 2 7 1"), "an element has a node that does not exist"),
        ("m.su2", SU2.replace("NPOIN= 4", "POINTS= 4"), "cannot be read: UnboundLocalError"),
        ("m.mesh", "MeshVersionFormatted 2\nDimension 2\nVertices\n2\n0 0 0 zero one 0\n", "cannot be read"),
    ],
)
def test_what_is_refused(name, text, said, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=said) as refusal:
        ka.read_mesh(tmp_path / name)
    assert str(tmp_path / name) in str(refusal.value)


def xdmf(item):
    return (
        '<Xdmf Version="3.0"><Domain><Grid><Geometry GeometryType="XY"><DataItem Dimensions="3 2" '
        f"{item}</DataItem></Geometry></Grid></Domain></Xdmf>"
    )


@pytest.mark.parametrize(
    ("item", "said"),
    [
        ('Format="HDF">../m.h5:/a', "its data must be in a file in the same folder; there is no file '../m.h5'"),
        ('Format="HDF">/dev/zero:/a', "its data must be in a file in the same folder"),
        ('Format="HDF">none.h5:/a', "its data must be in a file in the same folder"),
        ('Format="Binary">/dev/zero', "its data has the format 'Binary'; write it with HDF or XML"),
    ],
)
def test_xdmf_opens_nothing_but_what_is_beside_it(item, said, tmp_path):
    pytest.importorskip("h5py")
    (tmp_path / "m.xdmf").write_text(xdmf(item))
    with pytest.raises(ValueError, match=said):
        ka.read_mesh(tmp_path / "m.xdmf")


def test_without_h5py_the_error_names_the_extra(tmp_path):
    (tmp_path / "m.med").write_bytes(b"")
    code = "import sys; sys.modules['h5py'] = None; import kohonen_adapt as ka; ka.read_mesh(sys.argv[1])"
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "m.med"], capture_output=True, text=True, check=False)
    assert 'ImportError: read_mesh needs h5py for a MED file: pip install "kohonen-adapt[files]".' in done.stderr
