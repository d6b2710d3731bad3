"""The command `run`: its files, what it says, and how it ends."""

import contextlib
import io
import json
import re

import meshio
import numpy as np
import pytest
from helpers.cases import report_in, run_command, table_of
from helpers.places import EXAMPLES, names_in
from helpers.tensor_meshes import disk
from helpers.worlds import without_matplotlib
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli
from kohonen_adapt.magnetostatics import Magnetostatics

FILES = ["adapted.msh", "adapted.vtu", "history.csv", "inside.vtu", "passes", "report.html"]

CASE = f"""
mesh = {json.dumps(str(EXAMPLES / "c_core.msh"))}
scale = 1e-3
[materials.iron]
permeability = 1000.0
[materials.magnet]
permeability = 1.05
remanence = [0.0, 1.2]
[materials.air]
[potential]
outer = 0.0
[adapt]
passes = 2
[outputs.stored]
quantity = "energy"
"""


@pytest.fixture
def case(tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(CASE)
    return file


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a run with everything it writes but pictures, and what it said; only to be looked at."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "case.toml").write_text(CASE)
    out = folder / "new" / "out"
    with contextlib.redirect_stdout(io.StringIO()) as said, pytest.MonkeyPatch.context() as patched:
        without_matplotlib(patched)
        assert run_command("run", folder / "case.toml", "--out", out) == 0
    return out, said.getvalue()


def test_run_writes_mesh_fields_table_and_report(finished):
    out, said = finished
    assert names_in(out) == FILES
    assert re.findall(r"^pass (\d): 899 nodes", said, re.MULTILINE) == ["0", "1", "2"]
    assert "Energy-norm error %" in said and "Energy error %" in said and "stored (J/m)" in said
    assert said.endswith(f"Files in {out}: adapted.msh, adapted.vtu, inside.vtu, history.csv.\n")
    mesh, fields = ka.read_mesh(out / "adapted.msh", scale=1e-3), meshio.read(out / "adapted.vtu")
    assert set(mesh.subdomains) == {"air", "iron", "magnet"} and set(mesh.boundaries) == {"outer"}
    assert_allclose(mesh.p.T, fields.points[:, :2], rtol=1e-12, atol=1e-17)
    assert set(fields.point_data) == {"A (Wb per m)"}
    assert {"B (T)", "H (A per m)", "indicator"} <= set(fields.cell_data)
    rows = table_of(out / "history.csv")
    assert [row["pass"] for row in rows] == ["0", "1", "2"]
    best = min(float(row["estimate"]) for row in rows)
    assert best == pytest.approx(np.sqrt(np.sum(fields.cell_data["indicator"][0] ** 2)), rel=1e-12)
    assert best < 0.6 * float(rows[0]["estimate"])
    assert all(float(row["output stored (J/m)"]) > 0.0 for row in rows)
    report = report_in(out)
    assert "kohonen-adapt run case.toml --out out" in report and "permeability = 1000.0" in report
    assert "Plan: at most 2 passes" in report and "899 nodes" in report
    assert str(out.parents[1]) not in report and str(EXAMPLES) not in report


def test_the_fields_of_a_run_go_with_its_mesh_once_more(finished, tmp_path, capsys):
    """The mesh is in millimetres, as it came, and the fields are in metres."""
    adapted, fields, out = finished[0] / "adapted.msh", finished[0] / "adapted.vtu", tmp_path / "moved.msh"
    relocate = ["relocate", str(adapted), "--indicators", f"{fields}:indicator", "--out", str(out), "--quiet"]
    assert cli.main(relocate) == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        f"kohonen-adapt: read_field expected the mesh in '{fields}' at a scale of 1; its scale is 0.001, so the "
        "units differ. Use --scale 0.001 (metres per unit of the mesh, for a field file in metres)."
    )
    assert run_command(*relocate, "--scale", "0.001") == 0
    before, after = ka.read_mesh(adapted), ka.read_mesh(out)
    eta = meshio.read(fields).cell_data["indicator"][0]
    wanted = ka.relocate(before, ka.density_from_indicators(before, eta))
    assert_allclose(after.p, wanted.p, rtol=1e-12)
    assert set(after.subdomains) == set(before.subdomains)
    assert run_command(*relocate, "--scale", "0") == 2
    assert capsys.readouterr().err.endswith("scale must be a finite number > 0; got 0.0.\n")


def test_quiet_says_nothing(case, out, capfd, monkeypatch):
    without_matplotlib(monkeypatch)
    case.write_text(CASE.replace("passes = 2", "passes = 0"))
    assert run_command("run", case, "--out", out, "--quiet") == 0
    assert capfd.readouterr().out == ""
    assert "report.html" in names_in(out)


def test_a_dry_run_solves_and_writes_nothing(case, out, tmp_path, capsys, monkeypatch):
    def solve(*given):
        raise RuntimeError("a dry run must not solve")

    monkeypatch.setattr(Magnetostatics, "solve", solve)
    assert run_command("run", case, "--dry-run", "--out", out) == 0
    assert "no faults found;" in capsys.readouterr().out
    assert names_in(tmp_path) == ["case.toml"]


def test_what_is_not_toml(refused):
    refused(CASE.replace("1000.0", "1000,0"), "case.toml: is not TOML: ")
    remedy = "Text needs quotes (single quotes if it has a backslash); numbers need a decimal point, not a comma."
    refused(CASE.replace("1000.0", "1000,0"), remedy)


def test_a_mesh_is_no_case(capsys):
    mesh = EXAMPLES / "c_core.msh"
    assert run_command("run", mesh, "--dry-run") == 2
    error = capsys.readouterr().err
    assert (
        error.endswith(f". This is a mesh; create a case for it: kohonen-adapt init {mesh}.\n")
        and error.count("\n") == 1
    )


def test_a_warning_is_one_line(case, capsys):
    case.write_text(CASE.replace("permeability = 1000.0", "bh = [[1.0, 500.0], [1.2, 700.0]]"))
    assert run_command("run", case, "--dry-run", "--quiet") == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("kohonen-adapt: warning: the table ends at 1.2 T, 700 A/m far from saturation")


def test_without_matplotlib_there_are_the_other_files(case, out, capsys, monkeypatch):
    case.write_text("order = 1\n" + CASE.replace("passes = 2", "passes = 0"))
    without_matplotlib(monkeypatch)
    assert run_command("run", case, "--out", out) == 0
    names = ["adapted.msh", "adapted.vtu", "history.csv", "passes", "report.html"]  # nothing more inside of order 1
    assert names_in(out) == names
    assert "<img " not in report_in(out)
    assert (
        'Pictures need matplotlib: pip install "kohonen-adapt[plot]", then run the command again.'
        in capsys.readouterr().out
    )


def test_without_a_folder(case, capsys):
    assert run_command("run", case) == 2
    assert capsys.readouterr().err == (
        "kohonen-adapt: run expected --out DIR (folder for the results), --resume DIR or --dry-run.\n"
    )


def test_a_problem_without_a_solution_is_no_wrong_use(case, out, capsys, monkeypatch):
    def solve(self, mesh):
        raise np.linalg.LinAlgError("no finite solution")

    monkeypatch.setattr(Magnetostatics, "solve", solve)
    assert run_command("run", case, "--out", out) == 1
    assert capsys.readouterr().err.endswith("kohonen-adapt: no finite solution\n")
    assert [file.name for file in out.rglob("*")] == ["passes"]


def test_a_problem_that_fails_on_the_way_leaves_the_best_pass(case, out, capsys, monkeypatch):
    def solve_from(self, *given):
        raise RuntimeError("no second time")

    monkeypatch.setattr(Magnetostatics, "solve_from", solve_from)
    without_matplotlib(monkeypatch)  # pictures would take most of the time
    assert run_command("run", case, "--out", out) == 1
    assert "no second time" in capsys.readouterr().err
    assert "adapted.msh" in names_in(out)


def test_how_far_curves_are_from_their_facets_is_said_once_in_the_unit_of_the_file(out, tmp_path, capsys, monkeypatch):
    without_matplotlib(monkeypatch)
    mesh = disk([5.0, 10.0, 15.0, 20.0], {"magnet": 2, "air": 4})
    ka.write_mesh(tmp_path / "round.msh", mesh)
    (tmp_path / "case.toml").write_text(
        'mesh = "round.msh"\nscale = 1e-3\norder = 1\npotential.outer = 0.0\nadapt.passes = 2\n'
        "[materials.magnet]\nremanence = [0.0, 1.0]\n[materials.air]\n"
    )
    assert run_command("run", tmp_path / "case.toml", "--out", out) == 0
    heard = capsys.readouterr()
    found = re.findall(r"[Cc]urves are up to|distance of curves", heard.out + heard.err)
    sagitta = 10.0 * (1.0 - np.cos(np.pi / 12))  # of the magnet, which has 12 facets around
    (line,) = [line for line in heard.out.splitlines() if line.startswith("Largest distance of curves from ")]
    assert len(found) == 1 and line.endswith(f"before {sagitta:.3g}, in the unit of round.msh.")
