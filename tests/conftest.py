"""What holds for every test."""

import logging

import pytest


@pytest.fixture(autouse=True)
def quiet_again():
    """The command turns the package's remarks on for its process; here other tests follow."""
    logger = logging.getLogger("kohonen_adapt")
    level = logger.level
    yield
    logger.setLevel(level)
