"""`adapt` on elements with bent sides: the problem says whether it wants them, and gets them in every pass."""

import numpy as np
import pytest
from helpers.meshes import disk, square
from numpy.testing import assert_allclose
from skfem import Basis, ElementTriP1, ElementTriP2, LinearForm, MeshTri, MeshTri2, condense, solve
from skfem.models.poisson import laplace

import kohonen_adapt as ka
from kohonen_adapt.estimators import recovery
from kohonen_adapt.mesh.curved import corners_of


class Disk:
    """-laplace u = 1 on the unit disk with u = 0 on its rim, whose energy is pi / 16; isoparametric where bent."""

    order = 2

    def __init__(self, **more):
        self.meshes = []
        vars(self).update(more)

    def solve(self, mesh):
        self.meshes.append(mesh)
        basis = Basis(mesh, ElementTriP2(), intorder=6)
        load = unit_load.assemble(basis)
        u = solve(*condense(laplace.assemble(basis), load, D=basis.get_dofs(mesh.boundary_facets())))
        self.energy = 0.5 * float(load @ u)
        return u

    def indicators(self, mesh, u):
        straight = corners_of(mesh)
        return recovery(straight, u[: straight.nvertices], np.ones(straight.nelements))


unit_load = LinearForm(lambda v, w: v)
RIM = disk(4, 1.0)


@pytest.mark.parametrize("topology", ["flip", "recycle"])
def test_a_problem_that_wants_bent_sides_gets_them_from_the_input_on(topology):
    problem = Disk(curved=True)
    result = ka.adapt(RIM, problem, passes=2, topology=topology)
    for mesh in problem.meshes:
        assert type(mesh) is MeshTri2
        assert_allclose(np.hypot(*mesh.p[:, mesh.nvertices :][:, mesh.boundary_facets()]), 1.0, atol=1e-12)
    assert type(result.mesh) is MeshTri2 and result.history[0].mesh.nvertices == RIM.nvertices
    assert result.nodes.shape == (result.mesh.nvertices,)
    assert result.history[0].unknowns == RIM.nvertices + RIM.facets.shape[1]


@pytest.mark.parametrize(
    ("curved", "bent", "expected"),
    [(None, True, MeshTri2), (None, False, MeshTri), (True, False, MeshTri2), (False, True, MeshTri)],
)
def test_who_says_whether_sides_are_bent(curved, bent, expected):
    mesh = ka.adapt(RIM, Disk(curved=True), passes=0).mesh if bent else RIM
    problem = Disk() if curved is None else Disk(curved=curved)
    assert type(ka.adapt(mesh, problem, passes=1).mesh) is expected


def test_where_no_outline_is_curved_meshes_stay_straight():
    assert type(ka.adapt(square(4), Disk(curved=True), passes=1).mesh) is MeshTri


def test_densities_count_the_area_between_bent_sides():
    mesh = ka.adapt(RIM, Disk(curved=True), passes=0).mesh
    size = Basis(mesh, ElementTriP1(), intorder=4).dx.sum(axis=1)
    rho = ka.density_from_indicators(mesh, np.arange(1.0, mesh.nelements + 1.0), order=2)
    assert_allclose(np.sum(size * rho), mesh.nvertices, rtol=1e-12)
    assert ka.density_from_sizes(mesh, np.ones(mesh.nelements)).shape == (mesh.nelements,)
