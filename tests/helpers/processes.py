"""Run Python in a process of its own: numba fixes threads, and whether it compiles, at import."""

import os
import subprocess
import sys
import time
from pathlib import Path

TESTS = Path(__file__).parents[1]


def output_with(script, **variables):
    """What a script prints that finds package, benchmarks and helpers, with these variables of the environment."""
    paths = os.pathsep.join([str(TESTS), str(TESTS.parent), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "PYTHONPATH": paths, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


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
