"""The budget counts what it says it counts, on a package small enough to count by hand."""

import pytest

from benchmarks.checks import budget
from benchmarks.checks.package_figures import figures

FILES = {
    "__init__.py": '"""Public names."""\n\nfrom kohonen_adapt.loop.adapt import adapt\n\n__all__ = ["adapt"]\n',
    "loop/__init__.py": '"""The loop."""\n',
    "loop/adapt.py": "def adapt(a, b, c, d, e, f, g, h, i):\n    from .step import step\n\n    return step\n",
    "loop/step.py": "from kohonen_adapt.kernels import f\nclass Step:\n    def of(self, a, b, c, d, e, f, g, h): 0\n",
    "kernels/__init__.py": "def f(a, b, c, d, e, f, g, h, i): ...\n",
    "kernels/long.py": "x = 0\n" * 350 + "def f():\n" + "    x = 1\n" * 60,
    "mesh.py": "x = 0\n" * 330 + 'def f():\n    """' + "\n" * 70 + '    """\n' + "    x = 1\n" * 40,
}


@pytest.fixture
def checkout(tmp_path):
    (tmp_path / "pyproject.toml").write_text('[project]\ndependencies = ["numpy", "scipy"]\n')
    for name, text in FILES.items():
        path = tmp_path / "kohonen_adapt" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def test_figures_are_those_counted_by_hand(checkout):
    assert figures(checkout) == {
        "lines": 5 + 1 + 4 + 3 + 1 + 411 + 442,
        "files": 7,
        "files that are too long": 2,
        "files that are too short": 3,  # the loop's two files, and kernels/__init__.py, which defines a function
        "folders of many files": 0,
        "long functions outside of kernels": 0,  # 40 lines below its first
        "functions of many arguments": 1,
        "functions of many arguments in kernels": 1,
        "longest chain of imports": 4,
        "dependencies": 2,
        "lines of the top level": 5 + 442,
        "lines of loop": 8,
        "lines of kernels": 412,
    }


def test_files_that_import_one_another_are_an_error(checkout):
    (checkout / "kohonen_adapt" / "mesh.py").write_text("import kohonen_adapt.mesh2\n")
    (checkout / "kohonen_adapt" / "mesh2.py").write_text("from kohonen_adapt import mesh\n")
    with pytest.raises(ValueError, match="imports itself through others"):
        figures(checkout)


def test_seconds_are_those_of_the_last_line():
    assert budget.seconds_of_suite("1 passed in 3.00s\n=== 1 failed, 3752 passed in 431.93s (0:07:11) ===\n") == 431.93
    with pytest.raises(ValueError, match="output of pytest"):
        budget.seconds_of_suite("nothing")


def test_every_figure_stands_beside_its_limit():
    rows = budget.report(None, warmup=False).splitlines()
    (lines,) = [row.split() for row in rows if row.startswith("lines  ")]
    assert lines[1] == "22432" and lines[3] == "48000"
    assert lines[4] == ("OK" if int(lines[2]) <= 48000 else "over")
    assert "measured on request: --suite FILE --warmup" in rows
