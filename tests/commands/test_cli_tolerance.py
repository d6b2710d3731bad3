"""Tolerances in cases and on the command line: nodes and orders follow, errors are told, and mistakes are named."""

import pytest
from helpers.cases import case_in, report_in, run_command, table_of
from helpers.worlds import without_matplotlib

import kohonen_adapt as ka
from kohonen_adapt.cases import read_case
from kohonen_adapt.display import by_error

CASE = """
mesh = "mesh.msh"
scale = 1e-3
[materials.core]
permeability = 1000.0
remanence = [0.0, 1.2]
[materials.air]
[potential]
outer = 0.0
[adapt]
[outputs.stored]
quantity = "energy"
[outputs.calm]
quantity = "flux_density"
at = [1e-4, 5e-4]
component = "y"
"""
GOAL = CASE.replace("scale", 'goal = {quantity = "energy", part = "core"}\nscale')


@pytest.fixture
def run(tmp_path, capsys, monkeypatch):
    """Write a mesh of 81 nodes and the case, call the command, and return its exit status and what it says."""
    without_matplotlib(monkeypatch)

    def called(text, *arguments, command="run"):
        case_in(tmp_path, text)
        try:
            status = run_command(command, tmp_path / "case.toml", *arguments)
        except SystemExit as refusal:
            status = refusal.code
        said = capsys.readouterr()
        return status, said.out + said.err

    return called


def adapting(keys, text=CASE):
    return text.replace("[adapt]", f"[adapt]\n{keys}")


@pytest.mark.parametrize(
    ("text", "options", "plan"),
    [
        (CASE, [], "at most 4 passes without a tolerance (rtol), with 81 nodes of order 2."),
        (
            CASE,
            ["--rtol", "1e-3"],
            "at most 12 passes, until the estimated error is at most 0.1 % of the energy norm, with at most 200000 "
            "nodes of orders 2 to 8.",
        ),
        (
            adapting("rtol = 0.05\natol = 0.1\noutput_rtol = {stored = 0.01}\npasses = 1\nmax_nodes = 500"),
            ["--rtol", "0.02", "--max-nodes", "90"],
            "at most 1 pass, until the estimated error is at most 2 % of the energy norm plus 0.1 sqrt(J/m) and that "
            "of 'stored' is at most 1 %, with at most 90 nodes of orders 2 to 8.",
        ),
        (
            adapting("output_rtol = {stored = 0.01}"),
            ["--output-rtol", "0.02"],
            "at most 12 passes, until the estimated error of every output is at most 2 %, with at most 200000 nodes of "
            "orders 2 to 8.",
        ),
        (
            GOAL,
            ["--goal-rtol=0.01", "--output-rtol=0.1"],
            "at most 12 passes, until the estimated error of the goal is at most 1 % and that of every output is at "
            "most 10 %, with at most 200000 nodes of orders 2 to 8.",
        ),
        (
            "order = 5\n" + adapting("target_nodes = 100\nrtol = 0.01"),
            [],
            "at most 4 passes, until the estimated error is at most 1 % of the energy norm, with 81 to 100 nodes of "
            "order 2, then one solve of order 5.",
        ),
        (adapting("passes = 0"), [], "solve and estimate 81 nodes without a pass."),
    ],
)
def test_a_dry_run_says_what_a_run_does(text, options, plan, run):
    status, said = run(text, "--dry-run", *options)
    assert status == 0 and said.endswith(f"nodes.\nPlan: {plan}\n")


def test_check_says_of_a_case_what_a_dry_run_says(run):
    assert run(adapting("rtol = 0.01"), command="check") == run(adapting("rtol = 0.01"), "--dry-run")
    for options in (["--nodes"], ["--scale", "1e-3"]):
        status, said = run(CASE, *options, command="check")
        assert status == 2 and "--nodes, --surfaces and --scale are for meshes; a case has its own" in said


def test_tolerances_of_the_command_replace_those_of_the_case(run, tmp_path):
    case, out = adapting("rtol = 0.5\noutput_rtol = {stored = 0.5}\nseed = 1"), tmp_path / "out"
    status, said = run(case, "--rtol", "2e-3", "--output-rtol", "1e-4", "--out", out)
    assert status == 0
    options = "--rtol=0.002 --output-rtol=0.0001"
    assert f"kohonen-adapt run {tmp_path / 'case.toml'} {options} --resume {out}" in said
    first, *_, last = table_of(out / "history.csv")
    assert float(last["estimate"]) <= 2e-3 * float(last["energy_norm"]) < float(first["estimate"])
    for name in ("stored (J/m)", "calm (T)"):
        value, error = float(last[f"output {name}"]), float(last[f"error of output {name}"])
        assert 0.0 < abs(error) <= 1e-4 * abs(value)
        assert float(last[f"corrected output {name}"]) == value + error
        assert f"{name} {by_error(value, error)}, estimated error" in said and "(asked 0.01 %)" in said
    assert said.count("  error %") == said.count("  corrected") == 2 and ", error of stored (J/m) " in said
    report = report_in(out)
    assert f"kohonen-adapt run case.toml {options} --out out" in report
    assert "until the estimated error is at most 0.2 % of the energy norm and that of every output is at most" in report
    assert "<h3>Seed</h3>\n<pre>1</pre>" in report
    assert "<dt>error of stored (J/m)</dt>" in report and "<dt>corrected stored (J/m)</dt>" in report
    assert last["order"] != first["order"] == "2" and "<th>order</th>" in report and "  order  " in said


def test_a_goal_has_its_error_in_every_pass(run, out):
    status, said = run(GOAL, "--goal-rtol", "1e-6", "--out", out)
    assert status == 0 and "(asked 0.0001 %)" in said
    rows = table_of(out / "history.csv")
    assert all(row["goal error (J/m)"] for row in rows)
    assert abs(float(rows[-1]["goal error (J/m)"])) <= 1e-6 * abs(float(rows[-1]["goal (J/m)"]))
    report = report_in(out)
    assert (
        "until the estimated error of the goal is at most 0.0001 %" in report and "<dt>error of the goal</dt>" in report
    )


def test_the_largest_number_of_nodes_ends_a_run_with_its_report(run, out):
    case = "order = 1\n" + CASE
    status, said = run(case, "--rtol", "1e-3", "--max-nodes", "200", "--out", out)
    assert status == 0 and "Stopped at 200 nodes (`max_nodes` 200)" in said
    assert "<dd>maximum number of nodes</dd>" in report_in(out)


def test_a_resumed_run_goes_on_to_a_smaller_tolerance(run, tmp_path):
    case, out = "order = 2\n" + CASE, tmp_path / "out"
    assert run(case, "--rtol", "0.01", "--out", out)[0] == 0
    passes = len(table_of(out / "history.csv"))
    assert run(case, "--rtol", "0.005", "--resume", out)[0] == 0
    rows = table_of(out / "history.csv")
    assert float(rows[-1]["estimate"]) <= 0.005 * float(rows[-1]["energy_norm"])
    assert len(rows) > passes


def test_outputs_with_tolerances_have_the_labels_of_tables(run, tmp_path):
    run(adapting("output_rtol = {calm = 0.1}"), "--dry-run")
    case = read_case(tmp_path / "case.toml")
    assert case.options(ka.read_mesh(tmp_path / "mesh.msh", scale=1e-3))["output_rtol"] == {"calm (T)": 0.1}


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (adapting('rtol = "1e-3"'), [], "adapt.rtol must be a finite number; got '1e-3'. Write it without quotes."),
        (
            adapting('output_rtol = "1 %"'),
            [],
            "adapt.output_rtol must be a finite number or a table of keys; got '1 %'.",
        ),
        (adapting('output_rtol = {stored = "1"}'), [], "adapt.output_rtol.stored must be a finite number; got '1'."),
        (
            adapting("output_rtol = {stord = 0.1}"),
            [],
            "adapt.output_rtol.stord: the case has no such output; outputs are 'calm', 'stored'. Did you mean 'sto",
        ),
        (adapting("max_nodes = 80\nrtol = 0.1"), [], "max_nodes must be at least the nodes of the mesh, 81; got 80."),
        (CASE, ["--goal-rtol", "0.1"], "adapt: goal_rtol requires a problem with a goal"),
        (
            GOAL,
            ["--rtol", "0.1"],
            "adapt.rtol is relative to the energy norm, which does not measure a goal; give goal_",
        ),
        (
            GOAL.replace("outputs.calm", "outputs.goal"),
            [],
            "outputs.goal: the goal of the case is shown under this name",
        ),
        (
            CASE,
            ["--rtol", "0.1%"],
            "argument --rtol: expected a fraction from 0 to 1, such as 1e-3 for 0.1 %; got '0.1%'",
        ),
        (CASE, ["--output-rtol", "nan"], "argument --output-rtol: expected a fraction from 0 to 1"),
        (CASE, ["--max-nodes", "1e5"], "argument --max-nodes: invalid int value: '1e5'"),
        (adapting("rtol = 2"), [], "adapt: rtol must be a fraction, at most 1; got 2.0. Write 0.01 for 1 %."),
        (adapting("output_rtol = {stored = 5}"), [], "must be a fraction, at most 1; got 5.0."),
        (
            'order = 5\nestimator = "recovery"\n' + CASE,
            [],
            "order 5 have the estimator 'residual' only; got 'recovery'.",
        ),
        ('order = "Auto"\n' + CASE, [], "order must be a whole number from 1 to 8, or \"auto\"; got 'Auto'."),
    ],
)
def test_careless_uses_are_named_in_one_line(text, options, said, run):
    status, printed = run(text, "--dry-run", *options)
    assert status == 2
    assert sum(said in line for line in printed.splitlines()) == 1


def test_without_outputs_there_is_nothing_to_tolerate(run):
    status, said = run(CASE.partition("[outputs.stored]")[0], "--dry-run", "--output-rtol", "0.1")
    assert status == 2 and "adapt: output_rtol requires outputs" in said
