"""Checks of arguments with uniform messages."""

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from functools import partial, wraps
from inspect import signature
from math import isfinite
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Array, Floats

__all__ = [
    "as_reals",
    "check_count",
    "check_fields",
    "check_fraction",
    "check_hook",
    "check_state",
    "check_tolerance",
    "checked_mapping",
    "checked_points",
    "finite_point",
    "finite_reals",
    "finite_triple",
    "finite_values",
    "is_count",
    "is_number",
    "listed",
    "nearest_name",
    "point_text",
    "positive_number",
    "with_nearest_names",
]

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def is_count(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and bool(value >= 0)


def is_number(value: object) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def positive_number(value: Any, what: str) -> float:
    if not (is_number(value) and isfinite(value) and value > 0.0):
        raise ValueError(f"{what} must be a positive number; got {value!r}.")
    return float(value)


def check_fields(instance: object, **checks: Callable[[Any, str], Any]) -> None:
    """Replace fields of a frozen dataclass by the results of their checks."""
    kind = type(instance).__name__
    for field, check in checks.items():
        what = f"{field} of {'an' if kind[0] in 'AEIOU' else 'a'} {kind}"
        object.__setattr__(instance, field, check(getattr(instance, field), what))


def check_count(name: str, value: Any, least: int = 0) -> None:
    if not is_count(value) or value < least:
        raise ValueError(f"{name} must be an integer >= {least}; got {value!r}.")


def check_tolerance(name: str, value: object) -> None:
    if value is not None and not (is_number(value) and 0.0 <= value < np.inf):  # type: ignore[operator]
        raise ValueError(f"{name} must be a finite number >= 0, or None; got {value!r}.")


def checked_mapping(value: Any, expected: str) -> dict[Any, Any]:
    """Return a copy of a mapping, or an empty one for None."""
    if not isinstance(value, Mapping | None):
        raise ValueError(f"{expected}; got {value!r}.")
    return dict(value or {})


def check_fraction(name: str, value: object) -> None:
    check_tolerance(name, value)
    if value is not None and value > 1.0:  # type: ignore[operator]
        raise ValueError(f"{name} must be a fraction, at most 1; got {value!r}. Write 0.01 for 1 %.")


def check_hook(name: str, hook: object, expected: str) -> None:
    if hook is not None and not callable(hook):
        raise ValueError(f"{name} must be a function of {expected}, or None; got {hook!r}.")


def check_state(
    now: Mapping[str, Array],
    state: Mapping[str, Array],
    rows: Mapping[str, int],
    numbers: Mapping[str, tuple[int, int]],
) -> None:
    """Raise ValueError for the first stored array that does not fit.

    Parameters
    ----------
    now
        Arrays with the expected types and shapes, by name.
    state
        Stored arrays, by name.
    rows
        Expected length of each array.
    numbers
        Lower bound and exclusive upper bound of the values of an array, if any.
    """
    for name, like in now.items():
        if name not in state:
            raise ValueError(f"there is no array {name}")
        found = state[name]
        if (found.dtype, found.shape) != (like.dtype, (rows[name], *like.shape[1:])):
            raise ValueError(f"{name} is an array {found.shape} of {found.dtype}")
        low, high = numbers.get(name, (-np.inf, np.inf))
        if found.size and not (found.min() >= low and found.max() < high):
            raise ValueError(f"{name} has numbers from {found.min()} to {found.max()}")


def listed(names: Iterable[str]) -> str:
    return ", ".join(repr(name) for name in sorted(names)) or "none"


def nearest_name(given: Any, known: Iterable[str]) -> str:
    """Return " Did you mean 'name'?" for the nearest known name, or an empty string."""
    names = {name.casefold(): name for name in known if isinstance(name, str)}
    near = get_close_matches(given.casefold(), list(names), 1) if isinstance(given, str) else []
    return f" Did you mean {names[near[0]]!r}?" if near else ""


def with_nearest_names(
    synonyms: Mapping[str, str],
) -> Callable[[Callable[Arguments, Returned]], Callable[Arguments, Returned]]:
    """Return a decorator that suggests an argument for an unknown keyword.

    Parameters
    ----------
    synonyms
        Words of the field to arguments of the same meaning.

    Raises
    ------
    TypeError
        If the decorated function is called with an unknown keyword.
    """

    def decorated(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
        public = function.__qualname__.split(".")[0]  # the class, for a constructor
        known = [argument for argument in signature(function).parameters if argument != "self"]

        @wraps(function)
        def called(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Returned:
            for given in kwargs:
                if given not in known:
                    near = nearest_name(synonyms.get(given, given), known) or f" It has {listed(known)}."
                    raise TypeError(f"{public} has no argument {given!r}.{near}")
            return function(*args, **kwargs)

        return called

    return decorated


def point_text(point: Floats) -> str:
    return f"({', '.join(f'{x:.6g}' for x in point)})"


def as_reals(name: str, given: ArrayLike, shape: Mapping[str, int]) -> Floats:
    """Return a copy of an argument as floats of a shape.

    Parameters
    ----------
    name
        Name of the argument, for messages.
    given
        The argument.
    shape
        Expected shape, each length under its name in the documentation.
    """
    array, wanted = np.asarray(given), tuple(shape.values())
    if array.shape != wanted:
        names = ", ".join(shape) + ("," if len(shape) == 1 else "")
        raise ValueError(f"{name} must have shape ({names}) = {wanted}; got {array.shape}.")
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} must be real numbers; got {array.dtype}.")
    return array.astype(float)


def finite_reals(name: str, given: ArrayLike, shape: Mapping[str, int], place: str) -> Floats:
    """Return a copy of an argument as finite floats of a shape.

    `place` is the meaning of the last axis for messages, such as "node" or "element".
    """
    array = as_reals(name, given, shape)
    bad = np.flatnonzero(~np.isfinite(array).reshape(-1, array.shape[-1]).all(axis=0))
    if bad.size:
        raise ValueError(
            f"{name} must be finite; it is not at {bad.size} of {array.shape[-1]} {place}s, first {bad[0]}."
        )
    return array


def finite_values(name: str, value: Any, x: Floats, shape: tuple[int, ...], remedy: str = "") -> Floats:
    """Return the values of a function of points (d, n) in a shape, and refuse others.

    `remedy` is the end of the message about values that are not finite.
    """
    found = np.asarray(value(x) if callable(value) else value, float)
    if not found.shape and len(shape) == 1:
        found = np.full(shape, found)
    if found.shape != shape:
        names = "(n,)" if len(shape) == 1 else f"({shape[0]}, n)"
        raise ValueError(f"{name} must have shape {names} = {shape}; got {found.shape}.")
    bad = np.flatnonzero(~np.isfinite(np.atleast_2d(found)).all(axis=0))
    if bad.size:
        first = point_text(x[:, bad[0]])
        raise ValueError(
            f"{name} must be finite; it is not at {bad.size} of {shape[-1]} points, first {first}.{remedy}"
        )
    return found


def finite_coordinates(point: ArrayLike, what: str, count: int) -> tuple[float, ...]:
    try:
        found = tuple(float(coordinate) for coordinate in np.asarray(point, float))
    except (TypeError, ValueError):
        found = ()
    if len(found) != count or not all(map(isfinite, found)):
        wanted = "two finite numbers (x, y)" if count == 2 else "three finite numbers (x, y, z)"
        raise ValueError(f"{what} must be {wanted}; got {point!r}.")
    return found


finite_point = partial(finite_coordinates, count=2)
finite_triple = partial(finite_coordinates, count=3)


def checked_points(points: ArrayLike, what: str, dimension: int = 2) -> Floats:
    array = np.array(points, float)
    if array.ndim != 2 or len(array) != dimension:
        raise ValueError(f"{what} must have shape ({dimension}, n); got {array.shape}.")
    if not np.all(np.isfinite(array)):
        number = np.sum(~np.isfinite(array).all(axis=0))
        raise ValueError(f"{what} must be finite; {number} of {array.shape[1]} points are not.")
    return array
