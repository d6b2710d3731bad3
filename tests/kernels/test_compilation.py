"""No machine code outlives a kernel that it was made from."""

import os
import shutil
from pathlib import Path

import pytest
from helpers.copied_kernels import fast_compiler_only, make_package
from helpers.processes import python

import kohonen_adapt as ka

CALLEE = "from .numba.compilation import inner_kernel\n\n@inner_kernel\ndef scale(x):\n    return {factor} * x\n"
CALLER = (
    "from .numba.compilation import kernel\nfrom .callee import scale\n\n@kernel\ndef scaled(x):\n    return scale(x)\n"
)
TIMES = "from .numba.compilation import inner_kernel\n\n@inner_kernel\ndef times(x, k):\n    return k * x\n"
MANY_TIMES = """
import numpy as np
from .numba.compilation import kernel
from .callee import times

@kernel
def scaled(x):
    total = times(x, 3)
    for k in range(2):
        total += times(x, k) + times(1.0, np.int32(k + 1))
    return total + times(x, k=2)
"""
RUN = """
import sys
from {package}.caller import scaled
values = [scaled(x) for x in {arguments}]
print(*values, sum(scaled.stats.cache_hits.values()), sum(scaled.stats.cache_misses.values()))
"""


@pytest.fixture
def kernels(tmp_path):
    """A package of two kernels in two files, one of which calls the other."""
    folder = tmp_path / "copied"
    make_package(folder)
    (folder / "callee.py").write_text(CALLEE.format(factor=2))
    (folder / "caller.py").write_text(CALLER)
    return folder


def run(kernels, arguments="(1.0,)", cache=None):
    """What the caller gives in a process of its own, and how often it was found in the cache and not found."""
    code = RUN.format(package=kernels.name, arguments=arguments)
    done = python("-c", code, cwd=kernels.parent, NUMBA_CACHE_DIR=str(cache or kernels.parent / "cache"))
    *values, hits, misses = done.stdout.split()
    return [float(value) for value in values], int(hits), int(misses)


def files_of(cache, loop):
    return list(cache.glob(f"kernels-*/*/{loop}*.nbc"))


@pytest.mark.slow
def test_an_edited_kernel_is_seen_in_its_caller(kernels):
    assert run(kernels, "(1.0, 1)") == ([2.0, 2.0], 0, 2)
    for path in kernels.glob("*.py"):
        os.utime(path, (1e9, 1e9))  # which changes nothing
    assert run(kernels) == ([2.0], 1, 0)
    (kernels / "callee.py").write_text(CALLEE.format(factor=3))
    assert run(kernels) == ([3.0], 0, 1)
    assert run(kernels, "(1.0, 1)") == ([3.0, 3.0], 1, 1)
    (kernels / "callee.py").write_text(CALLEE.format(factor=2))
    assert run(kernels, "(1, 1.0)") == ([2.0, 2.0], 2, 0)


@pytest.mark.slow
def test_copies_of_the_same_kernels_share_their_code_wherever_they_lie(kernels, tmp_path):
    elsewhere = tmp_path / "a clone" / "beside it" / kernels.name
    shutil.copytree(kernels, elsewhere)
    cache = tmp_path / "cache"
    assert run(kernels, cache=cache) == ([2.0], 0, 1)
    assert run(elsewhere, cache=cache) == ([2.0], 1, 0)
    (elsewhere / "callee.py").write_text(CALLEE.format(factor=3))
    assert run(elsewhere, cache=cache) == ([3.0], 0, 1)
    assert run(kernels, cache=cache) == ([2.0], 1, 0)


@pytest.mark.slow
def test_the_code_of_kernels_not_used_for_longest_goes_first(kernels, tmp_path):
    cache = tmp_path / "cache"
    for age in range(10):
        (cache / f"kernels-{age}").mkdir(parents=True)
        os.utime(cache / f"kernels-{age}", (1e9 - age, 1e9 - age))
    assert run(kernels, cache=cache) == ([2.0], 0, 1)
    assert {path.name for path in cache.iterdir()} >= {f"kernels-{age}" for age in range(7)}
    assert len(list(cache.iterdir())) == 8
    assert run(kernels, cache=cache) == ([2.0], 1, 0)


@fast_compiler_only
@pytest.mark.slow
def test_a_loop_is_compiled_once_whatever_integers_it_is_called_with(kernels):
    (kernels / "callee.py").write_text(TIMES)
    (kernels / "caller.py").write_text(MANY_TIMES)
    assert run(kernels, "(1.0, 2.0)") == ([9.0, 15.0], 0, 1)
    assert len(files_of(kernels.parent / "cache", "callee.times")) == 1


@pytest.mark.slow
def test_an_index_of_types_that_are_gone_is_an_empty_one(kernels):
    types = "from typing import NamedTuple\n\nclass {name}(NamedTuple):\n    x: float\n"
    caller = "from .numba.compilation import kernel\n\n@kernel\ndef scaled(pair):\n    return 2 * pair.x\n"
    pairs = "(__import__('copied.{module}').{module}.{name}(1.0),)"
    (kernels / "caller.py").write_text(caller)
    (kernels / "before.py").write_text(types.format(name="Before"))
    assert run(kernels, pairs.format(module="before", name="Before")) == ([2.0], 0, 1)
    (kernels / "before.py").rename(kernels / "after.py")
    (kernels / "after.py").write_text(types.format(name="After"))
    assert run(kernels, pairs.format(module="after", name="After")) == ([2.0], 0, 1)


FIRST_RUN = """
import sys
import numpy as np, skfem, kohonen_adapt as ka
from numba.core.dispatcher import Dispatcher
from own_problem import Poisson

def compiled():
    kernels = [module for name, module in sys.modules.items() if name.startswith("kohonen_adapt.kernels")]
    found = {d for module in kernels for d in vars(module).values() if isinstance(d, Dispatcher)}
    return {(d.py_func.__name__, signature) for d in found for signature in d.overloads}

ka.warmup()
before = compiled()
corner = skfem.MeshTri.init_lshaped().refined(3)
result = ka.adapt(corner, Poisson(), passes=2)
ka.polish(result.mesh, Poisson())
for mesh in (corner, skfem.MeshTri.init_circle(3), skfem.MeshTri().refined(4)):
    for topology in ("fixed", "flip", "recycle"):
        ka.relocate(mesh, lambda x: np.exp(5.0 * x[0]), topology=topology)
    ka.KohonenMap(mesh).train(mesh.p[:, mesh.t].mean(axis=1))
print(len(before), sorted(compiled() - before))
"""


@pytest.mark.slow
def test_after_the_warm_up_a_first_run_compiles_nothing():
    examples = Path(__file__).parents[2] / "examples"
    done = python("-c", FIRST_RUN, cwd=examples)
    count, missing = done.stdout.split(maxsplit=1)
    assert int(count) > 30
    assert missing.strip() == "[]"


QUIET = """
import contextlib, sys
from numba.core import event

with event.install_recorder("numba:compile") as recorder:
    import kohonen_adapt as ka
    from kohonen_adapt.__main__ import main
    for mesh in sys.argv[1:]:
        ka.read_mesh(mesh)
        main(["check", mesh])
        main(["init", mesh, "-o", f"{len(mesh)}.toml"])
    with contextlib.suppress(SystemExit):
        main(["--help"])
print(len(recorder.buffer))
"""


def test_the_warm_up_says_nothing_of_its_own_meshes(caplog):
    with caplog.at_level("INFO", logger="kohonen_adapt"):
        ka.warmup()
    assert "largest distance" not in caplog.text


@pytest.mark.slow
def test_what_moves_no_node_compiles_nothing(tmp_path):
    meshes = [Path(__file__).parents[2] / "examples" / name for name in ("c_core.msh", "motor.msh")]
    done = python("-c", QUIET, *meshes, cwd=tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert "usage" in done.stdout and done.stdout.splitlines()[-1] == "0"
    assert all(f"{mesh.name}': " in done.stderr for mesh in meshes) and len(list(tmp_path.glob("*.toml"))) == 2


def test_a_kernel_can_be_interpreted(kernels):
    code = (
        "from copied.caller import scaled; from copied.numba.compilation import interpreted; "
        "print(interpreted(scaled)(1.5), len(scaled.overloads))"
    )
    assert python("-c", code, cwd=kernels.parent).stdout.split() == ["3.0", "0"]
