"""The functional of a solver: its derivatives, its minimum, and the `Ritz` of the solution."""

import numpy as np
import pytest
from skfem import MeshTet, MeshTri

from kohonen_adapt.magnetostatics import (
    Brauer,
    MagneticScalarPotential,
    MagneticVectorPotential,
    Magnetostatics,
    Material,
)
from kohonen_adapt.problem.functional_value import functional_value

LAW = Brauer(k1=50.0, k2=10.0, k3=1.5)
LINEAR, STEEL = Material(500.0), Material(bh=LAW)
MAGNET, STEEL_MAGNET = Material(1.05, remanence=(0.1, 0.6)), Material(bh=LAW, coercivity=(200.0, 400.0))
IN_SPACE = {LINEAR: LINEAR, STEEL: STEEL, MAGNET: Material(1.05, remanence=(0.1, 0.6, 0.3))}
IN_SPACE[STEEL_MAGNET] = Material(bh=LAW, coercivity=(200.0, 400.0, 100.0))
BODIES = pytest.mark.parametrize(
    "body", [LINEAR, MAGNET, STEEL, STEEL_MAGNET], ids=["linear", "magnet", "steel", "steel magnet"]
)


def body_and_air(mesh):
    return mesh.with_subdomains({
        "body": lambda x: np.all(np.abs(x - 0.5) < 0.25, axis=0),
        "air": lambda x: np.any(np.abs(x - 0.5) > 0.25, axis=0),
    }).with_defaults()  # fmt: skip


def in_plane(order, axisymmetric=False):
    def made(body):
        fixed = {"right": 0.0} if axisymmetric else {"left": 0.0, "right": 0.2}
        materials = {"body": body, "air": Material(current_density=2e5)}
        problem = Magnetostatics(materials, fixed, order=order, axisymmetric=axisymmetric)
        mesh = body_and_air(MeshTri.init_tensor(*[np.linspace(0.0, 1.0, 9)] * 2))
        return problem, mesh, problem.energy_on(mesh)

    return made


def in_space(kind, **options):
    def made(body):
        problem = kind({"body": IN_SPACE[body], "air": Material()}, {"left": 0.0, "right": 2e5}, **options)
        mesh = body_and_air(MeshTet.init_tensor(*[np.linspace(0.0, 1.0, 5)] * 3))
        return problem, mesh, problem.functional_on(mesh)[0]

    return made


BY_RITZ = [
    pytest.param(in_plane(1), id="plane 1"),
    pytest.param(in_plane(2), id="plane 2"),
    pytest.param(in_plane(3), id="plane 3"),
    pytest.param(in_plane(1, axisymmetric=True), id="axis 1"),
    pytest.param(in_plane(2, axisymmetric=True), id="axis 2"),
    pytest.param(in_plane(3, axisymmetric=True), id="axis 3"),
    pytest.param(in_space(MagneticScalarPotential, order=1), id="space 1"),
    pytest.param(in_space(MagneticScalarPotential, order=2), id="space 2"),
]
ALL = [
    *BY_RITZ,
    pytest.param(in_plane(5), id="plane 5"),
    pytest.param(in_plane(4, axisymmetric=True), id="axis 4"),
    pytest.param(in_space(MagneticVectorPotential), id="edges"),
]


@BODIES
@pytest.mark.parametrize("made", ALL)
def test_derivatives_are_those_of_the_value(made, body):
    problem, mesh, energy = made(body)
    free, solution = energy.conditions.free, problem.solve(mesh).unknown
    random, step = np.random.default_rng(0), np.zeros(energy.load.size)
    u = np.where(energy.conditions.fixed, solution, solution * (1.0 + 0.2 * random.uniform(size=solution.size)))
    step[free] = 1e-4 * np.ptp(solution) * random.normal(size=free.size)
    before, after = (energy.value(u + sign * step)[0] for sign in (-1.0, 1.0))
    gradient, hessian = energy.gradient(u), energy.hessian(u)
    assert gradient @ step[free] == pytest.approx(0.5 * (after - before), rel=1e-5, abs=1e-9 * abs(before))
    np.testing.assert_array_equal(gradient, energy.residual(u)[0])
    if hessian.rows is None:  # otherwise interiors are eliminated
        change = 0.5 * (energy.gradient(u + step) - energy.gradient(u - step))
        np.testing.assert_allclose(hessian.matrix @ step[free], change, rtol=0, atol=1e-4 * np.abs(change).max())
        assert abs(hessian.matrix - hessian.matrix.T).max() < 1e-14 * abs(hessian.matrix).max()


@BODIES
@pytest.mark.parametrize("made", ALL)
def test_a_solution_is_the_minimum(made, body):
    problem, mesh, energy = made(body)
    conditions, u = energy.conditions, problem.solve(mesh).unknown
    residual, size = energy.residual(u)
    assert np.linalg.norm(conditions.to_classes(residual)) < 1e-6 * size
    step = np.zeros(u.size)
    step[conditions.free] = 0.01 * np.ptp(u) * np.random.default_rng(1).normal(size=conditions.free.size)
    least = energy.value(u)[0]
    assert energy.value(u + step)[0] > least < energy.value(u - step)[0]


@BODIES
@pytest.mark.parametrize("made", BY_RITZ)
def test_the_ritz_of_a_solution_is_the_functional_that_was_solved(made, body):
    problem, mesh, energy = made(body)
    field = problem.solve(mesh)
    constant, found = energy.constant, functional_value(mesh, problem.ritz(mesh, field))
    if isinstance(problem, MagneticScalarPotential):  # that of magnets, except in laws
        given, linear = field.coefficients, ~field.coefficients.nonlinear
        density = given.coenergy_densities().density(np.linalg.norm(given.coercivity, axis=0))
        constant = float(field.elements.volumes[linear] @ density[linear])
    wanted = energy.value(field.unknown)[0] - constant
    assert found == pytest.approx(wanted, rel=1e-12, abs=1e-12 * abs(constant))
