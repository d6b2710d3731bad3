"""Plain aligned text for every table that the benchmarks print."""

from collections.abc import Sequence

Cell = str | float | int | None


def aligned(header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """First column to the left, the others to the right; four significant digits, None left empty."""
    text = [list(header), *([_cell(value) for value in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*text, strict=True)]
    return "\n".join(_line(row, widths) for row in text)


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    cells = [row[0].ljust(widths[0])] + [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
    return "  ".join(cells).rstrip()


def _cell(value: Cell) -> str:
    if value is None:
        return ""
    return f"{value:#.4g}" if isinstance(value, float) else str(value)
