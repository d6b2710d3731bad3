"""The table of entries is what a warm-up compiles, and a second process compiles a part of it into the same cache."""

import importlib
import json
import os
import pkgutil
from pathlib import Path

import pytest
from helpers.copied_kernels import fast_compiler_only
from helpers.processes import python
from numba.core.dispatcher import Dispatcher

import kohonen_adapt.kernels as package
from kohonen_adapt.kernels.entries import ENTRIES
from kohonen_adapt.kernels.numba.entry import name_of
from kohonen_adapt.precompile import compile_missing

EXAMPLES = Path(__file__).parents[2] / "examples"
PLANE = {name: chapter for name, chapter in ENTRIES.items() if not name.startswith("space")}
FEW = ("carrying", "locating")  # chapters that are compiled in a second or two
FIRST, *REST = [entry.name for chapter in ENTRIES if chapter in FEW for entry in ENTRIES[chapter]]

# What this process compiles itself, by name.
HEARD = """
import json, sys, time
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
from kohonen_adapt.kernels.numba.cache import is_cached
from kohonen_adapt.kernels.numba.compilation import expect, expected
from kohonen_adapt.kernels.entries import ENTRIES
from kohonen_adapt.kernels.numba.entry import name_of
"""
LOOPS = """
modules = [module for name, module in sys.modules.items() if name.startswith("kohonen_adapt.kernels")]
loops = {d for module in modules for d in vars(module).values() if isinstance(d, Dispatcher)}
"""
# Of loops that are on disk only those have code that Python has called, and not those that these call.
WARM = f"""
ka.warmup()
{LOOPS}
print(json.dumps([compiled, sorted(expected), {{name_of(d): [str(types) for types in d.overloads] for d in loops}}]))
"""
# What a front door says that it needs, and what it calls.
AT_THE_DOOR = f"""
import os
sys.path.insert(0, {str(EXAMPLES)!r})
from own_problem import Poisson
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from skfem import MeshTri
mesh = MeshTri().refined(4).with_boundaries({{"outer": lambda x: x[0] < 2.0}})
whole = mesh.with_subdomains({{"all": lambda x: x[0] < 2.0}})

def square(order):
    return Magnetostatics({{"all": Material(current_density=1.0)}}, potential={{"outer": 0.0}}, order=order)
"""
# Each in a child of one process, which has imported everything.
INSIDE = """
for name, call in DOORS.items():
    reading, writing = os.pipe()
    if not os.fork():
        exec(call)
        exec(LOOPS)
        with os.fdopen(writing, "w") as pipe:
            json.dump([sorted(expected), [name_of(d) for d in loops if d.overloads]], pipe)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        found[name] = json.load(pipe)
    os.wait()
print(json.dumps([found]))
"""
DOORS = {
    "flip": "ka.relocate(mesh, lambda x: 1.1 + x[0])",
    "recycle": "ka.relocate(mesh, lambda x: 1.1 + x[0], topology='recycle')",
    "disc": "ka.relocate(MeshTri.init_circle(3), lambda x: 1.1 + x[0])",
    "map": "ka.KohonenMap(mesh).train(mesh.p[:, mesh.t].mean(axis=1))",
    "polish": "ka.polish(mesh, Poisson())",
    "values": "ka.interpolate(mesh, mesh.p[0], mesh.p)",
    "places": "ka.find_elements(mesh, mesh.p)",
    "adapt": "ka.adapt(mesh, Poisson(), passes=2)",
    "order 1": "ka.adapt(whole, square(1), passes=2)",
    "order 2": "ka.adapt(whole, square(2), passes=2)",
}
# All of one chapter; or of several, the first loop here and the others when somebody has compiled them.
CHAPTER = """
for entry in ENTRIES["locating"]:
    entry.compile()
print(json.dumps([compiled]))
"""
HELPED = f"""
expect(*{FEW})
first, *rest = [entry for chapter in ENTRIES if chapter in {FEW} for entry in ENTRIES[chapter]]
first.compile()
end = time.monotonic() + 100
while not all(is_cached(entry.loop, entry.types) for entry in rest) and time.monotonic() < end:
    time.sleep(0.02)
for entry in rest:
    entry.compile()
print(json.dumps([compiled]))
"""


def in_a_process(script, **environment):
    done = python("-c", HEARD + script, **environment)
    return *json.loads(done.stdout), done.stderr


@pytest.mark.slow
def test_the_entries_are_the_loops_of_a_warm_up_which_expects_all_and_finds_what_is_compiled():
    compile_missing()
    compiled, expected, has, said = in_a_process(WARM)
    entries = sorted((entry.name, str(entry.types)) for chapter in PLANE.values() for entry in chapter)
    assert sorted((name, each) for name, types in has.items() for each in types) == entries
    assert expected == sorted(PLANE)
    assert compiled == [] and said == ""


@fast_compiler_only
def test_just_the_entries_have_machine_code_that_python_can_call():
    found = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    kernels = [importlib.import_module(each.name) for each in found]
    loops = {loop for module in kernels for loop in vars(module).values() if isinstance(loop, Dispatcher)}
    callable_ones = {name_of(loop.py_func) for loop in loops if not loop.targetoptions["no_cpython_wrapper"]}
    assert callable_ones == {entry.name for chapter in ENTRIES.values() for entry in chapter}


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_what_is_called_was_expected():
    compile_missing()
    given = f"DOORS, LOOPS, found = {DOORS!r}, {LOOPS!r}, {{}}\n"
    found, said = in_a_process(AT_THE_DOOR + given + INSIDE)
    assert found.keys() == DOORS.keys()
    for name, (expected, called) in found.items():
        assert called and set(called) <= {entry.name for chapter in expected for entry in ENTRIES[chapter]}, name
    assert said == ""


@pytest.mark.slow
def test_a_second_process_compiles_what_is_expected_beside_what_is_compiled_here(tmp_path):
    compiled, said = in_a_process(HELPED, NUMBA_CACHE_DIR=str(tmp_path), NUMBA_NUM_THREADS="2")
    assert compiled == [FIRST]
    assert f"compiling loops of kohonen_adapt, once ({1 + len(REST)}, about" in said and said.count("\n") == 1


@fast_compiler_only
def test_with_one_core_one_process_compiles_a_chapter_that_nobody_expected_and_says_so_once(tmp_path):
    compiled, said = in_a_process(CHAPTER, NUMBA_CACHE_DIR=str(tmp_path), NUMBA_NUM_THREADS="1")
    assert compiled == [entry.name for entry in ENTRIES["locating"]]
    assert f"compiling loops of kohonen_adapt, once ({len(compiled)}, about" in said and said.count("\n") == 1
