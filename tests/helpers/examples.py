"""Scale the number of examples that a property is tried on with hypothesis's profile (`tests/conftest.py` has them)."""

from hypothesis import settings

USUAL = 100  # examples of a test that names no number, in hypothesis's own profile and in that of every day


def examples(number, **options):
    """Settings for that many examples, in a profile that wants more of every test as many times more."""
    return settings(max_examples=number * settings.default.max_examples // USUAL, **options)
