"""Kernels are compiled by plain numba on request, and where numba's inner modules are not as expected."""

import pytest
from helpers.copied_kernels import make_package
from helpers.processes import python

LOOPS = """
from typing import NamedTuple
import numpy as np
from .numba.compilation import inner_kernel, kernel, record

@record
class Line(NamedTuple):
    start: np.ndarray
    slope: float

@inner_kernel
def scale(line, k):
    return line.start[k] + 2.0 * line.slope

@kernel
def scaled(line):
    return scale(line, np.int32(0)) + scale(line, 1)
"""
RUN = """
{before}
import numpy as np
from copied.loops import Line, scaled
from copied.numba.switch import PLAIN
print(PLAIN, scaled(Line(np.array([1.0, 2.0]), 0.5)), sum(scaled.stats.cache_hits.values()))
"""
WITHOUT_A_PASS = "import numba.core.untyped_passes as passes; del passes.WithLifting"


@pytest.fixture
def folder(tmp_path):
    make_package(tmp_path / "copied")
    (tmp_path / "copied" / "loops.py").write_text(LOOPS)
    return tmp_path


def run(folder, before="", **environment):
    environment = {"NUMBA_CACHE_DIR": str(folder / "cache"), **environment}
    return python("-c", RUN.format(before=before), cwd=folder, **environment)


@pytest.mark.slow
def test_the_switch_compiles_with_plain_numba_and_a_cache_of_its_own(folder):
    assert run(folder, KOHONEN_ADAPT_PLAIN_NUMBA="0").stdout.split() == ["False", "5.0", "0"]
    for hits in ("0", "1"):
        done = run(folder, KOHONEN_ADAPT_PLAIN_NUMBA="1")
        assert done.stdout.split() == ["True", "5.0", hits] and not done.stderr
    assert run(folder, KOHONEN_ADAPT_PLAIN_NUMBA="0").stdout.split()[0] == "False"


def test_an_unknown_numba_falls_back_with_one_warning(folder):
    done = run(folder, WITHOUT_A_PASS, KOHONEN_ADAPT_PLAIN_NUMBA="0")
    assert done.stdout.split()[:2] == ["True", "5.0"]
    (line,) = done.stderr.splitlines()
    assert "differs from the versions known to kohonen_adapt (AttributeError: " in line


@pytest.mark.slow
def test_an_unknown_cache_is_left_out_with_one_warning(folder):
    without = "import numba.core.caching as caching; del caching.IndexDataCacheFile._data_name"
    for _ in range(2):
        done = run(folder, without, KOHONEN_ADAPT_PLAIN_NUMBA="0")
        assert done.stdout.split() == ["False", "5.0", "0"]
        (line,) = done.stderr.splitlines()
        assert line.endswith("so every process compiles loops again.")
