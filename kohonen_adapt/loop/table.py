"""Table of passes as text and in HTML."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import Field, fields
from html import escape
from itertools import chain, pairwise
from math import floor, log10
from typing import Any

from kohonen_adapt.display import by_error, significant
from kohonen_adapt.loop.passes import Pass, Work, corrected_value

WIDTH = 120  # characters; further columns are printed as a second table below
GAP = "  "
DASH = "-"
SIGN_CHANGE = "sign"
ERROR_DIGITS = 2
GOAL_FIELDS = ("goal", "goal_error", "goal_unit")  # replaced by `goal_figures`

Columns = list[tuple[str, list[str]]]


def pass_figures(step: Pass) -> dict[str, Any]:
    figures: dict[str, Any] = {}
    for name in (entry.name for entry in fields(step) if entry.name not in (*GOAL_FIELDS, "output_errors", "doubts")):
        value = getattr(step, name)
        if isinstance(value, dict):
            singular = name.removesuffix("s") if name == "outputs" else name
            figures |= {f"{singular} {key}": number for key, number in value.items()}
        elif value is None or isinstance(value, int | float | str):
            figures[name] = value
    return figures | output_error_figures(step) | goal_figures(step)


def output_error_figures(step: Pass) -> dict[str, Any]:
    figures = dict[str, Any]()
    for name, error in step.output_errors.items():
        figures |= {f"error of output {name}": error, f"corrected output {name}": corrected_value(step, name)}
    return figures


def goal_figures(step: Pass) -> dict[str, float | None]:
    # The figures are the value, its error (None if not estimated), the corrected value, and the sum of the errors of
    # the elements.
    if step.goal is None:
        return {}
    total = corrected_value(step, "goal")
    figures = {"goal": step.goal, "error": step.goal_error, "goal + error": total, "estimate": step.shown_estimate}
    return {with_unit(name if name.startswith("goal") else f"goal {name}", step): figures[name] for name in figures}


def goal_sentence(step: Pass) -> str:
    if step.goal is None:
        return ""
    texts = goal_texts(step)
    if len(texts) == 1:
        return f"The goal is {texts[0]}; its error is not estimated."
    return "The goal is {}, with an estimated error of {}: the exact value is near {}.".format(*texts)


def goal_texts(step: Pass) -> list[str]:
    # the value, and if known its error and the corrected value
    value, error, total = list(goal_figures(step).values())[:3]
    texts = [by_error(each, error) for each in (value, total) if each is not None]
    texts[1:1] = [] if error is None else [significant(error, ERROR_DIGITS)]
    return [f"{text} {step.goal_unit}".rstrip() for text in texts]


def with_unit(name: str, step: Pass) -> str:
    return f"{name} ({step.goal_unit})" if step.goal_unit else name


def energy_norm_error(step: Pass) -> float | None:
    return 100.0 * step.estimate / step.energy_norm if step.calibrated and step.energy_norm else None


def energy_error(step: Pass) -> float | None:
    """Return the error of the energy in per cent, None if unknown.

    By Galerkin orthogonality the functional of a linear problem, int c/2 |grad u|^2 - f u, differs from its minimum by
    half the square of the error in the energy norm. Hence the relative error of the energy is (estimate / norm)^2. For
    nonlinear materials the estimate is in the norm of the linearised problem, and the relation holds near the solution.
    """
    error = energy_norm_error(step)
    return None if error is None else error**2 / 100.0


def word_for_estimate(history: Sequence[Pass]) -> str:
    return with_unit(estimate_word(history), history[0])


def estimate_word(history: Sequence[Pass]) -> str:
    return "estimate" if all(step.calibrated or step.goal is not None for step in history) else "indicator"


def change_of_output(before: float, after: float) -> float | None:
    return 100.0 * (abs(after) - abs(before)) / abs(before) if before and not changes_sign(before, after) else None


def changes_sign(before: float, after: float) -> bool:
    return min(before, after) < 0.0 < max(before, after)


def table_columns(history: tuple[Pass, ...]) -> list[Columns]:
    number = [("pass", [str(step.number) for step in history])]
    return [
        number,
        _solution_columns(history),
        *_goal_columns(history),
        *_output_columns(history),
        _work_columns(history),
    ]


def table_lines(history: tuple[Pass, ...], marks: Sequence[str]) -> list[str]:
    marks_with_title = ["", *marks]
    blocks = table_blocks(table_columns(history), width=WIDTH - max(map(len, marks_with_title)))
    return [line + mark for lines_so_far in blocks for line, mark in zip(lines_so_far, marks_with_title, strict=True)]


def html_table(history: tuple[Pass, ...], attributes: Sequence[str]) -> str:
    columns = list(chain.from_iterable(table_columns(history)))
    titles = _html_row("", "th", [title for title, _ in columns])
    rows = zip(attributes, *(cells for _, cells in columns), strict=True)
    lines = [_html_row(row_attributes, "td", cells) for row_attributes, *cells in rows]
    return "\n".join([f"<table><thead>{titles}</thead><tbody>", *lines, "</tbody></table>"])


def _html_row(attributes: str, kind: str, cells: Sequence[str]) -> str:
    return f"<tr{attributes}>" + "".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in cells) + "</tr>"


def _solution_columns(history: tuple[Pass, ...]) -> Columns:
    columns = [("nodes", [str(step.mesh.nvertices) for step in history])]
    if len({step.order for step in history}) > 1:
        columns.append(("order", [str(step.order) for step in history]))
    if any(step.unknowns != step.mesh.nvertices for step in history):
        columns.append(("unknowns", [str(step.unknowns) for step in history]))
    columns += [
        (word_for_estimate(history), [significant(step.shown_estimate, 4) for step in history]),
        ("change %", _changes([step.shown_estimate for step in history], ".1f")),
    ]
    if any(step.calibrated and step.energy_norm is not None for step in history):
        errors = [error for error in map(energy_norm_error, history) if error]
        decimals = _decimals(errors) if min(errors, default=1.0) < 0.01 else 2
        columns.append(("Energy-norm error %", _cells(energy_norm_error, decimals, history)))
        columns.append(("Energy error %", _cells(energy_error, _decimals(map(energy_error, history)), history)))
    if any(energy is not None for energy in map(_energy, history)):
        columns.append(("Delta Energy %", _changes([_energy(step) for step in history], ".2f")))
    return columns


def _goal_columns(history: tuple[Pass, ...]) -> list[Columns]:
    if history[0].goal is None:
        return []
    figures = [goal_figures(step) for step in history]
    value, error, total, _ = figures[0]  # the estimate has its column in `_solution_columns`
    least = _least([row[error] for row in figures])
    return [
        [
            (value, _by_error([row[value] for row in figures], least)),
            (error.replace("goal error", "error"), _significant([row[error] for row in figures])),
            (total, _by_error([row[total] for row in figures], least)),
        ]
    ]


def _least(errors: Iterable[float | None]) -> float | None:
    return min((abs(error) for error in errors if error is not None), default=None)


def _by_error(values: Iterable[float | None], error: float | None) -> list[str]:
    return [DASH if value is None else by_error(value, error) for value in values]


def _significant(values: Iterable[float | None]) -> list[str]:
    return [DASH if value is None else significant(value, ERROR_DIGITS) for value in values]


def _output_columns(history: tuple[Pass, ...]) -> list[Columns]:
    return [_columns_of_output(name, history) for name in history[0].outputs]


def _columns_of_output(name: str, history: tuple[Pass, ...]) -> Columns:
    values, errors = [step.outputs[name] for step in history], [step.output_errors.get(name) for step in history]
    least, changes = _least(errors), ("Delta %", [DASH, *map(_output_change, values, values[1:])])
    if least is None:
        return [(name, _by_error(values, None)), changes]
    pairs = zip(values, errors, strict=True)
    relative = [None if error is None or not value else 100.0 * error / abs(value) for value, error in pairs]
    corrected = [corrected_value(step, name) for step in history]
    return [
        (name, _by_error(values, least)),
        changes,
        ("error %", _significant(relative)),
        ("corrected", _by_error(corrected, least)),
    ]


def _output_change(before: float, after: float) -> str:
    change = change_of_output(before, after)
    return f"{change:+.2f}" if change is not None else SIGN_CHANGE if changes_sign(before, after) else DASH


def _work_columns(history: tuple[Pass, ...]) -> Columns:
    work = {entry.name for entry in fields(Work)}
    columns = [("elements", [str(step.mesh.t.shape[1]) for step in history])]
    columns += [_column(entry, history) for entry in _titled_fields(history) if entry.name not in work]
    columns.append(("seconds", [f"{sum(step.seconds.values()):.2f}" for step in history]))
    if any(step.functional is not None for step in history):
        columns.append(("gain of map", [DASH, *(_gain_of_map(*pair) for pair in pairwise(history))]))
    for entry in _titled_fields(history):
        if entry.name in work and any(getattr(step, entry.name) for step in history):
            title, cells = _column(entry, history)
            columns.append((title, [DASH, *cells[1:]]))
    return columns


def _titled_fields(history: tuple[Pass, ...]) -> list[Field[Any]]:
    return [entry for entry in fields(history[0]) if "title" in entry.metadata]


def _column(entry: Field[Any], history: tuple[Pass, ...]) -> tuple[str, list[str]]:
    return entry.metadata["title"], [_formatted(getattr(step, entry.name), entry.metadata["form"]) for step in history]


def _formatted(value: Any, form: str) -> str:
    return format(value, form).removesuffix(".")


def _cells(figure: Callable[[Pass], float | None], decimals: int, history: tuple[Pass, ...]) -> list[str]:
    return [DASH if value is None else f"{value:.{decimals}f}" for value in map(figure, history)]


def _decimals(values: Iterable[float | None]) -> int:
    least = min((value for value in values if value), default=1.0)
    return max(2, 1 - floor(log10(least)))


def _energy(step: Pass) -> float | None:
    if step.energy_norm is None:
        return step.functional if step.share is None else None
    return step.energy_norm**2


def _changes(values: Sequence[float | None], form: str) -> list[str]:
    return [
        DASH,
        *(f"{100.0 * (b - a) / abs(a):+{form}}" if a and b is not None else DASH for a, b in pairwise(values)),
    ]


def _gain_of_map(before: Pass, after: Pass) -> str:
    if before.functional is None or after.functional is None:
        return DASH
    return significant(before.functional - after.functional - after.polish_gain, 2)


def table_blocks(groups: list[Columns], width: int = WIDTH) -> Iterator[list[str]]:
    first, *others = (_aligned(group) for group in groups)
    lines_so_far = first
    for lines in others:
        if lines_so_far is not first and len(lines_so_far[0]) + len(GAP) + len(lines[0]) > width:
            yield lines_so_far
            lines_so_far = first
        lines_so_far = [GAP.join(pair) for pair in zip(lines_so_far, lines, strict=True)]
    yield lines_so_far


def _aligned(columns: Columns) -> list[str]:
    padded = []
    for title, cells in columns:
        width = max(map(len, [title, *cells]))
        padded.append([cell.rjust(width) for cell in [title, *cells]])
    return [GAP.join(row) for row in zip(*padded, strict=True)]
