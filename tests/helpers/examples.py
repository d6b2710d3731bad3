"""Scale the number of examples that a property is tried on with hypothesis's profile (`tests/conftest.py` has them)."""

from hypothesis import settings

USUAL = 100  # examples of a test that names no number, in hypothesis's own profile
FEW = 12  # examples of a test that no profile makes fewer


def examples(number, **options):
    """Settings for that many examples, times those that the profile has of every test in hundredths."""
    scaled = number * settings.default.max_examples // USUAL
    return settings(max_examples=max(min(number, FEW), scaled), **options)
