"""Align the text of every table that the benchmarks print, and print the same in Markdown for README.md."""

from collections.abc import Sequence

Cell = str | float | int | None


def aligned(header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """First column to the left, the others to the right; four significant digits, None left empty."""
    return "\n".join("  ".join(cells).rstrip() for cells in _padded(header, rows))


def markdown(header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """The same with Markdown's lines."""
    first, *others = _padded(header, rows)
    rule = ["-" * len(first[0]), *("-" * (len(cell) - 1) + ":" for cell in first[1:])]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (first, rule, *others))


def _padded(header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> list[list[str]]:
    text = [list(header), *([_cell(value) for value in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*text, strict=True)]
    return [
        [row[0].ljust(widths[0])] + [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        for row in text
    ]


def _cell(value: Cell) -> str:
    if value is None:
        return ""
    return f"{value:#.4g}" if isinstance(value, float) else str(value)
