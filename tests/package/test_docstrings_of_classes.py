"""Docstrings of classes name their fields, that of `adapt` its keywords, and comments what exists."""

import dataclasses
import importlib
import inspect
import pkgutil
import re
from pathlib import Path

from helpers.places import PACKAGE
from helpers.prose import comments, docstrings

import kohonen_adapt as ka

FILES = [path.as_posix() for folder in (PACKAGE, Path(__file__).parents[1]) for path in folder.rglob("*.py")]


def classes():
    for module in pkgutil.walk_packages([str(PACKAGE)], "kohonen_adapt."):
        if not module.name.endswith(("__main__", ".outline")):
            for name, kind in vars(importlib.import_module(module.name)).items():
                if inspect.isclass(kind) and kind.__module__ == module.name:
                    yield f"{module.name}.{name}", kind


CLASSES = dict(classes())


def section_of(kind, title):
    """The names at the head of every entry of a section of the class's own docstring."""
    found = re.search(
        rf"^{title}\n-+\n(.*?)(?=^\S[^\n]*\n-{{3,}}$|\Z)", inspect.cleandoc(kind.__doc__ or ""), re.M | re.S
    )
    heads = re.findall(r"^(\w[^:\n]*)", found[1], re.MULTILINE) if found else []
    return {name.strip() for head in heads for name in head.split(",")}


def fields_of(kind):
    """Annotations, attributes of the class and attributes that its methods set, those of its bases included."""
    found = set()
    for base in kind.__mro__[:-1]:
        found |= {*vars(base), *vars(base).get("__annotations__", {})}
        if base.__module__.startswith("kohonen_adapt"):
            found |= set(re.findall(r"\bself\.(\w+)", inspect.getsource(base)))
    return found


def stale(title, actual):
    """What the sections of that title name and `actual` of the class has not, by class."""
    found = {name: names for name, kind in CLASSES.items() if (names := section_of(kind, title))}
    assert len(found) > 20
    left = {name: names - actual(CLASSES[name]) for name, names in found.items()}
    return {name: names for name, names in left.items() if names}


def test_every_documented_attribute_is_a_field():
    assert stale("Attributes", fields_of) == {}


def test_every_documented_parameter_is_one():
    assert stale("Parameters", lambda kind: {*inspect.signature(kind).parameters}) == {}


def test_every_field_is_documented_where_fields_are():
    missing = {}
    for name, kind in CLASSES.items():
        if dataclasses.is_dataclass(kind) and section_of(kind, "Attributes"):
            fields = {field.name for field in dataclasses.fields(kind) if not field.name.startswith("_")}
            inherited = {name for base in kind.__mro__[1:] for name in vars(base).get("__annotations__", {})}
            named = section_of(kind, "Parameters") | set(re.findall(r"`(\w+)`", kind.__doc__))
            missing[name] = fields - section_of(kind, "Attributes") - named - inherited
    assert len(missing) > 20 and not any(missing.values()), {name: left for name, left in missing.items() if left}


def test_the_list_by_purpose_has_every_keyword_of_adapt():
    listed = re.search(r"By purpose:\n\n(.*?)\n\n", inspect.getdoc(ka.adapt), re.DOTALL)[1]
    keywords = [name for name, each in inspect.signature(ka.adapt).parameters.items() if each.kind is each.KEYWORD_ONLY]
    assert sorted(re.findall(r"`(\w+)`", listed)) == sorted(keywords)


def names_nothing(module, name):
    homes = [Path(file).read_text(encoding="utf-8") for file in FILES if file.endswith(f"/{module}.py")]
    return not any(re.search(rf"\b(def|class) {name}\b|^{name} =", home, re.MULTILINE) for home in homes)


def test_comments_name_files_and_functions_that_exist():
    for path in PACKAGE.rglob("*.py"):
        text = "\n".join(each[-1] for each in (*comments(path), *docstrings(path)))
        files = re.findall(r"[\w/]+\.py\b", text)
        functions = re.findall(r"\bsee `([a-z_]+)\.([A-Za-z_]\w*)`", text)
        nowhere = [name for name in files if not any(file.endswith(f"/{name}") for file in FILES)]
        nowhere += [pair for pair in functions if names_nothing(*pair)]
        assert not nowhere, f"{path} names {nowhere}"
