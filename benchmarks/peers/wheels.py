"""Tell which optional wheels of the benchmarks (`pip install .[bench]`) can be imported, and why others cannot."""

import importlib


def missing(name: str) -> str:
    """One line that says why a module cannot be imported, empty if it can."""
    try:
        importlib.import_module(name)
    except (ImportError, OSError) as error:  # the wheel of gmsh needs system libraries
        return f"{name} cannot be imported ({error}); pip install .[bench]"
    return ""
