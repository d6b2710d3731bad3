"""Public names and their arguments are those of the contract, `public_names.txt`, so that none changes by accident."""

import inspect
from enum import Enum
from pathlib import Path

from test_public_surface import CALLABLES, MODULES, PROTOCOLS

import kohonen_adapt as ka

CONTRACT = Path(__file__).with_name("public_names.txt").read_text(encoding="utf-8").splitlines()
ADVICE = (
    "Additions: add the lines to tests/package/public_names.txt. Removals: keep the former name for one minor version, "
    "with a DeprecationWarning; see docs/reference.md."
)


def arguments_of(thing):
    """Names of arguments; optional ones end in =, and those after * are keywords."""
    found, keyword = [], False
    for name, parameter in inspect.signature(thing).parameters.items():
        if parameter.kind is parameter.KEYWORD_ONLY and not keyword:
            found.append("*")
            keyword = True
        found.append(name if parameter.default is parameter.empty else f"{name}=")
    return [name for name in found if name not in ("self", "cls")]


def members_of(kind):
    if issubclass(kind, Enum):
        return sorted(each.name for each in kind)
    return sorted(name for name in vars(kind) if not name.startswith("_"))


def surface():
    """A line for every public name, method and protocol."""
    for module in MODULES:
        for name in module.__all__:
            full, thing = f"{module.__name__}.{name}", getattr(module, name)
            if thing in [*PROTOCOLS, ka.Status]:
                yield f"{full}: {', '.join(members_of(thing))}"
            elif full not in CALLABLES:
                yield full
    for full, thing in CALLABLES.items():
        exception = inspect.isclass(thing) and issubclass(thing, Exception)
        yield full if exception else f"{full}({', '.join(arguments_of(thing))})"


def test_the_public_surface_is_the_contract():
    now = sorted(set(surface()))
    added, removed = sorted(set(now) - set(CONTRACT)), sorted(set(CONTRACT) - set(now))
    assert (added, removed) == ([], []), ADVICE
    assert sorted(set(CONTRACT)) == CONTRACT
