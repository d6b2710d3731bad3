"""Write the tables of the benchmarks in Markdown, with columns that are aligned in plain text."""

from collections.abc import Sequence

Cell = str | float | int | None


def markdown(header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """First column to the left, the others to the right; four significant digits, None left empty."""
    text = [list(header), *([_cell(value) for value in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*text, strict=True)]
    rule = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]
    text.insert(1, rule)
    return "\n".join(
        f"| {row[0].ljust(widths[0])} | {' | '.join(map(str.rjust, row[1:], widths[1:]))} |" for row in text
    )


def _cell(value: Cell) -> str:
    if value is None:
        return ""
    return f"{value:#.4g}" if isinstance(value, float) else str(value)
