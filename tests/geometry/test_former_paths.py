"""Public names are found under the paths that they had before."""

import importlib
import sys

import pytest

import kohonen_adapt as ka


@pytest.mark.parametrize(
    ("module", "name"),
    [("curves", "Arc"), ("curves", "Line"), ("rules", "Rules"), ("spline", "Spline"), ("surfaces", "Cylinder")],
)
def test_a_former_path_warns_and_has_the_same_name(module, name):
    for loaded in [each for each in sys.modules if each.startswith("kohonen_adapt.outline")]:
        del sys.modules[loaded]
    with pytest.warns(DeprecationWarning, match=r"kohonen_adapt\.geometry"):
        found = importlib.import_module(f"kohonen_adapt.outline.{module}")
    assert getattr(found, name) is getattr(ka, name)
