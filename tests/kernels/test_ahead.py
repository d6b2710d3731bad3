"""The table of entries is what a warm-up compiles, and a second process compiles a part of it into the same cache."""

import json
import os
import subprocess
import sys

import pytest

from kohonen_adapt.kernels.entries import ENTRIES

SPACE = [name for name in ENTRIES if name.startswith("space")]
NAMES = [entry.name for name in ENTRIES if name not in SPACE for entry in ENTRIES[name]]

# What this process compiled itself, and what it has, by name.
WARM = """
import json, sys
from numba.core import event
from numba.core.dispatcher import Dispatcher
compiled, depth = [], 0

class Heard(event.Listener):
    def on_start(self, event):
        global depth
        depth += 1
    def on_end(self, event):
        global depth
        depth -= 1
        if not depth:
            compiled.append(name_of(event.data["dispatcher"].py_func))

event.register("numba:compile", Heard())
import kohonen_adapt as ka
from kohonen_adapt.kernels.entry import name_of
ka.warmup()
modules = [module for name, module in sys.modules.items() if name.startswith("kohonen_adapt.kernels")]
loops = {d for module in modules for d in vars(module).values() if isinstance(d, Dispatcher)}
print(json.dumps([compiled, {name_of(d): [str(types) for types in d.overloads] for d in loops}]))
"""


def warmed(cache, **environment):
    done = subprocess.run(
        [sys.executable, "-c", WARM],
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)} | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return *json.loads(done.stdout), done.stderr


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    cache = tmp_path_factory.mktemp("cache")
    return cache, *warmed(cache, NUMBA_NUM_THREADS="2")


@pytest.mark.slow
def test_the_types_of_the_entries_are_those_of_a_warm_up(first):
    _, _, has, _ = first
    entries = {entry.name: [str(entry.types)] for name in ENTRIES if name not in SPACE for entry in ENTRIES[name]}
    assert {name: has[name] for name in NAMES} == entries and len(NAMES) == len(entries)


@pytest.mark.slow
def test_a_second_process_compiles_a_part(first):
    cache, compiled, _, said = first
    assert set(compiled) < set(NAMES)
    assert f"compiling loops of kohonen_adapt, once ({len(NAMES)}, about" in said
    again, _, said = warmed(cache)
    assert again == [] and said == ""


@pytest.mark.slow
def test_with_one_core_one_process_compiles_all_entries_and_no_other_loop(tmp_path):
    compiled, _, said = warmed(tmp_path, NUMBA_NUM_THREADS="1")
    assert sorted(compiled) == sorted(NAMES)
    assert said.count("\n") == 1


@pytest.mark.slow
def test_a_chapter_that_nobody_expected_is_said_once(tmp_path):
    code = "import skfem, kohonen_adapt as ka; mesh = skfem.MeshTri(); ka.interpolate(mesh, mesh.p[0], mesh.p)"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stderr.count("compiling loops of kohonen_adapt") == 1
