"""The command: what it writes, what it says, and how it ends."""

import os
import re
import shutil
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from helpers.cases import run_command
from helpers.places import ROOT, names_in
from helpers.processes import python
from helpers.worlds import without_matplotlib

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli
from kohonen_adapt.commands.arguments import command_parser


def one_line(text):
    return text.count("\n") == 1 and text.startswith("kohonen-adapt: ")


def test_demo_without_matplotlib_names_the_remedy(tmp_path, capsys, monkeypatch):
    without_matplotlib(monkeypatch)
    files = tmp_path / "new" / "folder"
    assert run_command("demo", "magnet", "--out", files) == 0
    assert names_in(files) == ["magnet.msh", "magnet.vtu"]
    said = capsys.readouterr().out
    progress = re.findall(r"^pass (\d): .*, estimate [\d.]+ \(([\d.]+) %\), [\d.]+ s$", said, re.MULTILINE)
    assert [int(number) for number, _ in progress] == [0, 1, 2]
    assert float(progress[2][1]) <= 0.2 < float(progress[1][1])
    assert re.search(r"pass 2: 4\d\d nodes of order 4, estimate", said)
    assert "Converged after 1 pass and a solve of order 4: " in said and "Energy-norm error %" in said
    assert 'Pictures need matplotlib: pip install "kohonen-adapt[plot]", then run the command again.' in said
    assert said.endswith(f"Files in {files}: magnet.msh, magnet.vtu.\n")
    mesh = ka.read_mesh(files / "magnet.msh")
    assert set(mesh.subdomains) == {"air", "iron", "magnet"} and set(mesh.boundaries) == {"outer"}
    assert 400 < mesh.nvertices < 500


@pytest.mark.slow
def test_an_error_in_the_drawing_is_not_taken_for_a_missing_matplotlib(tmp_path):
    code = "import sys; sys.modules['PIL'] = None; from kohonen_adapt.__main__ import main; main()"  # matplotlib's
    done = python("-c", code, "demo", "magnet", "--out", tmp_path, status=1)
    assert "PIL" in done.stderr and "pip install" not in done.stdout
    assert names_in(tmp_path) == ["magnet.msh", "magnet.vtu"]


def test_version(capsys):
    with pytest.raises(SystemExit) as end:
        run_command("--version")
    assert end.value.code == 0
    assert capsys.readouterr().out == f"kohonen-adapt {ka.__version__}\n"


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["demo"],
        ["demo", "magnet"],
        ["demo", "motor", "--out", "x"],
        ["walk"],
        ["run", "c", "--out", "a", "--resume", "b"],
    ],
)
def test_wrong_use(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(arguments)
    assert end.value.code == 2
    assert "usage: kohonen-adapt" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["demo", "magnet"], "DIR"),
        (["run", "case.toml"], "DIR"),
        (["sweep", "case.toml", "--over", "scale=1:2:3"], "DIR"),
        (["relocate", "mesh.msh", "--sizes", "field.vtu:h"], "MESH2"),
        (["init", "mesh.msh"], "CASE.toml"),
    ],
)
def test_out_is_a_folder_for_several_files_and_a_file_for_one(arguments, what, capsys):
    parser = command_parser("", "", {})
    for option in ("-o", "--out"):
        assert parser.parse_args([*arguments, option, "there"]).out == Path("there")
    with pytest.raises(SystemExit):
        parser.parse_args([arguments[0], "--help"])
    assert f"-o {what}, --out {what}" in capsys.readouterr().out.replace("\n", " ")


def test_an_old_spelling_works_with_a_warning(tmp_path, capsys):
    arguments = [
        "init",
        str(ROOT / "examples" / "c_core.msh"),
        "--scale",
        "1e-3",
        "--output",
        str(tmp_path / "new.toml"),
    ]
    assert cli.main(arguments) == 0
    assert (tmp_path / "new.toml").exists()
    said = "kohonen-adapt: warning: --output is deprecated; use --out.\n"
    assert said in capsys.readouterr().err
    with pytest.raises(SystemExit):
        run_command("init", "--help")
    assert "--output" not in capsys.readouterr().out


def test_without_arguments_there_is_the_help(capsys):
    with pytest.raises(SystemExit):
        run_command()
    said = capsys.readouterr().err
    commands = ("demo", "run", "init", "check", "relocate")
    assert all(re.search(rf"^    {name} +\S", said, re.MULTILINE) for name in commands)
    assert " ".join(said.split()).endswith("To begin: kohonen-adapt init MESH.")


def test_out_is_a_file(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert run_command("demo", "magnet", "--out", tmp_path / "file") == 2
    error = capsys.readouterr().err
    assert one_line(error)
    assert f"--out expected a writable folder; cannot write to '{tmp_path / 'file'}': File exists." in error


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not bind the superuser")
def test_out_is_read_only(tmp_path, capsys):
    tmp_path.chmod(0o500)
    assert run_command("demo", "magnet", "--out", tmp_path) == 2
    assert "does not: Permission denied." in capsys.readouterr().err


@pytest.mark.slow
def test_a_missing_example(out, tmp_path):
    shutil.copytree(ROOT / "kohonen_adapt", tmp_path / "kohonen_adapt", ignore=shutil.ignore_patterns("__pycache__"))
    command = "-m", "kohonen_adapt", "demo", "magnet", "--out", out
    done = python(*command, status=2, PYTHONPATH=str(tmp_path), PYTHONSAFEPATH="1")
    expected = f"is missing in {tmp_path / 'kohonen_adapt' / 'data'}. Install kohonen-adapt again."
    assert done.stderr == f"kohonen-adapt: the example 'magnet.toml' {expected}\n"


def test_the_command_is_installed():
    commands = entry_points(group="console_scripts", name="kohonen-adapt")
    if not commands:
        pytest.skip("the package is not installed")
    assert next(iter(commands)).load() is cli.main
