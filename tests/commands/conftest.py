"""Fixtures of the tests of commands."""

import pytest
from helpers.cases import run_command


@pytest.fixture
def out(tmp_path):
    """A folder for results, which is not there yet."""
    return tmp_path / "out"


@pytest.fixture
def refused(tmp_path, capsys):
    """Check that a dry run of a case is refused, and that its last line holds some words."""

    def check(text, said):
        (tmp_path / "case.toml").write_text(text)
        assert run_command("run", tmp_path / "case.toml", "--dry-run") == 2
        assert said in capsys.readouterr().err.splitlines()[-1]

    return check
