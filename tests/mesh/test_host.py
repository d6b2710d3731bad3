"""scikit-fem still keeps its facets and names where we put them, and facets are numbered exactly as it numbers them."""

import ast
from pathlib import Path

import numpy as np
import pytest
import skfem
from helpers import tetrahedra
from helpers.meshes import comb, generic_square, holed, l_shape, perturbed, slit, square
from helpers.tetrahedra import hollow, turned
from numpy.testing import assert_array_equal
from skfem import MeshTet, MeshTri

import kohonen_adapt
from kohonen_adapt.mesh.host import keys_of, number_facets

MESHES = {
    "one triangle": MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]])),
    "square": square(5),
    "random": perturbed(generic_square(9), 3),
    "holed": holed(6),
    "comb": comb(10),
    "slit": slit(6),
    "tetrahedra": MeshTet().refined(1),
    "hollow": hollow(3),
    "comb of tetrahedra": tetrahedra.comb(5),
    "slit of tetrahedra": tetrahedra.slit(4),
}


def assert_numbered_as_scikit_fem_does(mesh):
    facets, t2f = mesh.build_entities(mesh.t, mesh.elem.refdom.facets)
    for mine, theirs in ((mesh.facets, facets), (mesh.t2f, t2f), (mesh.f2t, mesh.build_inverse(mesh.t, t2f))):
        assert_array_equal(mine, theirs)
        assert mine.dtype == theirs.dtype
        assert mine.flags.c_contiguous


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_facets_are_those_of_scikit_fem(name, seed):
    mesh = MESHES[name] if seed is None else turned(MESHES[name], seed)
    fresh = type(mesh)(mesh.p, mesh.t, sort_t=False)
    number_facets(fresh)
    assert_numbered_as_scikit_fem_does(fresh)


PACKAGE = Path(kohonen_adapt.__file__).parent
PRIVATE = {"_boundaries", "_subdomains", "_facets", "_t2f", "_f2t"}


def private_names_in(path):
    """Names of scikit-fem's own that a file gives or uses."""
    for each in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(each, ast.keyword) and each.arg in PRIVATE:
            yield each.arg
        elif isinstance(each, ast.Attribute) and each.attr in PRIVATE and ast.unparse(each.value) != "self":
            yield each.attr


def test_no_other_file_reaches_into_a_mesh():
    files = {path for path in PACKAGE.rglob("*.py") if any(private_names_in(path))}
    assert files == {PACKAGE / "mesh" / "host.py"}, "put it into mesh/host.py"


@pytest.fixture
def no_sorting(monkeypatch):
    """Let scikit-fem fail where it would number facets itself."""

    def refuse(*_):
        raise AssertionError("scikit-fem works out again what it was given")

    monkeypatch.setattr(skfem.Mesh, "build_entities", staticmethod(refuse))
    monkeypatch.setattr(skfem.Mesh, "build_inverse", staticmethod(refuse))


def test_scikit_fem_takes_the_facets_that_it_was_given(no_sorting):
    """Were it to keep them under other names one day, nothing would be wrong but everything slow."""
    mesh = l_shape(3)
    with pytest.raises(AssertionError, match="works out again"):
        MeshTri(mesh.p, mesh.t).facets  # noqa: B018
    number_facets(mesh)
    assert mesh.facets.shape == (2, mesh.t2f.max() + 1) and mesh.f2t.shape == mesh.facets.shape
    assert len(mesh.boundary_facets()) == np.sum(mesh.f2t[1] < 0)


def test_columns_come_in_their_order_however_many_nodes_there_are():
    rows = np.sort(np.random.default_rng(0).integers(0, 50, (3, 400)), axis=0)
    order = np.lexsort(rows[::-1])
    for count in (50, 3_000_000, 2**31 - 1):  # the last two are too many for a number of three digits to that base
        key = keys_of(rows + count - 50, count)
        assert_array_equal(rows[:, np.argsort(key, kind="stable")], rows[:, order])
        assert len(np.unique(key)) == len(np.unique(rows, axis=1).T)
