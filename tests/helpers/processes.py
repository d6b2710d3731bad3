"""Run Python in a process of its own: numba fixes threads, and whether it compiles, at import."""

import os
import subprocess
import sys
import time
from pathlib import Path

TESTS = Path(__file__).parents[1]


def python(*arguments, cwd=None, status=0, **variables):
    """Return a process of Python that has ended, with package and helpers on its path, and these variables."""
    paths = os.pathsep.join([str(TESTS), str(TESTS.parent), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": paths, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done


def output_with(script, **variables):
    return python("-c", script, **variables).stdout


def wait_until(happens, seconds=60):
    """Wait, and fail where it does not happen in so many seconds."""
    end = time.monotonic() + seconds
    while not happens():
        assert time.monotonic() < end
        time.sleep(0.02)


def alive(process):
    """Whether a process is there and has not ended; on Linux, which shows them as files."""
    stat = Path(f"/proc/{process}/stat")
    return stat.exists() and stat.read_text().rpartition(")")[2].split()[0] != "Z"


KILLED = """
import os, pathlib
from kohonen_adapt.files import whole_file, whole_files
path = pathlib.Path({path!r})
with whole_file(path) as one, whole_files(path.parent) as many:
    one.write_text("half")
    (many / path.name).write_text("half")
    os._exit(0)
"""


def leave_drafts(path):
    """Leave two drafts of a file as a process does that is killed while it writes, alone and with others."""
    output_with(KILLED.format(path=str(path)))
    assert len(list(path.parent.glob(".*.draft"))) == 2
