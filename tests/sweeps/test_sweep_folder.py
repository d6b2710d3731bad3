"""A sweep that is interrupted or killed loses what was running, leaves no process, and goes on to the same table."""

import functools
import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers import swept
from helpers.places import names_in
from helpers.processes import alive, leave_drafts, wait_until
from helpers.worlds import full_disk
from numpy.testing import assert_array_equal

import kohonen_adapt as ka

THREAD = ThreadPoolExecutor(1)


def here(function, cases, folder):
    return ka.sweep(function, cases, executor=THREAD, folder=folder)


def noted(folder):
    return functools.partial(swept.noted, log=str(folder / "log"))


# ---- what is finished ----


def test_what_is_finished_is_never_computed_again(tmp_path):
    first = here(noted(tmp_path), {"x": [1, 2, 3]}, tmp_path / "cases")
    (tmp_path / "cases" / "case-0001.json").unlink()
    again = here(noted(tmp_path), {"x": [1, 2, 3]}, tmp_path / "cases")
    assert (tmp_path / "log").read_text() == "1\n2\n3\n2\n"
    assert_array_equal(again.table[["x", "value"]], first.table[["x", "value"]])
    assert_array_equal(again.table["seconds"][[0, 2]], first.table["seconds"][[0, 2]])


def test_a_finished_sweep_needs_no_process_and_tells_so(tmp_path, monkeypatch):
    cases, told = {"x": [1 / 3, np.inf], "y": [0.1, np.nan]}, []
    first = here(swept.product, cases, tmp_path)
    monkeypatch.setattr("kohonen_adapt.sweeps.sweep.LocalPool", None)
    again = ka.sweep(swept.product, cases, folder=tmp_path, progress=lambda *now: told.append(now))
    assert again.table.tobytes() == first.table.tobytes() and again.table.dtype == first.table.dtype
    assert told == [(4, 4)]


def test_a_case_with_an_error_is_tried_again(tmp_path):
    assert here(swept.fails_at_two, {"x": [1, 2]}, tmp_path).errors[1]
    assert not (tmp_path / "case-0001.json").exists()
    assert isinstance(here(swept.fails_at_two, {"x": [1, 2]}, tmp_path).errors[1], KeyError)


def one(x):
    return x + 1


def edited(x):
    return x + 2


def test_a_folder_of_another_sweep_is_refused(tmp_path):
    def refused(function, cases, said):
        with pytest.raises(ValueError, match=said):
            here(function, cases, tmp_path)

    here(one, {"x": [1, 2]}, tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    edited.__qualname__ = "one"  # the same name, edited since
    refused(edited, {"x": [1, 2]}, r"of another sweep: its code or data of the function differ \(.*one.*one\)")
    refused(swept.square, {"x": [1, 2]}, "its function and code or data of the function differ")
    refused(one, {"x": [1, 3]}, "its values of parameters differ")
    refused(one, {"x": [1, 2, 3]}, "its values of parameters differ")
    refused(one, {"y": [1, 2]}, "its parameters differ .* choose another folder")
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before
    here(functools.partial(swept.product, y=1), {"x": [1]}, tmp_path / "partial")
    with pytest.raises(ValueError, match="its code or data of the function differ"):
        here(functools.partial(swept.product, y=2), {"x": [1]}, tmp_path / "partial")


def with_comment(text):
    scope = {"__name__": "somewhere"}
    exec(f"def f(x):\n    {text}return x in ('a', 'b', 'c')\n", scope)
    return scope["f"]


def test_a_comment_makes_no_other_function(tmp_path):
    here(with_comment(""), {"x": ["a"]}, tmp_path)
    here(with_comment("# yes\n    "), {"x": ["a"]}, tmp_path)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"outputs": {}}', '{"outputs": 3, "seconds": 1}', "\udcff"])
def test_a_damaged_file_is_named(content, tmp_path):
    here(one, {"x": [1, 2]}, tmp_path)
    (tmp_path / "case-0001.json").write_text(content, errors="surrogateescape")
    with pytest.raises(ValueError, match=r"case-0001.json' is damaged .* delete it and compute that again"):
        here(one, {"x": [1, 2]}, tmp_path)
    (tmp_path / "sweep.json").write_text(content, errors="surrogateescape")
    with pytest.raises(ValueError, match=r"sweep.json' is damaged|of another sweep"):
        here(one, {"x": [1, 2]}, tmp_path)


def test_a_file_is_whole_or_not_there(tmp_path):
    with full_disk(lambda target: "case-0001" in target), pytest.raises(OSError, match="No space left"):
        here(one, {"x": [1, 2, 3]}, tmp_path)
    assert names_in(tmp_path) == ["case-0000.json", "sweep.json"]
    leave_drafts(tmp_path / "case-0001.json")
    assert_array_equal(here(one, {"x": [1, 2, 3]}, tmp_path).table["value"], [2.0, 3.0, 4.0])
    assert not list(tmp_path.glob(".*"))


# ---- interrupted and killed ----

SCRIPT = """
import sys
from functools import partial
from helpers import swept
from helpers.processes import alive, wait_until
import kohonen_adapt as ka

if __name__ == "__main__":
    folder = sys.argv[1]
    ka.sweep(partial(swept.waiting, folder=folder), {"x": range(6)}, folder=f"{folder}/cases")
"""

HEARING = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"


def begin(folder):
    (folder / "script.py").write_text(HEARING + SCRIPT)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_NUM_THREADS": "2"}
    command = [sys.executable, str(folder / "script.py"), str(folder)]
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True)


def outputs(result, folder):
    result.to_csv(folder / "sweep.csv")
    return [line.rpartition(",")[0].rpartition(",")[0] for line in (folder / "sweep.csv").read_text().splitlines()]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes where Linux shows them")
@pytest.mark.parametrize("end", ["SIGINT", "SIGINT at a terminal", "SIGTERM", "SIGKILL"])
def test_cut_short_and_resumed(end, tmp_path):
    name, *everybody = end.split(maxsplit=1)
    number = signal.Signals[name]
    process = begin(tmp_path)
    wait_until(lambda: len(list(tmp_path.glob("begun *"))) == 4 and len(list(tmp_path.glob("cases/case-*"))) == 2)
    processes = {int(file.name.split()[-1]) for file in tmp_path.glob("begun *")}
    assert len(processes) == 2 and all(map(alive, processes))
    (os.killpg if everybody else os.kill)(process.pid, number)  # at a terminal the workers hear of it, too
    _, said = process.communicate(timeout=120)
    assert process.returncode == -number
    assert said.count("Traceback") == (number == signal.SIGINT)
    wait_until(lambda: not any(map(alive, processes)))
    finished = {file.name: file.read_bytes() for file in tmp_path.glob("cases/case-*")}
    assert len(finished) == 2 and all(json.loads(content)["outputs"] for content in finished.values())
    (tmp_path / "go on").touch()
    function = functools.partial(swept.waiting, folder=str(tmp_path))
    again = ka.sweep(function, {"x": range(6)}, executor=ThreadPoolExecutor(4), folder=tmp_path / "cases")
    assert all((tmp_path / "cases" / name).read_bytes() == content for name, content in finished.items())
    straight = here(functools.partial(swept.waiting, folder=tmp_path), {"x": range(6)}, None)
    assert outputs(again, tmp_path) == outputs(straight, tmp_path) and len(again.table) == 6
