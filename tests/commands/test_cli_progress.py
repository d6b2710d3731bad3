"""What the command shows while it works: steps on a terminal, nothing where nobody looks."""

import fcntl
import logging
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest

import kohonen_adapt as ka
from kohonen_adapt.commands import main as cli
from kohonen_adapt.commands.terminal import LineHandler, Terminal

ROOT = Path(__file__).parents[2]

SCRIPT = """
import logging, sys, time, warnings
from kohonen_adapt.terminal import LineHandler, Terminal

terminal = Terminal(quiet="--quiet" in sys.argv)
logging.basicConfig(format="%(message)s", handlers=[LineHandler()])
warnings.showwarning = terminal.warn

def work():
    terminal.show("pass 1 of 4: solve", 1, 5, "899 nodes")
    time.sleep(1.0)
    terminal.say("a line")
    logging.warning("a remark")
    warnings.warn("mind this")
    terminal.show("pass 2 of 4: polish", 2, 5)
    time.sleep(0.5)

terminal.wait_for(work)
terminal.say("the end")
"""


def on_a_terminal(*arguments, stdout=None):
    """What a process of Python writes to a terminal of 100 columns, and its return code."""
    ours, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"}
    process = subprocess.Popen(
        [sys.executable, *map(str, arguments)], stdin=its, stdout=stdout or its, stderr=its, env=environment
    )
    os.close(its)
    written = b""
    try:
        while piece := os.read(ours, 4096):
            written += piece
    except OSError:  # the other end is closed
        pass
    os.close(ours)
    return written.decode(), process.wait(60)


def lines_left(written):
    """What stands on the screen in the end: of what returns to the begin of its line only the last piece."""
    return [[part for part in line.split("\r") if part.strip()][-1:] for line in written.split("\n")]


def test_steps_are_shown_below_the_lines():
    written, code = on_a_terminal("-c", SCRIPT)
    assert code == 0
    assert re.search(r"\rpass 1 of 4: solve \S+ +00:00, 899 nodes\r", written)
    assert re.search(r"\rpass 2 of 4: polish \S+ +00:01\r", written)
    assert lines_left(written) == [["a line"], ["a remark"], ["kohonen-adapt: warning: mind this"], ["the end"], []]


def test_quiet_on_a_terminal():
    written, _ = on_a_terminal("-c", SCRIPT, "--quiet")
    assert written.replace("\r", "") == "a remark\nkohonen-adapt: warning: mind this\n"


def test_nothing_is_drawn_where_nobody_looks():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == (
        "a line\nthe end\n",
        "a remark\nkohonen-adapt: warning: mind this\n",
    )


def test_what_is_done_at_once_shows_nothing():
    code = "from kohonen_adapt.commands.terminal import Terminal; Terminal().wait_for(lambda: None)"
    assert on_a_terminal("-c", code) == ("", 0)


CASE = """
mesh = "mesh.msh"
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
passes = 1
"""


@pytest.fixture
def case(tmp_path):
    ka.write_mesh(tmp_path / "mesh.msh", ka.read_mesh(ROOT / "examples" / "c_core.msh").refined(2))
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path / "case.toml"


@pytest.mark.slow
def test_run_shows_its_passes_and_steps(case, tmp_path):
    with (tmp_path / "stdout").open("w") as stdout:
        arguments = ["-m", "kohonen_adapt", "run", case, "--out", tmp_path / "out"]
        written, code = on_a_terminal(*arguments, stdout=stdout)
    assert code == 0
    steps = re.findall(r"\r(?:pass (\d) of 1: )?(read|solve|relocate|polish|write|draw) \S* *\d\d:\d\d", written)
    assert {("1", "relocate"), ("", "draw")} <= set(steps)
    assert re.search(r"\rpass 1 of 1: \w+ .*, 13769 nodes, estimate [\d.]+ \([\d.]+ %\)", written)
    assert "\r" not in (tmp_path / "stdout").read_text()


def shown_by(arguments, monkeypatch):
    """The steps that a command shows, in order, each once."""
    shown = []
    monkeypatch.setattr(Terminal, "show", lambda self, step, *more: shown.append(step))
    assert cli.main([str(argument) for argument in arguments]) == 0
    return list(dict.fromkeys(shown))


STEPS = ["relocate", "polish", "solve", "estimate"]


def test_demo_shows_every_step(tmp_path, monkeypatch):
    steps = [f"pass {number} of 4: {step}" for number in (1, 2, 3, 4) for step in STEPS]
    first = [f"pass 0 of 4: {step}" for step in ("solve", "estimate")]
    assert shown_by(["demo", "magnet", "--out", tmp_path], monkeypatch) == [*first, *steps, "draw"]


def test_run_shows_every_step(case, tmp_path, monkeypatch):
    first = [f"pass 0 of 1: {step}" for step in ("solve", "estimate", "write", "checkpoint")]
    second = [f"pass 1 of 1: {step}" for step in (*STEPS, "write", "checkpoint")]
    assert shown_by(["run", case, "--out", tmp_path / "out"], monkeypatch) == ["read", *first, *second, "draw"]


def test_relocate_shows_every_step(case, tmp_path, monkeypatch):
    mesh = ka.read_mesh(tmp_path / "mesh.msh")
    ka.write_mesh(tmp_path / "field.vtu", mesh, cell_data={"rho": np.ones(mesh.t.shape[1])})
    arguments = ["relocate", tmp_path / "mesh.msh", "--density", f"{tmp_path / 'field.vtu'}:rho"]
    assert shown_by([*arguments, "--out", tmp_path / "after.msh"], monkeypatch) == ["read", "relocate", "write"]


# ---- the thread that works ----


def test_the_work_is_done_in_another_thread_and_its_result_comes_back():
    assert Terminal().wait_for(threading.current_thread) is not threading.main_thread()


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), TimeoutError("late")], ids=repr)
def test_what_the_work_raises_comes_through(error):
    def work():
        raise error

    with pytest.raises(type(error)) as raised:
        Terminal().wait_for(work)
    assert raised.value is error


def test_signals_are_left_to_the_system_until_the_work_is_done():
    def work():
        heard = signal.getsignal(signal.SIGINT)
        terminal.leave_signals()
        return heard, signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)

    terminal, sigterm = Terminal(), signal.getsignal(signal.SIGTERM)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # it may be ignored: see the next test
    try:
        assert terminal.wait_for(work) == (signal.default_int_handler, signal.SIG_DFL, signal.SIG_DFL)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        assert signal.getsignal(signal.SIGTERM) == sigterm
    finally:
        signal.signal(signal.SIGINT, before)


def test_what_is_ignored_stays_ignored():
    """As Ctrl-C is in the background of a shell script."""

    def work():
        terminal.leave_signals()
        return signal.getsignal(signal.SIGINT)

    terminal, before = Terminal(), signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert terminal.wait_for(work) is signal.SIG_IGN is signal.getsignal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_command_within_a_thread(capsys):
    """Signals are the business of whoever has the main thread."""
    codes = []
    thread = threading.Thread(target=lambda: codes.append(cli.main(["run", "none.toml", "--dry-run"])))
    thread.start()
    thread.join()
    assert codes == [2]
    assert "there is no file 'none.toml'" in capsys.readouterr().err


def test_remarks_and_warnings_are_lines(capsys):
    logger = logging.getLogger("kohonen_adapt.tests")
    logger.addHandler(LineHandler())
    logger.warning("a remark")
    with warnings.catch_warnings():
        warnings.showwarning = Terminal().warn
        warnings.warn("mind this", stacklevel=1)
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err == "a remark\nkohonen-adapt: warning: mind this\n"
