"""The maintainers' page names files that exist, and names in them."""

import re

from helpers.places import PACKAGE

TEXT = (PACKAGE / "README.md").read_text(encoding="utf-8")
PART = TEXT.partition("## Where to begin")[2].partition("## ")[0]
ROWS = [row.split("|")[2] for row in PART.splitlines()[4:] if "|" in row]


def test_every_file_exists_and_has_the_names_behind_it():
    assert len(ROWS) >= 6
    for row in ROWS:
        for path, names in re.findall(r"`([\w/.]+)`(?: \(([^)]*)\))?", row):
            text = (PACKAGE / path).read_text(encoding="utf-8") if "/" in path else ""
            for name in re.findall(r"`(\w+)`", names):
                assert name in text, f"{path} has no {name}"


def test_a_rule_needs_four_files_at_most():
    assert len(re.findall(r"`[\w/]+\.py`", ROWS[0])) <= 4
