"""A run that is interrupted, killed or out of disk leaves whole files, and goes on to what it would have been."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import meshio
import numpy as np
import pytest
from helpers.cases import INSET as CASE
from helpers.cases import case_in, run_command, run_in, table_of
from helpers.places import ROOT, names_in
from helpers.worlds import full_disk, without_matplotlib

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics

COMMAND = "import sys; from kohonen_adapt.__main__ import main; sys.exit(main())"
# Pictures would take most of the time.
PLAIN_COMMAND = f"import sys; sys.modules['matplotlib'] = None; {COMMAND}"


@pytest.fixture
def case(tmp_path):
    return case_in(tmp_path)


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    without_matplotlib(monkeypatch)


def run(case, *arguments):
    return run_command("run", case, *arguments, "--quiet")


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """The folder of the run of the case that nothing interrupts; only to be looked at."""
    return run_in(tmp_path_factory.mktemp("straight")).parent / "out"


def assert_same_results(one, other):
    for name in ("adapted.msh", "adapted.vtu"):
        assert (one / name).read_bytes() == (other / name).read_bytes()
    assert table_of(one / "history.csv") == table_of(other / "history.csv")


def assert_whole(folder):
    """Whatever stands under a final name can be read, and belongs to a finished pass."""
    if (folder / "adapted.msh").exists():
        ka.read_mesh(folder / "adapted.msh")
    if (folder / "adapted.vtu").exists():
        meshio.read(folder / "adapted.vtu")
    if (folder / "history.csv").exists():
        assert all(float(row["estimate"]) > 0.0 for row in table_of(folder / "history.csv"))
    for file in folder.glob("passes/*.npz"):
        with np.load(file) as content:
            assert all(content[name].dtype != object for name in content.files)


def drafts(folder):
    return [file.name for file in folder.rglob("*.draft")]


# ---- in a process of its own: signals ----


# where a shell started these tests in the background it made them ignore Ctrl-C, which processes inherit
HEARING = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"


@pytest.fixture
def begin():
    """Begin a command in a process of its own, which does not outlive the test."""
    processes = []

    def begun(*arguments, code=PLAIN_COMMAND, path=ROOT):
        environment = {**os.environ, "PYTHONPATH": f"{path}{os.pathsep}{ROOT}"}
        process = subprocess.Popen(
            [sys.executable, "-c", HEARING + code, *map(str, arguments)],
            env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        processes.append(process)
        return process

    yield begun
    for process in processes:
        process.kill()
        process.communicate()


def wait_for_line(process, begins):
    """The lines up to one that begins like that."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if line.startswith(begins):
            return lines
    raise AssertionError(process.stderr.read())


def interrupted(process, begins, number=signal.SIGINT, pause=0.0):
    """End the command after a line that begins like that, and return all lines up to it."""
    lines = wait_for_line(process, begins)
    time.sleep(pause)
    process.send_signal(number)
    process.communicate(timeout=30)
    assert process.returncode == -number
    return lines


STUBBORN = """
import hashlib, sys
from kohonen_adapt.magnetostatics import Magnetostatics

def solve_from(self, *given):
    print("stubborn", flush=True)
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)  # a loop of C that runs for many minutes and hears of nothing

Magnetostatics.solve_from = solve_from
"""


def test_a_loop_that_hears_of_nothing_ends_at_once(case, straight, out, begin):
    process = begin("run", case, "--out", out, code=STUBBORN + PLAIN_COMMAND)
    first, *_ = interrupted(process, "stubborn")
    assert first.endswith(f"To continue after an interruption: kohonen-adapt run {case} --resume {out}\n")
    assert_whole(out)
    assert len(table_of(out / "history.csv")) == 1
    assert run(case, "--resume", out) == 0
    assert_same_results(out, straight)


@pytest.mark.slow
def test_drawing_that_hears_of_nothing_ends_at_once(case, out, tmp_path, begin):
    """Everything else is written by then, and it says so."""
    (tmp_path / "slow").mkdir()
    (tmp_path / "slow" / "matplotlib.py").write_text("sum(range(10**13))  # a loop of C that keeps Python's lock\n")
    process = begin("run", case, "--out", out, code=COMMAND, path=tmp_path / "slow")
    begins = f"Results are in {out}. Drawing pictures and the report; Ctrl-C skips this step."
    interrupted(process, begins, signal.SIGTERM, pause=1.0)  # until it has the lock
    assert_whole(out)
    assert run(case, "--out", tmp_path / "straight") == 0
    assert_same_results(out, tmp_path / "straight")
    assert run(case, "--resume", out) == 0


# ---- killed at every file ----


def killed_at(call, after, case, *arguments):
    """The command in a fork that is killed when it gives a file its name; whether it came to that."""
    child = os.fork()
    if child == 0:
        replace, left = os.replace, [call]

        def fatal(source, target):
            left[0] -= 1
            if after:
                replace(source, target)
            if not left[0]:
                os.kill(os.getpid(), signal.SIGKILL)
            if not after:
                replace(source, target)

        os.replace = fatal
        os._exit(run(case, *arguments))
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL


@pytest.mark.slow
@pytest.mark.parametrize("after", [False, True], ids=["before", "after"])
def test_killed_while_a_file_gets_its_name(after, case, tmp_path):
    """Every other file before it has its name, and those between after that."""
    case.write_text(CASE.replace("passes = 2", "passes = 1"))
    assert run(case, "--out", tmp_path / "straight") == 0
    for call in range(1 + after, 100, 2):
        out = tmp_path / f"killed_{call}"
        if not killed_at(call, after, case, "--out", out):
            break
        assert_whole(out)
        assert after or drafts(out)
        assert run(case, "--resume", out) == 0
        assert not drafts(out)
        assert_same_results(out, tmp_path / "straight")
    # Of each pass mesh, fields, those inside the elements and history, once as a draft and once for good, and the
    # checkpoint; the report; no more. Every second name is tried.
    assert call == 2 * (4 + 4 + 1) + 1 + 2 - after


# ---- a full disk ----


def contents(folder):
    files = [file for file in folder.rglob("*") if file.is_file() and file.parent.suffix != ".draft"]
    return {file: file.read_bytes() for file in files}


@pytest.mark.parametrize("name", ["adapted.msh", "adapted.vtu", "history.csv", "pass-0001.npz"])
def test_a_full_disk_leaves_old_files_as_they_were(name, case, straight, tmp_path, capsys):
    """The disk is full when the file of that name is to be written after the second pass."""
    out, before = tmp_path / "out", {}

    def is_hit(target):
        is_second = (out / "passes" / "pass-0000.npz").exists()
        if is_second and not before:
            before.update(contents(out))
        return is_second and Path(target).name == name

    with full_disk(is_hit):
        assert run(case, "--out", out) == (1 if name == "pass-0001.npz" else 2)
    (line,) = capsys.readouterr().err.splitlines()
    assert "No space left on device" in line and name.partition(".")[0].replace("pass-000", "pass ") in line
    if name == "pass-0001.npz":  # the results of its pass are there before
        before.update({file: file.read_bytes() for file in out.iterdir() if file.is_file()})
    assert contents(out) == before and not drafts(out)
    assert run(case, "--resume", out) == 0
    assert_same_results(out, straight)


# ---- what the options say ----


def test_resume_says_where_it_goes_on(case, tmp_path, capsys):
    assert run(case, "--out", tmp_path / "out") == 0
    case.write_text(CASE.replace("passes = 2", "passes = 3"))
    assert run_command("run", case, "--resume", tmp_path / "out") == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f"Continuing after pass 2, the last finished pass in {tmp_path / 'out'}."
    assert said[3].startswith("pass 3: 81 nodes")
    assert [row["pass"] for row in table_of(tmp_path / "out" / "history.csv")] == ["0", "1", "2", "3"]


def test_a_finished_run_gets_its_files_back(case, out):
    assert run(case, "--out", out) == 0
    before = contents(out)
    for name in ("adapted.msh", "adapted.vtu", "history.csv"):
        (out / name).unlink()
    assert run(case, "--resume", out) == 0
    assert contents(out) == before


def finished(case, out):
    assert run(case, "--out", out) == 0


def unfinished(case, out):
    assert killed_at(10, True, case, "--out", out)


def without_passes(case, out):
    out.mkdir()
    (out / "history.csv").write_text("mine")


@pytest.mark.parametrize("make", [finished, unfinished, without_passes])
def test_run_over_a_run_asks_for_force_and_then_nothing_of_it_stays(make, case, out, capsys):
    make(case, out)
    case.write_text(CASE.replace("passes = 2", "passes = 0\nseed = 3"))
    before = contents(out)
    capsys.readouterr()
    assert run(case, "--out", out) == 2
    assert capsys.readouterr().err == (
        f"kohonen-adapt: '{out}' has the result of a run: continue with --resume {out}, overwrite with --force, or "
        "choose another folder.\n"
    )
    assert contents(out) == before
    assert run(case, "--out", out, "--force") == 0
    assert names_in(out / "passes") == ["pass-0000.npz"]
    assert len(table_of(out / "history.csv")) == 1


@pytest.mark.parametrize("options", [["--out"], ["--force", "--out"], ["--resume"]])
def test_a_link_in_place_of_the_passes_is_not_followed(options, case, tmp_path, capsys):
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "pass-0000.npz").write_text("precious")
    out.mkdir()
    (out / "passes").symlink_to(elsewhere)
    assert run(case, *options, out) == 2
    assert f"'{out / 'passes'}' is a link, and files behind links are not replaced" in capsys.readouterr().err
    assert contents(elsewhere) == {elsewhere / "pass-0000.npz": b"precious"}


def test_resume_where_nothing_was_begun(case, tmp_path, capsys):
    for folder in (tmp_path, tmp_path / "none"):
        assert run(case, "--resume", folder) == 2
        assert capsys.readouterr().err == (
            f"kohonen-adapt: --resume expected the folder of an earlier run; '{folder}' has no folder "
            f"'passes'. Start with --out {folder}.\n"
        )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("passes = 2", "seed = 1", "seed was 0, now 1. Use"),
        ("permeability = 1000.0", "permeability = 900.0", "the problem differs from the problem of the checkpoint"),
        ("scale = 1e-3", "scale = 1e-2", "mesh differs"),
    ],
)
def test_resume_with_another_case(old, new, said, case, out, capsys):
    assert run(case, "--out", out) == 0
    before = contents(out)
    case.write_text(CASE.replace(old, new))
    assert run(case, "--resume", out) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert contents(out) == before


def test_pictures_of_a_run_need_no_further_solve(case, out, monkeypatch):
    solve, meshes = Magnetostatics.solve, []

    def counted(self, mesh, *old):
        meshes.append(mesh)
        return solve(self, mesh)

    for name in ("solve", "solve_from"):
        monkeypatch.setattr(Magnetostatics, name, counted)
    assert run(case, "--out", out) == 0
    assert len(meshes) == 3
