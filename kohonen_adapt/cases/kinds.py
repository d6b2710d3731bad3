"""What a key of a case may hold: a check for each kind of value, and of a table of keys, that names the key."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from math import inf, isfinite
from typing import Any

__all__ = [
    "Kind",
    "about",
    "checked",
    "choice",
    "flag",
    "integer",
    "labels",
    "number",
    "pairs",
    "pins",
    "table",
    "table_of",
    "text",
    "vector",
]

Kind = Callable[[Any, str], Any]
"""Takes a value and the place of its key, and gives the value as it is meant, or a ValueError that names the place."""

LARGEST = 2**31 - 1  # of integers: nothing that is counted here is more

SHOWN = 60  # characters of a wrong value


@contextmanager
def about(place: object) -> Iterator[None]:
    """Name the place in what is refused inside."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from None


def checked(given: Any, kinds: Mapping[str, Kind], place: str, required: Sequence[str] = ()) -> dict[str, Any]:
    """The values of a table, each as its kind has it.

    Parameters
    ----------
    given
        The table.
    kinds
        Key to what it may hold.
    place
        Where the table stands, as ``materials.iron``; empty for the case itself.
    required
        Keys that must be there.

    Raises
    ------
    ValueError
        If it is no table, has a key that is not known, lacks one that must be there, or holds a wrong value.
    """
    entries = table(given, place or "a case")
    for key in entries:
        if key not in kinds:
            raise ValueError(_unknown(key, list(kinds), place))
    for key in required:
        if key not in entries:
            raise ValueError(f"{_below(place, key)} is missing; it must be there.")
    return {key: kinds[key](value, _below(place, key)) for key, value in entries.items()}


def table(given: Any, place: str) -> dict[str, Any]:
    """A table of keys."""
    if not isinstance(given, Mapping):
        raise ValueError(f"{place} must be a table of keys; got {_shown(given)}.")
    return {text(key, f"a key of {place}"): value for key, value in given.items()}


def table_of(kind: Kind) -> Kind:
    """A table from names of the user's to values of one kind."""

    def check(given: Any, place: str) -> dict[str, Any]:
        return {name: kind(value, _below(place, name)) for name, value in table(given, place).items()}

    return check


def number(*, least: float = -inf, above: float = -inf, most: float = inf) -> Kind:
    """A finite number in a range."""
    bounds = [f">= {least:g}"] * (least > -inf) + [f"> {above:g}"] * (above > -inf) + [f"<= {most:g}"] * (most < inf)
    wanted = " ".join(["a finite number", " and ".join(bounds)]).rstrip()

    def check(given: Any, place: str) -> float:
        try:
            value = float(given) if isinstance(given, int | float) and not isinstance(given, bool) else inf
        except OverflowError:
            value = inf
        if not (isfinite(value) and least <= value <= most and value > above):
            raise ValueError(f"{place} must be {wanted}; got {_shown(given)}.{_unquote(given)}")
        return value

    return check


def integer(*, least: int = 0) -> Kind:
    """An integer from `least` on."""

    def check(given: Any, place: str) -> int:
        if not isinstance(given, int) or isinstance(given, bool) or not least <= given <= LARGEST:
            raise ValueError(
                f"{place} must be an integer from {least} to {LARGEST}; got {_shown(given)}.{_unquote(given)}"
            )
        return given

    return check


def choice(*values: str | int) -> Kind:
    """One of these values."""
    said = ", ".join(map(repr, values))

    def check(given: Any, place: str) -> Any:
        if isinstance(given, bool) or not isinstance(given, str | int) or given not in values:
            near = get_close_matches(given, [str(value) for value in values], 1) if isinstance(given, str) else []
            hint = f" Did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{place} must be one of {said}; got {_shown(given)}.{hint}")
        return given

    return check


def flag(given: Any, place: str) -> bool:
    """True or false."""
    if not isinstance(given, bool):
        raise ValueError(f"{place} must be true or false; got {_shown(given)}.{_unquote(given)}")
    return given


def text(given: Any, place: str) -> str:
    """A text that is not empty."""
    if not isinstance(given, str) or not given:
        raise ValueError(f"{place} must be a text in quotes that is not empty; got {_shown(given)}.")
    return given


def vector(given: Any, place: str) -> tuple[float, float]:
    """Two finite numbers."""
    if not isinstance(given, list) or len(given) != 2:
        raise ValueError(f"{place} must be two numbers [x, y]; got {_shown(given)}.")
    x, y = (number()(value, f"{place}[{k}]") for k, value in enumerate(given))
    return x, y


def labels(given: Any, place: str) -> list[str]:
    """A name, or a list of names."""
    listed = given if isinstance(given, list) else [given]
    if not listed or not all(isinstance(name, str) and name for name in listed):
        raise ValueError(f"{place} must be a name or a list of names; got {_shown(given)}.")
    return listed


def pairs(given: Any, place: str) -> list[tuple[str, str]]:
    """A list of pairs of names."""
    if not isinstance(given, list) or not all(map(_is_pair, given)):
        raise ValueError(f'{place} must be a list of pairs of names, as [["left", "right"]]; got {_shown(given)}.')
    return [(one, other) for one, other in given]


def _is_pair(given: Any) -> bool:
    return isinstance(given, list) and len(given) == 2 and all(isinstance(name, str) for name in given)


def pins(given: Any, place: str) -> list[int | str]:
    """A list of names and numbers of nodes."""
    if not isinstance(given, list):
        raise ValueError(f"{place} must be a list of names and node numbers; got {_shown(given)}.")
    return [
        text(entry, f"{place}[{k}]") if isinstance(entry, str) else integer()(entry, f"{place}[{k}]")
        for k, entry in enumerate(given)
    ]


def _below(place: str, key: str) -> str:
    name = key if key.isprintable() and len(key) <= SHOWN else _shown(key)
    return f"{place}.{name}" if place else name


def _unknown(key: str, known: list[str], place: str) -> str:
    near = get_close_matches(key, known, 1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    where = f" in {place}" if place else ""
    return f"{_below(place, key)!r} is no key of a case.{hint} Known{where}: {', '.join(known)}."


def _unquote(given: Any) -> str:
    return " Write it without quotes." if isinstance(given, str) else ""


def _shown(given: Any) -> str:
    try:
        said = repr(given)
    except ValueError:  # an integer of more digits than Python writes
        return "a huge integer"
    return said if len(said) <= SHOWN else f"{said[:SHOWN]}..."
