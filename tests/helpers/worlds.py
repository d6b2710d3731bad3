"""Worlds in which something is missing."""

import sys


def without_matplotlib(monkeypatch):
    """Make importing matplotlib fail, and what needs it, for the rest of a test."""
    for name in [each for each in sys.modules if each.startswith(("matplotlib", "kohonen_adapt.plotting"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr("kohonen_adapt.plotting", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
