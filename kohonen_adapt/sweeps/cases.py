"""Cases of a sweep, their computation, and the result of all."""

import csv
import pickle
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from traceback import format_exc
from typing import Any, SupportsFloat

import numpy as np

from kohonen_adapt.arrays import Array, FilePath
from kohonen_adapt.display import by_error
from kohonen_adapt.files import whole_file
from kohonen_adapt.loop.result import DASH, Columns, table_blocks

__all__ = [
    "ASKED",
    "ERROR",
    "SECONDS",
    "VALUE",
    "Case",
    "Outcome",
    "SweepResult",
    "Value",
    "compute",
    "list_cases",
    "shown",
    "tabulated",
]

Value = bool | int | float | str
Case = dict[str, Value]
Outputs = dict[str, float | str]

SECONDS = "seconds"  # reserved column of the table, not allowed as a parameter or an output
VALUE = "value"  # name of the output of a function that returns a single number
ERROR, ASKED = "error of ", "asked error of "  # before the names of outputs, of their estimated and allowed errors


def list_cases(given: Any) -> list[Case]:
    if not isinstance(given, Mapping | Iterable) or isinstance(given, str | bytes):
        raise ValueError(
            f"cases must be a sequence of mappings, or a mapping of names to sequences of values; got {given!r}."
        )
    rows: list[Any] = []
    if not isinstance(given, Mapping):
        rows = list(given)
    elif given:
        for name, each in given.items():
            if not isinstance(each, Iterable) or isinstance(each, str | bytes | Mapping):
                raise ValueError(
                    f"cases[{name!r}] must be a sequence of values; got {each!r}. One value is a list of one."
                )
        rows = [dict(zip(given, row, strict=True)) for row in product(*given.values())]
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


@dataclass(frozen=True)
class Outcome:
    """Outputs, duration and error of a case.

    Attributes
    ----------
    outputs
        Numbers and texts by name; empty after an error.
    seconds
        Duration in seconds.
    error
        The exception raised by the function, or None.
    """

    outputs: Outputs
    seconds: float
    error: Exception | None = None


def compute(function: Callable[..., Any], case: Case) -> Outcome:
    start = time.perf_counter()
    try:
        returned = function(**case)
        given = returned if isinstance(returned, Mapping) else {VALUE: returned}
        kinds = SupportsFloat | str if given is returned else SupportsFloat
        for name, value in given.items():
            if not isinstance(name, str) or not isinstance(value, kinds):
                raise TypeError(
                    f"the function must return a number, or names and their numbers or texts; got {returned!r}."
                )
            if name in ("", SECONDS, *case):
                raise ValueError(
                    f"the function must name its outputs otherwise than parameters and seconds; got {name!r}."
                )
        outputs = {name: value if isinstance(value, str) else float(value) for name, value in given.items()}
    except (Exception, SystemExit) as error:
        return Outcome({}, time.perf_counter() - start, _portable(error))
    return Outcome(outputs, time.perf_counter() - start)


def _portable(error: BaseException) -> Exception:
    error.add_note(format_exc())
    try:
        sent = pickle.loads(pickle.dumps(error))
    except Exception:  # pickling can raise anything
        sent = None
    if isinstance(sent, Exception) and type(sent) is type(error):
        return sent
    replacement = RuntimeError(f"{type(error).__name__}: {error}")
    replacement.add_note(format_exc())
    return replacement


@dataclass(frozen=True, eq=False)
class SweepResult:
    """Result of a sweep.

    ``print(result)`` shows the table and the errors.

    Attributes
    ----------
    parameters
        Names of the parameters.
    outputs
        Names of the outputs; ``("value",)`` if the function returns a single number.
    table
        Structured array (ncases,) with parameters, outputs and ``"seconds"``, in the order of the cases. For instance
        ``table["torque"]`` is an array of floats. Outputs of a case that has none are nan, and texts empty.
    errors
        For every case the exception raised, or None.
    """

    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    table: Array = field(repr=False)
    errors: tuple[Exception | None, ...] = field(repr=False)

    def to_csv(self, path: FilePath) -> None:
        """Write the table and the errors to a CSV file.

        Numbers are written in full precision. An interrupted call leaves no partial file.

        Parameters
        ----------
        path
            The file.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        with whole_file(Path(path)) as draft, draft.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow([*self.parameters, *self.outputs, SECONDS, "error"])
            for row, error in zip(self.table.tolist(), self.errors, strict=True):
                writer.writerow([*row, "" if error is None else _said(error)])

    def __str__(self) -> str:
        groups: list[Columns] = [[("case", [str(number) for number in range(self.table.size)])]]
        groups[0] += [self._column(name) for name in self.parameters]
        groups += [[self._column(name)] for name in self.outputs]
        groups.append([(SECONDS, [f"{value:.2f}" for value in self.table[SECONDS]])])
        failed = [f"case {k}: {_said(error)}" for k, error in enumerate(self.errors) if error is not None]
        return "\n".join([line for block in table_blocks(groups) for line in block] + failed)

    def _column(self, name: str) -> tuple[str, list[str]]:
        values, error = self.table[name].tolist(), f"{ERROR}{name}"
        if error in self.outputs:
            errors = self.table[error].tolist()
            pairs = zip(values, errors, strict=True)
            return name, [shown(v) if np.isnan([v, error]).any() else by_error(v, error) for v, error in pairs]
        is_error = any(name in (f"{ERROR}{each}", f"{ASKED}{each}") for each in self.outputs)
        return name, [f"{value:.2g}" if is_error and not np.isnan(value) else shown(value) for value in values]


def shown(value: Value) -> str:
    if isinstance(value, float):
        return DASH if np.isnan(value) else f"{value:.6g}"
    return str(value) or DASH


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def tabulated(cases: list[Case], outcomes: list[Outcome]) -> SweepResult:
    parameters = tuple(cases[0])
    outputs = tuple(dict.fromkeys(name for outcome in outcomes for name in outcome.outputs))
    columns = {name: _values([case[name] for case in cases]) for name in parameters}
    columns |= {name: _column_of(name, outcomes) for name in outputs}
    columns[SECONDS] = np.array([outcome.seconds for outcome in outcomes])
    table = np.empty(len(cases), [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return SweepResult(parameters, outputs, table, tuple(outcome.error for outcome in outcomes))


def _column_of(name: str, outcomes: list[Outcome]) -> Array:
    given = [outcome.outputs.get(name) for outcome in outcomes]
    if any(isinstance(value, str) for value in given):
        return np.array(["" if value is None else value for value in given], object)
    return np.array([np.nan if value is None else value for value in given])


def _values(given: list[Value]) -> Array:
    kinds = {type(value) for value in given}
    return np.array(given, None if len(kinds) == 1 or kinds == {int, float} else object)
