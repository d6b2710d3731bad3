"""Tables of a command are filled where they have a place, all of them or none."""

import re

import pytest

from benchmarks.__main__ import REPORTS
from benchmarks.written import PAGES, PLACE, fill

PAGE = """Text.

<!-- table: time, 2 -->
| a | b |
|---|---|
| 1 | 2 |

<!-- table: error, 1 -->
| kept |
|---|
"""
PRINTED = "Title:\n\n| first |\n| --- |\n\n| a | b |\n| - | - |\n| 3 | \\4 |\n\nEnd."


def test_a_table_is_filled_and_the_rest_kept(tmp_path):
    page, other = tmp_path / "page.md", tmp_path / "other.md"
    page.write_text(PAGE, encoding="utf-8")
    other.write_text("No place.\n", encoding="utf-8")
    assert fill("time", PRINTED, [page, other]) == [page]
    assert page.read_text(encoding="utf-8") == PAGE.replace("|---|---|\n| 1 | 2 |", "| - | - |\n| 3 | \\4 |")
    assert fill("time", PRINTED, [page, other]) == []
    assert sorted(tmp_path.iterdir()) == [other, page]


def test_nothing_is_written_if_a_table_is_missing(tmp_path):
    first, second = tmp_path / "first.md", tmp_path / "second.md"
    first.write_text(PAGE, encoding="utf-8")
    second.write_text(PAGE.replace("time, 2", "time, 3"), encoding="utf-8")
    with pytest.raises(ValueError, match="time printed 2 tables; a page has a place for number 3"):
        fill("time", PRINTED, [first, second])
    assert first.read_text(encoding="utf-8") == PAGE


def test_every_place_has_a_command_and_a_table():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        places = [place["command"] for place in PLACE.finditer(text)]
        assert len(places) == text.count("<!-- table:"), page
        assert {re.sub(" --.*", "", command) for command in places} <= REPORTS.keys(), page
