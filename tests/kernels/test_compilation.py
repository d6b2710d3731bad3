"""No machine code outlives a kernel that it was made from."""

import os
import subprocess
import sys
from pathlib import Path
from shutil import copy

import pytest

import kohonen_adapt

COMPILATION = Path(kohonen_adapt.__file__).parent / "kernels" / "compilation.py"
CALLEE = "from .compilation import inner_kernel\n\n@inner_kernel\ndef scale(x):\n    return {factor} * x\n"
CALLER = "from .compilation import kernel\nfrom .callee import scale\n\n@kernel\ndef scaled(x):\n    return scale(x)\n"
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
    folder.mkdir()
    (folder / "__init__.py").touch()
    copy(COMPILATION, folder)
    (folder / "callee.py").write_text(CALLEE.format(factor=2))
    (folder / "caller.py").write_text(CALLER)
    return folder


def run(kernels, arguments="(1.0,)"):
    """What the caller gives in a process of its own, and how often it was found in the cache and not found."""
    code = RUN.format(package=kernels.name, arguments=arguments)
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=kernels.parent, env=environment, capture_output=True, text=True, check=True
    )
    *values, hits, misses = done.stdout.split()
    return [float(value) for value in values], int(hits), int(misses)


def test_an_edited_kernel_is_seen_in_its_caller(kernels):
    assert run(kernels) == ([2.0], 0, 1)
    assert run(kernels) == ([2.0], 1, 0)
    (kernels / "callee.py").write_text(CALLEE.format(factor=3))
    assert run(kernels) == ([3.0], 0, 1)
    assert run(kernels) == ([3.0], 1, 0)


def test_another_time_of_a_file_changes_nothing(kernels):
    run(kernels)
    for path in kernels.glob("*.py"):
        os.utime(path, (1e9, 1e9))
    assert run(kernels) == ([2.0], 1, 0)


def test_an_index_of_types_that_are_gone_is_an_empty_one(kernels):
    types = "from typing import NamedTuple\n\nclass {name}(NamedTuple):\n    x: float\n"
    caller = "from .compilation import kernel\n\n@kernel\ndef scaled(pair):\n    return 2 * pair.x\n"
    pairs = "(__import__('copied.{module}').{module}.{name}(1.0),)"
    (kernels / "caller.py").write_text(caller)
    (kernels / "before.py").write_text(types.format(name="Before"))
    assert run(kernels, pairs.format(module="before", name="Before")) == ([2.0], 0, 1)
    (kernels / "before.py").rename(kernels / "after.py")
    (kernels / "after.py").write_text(types.format(name="After"))
    assert run(kernels, pairs.format(module="after", name="After")) == ([2.0], 0, 1)


def test_code_is_named_by_its_signature_and_old_code_is_removed(kernels):
    run(kernels, "(1.0, 1)")
    cache = kernels / "__pycache__"
    first = {path.name for path in cache.glob("caller.scaled*.nbc")}
    assert len(first) == 2
    (kernels / "callee.py").write_text(CALLEE.format(factor=3))
    run(kernels)
    run(kernels, "(1,)")
    now = {path.name for path in cache.glob("caller.scaled*.nbc")}
    assert len(now) == 2 and not now & first
    (kernels / "callee.py").write_text(CALLEE.format(factor=2))
    run(kernels, "(1, 1.0)")
    assert {path.name for path in cache.glob("caller.scaled*.nbc")} == first  # whichever came first


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


def test_after_the_warm_up_a_first_run_compiles_nothing():
    examples = Path(__file__).parents[2] / "examples"
    done = subprocess.run([sys.executable, "-c", FIRST_RUN], cwd=examples, capture_output=True, text=True, check=True)
    count, missing = done.stdout.split(maxsplit=1)
    assert int(count) > 40
    assert missing.strip() == "[]"


QUIET = """
import sys
from numba.core import event

class Counted(event.Listener):
    def on_start(self, event):
        raise SystemExit(f"compiles {event.data['dispatcher'].py_func.__qualname__}")
    def on_end(self, event):
        pass

event.register("numba:compile", Counted())
import kohonen_adapt as ka
from kohonen_adapt.commands.main import main
mesh = ka.read_mesh(sys.argv[-1])
main(sys.argv[1:])
"""


@pytest.mark.parametrize("command", [["check"], ["--help"], ["init", "-o", "case.toml"]], ids=lambda words: words[0])
@pytest.mark.parametrize("name", ["c_core.msh", "motor.msh"])
def test_what_moves_no_node_compiles_nothing(command, name, tmp_path):
    mesh = Path(__file__).parents[2] / "examples" / name
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", QUIET, *command, str(mesh)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert "compiles" not in done.stderr and ("nodes" in done.stderr or "usage" in done.stdout)


def test_a_kernel_can_be_interpreted(kernels):
    code = (
        "from copied.caller import scaled; from copied.compilation import interpreted; "
        "print(interpreted(scaled)(1.5), len(scaled.overloads))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=kernels.parent, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["3.0", "0"]
