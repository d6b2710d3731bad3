"""Words of code by chapter, and the sizes of files and folders, stay within their budgets."""

import ast
import io
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
COUNTED = {tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING}
MOST_LINES, MOST_FILES = 400, 20  # of a file, and in a folder
LONGER = {"kohonen_adapt/magnetostatics/scalar_potential.py"}
LARGER = {"benchmarks/checks", "benchmarks/peers", "benchmarks/problems"}
BUDGET = {
    "benchmarks": 1_314,
    "benchmarks/checks": 15_519,
    "benchmarks/peers": 18_633,
    "benchmarks/problems": 24_649,
    "kohonen_adapt": 6_163,
    "kohonen_adapt/cases": 12_227,
    "kohonen_adapt/commands": 9_987,
    "kohonen_adapt/docs": 592,
    "kohonen_adapt/estimators": 6_856,
    "kohonen_adapt/geometry": 50_564,
    "kohonen_adapt/io": 24_023,
    "kohonen_adapt/kernels": 84_525,
    "kohonen_adapt/loop": 20_596,
    "kohonen_adapt/magnetostatics": 56_180,
    "kohonen_adapt/mesh": 39_864,
    "kohonen_adapt/outline": 36,
    "kohonen_adapt/plotting": 8_816,
    "kohonen_adapt/polishing": 26_174,
    "kohonen_adapt/problem": 9_483,
    "kohonen_adapt/report": 3_369,
    "kohonen_adapt/som": 18_676,
    "kohonen_adapt/sweeps": 3_541,
    "tests": 215,
    "tests/benchmarks": 8_290,
    "tests/cases": 7_846,
    "tests/commands": 20_954,
    "tests/estimators": 10_870,
    "tests/geometry": 30_508,
    "tests/helpers": 38_365,
    "tests/io": 25_335,
    "tests/kernels": 13_498,
    "tests/loop": 31_160,
    "tests/magnetostatics": 47_905,
    "tests/mesh": 16_640,
    "tests/package": 12_681,
    "tests/plotting": 8_793,
    "tests/polishing": 24_920,
    "tests/problem": 9_016,
    "tests/refusals": 1_725,
    "tests/report": 5_139,
    "tests/som": 20_079,
    "tests/sweeps": 4_301,
}


def left_out(tree):
    """Lines of docstrings, imports and `__all__`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            yield from range(node.body[0].lineno, node.body[0].end_lineno + 1)
        named = isinstance(node, ast.Assign) and any(getattr(each, "id", "") == "__all__" for each in node.targets)
        if named or isinstance(node, ast.Import | ast.ImportFrom):
            yield from range(node.lineno, node.end_lineno + 1)


def words_of(source):
    """Names, operators and literals; an f-string is one, which from Python 3.12 on is several tokens."""
    gone, count, inside = set(left_out(ast.parse(source))), 0, 0
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        name = tokenize.tok_name[token.type]
        is_word = not inside and (token.type in COUNTED or name == "FSTRING_START")
        inside += (name == "FSTRING_START") - (name == "FSTRING_END")
        count += is_word and token.start[0] not in gone
    return count


def files():
    return [path for part in ("kohonen_adapt", "tests", "benchmarks") for path in sorted((ROOT / part).rglob("*.py"))]


def words_by_chapter():
    words = Counter()
    for path in files():
        words["/".join(path.relative_to(ROOT).parent.parts[:2])] += words_of(path.read_text(encoding="utf-8"))
    return words


def test_words_are_names_operators_and_literals():
    source = (
        '"""What it is."""\n\nimport os\n\n__all__ = ["f"]\n\n\ndef f(x):  # a comment\n    return f"{x} {os}" + 1\n'
    )
    assert words_of(source) == 10


def test_every_chapter_is_within_its_budget():
    """A number that is reached may be written here, with one per cent to spare."""
    words = words_by_chapter()
    assert {chapter: count for chapter, count in words.items() if count > BUDGET[chapter]} == {}
    assert words.keys() == BUDGET.keys()


def read_by_maintainers():
    return [path.relative_to(ROOT) for path in files() if path.relative_to(ROOT).parts[0] != "tests"]


def test_files_are_no_longer_than_one_reads_at_once():
    lengths = {str(path): (ROOT / path).read_bytes().count(b"\n") for path in read_by_maintainers()}
    assert {path for path, length in lengths.items() if length > MOST_LINES} <= LONGER


def test_folders_have_no_more_files_than_one_oversees():
    counts = Counter(str(path.parent) for path in read_by_maintainers() if path.name != "__init__.py")
    assert {folder for folder, count in counts.items() if count > MOST_FILES} <= LARGER
