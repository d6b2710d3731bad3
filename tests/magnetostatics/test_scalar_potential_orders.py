"""Magnets and iron in space at orders 2 to 6: scikit-fem's assembly, exact polynomials, rates, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.magnet_solids import blocks, nested_balls
from helpers.sheets import MU0
from skfem import MeshTet

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Force, Froehlich, MagneticScalarPotential, Material, StoredEnergy
from kohonen_adapt.magnetostatics.solid_estimation import at_edges

AIR = Material()
AXIS = np.linspace(-1.0, 1.0, 5)
PARTS = {"magnet": ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.0)), "iron": ((-0.5, -0.5, 0.5), (0.5, 0.5, 1.0))}
RIM = {"outer": 0.0}
HIGH = (2, 3, pytest.param(5, marks=pytest.mark.slow))


def bent(strength=0.06):
    """Blocks whose inner nodes are displaced, so that no two elements are alike."""
    mesh = blocks([AXIS] * 3, PARTS)
    inner = mesh.interior_nodes()
    p = mesh.p.copy()
    p[:, inner] += np.random.default_rng(0).uniform(-strength, strength, (3, inner.size))
    return MeshTet(p, mesh.t).with_subdomains(mesh.subdomains).with_boundaries(mesh.boundaries)


def turning(x):
    return np.stack((x[1], 1.0 + x[0], x[2] * x[0]))


def harmonic(x):
    return x[0] ** 2 + 2.0 * x[1] * x[2] - x[2] ** 2 + 3.0 * x[1]


def field_of_harmonic(x):
    return -np.stack((2.0 * x[0], 2.0 * x[2] + 3.0, 2.0 * x[1] - 2.0 * x[2]))


# --- scikit-fem's own elements -------------------------------------------------------------------------------------


# --- exact cases ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", HIGH)
def test_a_quadratic_potential_is_exact(order):
    """At points, recovered, in its fluxes and energies, and without an estimated error."""
    problem = MagneticScalarPotential(dict.fromkeys(("magnet", "iron", "air"), AIR), {"outer": harmonic}, order=order)
    mesh = bent()
    field = problem.solve(mesh)
    x = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 100))
    np.testing.assert_allclose(field.potential_at(x), harmonic(x), atol=1e-9)
    for recovered in (False, True):
        density = field.flux_density_at(x, recovered=recovered)
        np.testing.assert_allclose(density, MU0 * field_of_harmonic(x), atol=1e-8 * MU0)
    # int |grad u|^2 over the cube of edge 2
    np.testing.assert_allclose(field.energy, 0.5 * MU0 * 8.0 * (4.0 / 3.0 + 4.0 / 3.0 + 9.0 + 8.0 / 3.0), rtol=1e-9)
    assert field.coenergy == pytest.approx(field.energy)
    for name, exact in {"x+": -8.0, "z-": 8.0, "y+": -12.0}.items():  # int H . n over a face of area 4
        assert field.flux(name) == pytest.approx(MU0 * exact, rel=1e-8)
    assert problem.indicators(mesh, field).max() < 1e-9 * problem.energy_norm(mesh, field)


# --- applied fields and planes of symmetry -------------------------------------------------------------------------


@pytest.mark.parametrize("iron", [Material(50.0), Material(bh=Froehlich(500.0, 1.6))])
@pytest.mark.parametrize("order", HIGH)
def test_an_applied_field_is_a_given_potential(order, iron):
    """A field of quadratic potential, applied or given at the boundary, is one solution."""
    mesh, size = bent(), 1e4
    materials = {"magnet": Material(1.05), "iron": iron, "air": AIR}
    applied = MagneticScalarPotential(
        materials, RIM, applied_field=lambda x: size * field_of_harmonic(x), order=order
    ).solve(mesh)
    given = MagneticScalarPotential(materials, {"outer": lambda x: size * harmonic(x)}, order=order).solve(mesh)
    scale = np.abs(given.flux_density).max()
    np.testing.assert_allclose(applied.flux_density, given.flux_density, atol=2e-6 * scale)
    total = applied.potential + size * harmonic(applied.elements.doflocs)
    np.testing.assert_allclose(total, given.potential, atol=2e-6 * np.abs(total).max())
    assert applied.energy == pytest.approx(given.energy, rel=1e-5)


# --- estimates and adapted meshes ----------------------------------------------------------------------------------


def wave(x):
    return np.sin(2.0 * x[0] + x[1]) * np.cos(1.5 * x[2])


def slope_of_wave(x):
    along = np.cos(2.0 * x[0] + x[1]) * np.cos(1.5 * x[2])
    return np.stack((2.0 * along, along, -1.5 * np.sin(2.0 * x[0] + x[1]) * np.sin(1.5 * x[2])))


def harmonic_wave(x):
    return np.sin(1.5 * x[0]) * np.sin(2.0 * x[1]) * np.exp(2.5 * x[2])


def slope_of_harmonic_wave(x):
    return np.stack((
        1.5 * np.cos(1.5 * x[0]) * np.sin(2.0 * x[1]),
        2.0 * np.sin(1.5 * x[0]) * np.cos(2.0 * x[1]),
        2.5 * np.sin(1.5 * x[0]) * np.sin(2.0 * x[1]),
    )) * np.exp(2.5 * x[2])  # fmt: skip


def strength_error(field, exact):
    """``sqrt(int mu |H - H_h|^2)``, with the exact H as a function of x."""
    at = field.at_quadrature
    difference = np.sum((at.field_strength - exact(at.x)) ** 2, axis=0)
    return float(np.sqrt(np.sum(field.point_volumes * at.permeabilities[0] * difference)))


@pytest.mark.parametrize(
    ("potential", "slope", "remanence"),
    [(harmonic_wave, slope_of_harmonic_wave, (0.0, 0.0, 0.0)), (wave, slope_of_wave, lambda x: MU0 * slope_of_wave(x))],
    ids=["air", "a magnet without flux"],
)
def test_smooth_fields_converge_by_the_square_and_the_estimate_is_the_error(potential, slope, remanence):
    errors, problem = [], MagneticScalarPotential({"all": Material(remanence=remanence)}, {"outer": potential}, order=2)
    for cells in (3, 6):
        axis = np.linspace(-1.0, 1.0, cells + 1)
        mesh = blocks([axis] * 3, {"all": ((-1.0,) * 3, (1.0,) * 3)})
        field = problem.solve(mesh)
        errors.append(strength_error(field, lambda x: -slope(x)))
        assert 0.85 < np.linalg.norm(problem.indicators(mesh, field)) / errors[-1] < 1.2
    assert np.log2(errors[0] / errors[1]) > 1.8


# --- questions to a field ------------------------------------------------------------------------------------------


def cube(cells):
    """A cube of edge 2 with a block of the permeability of air inside."""
    axis = np.linspace(-1.0, 1.0, cells + 1)
    mesh = blocks([axis] * 3, {"body": ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.0))})
    return mesh.with_boundaries({"part": lambda x: (x[0] > 1.0 - 1e-9) & (x[1] > 0.0)})


def solved_waves(cells=(4, 8), **arguments):
    problem = MagneticScalarPotential({"body": AIR, "air": AIR}, {"outer": harmonic_wave}, order=2, **arguments)
    return problem, [problem.solve(cube(count)) for count in cells]


def exact_energy(ends):
    """``int mu0 |H|^2 / 2`` of the harmonic wave over a box."""
    at, weight = np.polynomial.legendre.leggauss(12)
    axes = [0.5 * (b - a) * at + 0.5 * (a + b) for a, b in zip(*ends, strict=True)]
    volume = np.prod([0.5 * (b - a) for a, b in zip(*ends, strict=True)])
    x = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    weights = volume * np.einsum("i,j,k->ijk", weight, weight, weight).ravel()
    return 0.5 * MU0 * float(np.sum(weights * np.sum(slope_of_harmonic_wave(x) ** 2, axis=0)))


def rate(errors):
    return float(np.log2(np.linalg.norm(errors[0]) / np.linalg.norm(errors[1])))


# --- goals ---------------------------------------------------------------------------------------------------------


def test_the_error_of_an_energy_is_told():
    """Smooth fields: with the estimate most of the error is gone, and the parts of elements sum to more than it."""
    goal, errors = StoredEnergy("body"), []
    problem, fields = solved_waves(goal=goal)
    for field in fields:
        error = exact_energy(((-0.5, -0.5, -0.5), (0.5, 0.5, 0.0))) - goal(field)
        assert 0.5 < problem.goal_error(field) / error < 1.5
        assert np.sum(problem.indicators(field.mesh, field) ** 2) > 0.5 * abs(error)
        errors.append(error)
    assert rate(errors) > 3.0


def test_the_default_is_order_2_but_for_estimators_of_order_1():
    arguments = {"magnet": Material(remanence=(0.0, 0.0, 1.2)), "air": AIR}, RIM
    default = MagneticScalarPotential(*arguments)
    assert default.order == replace(default, order="auto").order == 2
    assert replace(default, estimator="recovery").order == 1
    assert replace(default, applied_field=(0.0, 0.0, 1.0)).order == 2
    assert replace(default, materials={"magnet": Material(remanence=turning), "air": AIR}).order == 2
    assert replace(replace(default, estimator="recovery"), estimator="residual").order == 2
    assert replace(default, order=1).order == 1


# --- refused -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [0, 7, True, "2"])
def test_orders_other_than_1_to_6_are_refused(order):
    with pytest.raises(ValueError, match=r"^order of the elements must be a whole number from 1 to 6, or 'auto'; got "):
        MagneticScalarPotential({"air": AIR}, order=order)


def test_recovery_is_refused():
    with pytest.raises(ValueError, match=r"^elements of order 2 have the estimator 'residual' only; got 'recovery'\."):
        MagneticScalarPotential({"air": AIR}, estimator="recovery", order=2)


def test_orders_above_2_are_not_polished():
    mesh, problem = bent(), MagneticScalarPotential(dict.fromkeys(("magnet", "iron", "air"), AIR), RIM, order=4)
    with pytest.raises(ka.NotOffered, match=r"^tetrahedra of order 4 are not polished, only"):
        problem.ritz(mesh, problem.solve(mesh))


@pytest.mark.parametrize("order", [3, 4])
def test_errors_of_smooth_fields_at_higher_orders_are_told(order):
    problem = MagneticScalarPotential({"body": AIR, "air": AIR}, {"outer": harmonic_wave}, order=order)
    field = problem.solve(cube(4))
    error = strength_error(field, lambda x: -slope_of_harmonic_wave(x))
    assert 0.8 < np.linalg.norm(problem.indicators(field.mesh, field)) / error < 1.3


def test_where_there_is_no_polish():
    mesh, materials = bent(), {"magnet": Material(remanence=turning), "iron": AIR, "air": AIR}
    problem = MagneticScalarPotential(materials, RIM, order=2)
    with pytest.raises(ka.NotOffered, match="order 2 are polished beside constant magnets"):
        problem.ritz(mesh, problem.solve(mesh))


def facing(gap):
    """Two blocks across a gap in a box, by one element per side of a block."""
    low, high = 0.5 * gap, 0.5 + 0.5 * gap
    parts = {"lower": ((-0.3, -0.3, -high), (0.3, 0.3, -low)), "upper": ((-0.3, -0.3, low), (0.3, 0.3, high))}
    across = np.array([-1.5, -0.75, -0.3, 0.0, 0.3, 0.75, 1.5])
    return blocks([across, across, np.array([-1.5, -0.9, -high, -low, low, high, 0.9, 1.5])], parts)


@pytest.mark.parametrize(
    ("gap", "lower", "output", "exact"),
    [  # by order 6 on two layers at the edges; order 5 differs by 2e-4
        (0.1, Material(1000.0), lambda field: field.energy, 34055.8),
        (0.2, Material(1.05, remanence=(0.0, 0.0, 1.0)), Force("lower", (0.0, 0.0, 1.0)), 37562.4),
    ],
)
def test_errors_of_outputs_include_orders_above_the_next(gap, lower, output, exact):
    mesh = facing(gap)
    materials = {"lower": lower, "upper": Material(1.05, remanence=(0.0, 0.0, 1.2)), "air": AIR}
    problem = MagneticScalarPotential(materials, RIM, order=4)
    field = problem.solve(mesh)
    told = problem.improved(mesh, field, {"output": output})["output"] - output(field)
    assert 0.7 < told / (exact - output(field)) < 1.4


def test_elements_at_edges_of_a_block_and_none_at_a_ball():
    mesh = blocks([AXIS] * 3, {"block": ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.0))})
    inside = np.isin(np.arange(mesh.nelements), mesh.subdomains["block"])
    on = (np.abs(mesh.p) < 0.51).all(axis=0) & (mesh.p[2] < 0.01)
    sides = [np.isclose(np.abs(mesh.p[0]), 0.5), np.isclose(np.abs(mesh.p[1]), 0.5)]
    sides.append(np.isclose(mesh.p[2], -0.5) | np.isclose(mesh.p[2], 0.0))
    edges = on & (np.sum(sides, axis=0) >= 2)
    np.testing.assert_array_equal(at_edges(mesh, inside.astype(int)), edges[mesh.t].any(axis=0))
    ball = nested_balls(4)
    assert not at_edges(ball, np.isin(np.arange(ball.nelements), ball.subdomains["ball"]).astype(int)).any()
