"""Set up what holds for every test: compiled loops, hypothesis's profiles, and a quiet logger."""

import logging
import os

# Threads of linear algebra only slow down processes that share the cores; numpy reads the number when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # or every process that a test begins compiles all modules anew

import pytest
from hypothesis import HealthCheck, settings

from kohonen_adapt import warmup

# By the clock nothing fails: a busy machine, or one that has to compile first, is no fault of the code.
STEADY = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}

# The same examples in every run, so that a red suite means a change, and few: `.ci/run` has more of these by
# `--hypothesis-profile=hundred`. `=fresh` looks for many new ones, `=ten-thousand` for so many of relocated tetrahedra
# (`tests/som/test_space_properties.py`).
settings.register_profile("steady", max_examples=40, derandomize=True, **STEADY)
settings.register_profile("hundred", max_examples=100, derandomize=True, **STEADY)
settings.register_profile("fresh", max_examples=1000, print_blob=True, **STEADY)
settings.register_profile("ten-thousand", max_examples=19_300, print_blob=True, **STEADY)
settings.load_profile("steady")


def pytest_sessionstart(session):
    """Compile all loops before processes begin that share the tests: each of them would compile them all by itself."""
    if session.config.getoption("numprocesses", default=None):
        warmup(space=True)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark all tests of the benchmarks as slow: they check studies that few users run."""
    for item in items:
        if item.path.parent.name == "benchmarks":
            item.add_marker("slow")


@pytest.fixture(autouse=True)
def quiet_again():
    """The command turns the package's remarks on for its process, in a fixture of a module, too."""
    logging.getLogger("kohonen_adapt").setLevel(logging.NOTSET)
    yield
    logging.getLogger("kohonen_adapt").setLevel(logging.NOTSET)
