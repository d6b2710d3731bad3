"""Physical groups keep number, dimension and name from file to file: by Gmsh's own account, in MSH 2.2 and 4.1."""

import shutil

import numpy as np
import pytest
from helpers.cases import run_command
from helpers.mesh_files import (
    WHY_NOT,
    assert_same,
    drawn_by_gmsh,
    gmsh,
    groups_in_gmsh,
    measures,
    needs_gmsh,
    two_rooms,
)
from helpers.places import EXAMPLES
from helpers.worlds import without_matplotlib
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.io import Groups

# As a user of GetDP draws: numbers without names, the same number for a line and a surface, a point, an overlap.
DRAWING = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1}; Rectangle(2) = {1, 0, 0, 1, 1}; Coherence;
Point(100) = {0.4, 0.6, 0}; Point{100} In Surface{1};
Physical Surface(1000) = {1}; Physical Surface("air", 3) = {2}; Physical Surface("all", 77) = {1, 2};
Physical Curve(1000) = {4}; Physical Curve("outer", 12) = {1, 4, 5, 6, 7, 3}; Physical Curve(9) = {2};
Physical Point(41) = {100}; Physical Point("corner", 3) = {1};
Mesh.MeshSizeMin = 0.2; Mesh.MeshSizeMax = 0.2;
"""


def assert_same_groups(path, other):
    got, wanted = groups_in_gmsh(path), groups_in_gmsh(other)
    assert got.keys() == wanted.keys()
    for key, (name, _, places) in wanted.items():
        assert got[key][0] == name
        here, there = (measures(each) @ each.mean(axis=1) for each in (got[key][2], places))
        assert_allclose(here, there, rtol=1e-12, atol=1e-12)


@pytest.fixture(params=["2.2", "4.1"])
def drawing(request, tmp_path):
    if gmsh is None:
        pytest.skip(WHY_NOT)
    return drawn_by_gmsh(tmp_path / "drawing.msh", DRAWING, request.param)


NAMES = {
    (0, 3): "corner",
    (0, 41): "point_41",
    (1, 9): "boundary_9",
    (1, 12): "outer",
    (1, 1000): "boundary_1000",
    (2, 3): "air",
    (2, 77): "all",
    (2, 1000): "region_1000",
}


def test_what_a_file_says_of_its_groups(drawing):
    groups, mesh = ka.read_groups(drawing, scale=1e-3), ka.read_mesh(drawing, scale=1e-3)
    assert groups.names == NAMES
    assert_array_equal(groups.points[41], [[0.4e-3], [0.6e-3]])
    assert_array_equal(groups.points[3], [[0.0], [0.0]])
    assert {*mesh.subdomains, *mesh.boundaries} == {name for (dimension, _), name in NAMES.items() if dimension}


@pytest.mark.parametrize("suffix", [".msh", ".msh2"])
def test_gmsh_reads_the_same_groups(drawing, suffix):
    out = drawing.with_name(f"copy{suffix}")
    ka.write_mesh(out, ka.read_mesh(drawing), groups=ka.read_groups(drawing))
    assert_same_groups(out, drawing)
    assert_same(ka.read_mesh(out), ka.read_mesh(drawing))
    assert ka.read_groups(out).names == ka.read_groups(drawing).names


@pytest.mark.parametrize("suffix", [".msh", ".msh2"])
@pytest.mark.parametrize("topology", ["flip", "recycle"])
def test_relocate_keeps_the_groups(drawing, suffix, topology):
    mesh = ka.read_mesh(drawing)
    ka.write_mesh(drawing.with_name("f.vtu"), mesh, cell_data={"rho": np.exp(3 * mesh.p[0, mesh.t].mean(axis=0))})
    out = drawing.with_name(f"out{suffix}")
    field = ["--density", f"{drawing.with_name('f.vtu')}:rho", "--topology", topology]
    assert run_command("relocate", drawing, *field, "--out", out, "--quiet") == 0
    assert_same_groups(out, drawing)
    assert not np.array_equal(ka.read_mesh(out).p, mesh.p)


def test_run_leaves_points_where_they_are(tmp_path, monkeypatch):
    """Where a coarser mesh would do, so that their nodes would be taken away."""
    without_matplotlib(monkeypatch)  # pictures would take most of the time
    mesh = ka.read_mesh(EXAMPLES / "c_core.msh")
    inside = mesh.interior_nodes()
    probes = mesh.p[:, inside[np.argsort(np.hypot(*mesh.p[:, inside]))[-40:]]]
    ka.write_mesh(tmp_path / "c_core.msh", mesh, groups=Groups({(0, 9): "probes"}, {9: probes}))
    shutil.copy(EXAMPLES / "magnet.toml", tmp_path)
    assert run_command("run", tmp_path / "magnet.toml", "--out", tmp_path / "out", "--quiet") == 0
    points = ka.read_groups(tmp_path / "out" / "adapted.msh").points[9]
    assert points.shape == probes.shape
    assert max(np.abs(points - probe[:, None]).max(axis=0).min() for probe in probes.T) < 1e-9


@needs_gmsh
@pytest.mark.parametrize("suffix", [".msh", ".msh2"])
def test_numbers_of_ones_own(tmp_path, suffix):
    names = {(2, 5): "left", (2, 2): "right side", (1, 5): "floor", (0, 8): "origin"}
    path = tmp_path / f"mesh{suffix}"
    ka.write_mesh(path, two_rooms(), groups=Groups(names, {8: np.zeros((2, 1))}))
    found = {key: name for key, (name, *_) in groups_in_gmsh(path).items()}
    assert names.items() <= found.items()
    # Those that have none get new ones, which differ from all others.
    new = found.keys() - names.keys()
    assert {found[key] for key in new} == {"low", "outer", "wall and floor", "interface"}
    assert len({number for _, number in new} | {5, 2, 8}) == len(new) + 3


@pytest.mark.parametrize(
    ("subdomains", "boundaries", "names"),
    [
        (
            {"region_101": np.arange(5), "iron": np.arange(5, 9)},
            {"boundary_101": lambda x: x[0] == 0, "boundary_0": lambda x: x[1] == 0},
            {(1, 2): "boundary_0", (1, 101): "boundary_101", (2, 1): "iron", (2, 101): "region_101"},
        ),
        (
            {"region_4": np.empty(0, np.int32), "all": np.arange(2)},
            {"boundary_9": lambda x: x[0] == 0},
            {(1, 9): "boundary_9", (2, 1): "all", (2, 4): "region_4"},
        ),
    ],
    ids=["numbers", "an empty one"],
)
def test_names_that_are_numbers_need_no_groups(subdomains, boundaries, names, tmp_path):
    mesh = MeshTri().refined(2).with_subdomains(subdomains).with_boundaries(boundaries)
    ka.write_mesh(tmp_path / "mesh.msh", mesh)
    assert ka.read_groups(tmp_path / "mesh.msh").names == names
    assert "region_101" not in (tmp_path / "mesh.msh").read_text()
    assert_same(ka.read_mesh(tmp_path / "mesh.msh"), mesh)


def test_two_numbers_of_one_name_are_reported(tmp_path, caplog):
    mesh = MeshTri().refined(1).with_subdomains({"a": np.arange(4), "b": np.arange(4, 8)})
    ka.write_mesh(tmp_path / "mesh.msh", mesh)
    text = (tmp_path / "mesh.msh").read_text()
    (tmp_path / "mesh.msh").write_text(text.replace('"b"', '"a"'))
    ka.write_mesh(
        tmp_path / "out.msh", ka.read_mesh(tmp_path / "mesh.msh"), groups=ka.read_groups(tmp_path / "mesh.msh")
    )
    assert (
        f"groups 1 and 2 of '{tmp_path / 'mesh.msh'}' have the same name 'a' and are merged into group 1" in caplog.text
    )
    assert ka.read_groups(tmp_path / "out.msh").names == {(2, 1): "a"}


def test_vtu_files_have_no_numbers(tmp_path):
    ka.write_mesh(tmp_path / "mesh.vtu", two_rooms(), groups=Groups({(2, 5): "left"}))
    assert ka.read_groups(tmp_path / "mesh.vtu") == Groups()


@pytest.mark.parametrize(("version", "suffix"), [("2.2", ".msh2"), ("4.1", ".msh")])
def test_the_version_of_msh_is_kept(version, suffix, tmp_path):
    """For programs that read one only; a suffix that says which goes before."""
    mesh = two_rooms()
    ka.write_mesh(tmp_path / f"one{suffix}", mesh)
    (tmp_path / f"one{suffix}").rename(tmp_path / "one.msh")
    assert ka.read_groups(tmp_path / "one.msh").version == version
    ka.write_mesh(tmp_path / "f.vtu", mesh, cell_data={"f": np.ones(64)})
    for name, wanted in (("two.msh", version), ("two.msh2", "2.2")):
        options = ["--density", f"{tmp_path}/f.vtu:f", "--out", str(tmp_path / name), "--quiet"]
        assert run_command("relocate", tmp_path / "one.msh", *options) == 0
        assert (tmp_path / name).read_text().startswith(f"$MeshFormat\n{wanted} 0 8\n")
