"""Cases of a sweep, listed one by one or as a grid of values."""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any

import numpy as np

__all__ = ["SECONDS", "Case", "Value", "list_cases"]

Value = bool | int | float | str
Case = dict[str, Value]

SECONDS = "seconds"  # reserved column of the table, not allowed as a parameter or an output


def list_cases(given: Any) -> list[Case]:
    if not isinstance(given, Mapping | Iterable) or isinstance(given, str | bytes):
        raise ValueError(
            f"cases must be a sequence of mappings, or a mapping of names to sequences of values; got {given!r}."
        )
    rows = _grid(given) if isinstance(given, Mapping) else list(given)
    if not rows:
        raise ValueError("cases must be one case at least; got none.")
    cases = [_case(number, row) for number, row in enumerate(rows)]
    for number, case in enumerate(cases):
        if case.keys() != cases[0].keys():
            raise ValueError(
                f"all cases must have the same parameters: case 0 has {', '.join(cases[0])}, and case {number} has "
                f"{', '.join(case)}."
            )
    return [{name: case[name] for name in cases[0]} for case in cases]


def _grid(values: Mapping[str, Any]) -> list[Case]:
    for name, each in values.items():
        if not isinstance(each, Iterable) or isinstance(each, str | bytes | Mapping):
            raise ValueError(f"cases[{name!r}] must be a sequence of values; got {each!r}. One value is a list of one.")
    return [dict(zip(values, row, strict=True)) for row in product(*values.values())] if values else []


def _case(number: int, given: Any) -> Case:
    if not isinstance(given, Mapping) or not given:
        raise ValueError(f"case {number} must be a mapping of parameters to values; got {given!r}.")
    for name in given:
        if not isinstance(name, str) or name in ("", SECONDS):
            raise ValueError(
                f"case {number}: a parameter must have a name that is some text other than '{SECONDS}', a column of "
                f"the table; got {name!r}."
            )
    return {name: _value(value, f"case {number}: {name}") for name, value in given.items()}


def _value(given: Any, description: str) -> Value:
    value = given.item() if isinstance(given, np.generic) else given
    if not isinstance(value, Value):
        raise ValueError(
            f"{description} must be a number, some text, or true or false; got {given!r}. Let the function make of "
            "such a value what it needs."
        )
    return value
