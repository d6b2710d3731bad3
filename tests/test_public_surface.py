"""What a user sees of the package: names that are listed, docstrings that say all, and no state that calls share."""

import ast
import importlib
import inspect
import re
from pathlib import Path

import pytest

import kohonen_adapt as ka

PACKAGE = Path(ka.__file__).parent
MODULES = [
    importlib.import_module(name)
    for name in (
        "kohonen_adapt",
        "kohonen_adapt.estimators",
        "kohonen_adapt.magnetostatics",
        "kohonen_adapt.plotting",
        "kohonen_adapt.cases",
    )
]
# Written with no arguments by anybody: a person implements a protocol, and reads a status.
NOT_CALLED = {"Goal", "Law", "Problem", "Status"}


def public_callables():
    """Every public function, class and method under its full name."""
    for module in MODULES:
        for name in module.__all__:
            thing = getattr(module, name)
            if callable(thing) and name not in NOT_CALLED:
                yield f"{module.__name__}.{name}", thing
                if inspect.isclass(thing):
                    yield from ((f"{module.__name__}.{name}.{key}", method) for key, method in own_methods(thing))


def own_methods(kind):
    for key, value in vars(kind).items():
        method = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if not key.startswith("_") and inspect.isfunction(method):
            yield key, method


CALLABLES = dict(public_callables())
every_callable = pytest.mark.parametrize("name", CALLABLES)


def sections_of(thing):
    """The sections of a NumPy docstring by their titles; what stands before them is ''."""
    parts = re.split(r"^([A-Z][\w ]+)\n-{3,}$", inspect.getdoc(thing) or "", flags=re.MULTILINE)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def names_in(section):
    """What the unindented lines of a section are about."""
    heads = [line.split(":")[0] for line in section.splitlines() if line and not line.startswith(" ")]
    return {name.strip() for head in heads for name in head.split(",")}


def parameters_of(thing):
    return set(inspect.signature(thing).parameters) - {"self", "cls"}


def raises(thing):
    return any(isinstance(node, ast.Raise) for node in ast.walk(ast.parse(inspect.cleandoc(inspect.getsource(thing)))))


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_names_are_listed_once_in_order_and_are_there(module):
    names = module.__all__
    assert names == sorted(set(names))
    assert all(hasattr(module, name) for name in names)


def test_the_front_lists_what_it_imports_and_shows_nothing_else():
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    imported = [alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert sorted(imported) == ka.__all__
    assert dir(ka) == sorted([*ka.__all__, "__version__"])


@every_callable
def test_every_parameter_is_documented_and_nothing_else(name):
    sections, wanted = sections_of(CALLABLES[name]), parameters_of(CALLABLES[name])
    documented = names_in(sections.get("Parameters", ""))
    short = "." in name.removeprefix("kohonen_adapt.") and "Parameters" not in sections and sections[""]
    if inspect.isclass(CALLABLES[name]):
        assert wanted <= documented | names_in(sections.get("Attributes", ""))
    elif not short:
        assert wanted <= documented
    assert documented <= wanted


@every_callable
def test_what_comes_back_is_documented(name):
    thing = CALLABLES[name]
    if inspect.isclass(thing) or inspect.signature(thing).return_annotation in (None, "None"):
        return
    assert "Returns" in sections_of(thing)
