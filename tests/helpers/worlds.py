"""Worlds in which something is missing."""

import errno
import os
import sys
from contextlib import contextmanager

import pytest


def without_matplotlib(monkeypatch):
    """Make importing matplotlib fail, and what needs it, for the rest of a test."""
    for name in [each for each in sys.modules if each.startswith(("matplotlib", "kohonen_adapt.plotting"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr("kohonen_adapt.plotting", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)


@contextmanager
def full_disk(is_hit):
    """Within it the disk is full whenever a file is to get a name for which `is_hit` holds."""
    replace = os.replace

    def full(source, target):
        if is_hit(str(target)):
            raise OSError(errno.ENOSPC, "No space left on device", str(source))
        replace(source, target)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(os, "replace", full)
        yield
