"""The rooms of the package and their direction: every file imports only from rooms that stand before its own."""

import ast
import os
import subprocess
import sys
from itertools import chain
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "kohonen_adapt"

# From the bottom to the loop; a room may import any room named before it.
TOWER = [
    *("kernels", "threads", "triangles", "facets", "whole_file"),
    *("polylines", "spans", "curves"),
    *("triangulation", "borders", "chains", "pairs", "outline", "sides", "layers", "locate", "density", "sampling"),
    *("ritz", "recycling", "tables", "functional", "carry"),
    *("schedule", "transport", "epoch", "som"),
    *("limits", "relocation", "problem", "descent", "precompile"),
    *("outputs", "result", "journal", "checkpoint", "stopping", "improvement", "growth", "identity", "loop"),
]
GROUND = TOWER[: TOWER.index("recycling")]
# The physics stands beside the tower: the loop knows nothing of it, and it nothing of the map and the loop.
BESIDE = {"estimators": GROUND, "magnetostatics": [*GROUND, "estimators"]}
# What a person touches; nothing but the package's front imports it.
TOP = ["showing", "io", "plotting", "report", "cases", "commands", "terminal", "cli"]
FRONT = ["__init__", "__main__"]

# What a notebook shows of a result is drawn when it asks: such an import stands in a function.
ON_REQUEST = {"result": {"plotting"}}

# Where a package other than the everyday ones (numpy, scipy, skfem) may be imported.
GUESTS = {
    "numba": {"kernels"},
    "meshio": {"io"},
    "matplotlib": {"plotting"},
    "pyamg": {"magnetostatics"},
    "gmsh": set(),
    "tqdm": {"terminal"},
}

FILES = sorted(PACKAGE.rglob("*.py"))


def room_of(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_modules(path):
    """Absolute names of the modules that a file imports anywhere, in functions too."""
    package = ["kohonen_adapt", *path.relative_to(PACKAGE).parent.parts]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{module}.{alias.name}" for alias in node.names)


def imported_rooms(path):
    names = [name.split(".") for name in imported_modules(path)]
    return {name[1] if len(name) > 1 else "__init__" for name in names if name[0] == "kohonen_adapt"} - {room_of(path)}


def allowed_rooms(room):
    if room in TOWER:
        return TOWER[: TOWER.index(room)]
    if room in BESIDE:
        return BESIDE[room]
    # A name of the package itself (`from . import __version__`) is the front's, which only the top may use.
    return [*TOWER, *BESIDE, *TOP, "__init__", "__version__"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_down(path):
    room = room_of(path)
    known = [*TOWER, *BESIDE, *TOP, *FRONT]
    assert room in known, f"{room} has no floor: give it one here and in kohonen_adapt/README.md"
    wrong = imported_rooms(path) - set(allowed_rooms(room)) - ON_REQUEST.get(room, set())
    assert not wrong, f"{path.name} imports {sorted(wrong)}, which stand above it"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_guests_stay_in_their_rooms(path):
    guests = {name.split(".")[0] for name in imported_modules(path)} & set(GUESTS)
    wrong = {guest for guest in guests if room_of(path) not in GUESTS[guest]}
    assert not wrong, f"{path.name} imports {sorted(wrong)}"


def test_the_rules_are_rules():
    loop = set(allowed_rooms("loop"))
    assert not loop & {*BESIDE, *TOP}
    assert allowed_rooms("kernels") == []
    assert "magnetostatics" not in allowed_rooms("estimators")
    assert not {"som", "relocation", "loop"} & set(chain.from_iterable(BESIDE.values()))


def in_a_fresh_process(code, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent), "NUMBA_CACHE_DIR": str(tmp_path)}
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True, timeout=120
    ).stdout.split()


def test_import_compiles_nothing_and_brings_no_optional_package(tmp_path):
    code = """
import sys
from numba.core import event
with event.install_recorder("numba:compile") as recorder:
    import kohonen_adapt
print(len(recorder.buffer), *({"matplotlib", "gmsh", "pyamg"} & set(sys.modules)))
"""
    assert in_a_fresh_process(code, tmp_path) == ["0"]
    assert not list(tmp_path.rglob("*.nb[ic]"))


def test_import_takes_less_than_a_second_beyond_skfem_and_numba(tmp_path):
    # Processor time, so that a busy machine does not decide.
    code = """
import numba, skfem, time
start = time.process_time()
import kohonen_adapt
print(time.process_time() - start)
"""
    (seconds,) = in_a_fresh_process(code, tmp_path)
    assert float(seconds) < 1.0
