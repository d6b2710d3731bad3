"""Lay out passes as a table: in text no wider than a terminal, and in HTML."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import Field, fields
from html import escape
from itertools import chain, pairwise
from typing import Any

from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.outline.movable import Work

__all__ = [
    "DASH",
    "Columns",
    "change_of_output",
    "energy_error",
    "has_turned",
    "html_table",
    "pass_figures",
    "table_blocks",
    "table_columns",
    "table_lines",
    "word_for_estimate",
]

WIDTH = 120  # of a printed table; what does not fit goes into another beneath
GAP = "  "
DASH = "-"
TURNED = "sign"

Columns = list[tuple[str, list[str]]]


def pass_figures(step: Pass) -> dict[str, Any]:
    """Every number and text of a pass by the name of its field, outputs and seconds each by a name of their own."""
    figures: dict[str, Any] = {}
    for name in (each.name for each in fields(step)):
        value = getattr(step, name)
        if isinstance(value, dict):
            singular = name.removesuffix("s") if name == "outputs" else name
            figures |= {f"{singular} {key}": number for key, number in value.items()}
        elif value is None or isinstance(value, int | float | str):
            figures[name] = value
    return figures


def energy_error(step: Pass) -> float | None:
    """The estimate as a share of the energy norm, in per cent; None without such a norm or a calibrated estimate."""
    return 100.0 * step.estimate / step.energy_norm if step.calibrated and step.energy_norm else None


def word_for_estimate(history: Sequence[Pass]) -> str:
    """What to call the estimates of these passes: "estimate" only where the problem vouches for their scale."""
    return "estimate" if all(step.calibrated for step in history) else "indicator"


def change_of_output(before: float, after: float) -> float | None:
    """What an output has gained in magnitude, in per cent; None from 0 and to the other sign."""
    return 100.0 * (abs(after) - abs(before)) / abs(before) if before and not has_turned(before, after) else None


def has_turned(before: float, after: float) -> bool:
    """Whether an output has changed its sign."""
    return min(before, after) < 0.0 < max(before, after)


def table_columns(history: tuple[Pass, ...]) -> list[Columns]:
    """The columns of the table in groups that stay together: what was solved, what of it was asked, what was done."""
    number = [("pass", [str(step.number) for step in history])]
    return [number, _solved(history), *_outputs(history), _done(history)]


def table_lines(history: tuple[Pass, ...], marks: Sequence[str]) -> list[str]:
    """The table as lines no wider than 120 characters, with a mark behind the row of every pass."""
    behind = ["", *marks]
    blocks = table_blocks(table_columns(history), width=WIDTH - max(map(len, behind)))
    return [line + mark for block in blocks for line, mark in zip(block, behind, strict=True)]


def html_table(history: tuple[Pass, ...], attributes: Sequence[str]) -> str:
    """The table in HTML, its rows with these attributes; names are text in it, whatever they hold."""
    columns = list(chain.from_iterable(table_columns(history)))
    titles = _html_row("", "th", [title for title, _ in columns])
    rows = zip(attributes, *(cells for _, cells in columns), strict=True)
    lines = [_html_row(given, "td", cells) for given, *cells in rows]
    return "\n".join([f"<table><thead>{titles}</thead><tbody>", *lines, "</tbody></table>"])


def _html_row(attributes: str, kind: str, cells: Sequence[str]) -> str:
    return f"<tr{attributes}>" + "".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in cells) + "</tr>"


def _solved(history: tuple[Pass, ...]) -> Columns:
    columns = [("nodes", [str(step.mesh.nvertices) for step in history])]
    if any(step.unknowns != step.mesh.nvertices for step in history):
        columns.append(("unknowns", [str(step.unknowns) for step in history]))
    columns += [
        (word_for_estimate(history), [f"{step.estimate:.4g}" for step in history]),
        ("change %", _changes([step.estimate for step in history], ".1f")),
    ]
    if any(step.calibrated and step.energy_norm is not None for step in history):
        columns.append(("Energy Error %", _cells(energy_error, ".2f", history)))
    if any(energy is not None for energy in map(_energy, history)):
        columns.append(("Delta Energy %", _changes([_energy(step) for step in history], ".2f")))
    return columns


def _outputs(history: tuple[Pass, ...]) -> list[Columns]:
    """One group per output: its values and the changes of their magnitude."""
    return [
        [(name, [f"{value:.5g}" for value in values]), ("Delta %", [DASH, *map(_gain, values, values[1:])])]
        for name in history[0].outputs
        for values in [[step.outputs[name] for step in history]]
    ]


def _gain(before: float, after: float) -> str:
    change = change_of_output(before, after)
    return f"{change:+.2f}" if change is not None else TURNED if has_turned(before, after) else DASH


def _done(history: tuple[Pass, ...]) -> Columns:
    """The mesh of every pass, what is derived of the pass, and what made the mesh: nothing made the input."""
    work = {each.name for each in fields(Work)}
    columns = [("elements", [str(step.mesh.t.shape[1]) for step in history])]
    columns += [_column(each, history) for each in _titled(history) if each.name not in work]
    columns.append(("seconds", [f"{sum(step.seconds.values()):.2f}" for step in history]))
    if any(step.functional is not None for step in history):
        columns.append(("gain of map", [DASH, *(f"{_gain_of_map(*pair):.2g}" for pair in pairwise(history))]))
    for each in _titled(history):
        if each.name in work and any(getattr(step, each.name) for step in history):
            title, cells = _column(each, history)
            columns.append((title, [DASH, *cells[1:]]))
    return columns


def _titled(history: tuple[Pass, ...]) -> list[Field[Any]]:
    """The fields whose metadata name a column."""
    return [each for each in fields(history[0]) if "title" in each.metadata]


def _column(each: Field[Any], history: tuple[Pass, ...]) -> tuple[str, list[str]]:
    return each.metadata["title"], [format(getattr(step, each.name), each.metadata["form"]) for step in history]


def _cells(figure: Callable[[Pass], float | None], form: str, history: tuple[Pass, ...]) -> list[str]:
    return [DASH if value is None else f"{value:{form}}" for value in map(figure, history)]


def _energy(step: Pass) -> float | None:
    """What stands for the energy of a solution: the square of its energy norm, else the functional it minimises.

    That of a goal is none.
    """
    if step.energy_norm is None:
        return step.functional if step.share is None else None
    return step.energy_norm**2


def _changes(values: Sequence[float | None], form: str) -> list[str]:
    """Change in per cent from each value to the next, a dash where there is none to compare."""
    return [
        DASH,
        *(f"{100.0 * (b - a) / abs(a):+{form}}" if a and b is not None else DASH for a, b in pairwise(values)),
    ]


def _gain_of_map(before: Pass, after: Pass) -> float:
    """What a pass took off the Ritz functional beside its polish."""
    return (before.functional or 0.0) - (after.functional or 0.0) - after.polish_gain


def table_blocks(groups: list[Columns], width: int = WIDTH) -> Iterator[list[str]]:
    """The lines of tables that are not wider than that, each with the first group; a group is never divided."""
    first, *others = (_aligned(group) for group in groups)
    block = first
    for lines in others:
        if block is not first and len(block[0]) + len(GAP) + len(lines[0]) > width:
            yield block
            block = first
        block = [GAP.join(pair) for pair in zip(block, lines, strict=True)]
    yield block


def _aligned(columns: Columns) -> list[str]:
    """Lines of the columns side by side, their titles first."""
    padded = []
    for title, cells in columns:
        width = max(map(len, [title, *cells]))
        padded.append([cell.rjust(width) for cell in [title, *cells]])
    return [GAP.join(row) for row in zip(*padded, strict=True)]
