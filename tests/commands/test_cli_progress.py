"""The command shows its steps on a terminal, in one line, and nothing where nobody looks."""

import fcntl
import logging
import os
import pty
import re
import struct
import termios
import threading
import warnings
from contextlib import contextmanager, redirect_stderr, redirect_stdout

import numpy as np
import pytest
from helpers.cases import INSET, case_in, run_command

import kohonen_adapt as ka
from kohonen_adapt import __main__ as cli
from kohonen_adapt.commands.terminal import Terminal


@contextmanager
def a_terminal(stdout=None):
    """What is written to a terminal of 100 columns within, as a function; with another stdout, to that instead."""
    ours, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    attributes = termios.tcgetattr(its)
    attributes[1] &= ~termios.OPOST  # a new line without the return of a carriage
    termios.tcsetattr(its, termios.TCSANOW, attributes)
    pieces = list[bytes]()

    def read():
        try:
            while piece := os.read(ours, 4096):
                pieces.append(piece)
        except OSError:  # the other end is closed
            pass

    reader = threading.Thread(target=read)
    reader.start()
    with os.fdopen(its, "w", encoding="utf-8") as screen, redirect_stdout(stdout or screen), redirect_stderr(screen):
        yield lambda: b"".join(pieces).decode()
    reader.join()
    os.close(ours)


def steps_and_lines(quiet=False):
    """Steps, lines, a remark and a warning by turns."""
    terminal, logger = Terminal(quiet), logging.getLogger("kohonen_adapt.tests")
    logger.addHandler(terminal)
    with warnings.catch_warnings():
        warnings.showwarning = terminal.warn
        terminal.show("pass 1 of 4: relocate, 899 nodes")
        terminal.show("pass 1 of 4: solve")
        terminal.say("a line")
        terminal.show("x" * 200)
        logger.warning("a remark")
        warnings.warn("mind this", stacklevel=1)
        terminal.show("pass 2 of 4: polish")
        terminal.say("the end")
    logger.removeHandler(terminal)


def lines_left(written):
    """What stands on the screen in the end: of what returns to the begin of its line only the last piece."""
    return [[part for part in line.split("\r") if part.strip()][-1:] for line in written.split("\n")]


def test_steps_are_shown_below_the_lines_and_give_way_to_them():
    with a_terminal() as written:
        steps_and_lines()
    assert written().startswith("\rpass 1 of 4: relocate, 899 nodes\rpass 1 of 4: solve              \r")
    assert f"\r{99 * 'x'}\r" in written()  # what is wider than the terminal would take another line
    assert lines_left(written()) == [["a line"], ["a remark"], ["kohonen-adapt: warning: mind this"], ["the end"], []]


def test_quiet_on_a_terminal():
    with a_terminal() as written:
        steps_and_lines(quiet=True)
    assert written().replace("\r", "") == "a remark\nkohonen-adapt: warning: mind this\n"


def test_nothing_is_drawn_where_nobody_looks(capsys):
    steps_and_lines()
    assert capsys.readouterr() == ("a line\nthe end\n", "a remark\nkohonen-adapt: warning: mind this\n")


@pytest.fixture
def case(tmp_path):
    return case_in(tmp_path, INSET.replace("passes = 2", "passes = 1"))


def shown_by(*arguments, stdout=None):
    """The steps that a command shows on a terminal, in order, each once, what it knows then, and all that is there."""
    with a_terminal(stdout) as written, pytest.MonkeyPatch.context() as patched:
        patched.setattr(logging.getLogger(), "handlers", [])  # or the command would leave remarks to those of pytest
        assert cli.main(list(map(str, arguments))) == 0
    shown = re.findall(r"\r((?:pass \d of \d+: )?[a-z ]*[a-z])(?:, (.*?))? *(?=\r)", written())
    return list(dict.fromkeys(step for step, _ in shown)), [known for _, known in shown], written()


STEPS = ["relocate", "polish", "solve", "estimate"]


@pytest.mark.slow
def test_run_shows_every_step_on_a_terminal_and_none_in_a_file(case, out, tmp_path):
    first = [f"pass 0 of 1: {step}" for step in ("solve", "estimate", "write", "checkpoint")]
    second = [f"pass 1 of 1: {step}" for step in (*STEPS, "write", "checkpoint")]
    with (tmp_path / "stdout").open("w") as stdout:
        shown, known, written = shown_by("run", case, "--out", out, stdout=stdout)
    assert shown == ["read", *first, *second, "draw"]
    assert re.fullmatch(r"81 nodes, estimate [\de.-]+ \([\d.]+ %\)", known[-4])
    # lines go to one stream, remarks to another
    said, remark = (tmp_path / "stdout").read_text(), "mesh.msh': 81 nodes"
    assert "\r" not in said and "pass 1: 81 nodes, estimate" in said and remark not in said
    assert remark in written and "pass 1: 81 nodes" not in written


def test_relocate_shows_every_step(case, tmp_path):
    mesh = ka.read_mesh(tmp_path / "mesh.msh")
    ka.write_mesh(tmp_path / "field.vtu", mesh, cell_data={"rho": np.ones(mesh.nelements)})
    arguments = ["relocate", tmp_path / "mesh.msh", "--density", f"{tmp_path / 'field.vtu'}:rho"]
    assert shown_by(*arguments, "--out", tmp_path / "after.msh")[0] == ["read", "relocate", "write"]


def test_a_command_within_a_thread(capsys):
    """Signals are the business of whoever has the main thread."""
    codes = []
    thread = threading.Thread(target=lambda: codes.append(run_command("run", "none.toml", "--dry-run")))
    thread.start()
    thread.join()
    assert codes == [2]
    assert "there is no file 'none.toml'" in capsys.readouterr().err
