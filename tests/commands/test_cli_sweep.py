"""The command `sweep`: a case for many values of its keys, as a table and a picture, cut short and gone on with."""

import json
import sys

import pytest
from helpers.cases import case_in, run_command, table_of, without_processes
from helpers.meshes import inset

import kohonen_adapt as ka
from kohonen_adapt.cases import fitting_mesh, read_case

CASE = """
mesh = "mesh.msh"
scale = 1e-3
[materials.core]
permeability = 1000.0
remanence = [0.0, 1.2]
current_density = 0.0
[materials.air]
[potential]
outer = 0.0
[adapt]
passes = 1
[outputs.stored]
quantity = "energy"
[outputs.pull]
quantity = "force"
body = "core"
component = "y"
"""
OVER = ["--over", "materials.core.permeability=10:1000:2", "--over", "materials.core.current_density=0:1e6:2"]


@pytest.fixture
def case(tmp_path):
    return case_in(tmp_path, CASE)


@pytest.fixture
def here(monkeypatch):
    without_processes(monkeypatch)


def sweep(case, *arguments):
    """The command, by one process: a second one would begin for nothing."""
    jobs = [] if "--jobs" in arguments or "--scheduler" in arguments else ["--jobs", "1"]
    return run_command("sweep", case, *arguments, *jobs, "--quiet")


def test_every_combination_is_a_row_and_a_point(case, here, tmp_path, capsys):
    assert run_command("sweep", case, *OVER, "--jobs", "1", "-o", tmp_path / "out") == 0
    table = table_of(tmp_path / "out" / "sweep.csv")
    assert list(table[0]) == [
        *("materials.core.permeability", "materials.core.current_density", "stored (J/m)", "pull (N/m)"),
        *("status", "missed", "error"),
    ]
    assert {row["status"] for row in table} == {"max_passes"} and not any(row["missed"] for row in table)
    values = [tuple(float(row[name]) for name in list(row)[:2]) for row in table]
    assert values == [(mu, j) for mu in (10.0, 1000.0) for j in (0.0, 1e6)]
    (tmp_path / "last.toml").write_text(CASE.replace("current_density = 0.0", "current_density = 1e6"))
    last = read_case(tmp_path / "last.toml")
    result = ka.adapt(fitting_mesh(last), last.problem, outputs=last.labelled_outputs, **last.adapt)
    assert {name: float(table[-1][name]) for name in result.best.outputs} == result.best.outputs
    assert (tmp_path / "out" / "sweep.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    said = capsys.readouterr().out
    assert "\nPlan of every case: at most 1 pass without a tolerance (rtol), with 81 nodes of order 2.\n" in said
    assert said.startswith(f"To continue after an interruption: kohonen-adapt sweep {case} --over=materials.core.")
    assert "stored (J/m)" in said and said.endswith(f"Files in {tmp_path / 'out'}: sweep.csv, sweep.json, sweep.png.\n")


def test_a_case_with_an_error_ends_no_sweep(case, here, out, capsys):
    """A negative permeability is refused when it comes to it."""
    assert sweep(case, "--over", "materials.core.permeability=1000:-1000:3", "--out", out) == 1
    errors = [row["error"] for row in table_of(out / "sweep.csv")]
    assert errors[0] == "" and all("permeability" in error for error in errors[1:])
    assert "2 of 3 cases failed; --resume tries them again." in capsys.readouterr().err
    assert (out / "sweep.png").exists()


def test_a_missed_tolerance_is_told(case, here, out, capsys):
    """The error of an output, what is asked of it, and how every case ended, as in a run."""
    options = "passes = 0\noutput_rtol = {stored = 0.1, pull = 1e-9}\nrtol = 1e-9"
    case.write_text(CASE.replace("passes = 1", options).replace("current_density = 0.0", "current_density = 1e6"))
    assert sweep(case, "--over", "materials.core.permeability=10:1000:2", "--out", out) == 0
    table, records = table_of(out / "sweep.csv"), json.loads((out / "sweep.json").read_text())
    for row, record in zip(table, records, strict=True):
        assert row["status"] == record["status"] == "max_passes"
        assert row["missed"] == record["missed"] == "energy, pull (N/m)"
        assert float(row["asked error of stored (J/m)"]) == pytest.approx(0.1 * float(row["stored (J/m)"]))
        assert float(row["error of pull (N/m)"]) == record["error of pull (N/m)"] != 0.0
        assert abs(float(row["error of stored (J/m)"])) < float(row["asked error of stored (J/m)"])
    said = capsys.readouterr().err
    assert "2 of 2 cases missed a tolerance: case 0 (energy, pull (N/m)); case 1 (energy, pull (N/m))." in said


def test_a_goal_is_an_output_of_a_sweep(case, here, out):
    goal = 'goal = {quantity = "energy", part = "core"}\n'
    case.write_text(goal + CASE.replace("passes = 1", "goal_rtol = 0.1"))
    assert sweep(case, "--over", "materials.core.permeability=10:1000:2", "--out", out) == 0
    for row in table_of(out / "sweep.csv"):
        assert row["status"] == "converged" and row["missed"] == ""
        assert abs(float(row["error of goal (J/m)"])) <= float(row["asked error of goal (J/m)"])
        assert float(row["asked error of goal (J/m)"]) == pytest.approx(0.1 * float(row["goal (J/m)"]))


def test_a_sweep_that_was_stopped_before_its_first_case(case, here, out):
    out.mkdir()
    over = ["--over", "materials.core.permeability=10:1000:2"]
    assert sweep(case, *over, "--resume", out) == 0 and len(table_of(out / "sweep.csv")) == 2


@pytest.mark.parametrize(
    ("name", "values"), [("adapt.passes", ["0", "1", "2"]), ('materials."core".permeability', ["1.0", "1.5", "2.0"])]
)
def test_values_are_integers_if_all_are_and_keys_may_be_quoted(name, values, case, here, out):
    assert sweep(case, "--over", f"{name}={values[0][0]}:2:3", "--out", out) == 0
    assert [row[name] for row in table_of(out / "sweep.csv")] == values


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--over", "scale", "--out", "out"], "--over expected NAME=FIRST:LAST:COUNT, as "),
        (["--over", "scale=1:2", "--out", "out"], "got 'scale=1:2'"),
        (["--over", "scale=1:2:0", "--out", "out"], "got 'scale=1:2:0'"),
        (["--over", "scale=1:2:x", "--out", "out"], "got 'scale=1:2:x'"),
        (["--over", "scale=1:inf:3", "--out", "out"], "got 'scale=1:inf:3'"),
        (["--over", "a b=1:2:3", "--out", "out"], "--over expected a dotted key of the case; got 'a b'"),
        (["--over", "scale.x=1:2:3", "--out", "out"], "'scale' is 0.001 in the case, and has no key 'x'"),
        (["--over", "materials.core.permeabilty=1:2:3", "--out", "out"], "Did you mean 'permeability'?"),
        (["--over", "materials.cor.permeability=1:2:3", "--out", "out"], "cor"),
        (["--over", "scale=1:2:3"], "sweep expected --out DIR"),
        (["--over", "scale=1:2:3", "--out", "out", "--jobs", "0"], "processes must be an integer >= 1; got 0"),
        (["--over", "scale=1:2:3", "--resume", "none"], "'none' has no folder 'cases'. Start with --out none."),
    ],
)
def test_wrong_arguments(arguments, said, case, out, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert sweep(case, *arguments) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and said in err
    assert not (out / "cases").exists()


def test_a_case_without_outputs(case, out, capsys):
    case.write_text(CASE.partition("[outputs")[0])
    assert sweep(case, "--over", "scale=1:2:3", "--out", out) == 2
    assert "sweep expected [outputs]" in capsys.readouterr().err


@pytest.mark.slow
def test_what_has_not_ended_is_not_thrown_away(case, out, capsys):
    over = ["--over", "materials.core.permeability=10:1000:2"]
    assert sweep(case, *over, "--out", out) == 0
    first = table_of(out / "sweep.csv")
    (out / "sweep.csv").unlink()  # as if it were cut short
    (out / "cases" / "case-0000.json").unlink()
    assert sweep(case, *over, "--out", out) == 2
    assert f"has cases of an unfinished sweep: continue with --resume {out}" in capsys.readouterr().err
    before = (out / "cases" / "case-0001.json").read_bytes()
    assert sweep(case, *over, "--resume", out) == 0
    assert table_of(out / "sweep.csv") == first and (out / "cases" / "case-0001.json").read_bytes() == before
    assert sweep(case, *over[:-1], "materials.core.permeability=10:1000:4", "--resume", out) == 2
    assert "values of parameters differ" in capsys.readouterr().err
    assert sweep(case, "--over", "scale=1e-3:2e-3:2", "--out", out) == 0  # that one has ended
    assert len(table_of(out / "sweep.csv")) == 2 and "scale" in table_of(out / "sweep.csv")[0]


def test_another_mesh_or_tolerance_is_another_sweep(case, here, out, tmp_path, capsys):
    over = ["--over", "materials.core.permeability=10:1000:2"]
    assert sweep(case, *over, "--out", out) == 0
    assert sweep(case, *over, "--output-rtol", "0.1", "--resume", out) == 2
    mesh = inset(10)
    ka.write_mesh(tmp_path / "mesh.msh", mesh.with_boundaries({"outer": mesh.boundary_facets()}))
    assert sweep(case, *over, "--resume", out) == 2
    assert capsys.readouterr().err.count("its code or data of the function differ") == 2


def test_a_scheduler_without_dask(case, out, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert sweep(case, *OVER, "--scheduler", "tcp://127.0.0.1:1", "--out", out) == 2
    assert 'pip install "kohonen-adapt[sweep]"' in capsys.readouterr().err


@pytest.mark.slow
def test_a_cluster_computes_the_same(case, here, tmp_path):
    distributed = pytest.importorskip("distributed")
    over = ["--over", "materials.core.permeability=10:1000:2"]
    assert sweep(case, *over, "--out", tmp_path / "here") == 0
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        assert sweep(case, *over, "--scheduler", cluster.scheduler_address, "--out", tmp_path / "cluster") == 0
    found, wanted = (table_of(tmp_path / name / "sweep.csv") for name in ("cluster", "here"))
    assert found == wanted and all(row["pull (N/m)"] for row in found)
