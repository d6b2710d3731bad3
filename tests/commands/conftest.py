"""Fixtures of the tests of commands."""

import pytest


@pytest.fixture
def out(tmp_path):
    """A folder for results, which is not there yet."""
    return tmp_path / "out"
