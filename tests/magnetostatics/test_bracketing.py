"""Both potentials on one mesh bound the exact energy and the errors of their fields."""

import numpy as np
import pytest
from helpers.magnet_solids import blocks, graded
from helpers.solids import box
from skfem.mesh import MeshTet2

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Coil, Froehlich, MagneticScalarPotential, Material, bracket
from kohonen_adapt.magnetostatics.bracketing import bracket_of

AIR, STEEL = Material(), Material(bh=Froehlich(1000.0, 2.0))
UP = Material(permeability=1.05, remanence=(0.0, 0.3, 1.2))
NONLINEAR = Material(bh=Froehlich(100.0, 1.2), coercivity=(0.0, 0.0, 5e5))
CLOSED = {"outer": 0.0}
SQUARE = np.array([[0.12, 0.88, 0.88, 0.12], [0.12, 0.12, 0.88, 0.88], [0.5] * 4])


def cube(cells=4):
    mesh = box(cells).with_boundaries({"outer": lambda x: x[0] > -1.0})
    return named(mesh)


def named(mesh):
    mesh = mesh.with_boundaries({"outer": lambda x: x[0] > -1.0})
    inside = np.all(np.abs(mesh.p[:, mesh.t].mean(axis=1) - 0.5) < 0.25, axis=0)
    return mesh.with_subdomains({"body": np.flatnonzero(inside), "air": np.flatnonzero(~inside)})


@pytest.mark.parametrize(
    ("body", "arguments"),
    [
        (UP, {"potential": CLOSED}),
        (NONLINEAR, {"potential": CLOSED}),
        (STEEL, {"potential": CLOSED, "applied_field": (0.0, 2e5, 1e5)}),
        (NONLINEAR, {"applied_field": (0.0, 2e5, 1e5)}),
        (STEEL, {"potential": {"outer": lambda x: 1e5 * x[1]}}),
        (STEEL, {"potential": CLOSED, "coils": {"around": Coil(SQUARE, 0.1, 0.2, 3e4)}}),
    ],
)
def test_the_bounds_are_the_values_of_both_functionals(body, arguments):
    mesh, materials = cube(), {"body": body, "air": AIR}
    found = bracket(mesh, materials, **arguments)
    problem = MagneticScalarPotential(materials, **arguments)
    functional, start = problem.vector_potential.functional_on(mesh)
    coercivity = np.linalg.norm(start.coefficients.coercivity, axis=0)[None]
    at_rest = float(np.sum(found.scalar.volume * start.coefficients.coenergy_densities().density(coercivity)))
    size = abs(found.lower) + abs(found.upper) + at_rest
    if "coils" not in arguments:
        assert np.isclose(found.upper, found.scalar.coenergy, rtol=1e-9)
    lower = -functional.value(found.vector.unknown)[0] - at_rest + found.source_error
    assert abs(lower - found.lower) < 1e-9 * size
    assert found.guaranteed
    finer = bracket(named(mesh.refined()), materials, **arguments)
    assert found.lower < finer.lower < finer.upper < found.upper
    if found.energy is not None:
        assert found.energy[0] < finer.vector.energy < found.energy[1]


def test_a_tolerance_by_the_bracket_is_met():
    at = graded((0.2, 0.4, 0.6), 0.1, 0.4, 2)
    mesh = blocks([at] * 3, {"magnet": ((0.2, 0.2, 0.4), (0.4, 0.4, 0.6)), "iron": ((0.2, 0.2, 0.2), (0.6, 0.6, 0.4))})
    materials = {"magnet": UP, "iron": STEEL, "air": AIR}
    problem = MagneticScalarPotential(materials, CLOSED, estimator="bracket")
    field = problem.solve(mesh)
    estimate = np.linalg.norm(problem.indicators(mesh, field))
    finer = mesh.refined().with_boundaries({"outer": lambda x: np.full(x.shape[1], True)})
    true = 2.0 * (field.coenergy - problem.solve(finer).coenergy)
    assert 0.2 * estimate**2 < true < estimate**2
    rtol = 0.8 * estimate / problem.energy_norm(mesh, field)
    result = ka.adapt(mesh, problem, rtol=rtol, passes=3)
    assert result.status is ka.Status.CONVERGED
    assert result.estimate < rtol * problem.energy_norm(result.mesh, result.solution)


def test_inductance_of_a_coil_and_what_is_no_guarantee():
    mesh = cube()
    iron = {"body": Material(permeability=100.0), "air": AIR}
    one, ten = (bracket(mesh, iron, CLOSED, coils={"coil": Coil(SQUARE, 0.1, 0.2, turns)}) for turns in (1.0, 10.0))
    assert np.allclose(one.inductance, ten.inductance, rtol=1e-9)
    assert np.allclose(one.inductance, 2.0 * np.array(one.energy))
    turning = bracket(cube(), {"body": Material(remanence=lambda x: 1.0 + x), "air": AIR}, CLOSED)
    assert turning.reasons == ("the magnetisation of body varies within elements",)
    assert "no guarantee, because the magnetisation" in repr(turning)
    given = bracket(cube(), {"body": STEEL, "air": AIR}, {"outer": lambda x: 1e4 * x[0] ** 2})
    assert given.reasons == ("the potential of outer is not linear in facets",)
    assert given.energy is None
    assert bracket(cube(), {"body": STEEL, "air": AIR}, {"outer": lambda x: 1e4 * x[0]}).guaranteed


def test_a_potential_inside_has_no_bound():
    mesh = cube()
    inside = mesh.with_boundaries({"inside": np.asarray(mesh.facets_around("body"))})
    problem = MagneticScalarPotential({"body": UP, "air": AIR}, {"outer": 0.0, "inside": 1.0}, estimator="bracket")
    with pytest.raises(ValueError, match="the potential of 'inside' is inside the mesh"):
        problem.check(inside)


def test_edges_of_a_curved_mesh_count_as_straight():
    mesh, parts = cube(), {"body": UP, "air": AIR}
    second = MeshTet2.from_mesh(mesh).with_subdomains(mesh.subdomains).with_boundaries(mesh.boundaries)
    assert bracket(second, parts, CLOSED).energy == bracket(mesh, parts, CLOSED).energy
    problem = MagneticScalarPotential(parts, CLOSED)
    with pytest.raises(ValueError, match=r"the field is on curved ones; set curved=False\."):
        bracket_of(problem, problem.solve(second))
