"""Count what a package of Python files is made of: lines, files, long functions, chains of imports."""

import ast
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

LONGEST = 400  # lines of a file
SHORTEST = 60
MOST_FILES = 20  # in a folder
BODY = 40  # lines of a function without its docstring
ARGUMENTS = 8

Function = ast.FunctionDef | ast.AsyncFunctionDef


def figures(root: Path) -> dict[str, int]:
    """Every figure of the package in a checkout by its name, lines of each chapter included."""
    package = root / "kohonen_adapt"
    lines = {path.relative_to(package): path.read_bytes().count(b"\n") for path in package.rglob("*.py")}
    trees = {path: ast.parse((package / path).read_bytes()) for path in lines}
    functions = [(path, node) for path, tree in trees.items() for node in ast.walk(tree) if isinstance(node, Function)]
    outside = [node for path, node in functions if chapter(path) != "kernels"]
    found = {
        "lines": sum(lines.values()),
        "files": len(lines),
        "files that are too long": sum(n > LONGEST for n in lines.values()),
        "files that are too short": sum(n < SHORTEST and not is_face(path, trees[path]) for path, n in lines.items()),
        "folders of many files": sum(n > MOST_FILES for n in Counter(path.parent for path in lines).values()),
        "long functions outside of kernels": sum(length(node) > BODY for node in outside),
        "functions of many arguments": sum(arguments(node) > ARGUMENTS for node in outside),
        "functions of many arguments in kernels": sum(arguments(node) > ARGUMENTS for _, node in functions)
        - sum(arguments(node) > ARGUMENTS for node in outside),
        "longest chain of imports": longest_chain(trees),
        "dependencies": len(tomllib.loads((root / "pyproject.toml").read_text())["project"]["dependencies"]),
    }
    for path, count in sorted(lines.items()):
        name = f"lines of {chapter(path)}"
        found[name] = found.get(name, 0) + count
    return found


def chapter(path: Path) -> str:
    """The folder of a file; all modules at the top level count as one chapter."""
    return path.parts[0] if len(path.parts) > 1 else "the top level"


def is_face(path: Path, tree: ast.Module) -> bool:
    """Whether it is an ``__init__.py`` that says its role, imports and names, and defines no more than ``__dir__``."""
    defined = {node.name for node in tree.body if isinstance(node, Function | ast.ClassDef)}
    return path.name == "__init__.py" and defined <= {"__dir__"}


def length(function: Function) -> int:
    """Lines of a function below its first one, less those of its docstring."""
    first = function.body[0]
    said = first.end_lineno - first.lineno + 1 if ast.get_docstring(function) else 0
    return function.end_lineno - function.lineno - said


def arguments(function: Function) -> int:
    """How many a caller may give; ``self`` is not one."""
    given = function.args
    names = [argument.arg for argument in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def longest_chain(trees: dict[Path, ast.Module]) -> int:
    """Files on the longest way down along imports, those in functions included.

    Raises
    ------
    ValueError
        If files import one another in a circle.
    """
    modules = {module_name(path): path for path in trees}
    below = {name: set(imported(name, path, trees[path], modules)) - {name} for name, path in modules.items()}
    entered = set[str]()

    @cache
    def depth(name: str) -> int:
        if name in entered:
            raise ValueError(f"{name} imports itself through others.")
        entered.add(name)
        return 1 + max(map(depth, below[name]), default=0)

    return max(map(depth, below))


def module_name(path: Path) -> str:
    parts = ("kohonen_adapt", *path.with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(name: str, path: Path, tree: ast.Module, modules: dict[str, Path]) -> Iterator[str]:
    """The modules of the package that a file imports, by dots too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules)
        elif isinstance(node, ast.ImportFrom):
            source = node.module or ""
            if node.level:
                here = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
                source = ".".join([*here[: len(here) + 1 - node.level], *filter(None, [node.module])])
            for alias in node.names:
                full = f"{source}.{alias.name}"
                yield from (module for module in ([full] if full in modules else [source]) if module in modules)
