"""Result of a sweep, a table of parameters and outputs with the errors of cases."""

import csv
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.files import whole_file
from kohonen_adapt.loop.table import DASH, Columns, table_blocks
from kohonen_adapt.sweeps.cases import SECONDS, Case, Outcome, Value

__all__ = ["SweepResult", "shown", "tabulated"]


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
        ``table["torque"]`` is an array of floats. Outputs of a case that has none are nan.
    errors
        For every case the exception raised, or None.
    """

    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    table: NDArray[Any] = field(repr=False)
    errors: tuple[Exception | None, ...] = field(repr=False)

    def to_csv(self, path: str | PathLike[str]) -> None:
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
        return name, [shown(value) for value in self.table[name].tolist()]


def shown(value: Value) -> str:
    if isinstance(value, float):
        return DASH if np.isnan(value) else f"{value:.6g}"
    return str(value)


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def tabulated(cases: list[Case], outcomes: list[Outcome]) -> SweepResult:
    parameters = tuple(cases[0])
    outputs = tuple(dict.fromkeys(name for outcome in outcomes for name in outcome.outputs))
    columns = {name: _values([case[name] for case in cases]) for name in parameters}
    columns |= {name: np.array([outcome.outputs.get(name, np.nan) for outcome in outcomes]) for name in outputs}
    columns[SECONDS] = np.array([outcome.seconds for outcome in outcomes])
    table = np.empty(len(cases), dtype=[(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return SweepResult(parameters, outputs, table, tuple(outcome.error for outcome in outcomes))


def _values(given: list[Value]) -> NDArray[Any]:
    kinds = {type(value) for value in given}
    return np.array(given, dtype=None if len(kinds) == 1 or kinds == {int, float} else object)
