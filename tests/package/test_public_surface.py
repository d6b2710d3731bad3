"""The package lists its names, its docstrings say all, and calls share no state."""

import ast
import copy
import doctest
import importlib
import inspect
import io
import re
import sys
import textwrap
from pathlib import Path

import pytest
from helpers.places import PACKAGE
from helpers.prose import imports_of
from numpy.testing import assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Goal, Law, Magnetostatics, Material
from kohonen_adapt.magnetostatics.field_problem import FieldProblem
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField

MODULES = [
    importlib.import_module(name)
    for name in (
        "kohonen_adapt",
        "kohonen_adapt.elements",
        "kohonen_adapt.estimators",
        "kohonen_adapt.magnetostatics",
        "kohonen_adapt.plotting",
        "kohonen_adapt.report",
        "kohonen_adapt.cases",
    )
]
# People implement these, and do not call them: what a method does is said there, for all classes that have it.
PROTOCOLS = [ka.Problem, Goal, Law]
VALUES = ["flux_density_at", "field_strength_at", "potential_at"]  # of all fields
AS_THEIRS = {key for protocol in PROTOCOLS for key in vars(protocol)}


def public_callables():
    """Every public function, class and method under its full name."""
    yield from ((f"FieldProblem.{key}", method) for key, method in own_methods(FieldProblem))
    for module in MODULES:
        for name in module.__all__:
            thing = getattr(module, name)
            if (inspect.isclass(thing) or inspect.isfunction(thing)) and thing not in [*PROTOCOLS, ka.Status]:
                yield f"{module.__name__}.{name}", thing
                if inspect.isclass(thing) and thing.__name__ == name:  # an alias has the members of its class
                    yield from ((f"{module.__name__}.{name}.{key}", method) for key, method in own_methods(thing))


def sections_of(thing):
    """The sections of a NumPy docstring by their titles; what stands before them is ''."""
    parts = re.split(r"^([A-Z][\w ]+)\n-{3,}$", inspect.getdoc(thing) or "", flags=re.MULTILINE)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def is_as_a_protocol_says(name, method):
    return name in AS_THEIRS and set(sections_of(method)) == {""}


def own_methods(kind):
    values = {key: vars(MagneticField)[key] for key in VALUES} if issubclass(kind, MagneticField) else {}
    for key, value in {**values, **vars(kind)}.items():
        method = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if not key.startswith("_") and inspect.isfunction(method) and not is_as_a_protocol_says(key, method):
            yield key, method


CALLABLES = dict(public_callables())


def names_in(section):
    """What the unindented lines of a section are about."""
    heads = [line.split(":")[0] for line in section.splitlines() if line and not line.startswith(" ")]
    return {name.strip() for head in heads for name in head.split(",")}


def parameters_of(thing):
    if inspect.isclass(thing) and issubclass(thing, Exception) and "__init__" not in vars(thing):
        return set()  # Python tells no signature of an exception that is made of its text alone
    return set(inspect.signature(thing).parameters) - {"self", "cls"}


def raises(thing):
    return any(isinstance(node, ast.Raise) for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(thing)))))


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_names_are_listed_once_in_order_and_are_there(module):
    names = module.__all__
    assert names == sorted(set(names))
    assert all(hasattr(module, name) for name in names)


def test_the_front_lists_what_it_imports_and_shows_nothing_else():
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    imported = [alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert sorted(imported) == sorted([*ka.__all__, "__version__"])
    assert dir(ka) == sorted([*ka.__all__, "__version__"])


def documented_parameters(thing):
    """Names in the section of parameters; a class for results tells its attributes."""
    sections = sections_of(thing)
    named = names_in(sections.get("Parameters", ""))
    attributes = names_in(sections.get("Attributes", "")) if inspect.isclass(thing) else set()
    return named | attributes & parameters_of(thing)


def returns_something(thing):
    return inspect.signature(thing).return_annotation not in (None, "None")


def test_every_parameter_is_documented_and_no_other():
    assert all(sections_of(thing)[""] for thing in CALLABLES.values())
    wrong = {name for name, thing in CALLABLES.items() if documented_parameters(thing) != parameters_of(thing)}
    assert not wrong


def test_what_comes_back_is_documented_where_something_goes_in():
    functions = {
        name: thing for name, thing in CALLABLES.items() if not inspect.isclass(thing) and parameters_of(thing)
    }
    wrong = {name for name, thing in functions.items() if returns_something(thing) != ("Returns" in sections_of(thing))}
    assert functions and not wrong


def test_what_it_raises_is_documented():
    assert not {name for name, thing in CALLABLES.items() if raises(thing) and "Raises" not in sections_of(thing)}


def test_what_people_start_with_has_an_example():
    without = {name.rpartition(".")[2] for name, thing in CALLABLES.items() if "Examples" not in sections_of(thing)}
    assert (
        without
        & {
            *(
                "adapt",
                "relocate",
                "polish",
                "KohonenMap",
                "Schedule",
                "Stage",
                "Ritz",
                "Arc",
                "Line",
                "Spline",
                *("Plane", "Sphere", "Cylinder", "Cone"),
                "sweep",
            ),
            *("density_from_indicators", "density_from_sizes", "interpolate", "find_elements", "quality"),
            *(
                "read_mesh",
                "write_mesh",
                "Magnetostatics",
                "Material",
                "Brauer",
                "Froehlich",
                "Arctan",
                "Table",
                "read_bh",
            ),
            *("force", "torque", "flux_linkage", "lorentz_force", "apparent_inductance", *ka.estimators.__all__),
            *("draw_mesh", "draw_indicators", "draw_field_lines", "plot_bh", "plot_outlines"),
        }
        == set()
    )


@pytest.mark.parametrize("name", [name for name, thing in CALLABLES.items() if "Examples" in sections_of(thing)])
def test_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # some write files
    report, runner = io.StringIO(), doctest.DocTestRunner()
    for example in doctest.DocTestFinder(recurse=False).find(CALLABLES[name], name, globs={}):
        runner.run(example, out=report.write)
    assert runner.failures == 0, report.getvalue()


def shared_state():
    """What the package's modules hold that can change, but for idle threads and the loops to compile ahead."""
    return {
        f"{module}.{name}": copy.copy(value)
        for module in [module for module in sys.modules if module.startswith("kohonen_adapt")]
        for name, value in vars(sys.modules[module]).items()
        if isinstance(value, dict | list | set | bytearray)
        and name not in ("_pools", "expected", "__builtins__", "__warningregistry__")
    }


def test_calls_leave_nothing_behind():
    mesh = MeshTri().refined(3).with_defaults().with_subdomains({"air": lambda x: x[0] > 0.0})
    problem = Magnetostatics({"air": Material(current_density=1e3)}, potential={"left": 0.0})
    before = shared_state()
    first = ka.adapt(mesh, problem, passes=2)
    assert shared_state() == before and len(before) > 10
    assert_array_equal(ka.adapt(mesh, problem, passes=2).mesh.p, first.mesh.p)


def imports_of_tests():
    """Path, module and name of every import in the tests."""
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        yield from ((path, *each) for each in imports_of(path.read_text(encoding="utf-8")))


def test_tests_import_public_names_from_where_they_are_public():
    """So a file of the package moves without them. Kernels are an exception, which have slow twins beside them."""
    public = {name: getattr(module, name) for module in MODULES for name in module.__all__}
    homes = {module.__name__ for module in MODULES}
    wrong = [
        f"{path}: {name} of {module}"
        for path, module, name in imports_of_tests()
        if module.startswith("kohonen_adapt.") and module not in homes and ".kernels" not in module
        if name in public and getattr(importlib.import_module(module), name, None) is public[name]
    ]
    assert not wrong


def test_only_tests_of_benchmarks_import_them():
    found = {path.parent.name for path, module, _ in imports_of_tests() if module.partition(".")[0] == "benchmarks"}
    assert found == {"benchmarks"}
