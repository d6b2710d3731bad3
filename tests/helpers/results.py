"""Results of `adapt`, compared bit for bit."""

from dataclasses import fields

import numpy as np
from numpy.testing import assert_array_equal

import kohonen_adapt as ka


def assert_same_mesh(one, other):
    assert one.p.tobytes() == other.p.tobytes() and one.t.tobytes() == other.t.tobytes()
    for a, b in ((one.boundaries, other.boundaries), (one.subdomains, other.subdomains)):
        assert list(a or ()) == list(b or ())
        for name in a or ():
            assert a[name].dtype == b[name].dtype
            assert_array_equal(np.asarray(a[name]), np.asarray(b[name]))
            assert_array_equal(getattr(a[name], "ori", None), getattr(b[name], "ori", None))


def assert_same(one, other):
    """Whole results, but for the time they took."""
    assert_same_mesh(one.mesh, other.mesh)
    assert_array_equal(one.indicators, other.indicators)
    assert_array_equal(one.nodes, other.nodes)
    assert_array_equal(*(getattr(each.solution, "potential", each.solution) for each in (one, other)))
    assert (one.status, one.message, one.estimate) == (other.status, other.message, other.estimate)
    assert len(one.history) == len(other.history)
    for a, b in zip(one.history, other.history, strict=True):
        assert_same_mesh(a.mesh, b.mesh)
        assert_same_figures(a, b)


def assert_same_figures(one, other):
    """All fields of two passes, but their meshes and the time they took."""
    for name in (each.name for each in fields(ka.Pass) if "seconds" not in each.name and each.name != "mesh"):
        value, again = getattr(one, name), getattr(other, name)
        assert type(value) is type(again) or all(isinstance(each, float) for each in (value, again))
        if isinstance(value, np.ndarray):
            assert (value.dtype, value.shape) == (again.dtype, again.shape)
            assert value.tobytes() == again.tobytes()
        else:
            assert value == again
