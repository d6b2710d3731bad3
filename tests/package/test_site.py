"""The documentation site says what is so: programs and commands of its pages run, and every public name appears."""

import doctest
import inspect
import io
import re
import shlex

import pytest
from helpers.places import EXAMPLES, ROOT
from test_public_surface import MODULES

import kohonen_adapt as ka
from kohonen_adapt.__main__ import main
from kohonen_adapt.magnetostatics import Magnetostatics, Material

DOCS = ROOT / "kohonen_adapt" / "docs"
PAGES = {path.stem: path.read_text(encoding="utf-8") for path in sorted(DOCS.glob("*.md"))}
BLOCKS = re.compile(r"^```(python|pycon|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
RUN = sorted(name for name, text in PAGES.items() if BLOCKS.search(text))
NUMBER = re.compile(r"-?\d+\.\d+(?:e[-+]\d+)?")


class NearlySame(doctest.OutputChecker):
    """The same words and integers; decimal fractions to 3 %, as other processors add up in another order."""

    def check_output(self, want, got, optionflags):
        wanted, given = ([float(number) for number in NUMBER.findall(text)] for text in (want, got))
        words = super().check_output(NUMBER.sub("#", want), NUMBER.sub("#", got), optionflags)
        return words and wanted == pytest.approx(given, rel=0.03)


def run_pycon(text, scope, name):
    """A dialogue with Python, in the names of the page so far."""
    report = io.StringIO()
    runner = doctest.DocTestRunner(NearlySame(), optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    dialogue = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    dialogue.globs = scope
    runner.run(dialogue, out=report.write, clear_globs=False)
    assert runner.failures == 0, report.getvalue()


def run_console(text, capsys):
    """Commands after "$ " with what they print."""
    for command, wanted in re.findall(r"^\$ kohonen-adapt (.*)\n((?:(?!\$ ).*\n)*)", text, re.MULTILINE):
        assert main(shlex.split(command)) == 0
        given = capsys.readouterr().out
        assert NearlySame().check_output(wanted, given, doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE), given


@pytest.mark.slow
@pytest.mark.parametrize("name", RUN)
def test_what_a_page_does_gives_what_it_says(name, tmp_path, monkeypatch, capsys):
    """From the beginning of the page to its end, as a reader would who tries everything."""
    (tmp_path / "examples").symlink_to(EXAMPLES)
    monkeypatch.chdir(tmp_path)
    scope = {"__name__": "__main__"}
    for kind, text in BLOCKS.findall(PAGES[name]):
        if kind == "python":
            exec(compile(text, f"{name}.md", "exec"), scope)
        elif kind == "pycon":
            run_pycon(text, scope, name)
        else:
            run_console(text, capsys)


def test_the_guides_are_tried():
    assert {"first_steps", "own_problem", "magnetostatics", "sweeps", "how_it_works"} <= set(RUN)


@pytest.mark.parametrize(
    ("name", "things"), [("magnetostatics", [Magnetostatics, Material]), ("own_problem", [ka.Ritz])]
)
def test_a_guide_names_every_argument_of_what_it_is_about(name, things):
    arguments = {argument for thing in things for argument in inspect.signature(thing).parameters}
    assert arguments - set(re.findall(r"\w+", PAGES[name])) == set()


def test_the_guide_names_everything_that_a_problem_may_offer():
    offered = set(re.findall(r"``(\w+)(?:\(.*?\))?[^`]*``", ka.Problem.__doc__))
    assert offered >= {"order", "norm", "solve_from", "energy_norm", "ritz", "pairs", "points", "curves", "improved"}
    assert offered - set(re.findall(r"\w+", PAGES["own_problem"])) == set()


def names_documented():
    """Full names of what the reference is generated for."""
    module = ""
    for page in DOCS.glob("api*.md"):
        for directive, target in re.findall(r"^\.\. (\w+):: (\S+)$", PAGES[page.stem], re.MULTILINE):
            if directive == "currentmodule":
                module = target
            elif directive not in ("automethod", "autoattribute"):
                yield f"{module}.{target}"


def is_other_name(module, name):
    found = getattr(module, name)
    return isinstance(found, type) and found.__name__ != name


def test_the_reference_has_every_public_name_once():
    public = {f"{module.__name__}.{name}" for module in MODULES for name in module.__all__}
    public -= {module.__name__ for module in MODULES}
    public -= {
        f"{module.__name__}.{name}" for module in MODULES for name in module.__all__ if is_other_name(module, name)
    }
    documented = list(names_documented())
    assert sorted(documented) == sorted(public)


def test_the_gallery_shows_every_script_and_every_picture():
    gallery = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    scripts = [path.name for path in EXAMPLES.glob("*.py") if "__main__" in path.read_text(encoding="utf-8")]
    pictures = [f"pictures/{path.name}" for path in (EXAMPLES / "pictures").iterdir()]
    assert [name for name in [*scripts, *pictures] if name not in gallery] == []
