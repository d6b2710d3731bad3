"""Fill tables of Markdown files with those that a command has printed.

A table stands after a line `<!-- table: COMMAND, NUMBER -->`, with the number of the table in what the command prints.
"""

import os
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [
    Path(__file__).with_name("README.md"),
    ROOT / "README.md",
    *sorted((ROOT / "kohonen_adapt" / "docs").glob("*.md")),
]
TABLE = re.compile(r"(?:^\|.*\n?)+", re.MULTILINE)
PLACE = re.compile(r"^(?P<mark><!-- table: (?P<command>.+), (?P<number>\d+) -->\n)(?:\|.*\n)+", re.MULTILINE)


def fill(command: str, printed: str, pages: list[Path] = PAGES) -> list[Path]:
    """Write the tables of a command to their places, and return the pages that changed.

    Raises
    ------
    ValueError
        If a place has a number that was not printed; no page is written then.
    """
    tables = [found.rstrip("\n") + "\n" for found in TABLE.findall(printed)]
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    filled = {page: PLACE.sub(lambda place: _table(place, command, tables), text) for page, text in texts.items()}
    changed = [page for page in pages if filled[page] != texts[page]]
    for page in changed:
        _write_whole(page, filled[page])
    return changed


def _table(place: re.Match[str], command: str, tables: list[str]) -> str:
    number = int(place["number"])
    if place["command"] != command:
        return place[0]
    if not 0 < number <= len(tables):
        raise ValueError(f"{command} printed {len(tables)} tables; a page has a place for number {number}.")
    return place["mark"] + tables[number - 1]


def _write_whole(page: Path, text: str) -> None:
    whole = page.with_suffix(".new")
    whole.write_text(text, encoding="utf-8")
    os.replace(whole, page)
