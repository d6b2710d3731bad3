"""A package of a test with loops of its own, compiled and cached as those of `kohonen_adapt.kernels`."""

from pathlib import Path

import pytest

import kohonen_adapt
from kohonen_adapt.kernels.numba.switch import PLAIN

fast_compiler_only = pytest.mark.skipif(PLAIN, reason="kernels are compiled by plain numba")

FENCE = Path(kohonen_adapt.__file__).parent / "kernels" / "numba"


def make_package(folder):
    """Put what compiles loops into a new package, whose modules import `.numba.compilation`."""
    (folder / "numba").mkdir(parents=True)
    (folder / "__init__.py").touch()
    for path in FENCE.glob("*.py"):
        text = path.read_text().replace("kohonen_adapt.kernels.numba", f"{folder.name}.numba")
        (folder / "numba" / path.name).write_text(text)
