"""Readers of the tables of a case, derived from the types of arguments."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import Parameter, signature
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from kohonen_adapt.checks import nearest_name

__all__ = [
    "NUMBER",
    "ORDER",
    "POINT",
    "POINTS",
    "TEXT",
    "VECTOR",
    "Kind",
    "Maker",
    "Reader",
    "UnknownKeyError",
    "call_checked",
    "kinds_of",
    "list_of",
    "locate_errors",
    "make_from_table",
    "make_named",
    "read_table",
    "table_of",
    "tuple_of",
]

Reader = Callable[[Any, str], Any]
"""Function of a TOML value and the dotted key of the value, which returns the argument or raises a ValueError."""

Maker = Callable[..., Any]
"""Class or function whose arguments are the keys of a table."""

LARGEST = 2**31 - 1  # of integers

SHOWN = 60  # characters of an invalid value in a message


class UnknownKeyError(ValueError):
    """Error for an unknown key of a table.

    Attributes
    ----------
    key
        The key.
    """

    def __init__(self, message: str, key: str) -> None:
        super().__init__(message)
        self.key = key


@dataclass(frozen=True)
class Kind:
    """Kind of value in a case.

    Attributes
    ----------
    types
        Types of the value in TOML.
    wanted
        Description for messages.
    fits
        Condition on a value of these types.
    read
        Conversion of a valid value.
    """

    types: tuple[type, ...]
    wanted: str
    fits: Callable[[Any], bool] = lambda given: True
    read: Reader = lambda given, location: given

    def __call__(self, given: Any, location: str) -> Any:
        if type(given) not in self.types or not self.fits(given):
            plain = {bool, int, float} & set(self.types)
            hint = " Write it without quotes." if isinstance(given, str) and plain and str not in self.types else ""
            raise ValueError(f"{location} must be {self.wanted}; got {_shortened(given)}.{hint}")
        return self.read(given, location)


FLAG = Kind((bool,), "true or false")
INTEGER = Kind((int,), f"an integer up to {LARGEST}", lambda given: abs(given) <= LARGEST)
NUMBER = Kind(
    (int, float),
    "a finite number",
    lambda given: abs(given) <= sys.float_info.max,
    lambda given, location: float(given),
)
TEXT = Kind((str,), "text in quotes", bool)
ORDER = Kind((int, str), 'a whole number from 1 to 8, or "auto"', lambda given: given in ("auto", *range(1, 9)))
SCALARS = {bool: FLAG, int: INTEGER, float: NUMBER, str: TEXT}


def table_of(read: Reader) -> Kind:
    def read_each(given: Any, location: str) -> dict[str, Any]:
        return {TEXT(key, f"a key of {location}"): read(value, _subkey(location, key)) for key, value in given.items()}

    return Kind((dict,), "a table of keys", read=read_each)


TABLE = table_of(lambda given, location: given)


def list_of(kind: Kind) -> Kind:
    def read(given: Any, location: str) -> list[Any]:
        return [kind(value, f"{location}[{k}]") for k, value in enumerate(given)]

    return Kind((list,), f"[{kind.wanted}, ...]", read=read)


def tuple_of(kinds: Sequence[Kind]) -> Kind:
    def read(given: Any, location: str) -> tuple[Any, ...]:
        return tuple(kind(value, f"{location}[{k}]") for k, (kind, value) in enumerate(zip(kinds, given, strict=True)))

    wanted = f"[{', '.join(kind.wanted for kind in kinds)}]"
    return Kind((list,), wanted, lambda given: len(given) == len(kinds), read)


POINT = tuple_of([NUMBER, NUMBER])
POINTS = list_of(POINT)
VECTOR = Kind(
    (list,),
    f"{POINT.wanted}, or three of them in space",
    lambda given: len(given) in (2, 3),
    lambda given, location: tuple(list_of(NUMBER)(given, location)),
)


def kind_of(annotation: Any) -> Kind | None:
    if isinstance(annotation, type) and annotation in SCALARS:
        return SCALARS[annotation]
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return Kind((str,), f"one of {', '.join(map(repr, arguments))}", lambda given: given in arguments)
    kinds = [kind for each in arguments if (kind := kind_of(each))]
    if not kinds:
        return None
    if origin in (Union, UnionType):
        return _either(kinds)
    if origin is tuple:
        return VECTOR if Ellipsis in arguments else tuple_of(kinds)
    if origin in (list, Sequence):
        return list_of(kinds[0])
    return table_of(kinds[1]) if origin is Mapping and len(kinds) == 2 else None


def kinds_of(make: Maker, special: Mapping[str, Reader] | None = None) -> dict[str, Reader]:
    """Return readers for the arguments that TOML can hold, by their annotations.

    `special` has readers that replace those of the annotations.
    """
    readers = {
        name: (special or {}).get(name) or kind_of(each.annotation) for name, each in signature(make).parameters.items()
    }
    return {name: reader for name, reader in readers.items() if reader}


def read_table(
    given: Any, readers: Mapping[str, Reader], location: str, required: Iterable[str] = ()
) -> dict[str, Any]:
    # `location` is the dotted key of the table, such as ``materials.iron``, empty for the whole case.
    entries = TABLE(given, location or "a case")
    for key in entries:
        if key not in readers:
            where, near = f" in {location}" if location else "", nearest_name(key, readers)
            raise UnknownKeyError(
                f"{_subkey(location, key)!r} is not a key of a case.{near} Known{where}: {', '.join(readers)}.", key
            )
    for key in required:
        if key not in entries:
            raise ValueError(f"{_subkey(location, key)} is missing; it is required.")
    return {key: readers[key](value, _subkey(location, key)) for key, value in entries.items()}


def make_from_table(make: Maker, given: Any, location: str, special: Mapping[str, Reader] | None = None) -> Any:
    required = [name for name, each in signature(make).parameters.items() if each.default is Parameter.empty]
    return call_checked(make, read_table(given, kinds_of(make, special), location, required), location)


def call_checked(make: Maker, values: Mapping[str, Any], location: str) -> Any:
    with locate_errors(location):
        try:
            return make(**values)
        except (ArithmeticError, RuntimeError) as error:  # extreme numbers overflow, or iterations do not converge
            raise ValueError(str(error)) from None


def make_named(
    makers: Mapping[str, Maker],
    key: str,
    given: Any,
    location: str,
    special: Mapping[str, Reader] | None = None,
) -> Any:
    options = f"one of {', '.join(map(repr, makers))}"
    entries = Kind((dict,), f"a table with a key {key}, {options}", read=TABLE)(given, location)
    name = entries.pop(key, None)
    if name is None:
        raise ValueError(f"{_subkey(location, key)} is missing; it must be {options}.")
    if not isinstance(name, str) or name not in makers:
        raise ValueError(
            f"{_subkey(location, key)} must be {options}; got {_shortened(name)}.{nearest_name(name, makers)}"
        )
    return make_from_table(makers[name], entries, location, special)


@contextmanager
def locate_errors(location: object) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{location}: {error}") from None


def _either(kinds: Sequence[Kind]) -> Kind:
    def read(given: Any, location: str) -> Any:
        return next(kind for kind in kinds if type(given) in kind.types)(given, location)

    types = tuple(each for kind in kinds for each in kind.types)
    return Kind(types, " or ".join(kind.wanted for kind in kinds), read=read)


def _subkey(location: str, key: str) -> str:
    name = key if key.isprintable() and len(key) <= SHOWN else _shortened(key)
    return f"{location}.{name}" if location else name


def _shortened(given: Any) -> str:
    try:
        text = repr(given)
    except ValueError:  # an integer with more digits than Python formats
        return "a huge integer"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
