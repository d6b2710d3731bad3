"""The command `check`: what it says of good meshes and of every kind of fault."""

import re
from itertools import chain, combinations

import numpy as np
import pytest
from helpers.cases import run_command, said_of, whole
from helpers.mesh_files import two_rooms
from helpers.meshes import disk, named, slit, square
from helpers.places import EXAMPLES
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli
from kohonen_adapt.commands.check import faults, hints_of_mesh


def test_a_good_mesh(capsys):
    assert run_command("check", EXAMPLES / "c_core.msh", "--scale", "1e-3") == 0
    lines = capsys.readouterr().out.splitlines()
    mesh = ka.read_mesh(EXAMPLES / "c_core.msh", scale=1e-3)
    value = ka.quality(mesh)
    assert lines[0] == "size: 0.14 x 0.14 m, 899 nodes, 1696 triangles"
    for line, (name, rows) in zip(lines[1:4], sorted(mesh.subdomains.items()), strict=True):
        assert re.fullmatch(rf"subdomain '{name}': {len(rows)} triangles, [\d.]+ m\^2", line)
    assert lines[4] == f"boundary 'outer': {len(mesh.boundaries['outer'])} facets"
    lines = lines[2:]
    assert lines[3] == "coverage: 1696 triangles in one subdomain, 0 in none, 0 in two or more"
    assert lines[4].startswith(f"quality: worst {value.min():.3g} (triangle {np.argmin(value)} near (")
    assert lines[4].endswith(f"mean {value.mean():.3g}")
    assert lines[5].startswith("smallest angle: ")
    assert lines[6] == "boundaries and interfaces: 22 segments, 22 straight, 0 on arcs, 0 closed"
    assert lines[7].startswith("nodes: ") and lines[7].endswith(" 16 at corners, 4 fixed")
    assert lines[8:] == ["No faults found."]


def test_held_nodes_are_counted_by_reason(capsys):
    assert run_command("check", "--nodes", EXAMPLES / "c_core.msh", "--scale", "1e-3") == 0
    held = capsys.readouterr().out.partition("held nodes: ")[2].splitlines()
    assert held[:3] == [
        "20",
        "  12: corner of subdomains 'air', 'iron', 90 degrees",
        "  4: corner of boundary 'outer', 90 degrees",
    ]


def test_arcs_have_radii(tmp_path, capsys):
    said = said_of(whole(disk(6, 0.25)), tmp_path, capsys)
    assert "boundaries and interfaces: 1 segment, 0 straight, 1 on arcs (radius 0.25 m), 1 closed" in said


def test_the_smallest_angle(tmp_path, capsys):
    assert "smallest angle: 45 degrees" in said_of(whole(square(2)), tmp_path, capsys)


@pytest.mark.parametrize(("scale", "doubt"), [("1", "that looks like millimetres"), ("5", "a scale of 5 looks too")])
def test_a_large_mesh_is_no_fault(scale, doubt, capsys):
    assert run_command("check", EXAMPLES / "c_core.msh", "--scale", scale) == 0
    assert f"hint: the mesh is {140 * int(scale)} x {140 * int(scale)} m: {doubt}" in capsys.readouterr().out


def test_names_that_overlap_or_lack(tmp_path, capsys):
    said = said_of(two_rooms(), tmp_path, capsys)
    assert "in two or more" in said and said.endswith("\nNo faults found.\n")  # "left" and "right side" are enough
    mesh = two_rooms()
    few = {name: mesh.subdomains[name] for name in ("left", "low")}
    said = said_of(MeshTri(mesh.p, mesh.t, mesh.boundaries, few), tmp_path, capsys)
    assert re.search(r"- \d+ triangles are in no subdomain, one near \(", said)
    assert re.search(r"- \d+ triangles are in more than one subdomain, one near \(", said)
    said = said_of(square(4), tmp_path, capsys)
    assert "- 32 triangles are in no subdomain, one near (" in said
    assert 'hint: no boundary has a name: for a potential, write rim = "outer"' in said


@given(st.lists(st.lists(st.integers(0, 5), min_size=1, max_size=3, unique=True), min_size=1, max_size=6))
def test_names_that_overlap_are_no_fault_where_some_are_enough(names):
    """Six squares in a row, in all names that are drawn, which are enough if some name every square once."""
    mesh = MeshTri.init_tensor(np.arange(7.0), np.arange(2.0))
    square_of = mesh.p[0, mesh.t].mean(axis=0).astype(int)
    sets = {str(k): np.flatnonzero(np.isin(square_of, squares)) for k, squares in enumerate(names)}
    chosen = [sorted(chain(*part)) for r in range(1, 7) for part in combinations(names, r)]
    said = " ".join(faults(mesh.with_subdomains(sets)))
    assert ("more than one" in said) == (sorted(set(chain(*names))) not in chosen)


def test_a_subdomain_that_consists_of_others_is_no_fault(tmp_path, capsys):
    """All that turns, for `[turn]` of a case, or a second name."""
    half = {"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5}
    mesh = square(8).with_subdomains(half | {"all": lambda x: x[0] > -1.0, "right_half": half["right"]})
    said = said_of(mesh.with_boundaries({"rim": mesh.boundary_facets()}), tmp_path, capsys)
    assert said.endswith("\nNo faults found.\n")
    assert "hint: subdomain 'all' consists of 'left', 'right'" in said


def of(x, y, *elements):
    return MeshTri(np.array([x, y], float), np.array(elements).T)


SEAMS = {
    "Unless a slit is intended, merge them": slit(4),
    "1 hanging node, at (0.5, 0), inside an edge of another triangle": of(
        [0, 1, 0, 1, 0.5, 1], [0, 0, 1, 1, 0, -1], [0, 1, 2], [1, 3, 2], [0, 4, 5], [4, 1, 5]
    ),
    "1 non-manifold node, at (0, 0): parts of the mesh touch only in a point": of(
        [0, 1, 0, -1, 0], [0, 0, 1, 0, -1], [0, 1, 2], [0, 3, 4]
    ),
}


@pytest.mark.parametrize("said", SEAMS)
def test_seams_are_faults_at_a_place(said):
    assert sum(said in fault for fault in faults(whole(SEAMS[said]))) == 1


def test_bad_elements():
    mesh = whole(MeshTri.init_tensor(np.linspace(0, 1, 5), np.linspace(0, 0.01, 3)))
    (found,) = [hint for hint in hints_of_mesh(mesh) if "quality" in hint]
    assert found.startswith("16 triangles have a quality below 0.3, the default of min_quality; the worst, ")


@pytest.mark.parametrize("layers", [1, 2])
def test_a_gap_of_one_layer_is_a_hint(layers, tmp_path, capsys):
    ticks = np.concatenate([[0.0, 0.4, 0.8], np.linspace(0.8, 0.9, layers + 1)[1:], [1.3, 1.7]])
    mesh = MeshTri.init_tensor(np.linspace(0, 2, 8 * layers), ticks)
    mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()}).with_subdomains(
        {"gap": lambda x: np.abs(x[1] - 0.85) < 0.05, "rest": lambda x: np.abs(x[1] - 0.85) > 0.05}
    )
    lines = said_of(mesh, tmp_path, capsys).splitlines()
    hint = lines[-2].startswith("hint: subdomain 'gap' has 1 layer of elements between its sides near (")
    assert lines[-1] == "No faults found." and hint == (layers == 1)


def test_a_region_of_many_elements_is_not_thin_where_its_sides_meet(capsys):
    """Near a corner one of its 1128 elements joins them."""
    assert run_command("check", EXAMPLES / "getdp.msh") == 0
    assert "layer" not in capsys.readouterr().out


def test_no_fault_in_a_mesh_with_every_kind_of_name():
    said = " ".join(faults(named(8)))
    assert "hanging" not in said and "coincident rim node" not in said


def test_the_status_is_in_the_help(capsys):
    with pytest.raises(SystemExit):
        run_command("check", "--help")
    said = " ".join(capsys.readouterr().out.split())
    assert "The exit status is 0 without faults, 1 with faults, and 2 if the file cannot be read." in said


def test_no_mesh(tmp_path, capsys):
    assert run_command("check", tmp_path / "none.msh") == 2
    assert "read_mesh expected a mesh file; there is none at" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["check", "run", "dry run", "relocate"])
def test_a_name_that_no_file_can_carry_is_refused_before_the_solve(command, tmp_path, capsys):
    file, case, out, name = tmp_path / "it.msh", tmp_path / "it.toml", tmp_path / "out", "r" * 128
    ka.write_mesh(file, whole(square(4)), cell_data={"rho": np.ones(32)})
    file.write_text(file.read_text().replace('"rim"', f'"{name}"'))
    case.write_text(f'mesh = "it.msh"\n[materials.all]\ncurrent_density = 1e6\n[potential]\n{name} = 0.0\n')
    arguments = {
        "check": ["check", str(file)],
        "run": ["run", str(case), "--out", str(out)],
        "dry run": ["run", str(case), "--dry-run"],
        "relocate": ["relocate", str(file), "--density", f"{file}:rho", "--out", f"{out}.msh"],
    }[command]
    assert cli.main(arguments) == (1 if command == "check" else 2)
    said = "".join(capsys.readouterr())
    assert f"the name of a boundary must have at most 127 bytes, because Gmsh cuts longer names; got '{name}'." in said
    assert "pass 0" not in said
    assert not out.exists() and not out.with_suffix(".msh").exists()
