"""Files of other programs come in with the names they have: written by Gmsh, meshio and scikit-fem."""

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
        for suffix in (".msh", *SUFFIXES):
            gmsh.write(str(folder / f"m{suffix}"))
    return folder


@needs_gmsh
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_mesh_and_names_are_those_of_gmsh(by_gmsh, suffix):
    """Numbers stand for names in .vtk and .mesh; .su2 names boundaries only."""
    skip_without_h5py(suffix)
    wanted, mesh = (ka.read_mesh(by_gmsh / f"m{each}") for each in (".msh", suffix))
    assert_allclose(mesh.p, wanted.p, rtol=1e-12, atol=1e-12)
    assert_array_equal(mesh.t, wanted.t)
    if suffix in (".vtk", ".mesh"):
        assert all(name.startswith("region_") for name in mesh.subdomains)
        areas = [sorted(area(each)[rows].sum() for rows in each.subdomains.values()) for each in (mesh, wanted)]
        assert_allclose(*areas, rtol=1e-12)
        assert sum(map(len, mesh.boundaries.values())) >= sum(map(len, wanted.boundaries.values()))
        return
    for name, rows in wanted.boundaries.items():
        assert_array_equal(np.sort(mesh.boundaries[name]), np.sort(rows))
    assert (mesh.subdomains is None) == (suffix == ".su2")
    for name, rows in wanted.subdomains.items() if mesh.subdomains else ():
        assert_array_equal(mesh.subdomains[name], np.sort(rows))


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
