"""Hold the size and cost of the package against limits and against the last release."""

import re
from collections.abc import Iterator
from pathlib import Path

from benchmarks.checks.package_figures import figures
from benchmarks.checks.warmup import seconds_of_first_use
from benchmarks.table import Cell, aligned

ROOT = Path(__file__).parents[2]
SUITE, WARMUP = "seconds of the tests", "seconds of warm-up, cache empty"
LAST_RELEASE = {  # 0.4.0, its files counted for the chapters that they have moved to; seconds on two cores
    "lines": 22432,
    "lines of the top level": 260,
    "lines of kernels": 3865,
    "lines of mesh": 539,
    "lines of geometry": 1937,
    "lines of problem": 450,
    "lines of estimators": 782,
    "lines of som": 2072,
    "lines of polishing": 529,
    "lines of magnetostatics": 4285,
    "lines of io": 2392,
    "lines of loop": 1476,
    "lines of plotting": 1112,
    "lines of cases": 766,
    "lines of report": 573,
    "lines of commands": 1394,
    "files": 153,
    "files that are too long": 5,
    "files that are too short": 25,
    "folders of many files": 2,
    "long functions outside of kernels": 0,
    "functions of many arguments": 8,
    "functions of many arguments in kernels": 19,
    "longest chain of imports": 25,
    "dependencies": 6,
    SUITE: 432,
    WARMUP: 61,
}
LIMITS = {  # what has none here may not grow beyond the last release, lines of chapters apart
    "lines": 48_000,
    "files": 290,
    "files that are too long": 0,
    "files that are too short": 10,
    "folders of many files": 0,
    "functions of many arguments": 7,
    "functions of many arguments in kernels": 18,
    "longest chain of imports": 18,
}
NOISE = 1.2  # a busy machine takes so many times as long
RULES = """\
lines: of all files *.py in kohonen_adapt, blank ones and docstrings included
too long: more than 400 lines
too short: fewer than 60 lines, except an __init__.py that only imports and names
many files: more than 20
long functions: more than 40 lines without the docstring
many arguments: more than 8, self apart
chain of imports: files on the longest way down, imports in functions included"""


def report(suite: Path | None, warmup: bool) -> str:
    """Every figure beside the last release's and its limit; seconds of the tests out of what pytest printed to a file.

    Raises
    ------
    ValueError
        If the file does not end as pytest's output does.
    """
    now: dict[str, Cell] = {**figures(ROOT)}
    now[SUITE] = None if suite is None else seconds_of_suite(suite.read_text(encoding="utf-8"))
    now[WARMUP] = seconds_of_first_use() if warmup else None
    names = [*LAST_RELEASE, *(name for name in now if name not in LAST_RELEASE)]
    missing = [option for option, name in (("--suite FILE", SUITE), ("--warmup", WARMUP)) if now[name] is None]
    remarks = [f"measured on request: {' '.join(missing)}"] if missing else []
    rows = [[name, LAST_RELEASE.get(name), *judged(name, now.get(name))] for name in names]
    return "\n".join([aligned(["budget", "0.4.0", "now", "limit", ""], rows), *remarks, "", RULES])


def judged(name: str, value: Cell) -> Iterator[Cell]:
    """The figure, its limit and the verdict, as far as there are any."""
    limit = limit_of(name)
    yield from (value, limit)
    yield None if value is None or limit is None else "OK" if value <= limit else "over"


def limit_of(name: str) -> float | int | None:
    """A limit of the house, the last release's figure, or none."""
    if name.startswith("lines of "):
        return None
    last = LAST_RELEASE[name]
    return LIMITS.get(name, round(NOISE * last) if name in (SUITE, WARMUP) else last)


def seconds_of_suite(output: str) -> float:
    """What the last line of pytest's output says it took."""
    found = re.findall(r"^=*\s*\d+ \w+.* in ([\d.]+)s", output, re.MULTILINE)
    if not found:
        raise ValueError("the file of --suite must hold the output of pytest, with the line that ends it.")
    return float(found[-1])
