"""Unknowns, gradients and loads are those of scikit-fem's elements, of ours for order 3 and 4 on tetrahedra, too."""

import numpy as np
import pytest
import skfem
from numpy.testing import assert_allclose
from skfem.models import laplace, unit_load

from kohonen_adapt.elements import ElementTetP3, ElementTetP4
from kohonen_adapt.mesh.elements.space import Space

TRIANGLES = skfem.ElementTriP1, skfem.ElementTriP2, skfem.ElementTriP3
TETRAHEDRA = skfem.ElementTetP1, skfem.ElementTetP2, ElementTetP3, ElementTetP4


def permuted(kind, cells=2):
    """A square or cube whose inner nodes are displaced, with nodes and the corners of elements in random order."""
    mesh, rng = kind.init_tensor(*[np.linspace(0.0, 1.0, cells + 1)] * kind().dim()), np.random.default_rng(0)
    p, inner = mesh.p.copy(), mesh.interior_nodes()
    p[:, inner] += rng.uniform(-0.2, 0.2, (len(p), inner.size)) / cells
    number = rng.permutation(mesh.nvertices)
    moved = np.empty_like(p)
    moved[:, number] = p
    return kind(moved, rng.permuted(number[mesh.t], axis=0))


@pytest.mark.parametrize(
    ("kind", "order", "element"),
    [
        *((skfem.MeshTri, order, each) for order, each in enumerate(TRIANGLES, 1)),
        *((skfem.MeshTet, order, each) for order, each in enumerate(TETRAHEDRA, 1)),
    ],
)
def test_unknowns_matrix_and_load_are_those_of_the_space(kind, order, element):
    mesh = permuted(kind)
    basis, space = skfem.Basis(mesh, element()), Space(mesh, order, arcs=order > 3)
    assert space.doflocs.shape[1] == basis.N
    u = np.random.default_rng(1).normal(size=basis.N)
    energy = np.sum(space.weights * np.sum(space.gradient(u) ** 2, axis=0))
    assert u @ (laplace.assemble(basis) @ u) == pytest.approx(energy, rel=1e-11)
    assert_allclose(
        unit_load.assemble(basis), space.loads(np.ones(mesh.nelements), np.zeros_like(space.points)), atol=1e-16
    )
