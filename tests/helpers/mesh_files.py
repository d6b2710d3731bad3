"""Meshes with names for the tests of files, and Gmsh where it can be imported."""

from contextlib import contextmanager

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from skfem import MeshTri

try:
    import gmsh
except (ImportError, OSError) as error:  # the wheel needs system libraries
    gmsh = None
    WHY_NOT = f"gmsh cannot be imported: {error}"
else:
    WHY_NOT = ""

needs_gmsh = pytest.mark.skipif(gmsh is None, reason=WHY_NOT)
SUFFIXES = [".msh", ".msh2", ".vtu"]


@contextmanager
def gmsh_session():
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        yield gmsh.model
    finally:
        gmsh.finalize()


def two_rooms():
    """Two squares side by side with an interface, a group over both, a part without a name."""
    mesh = MeshTri.init_tensor(np.linspace(0, 2, 9), np.linspace(0, 1, 5) / 3)
    mesh = mesh.with_subdomains(
        {
            "left": lambda x: x[0] < 1,
            "right side": lambda x: x[0] > 1,
            "low": lambda x: (x[1] < 0.15) & (x[0] < 1.5),
        }
    )
    return mesh.with_boundaries(
        {
            "outer": lambda x: (x[0] == 0) | (x[0] == 2),
            "floor": lambda x: x[1] == 0,
            "wall and floor": lambda x: (x[1] == 0) | (x[0] == 0),
            "interface": lambda x: x[0] == 1,
        },
        boundaries_only=False,
    )


def assert_same(mesh, other):
    assert type(mesh) is MeshTri
    assert_array_equal(mesh.p, other.p)
    assert_array_equal(mesh.t, other.t)
    for got, wanted in ((mesh.subdomains, other.subdomains), (mesh.boundaries, other.boundaries)):
        assert (got is None) == (wanted is None)
        assert set(got or ()) == set(wanted or ())
        for name in wanted or ():
            assert_array_equal(got[name], np.sort(np.asarray(wanted[name])))


def in_front(mesh, name):
    """For every facet of a boundary, in no order, where it is and where the element is that it faces."""
    boundary = mesh.boundaries[name]
    element = mesh.f2t[getattr(boundary, "ori", 0), boundary]
    places = [mesh.p[:, mesh.facets[:, boundary]].mean(axis=1), mesh.p[:, mesh.t[:, element]].mean(axis=1)]
    return sorted(map(tuple, np.vstack(places).round(12).T.tolist()))
