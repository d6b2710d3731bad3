"""Writing and reading meshes: names to the letter, coordinates to the bit, files whole or not at all."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from helpers.curved_meshes import curved_annulus
from helpers.examples import examples
from helpers.mesh_files import SUFFIXES, assert_same, assert_same_directions, two_boxes, two_rooms
from helpers.meshes import square
from helpers.places import names_in
from helpers.worlds import full_disk
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from skfem import MeshTet, MeshTet2, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt import read_field, read_mesh, write_mesh


def directed():
    """Two rooms with facets that two boundaries have in opposite directions."""
    mesh = two_rooms()
    around = mesh.facets_around("low")
    inside = OrientedBoundary(around, np.where(mesh.f2t[1, around] < 0, 0, 1 - around.ori))
    return mesh.with_boundaries({"around": around, "inside": inside}, boundaries_only=False)


def large():
    """More elements than are handled together."""
    mesh = square(183).with_boundaries({"left": lambda x: x[0] == 0})
    return mesh.with_subdomains({"low": lambda x: x[1] < 0.9, "all": np.arange(mesh.nelements)})


def curved_boxes():
    """Two boxes with every middle of an edge moved."""
    mesh = MeshTet2.from_mesh(two_boxes(2))
    off = np.random.default_rng(0).uniform(-0.01, 0.01, mesh.p.shape) * (np.arange(mesh.p.shape[1]) >= mesh.nvertices)
    return MeshTet2(mesh.p + off, mesh.t, two_boxes(2).boundaries, two_boxes(2).subdomains)


MESHES = {
    "plane": two_rooms,
    "space": two_boxes,
    "directions": directed,
    "more names than an integer has bits": lambda: (
        MeshTri().refined(3).with_subdomains({f"name {k}": np.arange(k, 128) for k in range(80)})
    ),
    "large": large,
    "curved": lambda: curved_annulus(24),
    "curved in space": curved_boxes,
}


@pytest.mark.parametrize("make", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_written_comes_back_and_is_left_alone(tmp_path, suffix, make):
    mesh, path, values = make(), tmp_path / f"mesh{suffix}", np.linspace(0.0, 1.0, make().nelements)
    data = {"field": values}
    write_mesh(path, mesh, cell_data=data)
    assert_same(mesh, make())
    assert data.keys() == {"field"} and np.array_equal(values, np.linspace(0.0, 1.0, mesh.nelements))
    back = read_mesh(path)
    assert_same(back, mesh)
    assert_same_directions(back, mesh)
    assert type((back.boundaries or {}).get("outer", np.empty(0))) is np.ndarray
    assert_array_equal(read_field(path, back, "field"), values)


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
def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path, suffix):
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, MeshTri())
    before = path.read_bytes()
    with full_disk(lambda target: True), pytest.raises(OSError, match="No space left on device") as caught:
        write_mesh(path, two_rooms())
    assert caught.value.filename == str(path)
    assert names_in(tmp_path) == [path.name] and path.read_bytes() == before


def test_paths_may_be_strings(tmp_path):
    write_mesh(str(tmp_path / "mesh.MSH"), MeshTri())
    assert_same(read_mesh(str(tmp_path / "mesh.MSH")), MeshTri())
    assert Path(tmp_path / "mesh.MSH").read_text().startswith("$MeshFormat\n4.1 0 8\n")
