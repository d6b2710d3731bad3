"""Places of files that tests look at, and what is there."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
PACKAGE = ROOT / "kohonen_adapt"


def names_in(folder):
    """Return the names in a folder in their order."""
    return sorted(file.name for file in folder.iterdir())
