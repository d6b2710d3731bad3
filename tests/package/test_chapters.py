"""A file imports from its own chapter and from those below it."""

import inspect
import re

from helpers.places import PACKAGE
from helpers.processes import python
from helpers.prose import imports_of

import kohonen_adapt

# From the bottom up; chapters that stand side by side do not know each other. The README's table is this list.
LAYERS = [
    ("arrays", "log", "version"),
    ("checks", "files"),
    ("kernels",),
    ("mesh",),
    ("geometry", "problem", "estimators", "display", "elements"),
    ("som", "polishing", "magnetostatics", "io"),
    ("loop",),
    ("precompile", "outline"),
    ("sweeps",),
    ("__init__",),
    ("plotting", "cases"),
    ("report",),
    ("commands",),
    ("__main__",),
    ("docs",),
]
# Where a package other than the everyday ones (numpy, scipy, skfem) may be imported.
GUESTS = {
    "numba": {"kernels"},
    "meshio": {"io"},
    "matplotlib": {"plotting"},
    "pyamg": {"magnetostatics"},
    "distributed": {"commands"},
    "h5py": {"io"},
    "gmsh": {"cases"},
    "sphinx": {"docs"},
}

FILES = sorted(PACKAGE.rglob("*.py"))
LEVEL = {chapter: level for level, chapters in enumerate(LAYERS) for chapter in chapters}


def chapter_of(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_modules(path):
    """Absolute names of the modules that a file imports anywhere, in functions too."""
    for module, name in imports_of(path.read_text(encoding="utf-8")):
        assert not module.startswith("."), f"{path.relative_to(PACKAGE)} imports by dots; write kohonen_adapt.…"
        yield f"{module}.{name}" if name else module


def imported_chapters(path):
    names = [name.split(".") for name in imported_modules(path)]
    found = {name[1] if name[1] in LEVEL else "__init__" for name in names if name[0] == "kohonen_adapt"}
    return found - {chapter_of(path)}


def test_imports_point_down():
    homeless = {chapter_of(path) for path in FILES} - set(LEVEL)
    assert not homeless, f"{homeless} have no place: give them one in LAYERS and in kohonen_adapt/README.md"
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {other}, which does not stand below"
        for path in FILES
        for other in imported_chapters(path)
        if LEVEL[other] >= LEVEL[chapter_of(path)]
    ]
    assert not wrong


def test_guests_stay_in_their_chapters():
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in FILES
        for name in imported_modules(path)
        if chapter_of(path) not in GUESTS.get(name.split(".")[0], {chapter_of(path)})
    ]
    assert not wrong


def test_two_files_know_meshio():
    """It is hardly kept any more: its last release is of January 2024."""
    files = {path.name for path in FILES if "meshio" in {name.split(".")[0] for name in imported_modules(path)}}
    assert files == {"meshio_reader.py", "vtu.py"}


def test_the_top_level_has_no_other_modules():
    modules = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}
    assert modules <= {"arrays", "checks", "files", "display", "elements", "log", "precompile", "version"}


def test_no_module_hides_a_public_function():
    functions = {name for name in kohonen_adapt.__all__ if not inspect.ismodule(getattr(kohonen_adapt, name))}
    hidden = {path.stem for path in PACKAGE.iterdir() if path.is_dir() or path.suffix == ".py"} & functions
    assert not hidden, f"importlib and pydoc find the modules of these names and not the functions: {sorted(hidden)}"


def test_import_compiles_nothing_and_brings_no_optional_package(tmp_path):
    code = """
import sys
from numba.core import event
with event.install_recorder("numba:compile") as recorder:
    import kohonen_adapt
print(len(recorder.buffer), *({"matplotlib", "gmsh", "pyamg", "distributed", "h5py"} & set(sys.modules)))
"""
    assert python("-c", code, NUMBA_CACHE_DIR=str(tmp_path)).stdout == "0\n"
    assert not list(tmp_path.rglob("*.nb[ic]"))


def test_the_readme_has_the_same_chapters_in_the_same_order():
    table = (PACKAGE / "README.md").read_text(encoding="utf-8").partition("|---|---|\n")[2].partition("\n\n")[0]
    rows = [tuple(re.findall(r"`(\w+)`", row.split("|")[1])) for row in table.splitlines()]
    assert rows == LAYERS
