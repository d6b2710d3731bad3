"""The READMEs and the site do what they say: examples run, cases fit their meshes, and names are there."""

import importlib
import re
import shutil
import tomllib
from pathlib import Path

import pytest
from helpers.places import ROOT

import kohonen_adapt as ka
from kohonen_adapt import magnetostatics
from kohonen_adapt.cases import case_of, fitting_mesh
from kohonen_adapt.cases.readers import kinds_of
from kohonen_adapt.cases.reading import ADAPT, PROBLEM
from kohonen_adapt.cases.tables import COILS, GOALS, LAWS, MOTIONS, PATTERNS, QUANTITIES, SHAPES

READMES = ("README.md", "examples/README.md", "benchmarks/README.md", "kohonen_adapt/README.md")
SITE = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "kohonen_adapt" / "docs").glob("*.md"))
PAGES = {page: (ROOT / page).read_text(encoding="utf-8") for page in (*READMES, *SITE)}
README = PAGES["README.md"]
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
CASES = [(page, case) for page, text in PAGES.items() for case in re.findall(r"```toml\n(.*?)```", text, re.DOTALL)]


@pytest.mark.parametrize(("page", "case"), CASES)
def test_every_case_fits_its_mesh(page, case):
    given = tomllib.loads(case)
    mesh = fitting_mesh(case_of(given, (ROOT / page).parent))
    assert mesh.nvertices == {"c_core.msh": 899, "motor.msh": 4692, "gripper.msh": 1510}[Path(given["mesh"]).name]


def test_every_key_of_a_case_is_explained():
    said = set(re.findall(r"\w+", PAGES["examples/README.md"].partition("## From the command line")[2]))
    makers = [LAWS, PATTERNS, COILS, QUANTITIES, GOALS, SHAPES, MOTIONS]
    named = {name for table in makers for name in table}
    arguments = {key for table in makers for make in table.values() for key in kinds_of(make)}
    assert {"mesh", "scale", "materials", *PROBLEM, *ADAPT, *named, *arguments} <= said


def test_the_example_runs_as_it_stands(tmp_path, monkeypatch, capsys):
    (example,) = [block for block in BLOCKS if block.startswith("import kohonen_adapt")]
    assert len([line for line in example.splitlines() if line]) <= 12
    (tmp_path / "examples").mkdir()
    shutil.copy(ROOT / "examples" / "c_core.msh", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    scope = {}
    exec(example, scope)
    history = scope["result"].history
    assert history[-1].estimate < 0.75 * history[0].estimate
    assert "Energy-norm error %" in capsys.readouterr().out
    assert (tmp_path / "magnet.vtu").stat().st_size > 0


def test_every_piece_of_python_is_python():
    for page, text in PAGES.items():
        for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
            compile(code, page, "exec")


def test_the_test_command_follows_its_marker():
    command = re.search(r"<!-- test command -->\n```bash\n(.*?)```", README, re.DOTALL)
    assert command and "pytest" in command[1]


PATHS = re.compile(r"(?<![\w/])(?:examples|benchmarks|tests|kohonen_adapt|\.ci)/[\w./]*\w")
LINKS = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


def test_every_file_it_names_is_there():
    named = {(page, path) for page, text in PAGES.items() for path in PATHS.findall(text)}
    assert named and not {(page, path) for page, path in named if not (ROOT / path).exists()}


def test_every_link_leads_somewhere():
    links = {(page, path) for page, text in PAGES.items() for path in LINKS.findall(text)}
    assert links and not {(page, path) for page, path in links if not ((ROOT / page).parent / path).exists()}


def names_after(prefix):
    return {name for text in PAGES.values() for name in re.findall(rf"\b{prefix}\.(\w+)", text)}


def test_every_name_of_the_package_is_there():
    assert names_after("ka") <= set(ka.__all__)
    assert names_after("plotting") <= set(importlib.import_module("kohonen_adapt.plotting").__all__)


def test_every_property_of_a_field_is_there():
    kinds = (magnetostatics.Field, magnetostatics.SolidField)
    known = {name for kind in kinds for name in [*dir(kind), *kind.__dataclass_fields__]}
    assert names_after("field") <= known
