"""Docstrings, comments and names are plain English; the counts of faults may only fall."""

from pathlib import Path

from helpers.prose import HUMAN, PRONOUNS, comments, docstrings, faults, house_names, plain

import kohonen_adapt

FILES = sorted(Path(kohonen_adapt.__file__).parent.rglob("*.py"))

FLAGGED = 1
LATER = 1  # paragraphs after the first
COMMENTS = 0
OLD_NAMES = 11  # the field `worth` of `Pass`


def test_docstrings():
    texts = [(path, *each) for path in FILES for each in docstrings(path)]
    flagged = [f"{path}:{line} {name}" for path, line, name, kind, text in texts if faults(text, kind)]
    assert len(flagged) <= FLAGGED, flagged
    later = [
        f"{path}:{line} {name}"
        for path, line, name, _, text in texts
        for paragraph in text.split("\n\n")[1:]
        if HUMAN.search(plain(paragraph))
    ]
    assert len(later) <= LATER, later


def test_comments():
    found = [
        f"{path}:{line} {text}"
        for path in FILES
        for line, text in comments(path)
        if HUMAN.search(plain(text)) or PRONOUNS.search(plain(text))
    ]
    assert len(found) <= COMMENTS, found


def test_names():
    found = [f"{path}:{line} {name}" for path in FILES for line, name in house_names(path)]
    assert len(found) <= OLD_NAMES, found
