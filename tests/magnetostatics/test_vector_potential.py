"""Edge elements against exact fields, against the scalar potential, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.magnet_solids import blocks, graded
from helpers.sheets import MU0
from helpers.solids import box, named
from skfem import MeshTet
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Froehlich, MagneticScalarPotential, MagneticVectorPotential, Material
from kohonen_adapt.magnetostatics.equations import edge_solver

AIR = Material()
STEEL = Material(bh=Froehlich(1000.0, 2.0))
MAGNET = Material(permeability=1.05, remanence=(0.0, 0.3, 1.2))


def lattice(mesh):
    """The mesh with nodes inside moved off their planes."""
    inner = np.ones(mesh.p.shape[1], dtype=bool)
    inner[mesh.facets[:, mesh.boundary_facets()]] = False
    p = mesh.p.copy()
    p[:, inner] += np.random.default_rng(0).uniform(-0.04, 0.04, (3, inner.sum()))
    return MeshTet(p, mesh.t).with_defaults().with_subdomains({"iron": lambda x: x[0] > -1.0})


@pytest.fixture(scope="module")
def magnets():
    """A magnet on iron in air, on a mesh and on the same mesh refined."""
    at = graded((0.2, 0.4, 0.6), 0.1, 0.4, 2)
    parts = {"magnet": ((0.2, 0.2, 0.4), (0.4, 0.4, 0.6)), "iron": ((0.2, 0.2, 0.2), (0.6, 0.6, 0.4))}
    mesh = blocks([at] * 3, parts)
    finer = mesh.refined().with_boundaries({"outer": lambda x: np.full(x.shape[1], True)})
    ends = {name: (lambda x, end=at[k]: np.abs(x[2] - end) < 1e-9) for name, k in (("z-", 0), ("z+", -1))}
    return mesh, finer.with_boundaries(ends)


@pytest.mark.parametrize("iron", [Material(permeability=500.0), STEEL])
def test_a_uniform_field_between_two_poles_is_exact(iron):
    mesh = lattice(box(4))
    field = MagneticVectorPotential({"iron": iron}, {"left": 700.0, "right": 0.0}).solve(mesh)
    expected = MagneticScalarPotential({"iron": iron}, {"left": 700.0, "right": 0.0}).solve(mesh)
    assert np.allclose(field.field_strength, [[700.0], [0.0], [0.0]], atol=1e-3)
    assert np.allclose(field.flux_density, expected.flux_density, rtol=1e-6, atol=1e-6)
    assert np.isclose(field.flux("right"), expected.flux("right"), rtol=1e-6)
    assert np.isclose(field.energy, expected.energy, rtol=1e-6)


def test_an_applied_field_alone_is_exact():
    mesh = lattice(box(4)).with_boundaries({"outer": lambda x: x[0] > -1.0})
    field = MagneticVectorPotential({"iron": AIR}, {"outer": 0.0}, applied_field=(1e5, -2e5, 3e5)).solve(mesh)
    assert np.allclose(field.flux_density / MU0, [[1e5], [-2e5], [3e5]], atol=1.0)
    x = np.array([[0.3, 0.6], [0.4, 0.2], [0.5, 0.9]])
    assert np.allclose(field.flux_density_at(x) / MU0, [[1e5] * 2, [-2e5] * 2, [3e5] * 2], atol=1.0)
    ring = np.linspace(0.0, 2.0 * np.pi, 2001)
    path = np.array([0.5 + 0.2 * np.cos(ring), 0.5 + 0.2 * np.sin(ring), np.full(2001, 0.45)])
    along = field.potential_at(0.5 * (path[:, 1:] + path[:, :-1])) * np.diff(path)
    assert np.isclose(np.sum(along), MU0 * 3e5 * np.pi * 0.2**2, rtol=1e-3)


def test_fluxes_out_of_closed_surfaces_sum_to_zero(magnets):
    mesh = magnets[0]
    around = mesh.facets_around("iron")
    mesh = named(mesh, {**mesh.boundaries, "around": around, "half": OrientedBoundary(around[::2], around.ori[::2])})
    materials = {"magnet": MAGNET, "iron": STEEL, "air": AIR}
    field = MagneticVectorPotential(materials, {"outer": 0.0}).solve(mesh)
    size = np.max(np.abs(field.flux_density)) * 0.2**2
    assert abs(field.flux("around")) < 1e-14 * size
    assert abs(field.flux("half")) > 1e-3 * size
    assert abs(field.flux("outer")) < 1e-14 * size
    scalar = MagneticScalarPotential(materials, {"outer": 0.0}).solve(mesh)
    assert abs(scalar.flux("around")) > 1e-3 * size


def test_sweeps_with_and_without_pyamg_give_the_same_field(magnets, monkeypatch):
    pytest.importorskip("pyamg")
    for outside in ({"outer": 0.0}, {"z+": 3e4, "z-": 0.0}, None):
        problem = MagneticVectorPotential({"magnet": MAGNET, "iron": STEEL, "air": AIR}, outside)
        field = problem.solve(magnets[0])
        with monkeypatch.context() as without:
            without.setattr(edge_solver, "find_spec", lambda name: None)
            other = problem.solve(magnets[0])
        assert np.isclose(field.energy, other.energy, rtol=1e-9)
        assert np.allclose(field.flux_density, other.flux_density, atol=1e-5)


def test_adapt_takes_a_vector_potential(magnets):
    problem = MagneticVectorPotential({"magnet": MAGNET, "iron": STEEL, "air": AIR}, {"outer": 0.0})
    result = ka.adapt(magnets[0], problem, passes=1)
    assert result.mesh.nvertices == magnets[0].nvertices
    assert result.estimate <= result.history[0].estimate


def test_bad_input(magnets):
    mesh = magnets[0]
    materials = {"magnet": MAGNET, "iron": STEEL, "air": AIR}
    problem = MagneticVectorPotential(materials, {"outer": 0.0})
    with pytest.raises(ValueError, match="have none"):
        replace(problem, materials={"magnet": MAGNET, "air": AIR}).solve(mesh)
    with pytest.raises(ValueError, match="give the current as a Coil in coils, or its field as applied_field"):
        replace(problem, materials={**materials, "air": Material(current_density=1.0)})
    inside = mesh.with_boundaries({"inside": np.asarray(mesh.facets_around("iron"))})
    with pytest.raises(ValueError, match="'inside' is inside the mesh, where a vector potential takes none"):
        replace(problem, potential={"inside": 1.0}).check(inside)
    with pytest.raises(ValueError, match="the flux is parallel to the plane of symmetry 'z-'"):
        replace(problem, symmetry={"z-": "parallel"}, applied_field=(0.0, 0.0, 1.0)).check(mesh)
    with pytest.raises(ValueError, match="goal_error needs a goal"):
        problem.goal_error(problem.functional_on(mesh)[1])
    hollow = box(3)
    hollow = hollow.restrict(hollow.elements_satisfying(lambda x: np.abs(x - 0.5).max(axis=0) > 1 / 6))
    hollow = hollow.with_subdomains({"air": lambda x: x[0] > -1.0})
    hollow = hollow.with_boundaries({"inner": lambda x: np.abs(x - 0.5).max(axis=0) < 0.2, "x": lambda x: x[0] == 0.0})
    with pytest.raises(ValueError, match="separate closed surfaces"):
        MagneticVectorPotential({"air": AIR}, {"inner": 1.0, "x": 0.0}).check(hollow)
