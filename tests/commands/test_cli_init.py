"""The command `init`: a case that runs as it stands, for meshes with names of all kinds."""

import shutil
import tomllib

import numpy as np
import pytest
from helpers.cases import dry_run, run_command
from helpers.examples import examples
from helpers.mesh_files import two_rooms
from helpers.meshes import centres, square
from helpers.places import EXAMPLES
from hypothesis import given
from hypothesis import strategies as st
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli
from kohonen_adapt.cases import case_text


@pytest.mark.parametrize("name", ["c_core", "actuator_1", "motor"])
def test_the_case_runs_dry_once_the_potential_is_chosen(name, tmp_path, capsys):
    shutil.copy(EXAMPLES / f"{name}.msh", tmp_path)
    (tmp_path / "cases").mkdir()
    case = tmp_path / "cases" / "new.toml"
    assert run_command("init", tmp_path / f"{name}.msh", "--scale", "1e-3", "-o", case) == 0
    said = capsys.readouterr().out
    assert said == f"Wrote {case}. Fill in its materials and potential, then: kohonen-adapt run {case} --dry-run\n"
    written, mesh = tomllib.loads(case.read_text()), ka.read_mesh(tmp_path / f"{name}.msh")
    assert written["mesh"] == f"../{name}.msh" and written["scale"] == 1e-3
    assert set(written["materials"]) == set(mesh.subdomains)
    assert len(written["potential"]) == (name != "motor")
    assert all(f"\n{boundary} = 0.0" in case.read_text().replace("\n# ", "\n") for boundary in mesh.boundaries)
    assert dry_run(case, case.read_text().replace("# outer = 0.0", "outer = 0.0")) == 0


def test_without_a_boundary_on_most_of_the_rim_the_user_chooses():
    """The longest boundaries of the motor are its antiperiodic sides."""
    text = case_text(ka.read_mesh(EXAMPLES / "motor.msh", scale=1e-3), "motor.msh", 1e-3)
    assert tomllib.loads(text)["potential"] == {}
    assert (
        "# No boundary covers more than half of the rim: set 0 where no flux leaves, but not on periodic sides.\n"
        "# inner = 0.0  # 5.76 % of the rim\n"
        "# left = 0.0  # 31.8 % of the rim\n"
        "# outer = 0.0  # 30.7 % of the rim\n"
        "# right = 0.0  # 31.8 % of the rim\n"
        "# ring = 0.0  # has facets inside the mesh\n"
    ) in text


def test_millimetres_taken_for_metres_are_doubted(tmp_path, capsys):
    arguments = ["init", str(EXAMPLES / "c_core.msh"), "-o", str(tmp_path / "new.toml")]
    assert cli.main(arguments) == 0
    assert "kohonen-adapt: warning: the mesh is " in capsys.readouterr().err


def test_it_does_not_overwrite(tmp_path, capsys):
    shutil.copy(EXAMPLES / "c_core.msh", tmp_path)
    (tmp_path / "c_core.toml").write_text("mine")
    assert run_command("init", tmp_path / "c_core.msh") == 2
    case = tmp_path / "c_core.toml"
    assert case.read_text() == "mine"
    assert capsys.readouterr().err == (
        f"kohonen-adapt: init does not overwrite '{case}'; choose another name with -o CASE.toml.\n"
    )


def test_overlapping_names_are_commented_out(tmp_path):
    ka.write_mesh(tmp_path / "rooms.msh", two_rooms())
    assert run_command("init", tmp_path / "rooms.msh") == 0
    text = (tmp_path / "rooms.toml").read_text()
    assert set(tomllib.loads(text)["materials"]) == {"left", "right side"}
    assert "# [materials.low]" in text and "# interface = 0.0" in text and '# "wall and floor" = 0.0' in text
    assert dry_run(tmp_path / "rooms.toml", text.replace('# "wall and floor"', '"wall and floor"')) == 0


def test_no_flux_leaves_where_most_of_the_rim_is():
    """Not on the longest boundary, which is inside, nor on the rim of a hole."""
    mesh = square(9, 0.0, 9.0)
    mesh = mesh.remove_elements(np.flatnonzero((np.abs(centres(mesh) - 4.5) < 0.5).all(axis=0)))
    rim = mesh.boundary_facets()
    far = (np.abs(mesh.p[:, mesh.facets[:, rim]].mean(axis=1) - 4.5) > 4).any(axis=0)
    inside = np.setdiff1d(np.arange(mesh.facets.shape[1]), rim)
    mesh = mesh.with_boundaries({"hole": rim[~far], "inside": inside, "outside": rim[far]})
    written = case_text(mesh, "m.msh", 1.0)
    assert tomllib.loads(written)["potential"] == {"outside": 0.0}
    assert "# inside = 0.0  # has facets inside the mesh\n" in written
    assert "# hole = 0.0  # 10 % of the rim\noutside = 0.0  # 90 % of the rim\n" in written


def test_a_mesh_without_names_says_what_it_lacks():
    text = case_text(MeshTri().refined(1), "m.msh", 1.0)
    assert "# 100 % of the area has no material above: give it a surface group of its own" in text
    assert 'rim = "rim"  # a name for the whole rim, holes included; no part of it has a name in the mesh' in text
    assert tomllib.loads(text)["potential"] == {"rim": 0.0}


@examples(40)
@given(st.text(min_size=1), st.text(min_size=1), st.text(min_size=1))
def test_any_name_comes_back(subdomain, boundary, file):
    if subdomain.startswith("gmsh:") or boundary.startswith("gmsh:"):
        return
    mesh = MeshTri().refined(1)
    mesh = mesh.with_subdomains({subdomain: np.arange(mesh.nelements)})
    mesh = mesh.with_boundaries({boundary: mesh.boundary_facets()})
    given = tomllib.loads(case_text(mesh, file, 1e-3))
    assert (set(given["materials"]), set(given["potential"]), given["mesh"]) == ({subdomain}, {boundary}, file)
    assert given["scale"] == 1e-3
