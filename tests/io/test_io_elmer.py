"""Meshes of Elmer: a folder in and out with every name, number and orientation."""

import numpy as np
import pytest
from helpers.mesh_files import assert_same, assert_same_directions, two_boxes, two_rooms
from helpers.places import names_in
from helpers.small_files import GRID, written
from numpy.testing import assert_array_equal
from skfem import MeshTet, MeshTri
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt.cases import fitting_mesh, read_case

FILES = ("mesh.header", "mesh.nodes", "mesh.elements", "mesh.boundary", "mesh.names")


def rooms():
    """No element in two subdomains, no facet in two boundaries; some in none."""
    mesh = two_rooms()
    subdomains = {name: mesh.subdomains[name] for name in ("left", "right side")}
    boundaries = {name: mesh.boundaries[name] for name in ("outer", "floor")}
    mesh = MeshTri(mesh.p, mesh.t, boundaries, {**subdomains, "left": subdomains["left"][:-3]})
    around = mesh.facets_around("right side")
    inner = mesh.f2t[1, around] >= 0
    inside = OrientedBoundary(np.asarray(around)[inner], around.ori[inner])
    return mesh.with_boundaries({"inside": inside}, boundaries_only=False)


def boxes():
    """Two of the names of every kind, which do not overlap."""
    mesh = two_boxes(2)
    boundaries = {name: mesh.boundaries[name] for name in ("outer", "wall")}
    return MeshTet(mesh.p, mesh.t, boundaries, {name: mesh.subdomains[name] for name in ("low", "upper half")})


@pytest.mark.parametrize(("make", "kinds"), [(rooms, "2 202 20 303 64"), (boxes, "2 303 64 504 384")])
def test_round_trip(tmp_path, make, kinds):
    mesh = make()
    ka.write_mesh(tmp_path / "elmer", mesh)
    back = ka.read_mesh(tmp_path / "elmer")
    assert_same(back, mesh)
    assert_same_directions(back, mesh)
    assert names_in(tmp_path / "elmer") == sorted(FILES)
    assert (tmp_path / "elmer" / "mesh.header").read_text().split()[3:] == kinds.split()


def test_a_folder_that_is_there_keeps_its_other_files(tmp_path):
    (tmp_path / "case.sif").write_text("Header")
    ka.write_mesh(tmp_path, MeshTri().refined(1))
    ka.write_mesh(tmp_path, MeshTri())
    assert_same(ka.read_mesh(tmp_path), MeshTri())
    assert names_in(tmp_path) == sorted([*FILES, "case.sif"])


def test_what_elmergrid_writes(tmp_path):
    mesh = ka.read_mesh(written(tmp_path, GRID), scale=1e-3)
    assert_array_equal(1e3 * mesh.p, [[0, 1, 0], [1, 0, 0]])
    assert {name: rows.tolist() for name, rows in mesh.subdomains.items()} == {"core": [0]}
    assert {name: len(rows) for name, rows in mesh.boundaries.items()} == {"far away": 2, "boundary_5": 1}


def test_names_are_not_needed(tmp_path):
    """ElmerSolver writes padded columns, and no names."""
    padded = {name: text.replace(" ", "     ") for name, text in GRID.items() if name != "mesh.names"}
    mesh = ka.read_mesh(written(tmp_path, padded))
    assert set(mesh.subdomains) == {"region_3"} and set(mesh.boundaries) == {"boundary_2", "boundary_5"}


def test_numbers_are_kept(tmp_path):
    written(tmp_path / "one", GRID)
    groups = ka.read_groups(tmp_path / "one")
    assert groups.names == {(0, 6): "point_6", (1, 2): "far away", (1, 5): "boundary_5", (2, 3): "core"}
    ka.write_mesh(tmp_path / "two", ka.read_mesh(tmp_path / "one"), groups=groups)
    again = ka.read_groups(tmp_path / "two").names
    assert again == {key: name for key, name in groups.names.items() if key[0] > 0}


def test_a_case_may_name_a_folder(tmp_path):
    ka.write_mesh(tmp_path / "mesh", rooms())
    (tmp_path / "case.toml").write_text(
        'mesh = "mesh"\nmaterials = {left = {}, "right side" = {}}\n[potential]\nfloor = 0.0\n'
    )
    with pytest.raises(ValueError, match="every element needs a material; 3 of 64 have none"):
        fitting_mesh(read_case(tmp_path / "case.toml"))
