"""The README does what it says: its example runs as it stands, and the test command is where CI looks for it."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from kohonen_adapt.cases import case_of

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def test_the_case_fits_its_mesh():
    (case,) = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    assert case_of(tomllib.loads(case), ROOT).fitting_mesh().p.shape == (2, 899)


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
    assert "Energy Error %" in capsys.readouterr().out
    assert (tmp_path / "magnet.vtu").stat().st_size > 0


def test_the_test_command_follows_its_marker():
    command = re.search(r"<!-- test command -->\n```bash\n(.*?)```", README, re.DOTALL)
    assert command and "pytest" in command[1]


@pytest.mark.parametrize("path", sorted(set(re.findall(r"(?:examples|benchmarks|\.ci)/[\w./]*\w", README))))
def test_every_file_it_names_is_there(path):
    assert (ROOT / path).exists() or path == "examples/"
