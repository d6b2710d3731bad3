"""Files of other programs come in with the names they have: written by Gmsh, meshio and scikit-fem."""

import meshio
import numpy as np
import pytest
import skfem
from helpers.mesh_files import assert_same, gmsh, gmsh_session, in_front, needs_gmsh, sizes, two_rooms
from helpers.places import EXAMPLES
from helpers.small_files import ABAQUS, SU2
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt.mesh.measures import signed_area

SUFFIXES = [".vtk", ".inp", ".mesh", ".su2", ".med"]
BOXES = """
SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 1}; Box(2) = {1, 0, 0, 1, 1, 1};
BooleanFragments{ Volume{1, 2}; Delete; }{}
Physical Volume("core") = {1}; Physical Volume("air") = {2}; Mesh.MeshSizeMin = 0.5; Mesh.MeshSizeMax = 0.5;
Physical Surface("wall") = Surface In BoundingBox{0.9, -0.1, -0.1, 1.1, 1.1, 1.1};
Physical Surface("floor") = Surface In BoundingBox{-0.1, -0.1, -0.1, 2.1, 1.1, 0.1};
"""
DRAWINGS = {2: (EXAMPLES / "actuator.geo").read_text(encoding="utf-8"), 3: BOXES}


def skip_without_h5py(suffix):
    if suffix in (".med", ".xdmf"):
        pytest.importorskip("h5py")


@pytest.fixture(scope="module")
def by_gmsh(tmp_path_factory):
    """The same mesh in every format, by its dimension."""
    folder = tmp_path_factory.mktemp("formats")
    for dimension, text in DRAWINGS.items():
        (folder / "drawing.geo").write_text(text)
        with gmsh_session() as model:
            gmsh.open(str(folder / "drawing.geo"))
            model.mesh.generate(dimension)
            for suffix in (".msh", *SUFFIXES):
                gmsh.write(str(folder / f"{dimension}{suffix}"))
    return folder


@needs_gmsh
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("dimension", DRAWINGS)
def test_mesh_and_names_are_those_of_gmsh(by_gmsh, dimension, suffix):
    """Numbers stand for names in .vtk and .mesh; .su2 names boundaries only."""
    skip_without_h5py(suffix)
    wanted, mesh = (ka.read_mesh(by_gmsh / f"{dimension}{each}") for each in (".msh", suffix))
    assert_allclose(mesh.p, wanted.p, rtol=1e-12, atol=1e-7 if suffix == ".mesh" and dimension == 3 else 1e-12)
    assert_array_equal(*(np.unique(np.sort(each.t, axis=0), axis=1) for each in (mesh, wanted)))
    assert np.all(signed_area(mesh) > 0) or dimension == 2
    (parts, sides), (wanted_parts, wanted_sides) = sizes(mesh), sizes(wanted)
    if suffix in (".vtk", ".mesh"):
        assert all(name.startswith("region_") for name in parts)
        assert_allclose(*(sorted(each.values()) for each in (parts, wanted_parts)), rtol=1e-6)
        assert len(sides) >= len(wanted_sides)
    else:
        assert (mesh.subdomains is None) == (suffix == ".su2")
        for found, names in ((parts, wanted_parts), (sides, wanted_sides)):
            assert not found or {name: found[name] for name in names} == pytest.approx(names)


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
    meshio.gmsh.read(EXAMPLES / "getdp.msh").write(tmp_path / f"m{suffix}")
    mesh, wanted = ka.read_mesh(tmp_path / f"m{suffix}"), ka.read_mesh(EXAMPLES / "getdp.msh")
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
