"""Writing and reading meshes: names to the letter, coordinates to the bit, files whole or not at all."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from helpers.examples import examples
from helpers.mesh_files import SUFFIXES, assert_same, in_front, two_boxes, two_rooms
from helpers.places import names_in
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from skfem import MeshTet, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt import read_mesh, write_mesh
from kohonen_adapt.mesh.measures import area


@pytest.mark.parametrize("make", [two_rooms, two_boxes])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_keeps_everything(tmp_path, suffix, make):
    mesh = make()
    write_mesh(tmp_path / f"mesh{suffix}", mesh)
    back = read_mesh(tmp_path / f"mesh{suffix}")
    assert_same(back, mesh)
    assert area(back)[back.subdomains["low"]].sum() == area(mesh)[mesh.subdomains["low"]].sum()
    assert not isinstance(back.boundaries["outer"], OrientedBoundary)
    for name in [name for name, rows in mesh.boundaries.items() if isinstance(rows, OrientedBoundary)]:
        assert isinstance(back.boundaries[name], OrientedBoundary) and in_front(back, name) == in_front(mesh, name)


NAMES = st.dictionaries(
    st.text(min_size=1, max_size=20).filter(
        lambda name: name.isprintable() and '"' not in name and name[:5] != "gmsh:"
    ),
    st.sets(st.integers(0, 31)),
    max_size=6,
)


@examples(50)
@given(
    subdomains=NAMES,
    boundaries=NAMES,
    seed=st.integers(0, 2**32 - 1),
    suffix=st.sampled_from(SUFFIXES),
    mesh=st.sampled_from([MeshTri().refined(2), MeshTet.init_tensor(*[np.linspace(0, 1, 3)] * 3).oriented()]),
)
def test_any_names_on_any_sets_come_back(tmp_path_factory, subdomains, boundaries, seed, suffix, mesh):
    # Digits to the last: spread over magnitudes, and off the round numbers of a grid.
    shift = np.random.default_rng(seed).uniform(-0.05, 0.05, mesh.p.shape)
    boundaries, subdomains = (
        {name: np.array(sorted(items), dtype=np.int32) for name, items in sets.items()} or None
        for sets in (boundaries, subdomains)
    )
    mesh = type(mesh)((mesh.p + shift) * 10.0 ** (seed % 13 - 6), mesh.t, boundaries, subdomains)
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
def test_more_elements_than_are_handled_together(tmp_path, suffix):
    mesh = MeshTri.init_tensor(*(np.linspace(0, 1, 200),) * 2).with_boundaries({"left": lambda x: x[0] == 0})
    mesh = mesh.with_subdomains({"low": lambda x: x[1] < 0.9, "all": np.arange(mesh.nelements)})
    write_mesh(tmp_path / f"mesh{suffix}", mesh)
    assert_same(read_mesh(tmp_path / f"mesh{suffix}"), mesh)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_boundary_keeps_its_orientation(tmp_path, suffix):
    """Of facets that two boundaries have in opposite directions, too."""
    mesh = two_rooms()
    around = mesh.facets_around("low")
    inside = OrientedBoundary(around, np.where(mesh.f2t[1, around] < 0, 0, 1 - around.ori))
    mesh = mesh.with_boundaries({"around": around, "inside": inside}, boundaries_only=False)
    write_mesh(tmp_path / f"mesh{suffix}", mesh)
    back = read_mesh(tmp_path / f"mesh{suffix}")
    assert_same(back, mesh)
    assert all(in_front(back, name) == in_front(mesh, name) for name in mesh.boundaries)
    assert {type(back.boundaries[name]) for name in ("around", "inside")} == {OrientedBoundary}
    assert in_front(back, "around") != in_front(back, "inside")
    assert type(back.boundaries["outer"]) is np.ndarray


def test_lines_of_no_direction_are_no_orientation(tmp_path):
    """Else every node where the direction changes would be a corner, and held."""
    write_mesh(tmp_path / "mesh.msh2", two_rooms())
    lines = (tmp_path / "mesh.msh2").read_text().splitlines()
    for number, line in enumerate(lines):
        words = line.split()
        if len(words) == 7 and words[1] == "1":
            lines[number] = " ".join([*words[:5], *sorted(words[5:], key=int, reverse=int(words[5]) % 2 == 0)])
    (tmp_path / "mesh.msh2").write_text("\n".join(lines))
    assert type(read_mesh(tmp_path / "mesh.msh2").boundaries["interface"]) is np.ndarray


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
    assert names_in(tmp_path) == [path.name]
    assert path.read_bytes() == before


def test_paths_may_be_strings(tmp_path):
    write_mesh(str(tmp_path / "mesh.MSH"), MeshTri())
    assert_same(read_mesh(str(tmp_path / "mesh.MSH")), MeshTri())
    assert Path(tmp_path / "mesh.MSH").read_text().startswith("$MeshFormat\n4.1 0 8\n")
