"""Benchmarks and examples use the package as its users do: by public names, and no object's insides."""

import ast
import importlib
import json

from helpers.places import ROOT
from helpers.prose import imports_of

FACES = ["", ".cases", ".elements", ".estimators", ".magnetostatics", ".plotting", ".report"]
PUBLIC = {f"kohonen_adapt{face}": set(importlib.import_module(f"kohonen_adapt{face}").__all__) for face in FACES}


def notebook_text(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")


def programs():
    """Every program outside of the package and its tests, by its path; of a notebook the code."""
    for folder in (ROOT / "benchmarks", ROOT / "examples"):
        for path in sorted(folder.rglob("*.py")):
            yield str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
        for path in sorted(folder.rglob("*.ipynb")):
            yield str(path.relative_to(ROOT)), notebook_text(path)


PROGRAMS = dict(programs())
# The reference solutions of a case read its pairs, cuts and curves as the package defines them.
ORACLE = ("case_oracle", "ngsolve_field", "ngsolve_force", "ngsolve_mesh")
READS_CASES = {f"benchmarks/peers/{name}.py" for name in ORACLE}
# What is measured there is the package's own rule for errors of values, of any field, and of orders in space.
READS_ERRORS = {f"benchmarks/checks/{name}.py" for name in ("effectivity", "forces_in_space")}
READS_ERRORS |= {"benchmarks/problems/solids_by_order.py", "benchmarks/peers/hp_in_space.py"}


def parts_of(node):
    """The parts of a dotted name; an expression that such a name begins with is left out as one empty part."""
    if isinstance(node, ast.Attribute):
        return (*parts_of(node.value), node.attr)
    return (node.id,) if isinstance(node, ast.Name) else ("",)


def dotted_names(program):
    return {parts_of(node) for node in ast.walk(ast.parse(program)) if isinstance(node, ast.Attribute)}


def test_they_import_public_names():
    wrong = [
        f"{path} imports {name} of {module}"
        for path in PROGRAMS.keys() - READS_CASES - READS_ERRORS
        for module, name in imports_of(PROGRAMS[path])
        if module.split(".")[0] == "kohonen_adapt"
        and (module != "kohonen_adapt" if name is None else name not in PUBLIC.get(module, ()))
    ]
    assert not wrong


def test_they_take_public_names_of_what_they_import():
    known = {("ka", name) for name in PUBLIC["kohonen_adapt"] | {"__version__"}}
    known |= {("ka", "estimators", name) for name in PUBLIC["kohonen_adapt.estimators"]}
    wrong = [
        f"{path} uses {'.'.join(name)}"
        for path, program in PROGRAMS.items()
        for name in dotted_names(program)
        if name[0] == "ka" and name[: 3 if name[1] == "estimators" else 2] not in known
    ]
    assert not wrong


def test_they_leave_the_insides_of_objects_alone():
    wrong = [
        f"{path} uses {'.'.join(name)}"
        for path, program in PROGRAMS.items()
        for name in dotted_names(program)
        if name[0] != "self" and name[-1].startswith("_") and not name[-1].endswith("__")
    ]
    assert not wrong


def test_there_are_programs():
    assert {"benchmarks/__main__.py", "examples/motor.py", "examples/tour.ipynb"} <= PROGRAMS.keys()
