"""The polish of iron and magnets in applied fields: the functional falls by what is told, and what is driven stays."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.driven_solids import block_mesh, loop, uniform
from skfem import Basis, ElementTetP1, ElementTetP2

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.magnetostatics import Froehlich, MagneticScalarPotential, Material
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.polishing.space.transfer_in_space import transferred_in_space
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.som.relocate import move_in_space

both_orders = pytest.mark.parametrize("order", [1, 2])
AIR, STEEL = Material(), Froehlich(2000.0, 1.9)
IRON = {"iron": Material(1000.0), "block": Material(500.0), "air": AIR}


def solved(mesh, problem):
    """The functional of the solution, which is certified to be stationary, and its value."""
    field, movable = problem.solve(mesh), MovableSolid.of(mesh, Rules("recycle"))
    functional = SolidFunctional.of_solution(problem.ritz(mesh, field), movable, mesh)
    return field, movable, functional, functional_value(mesh, functional.ritz)


@both_orders
def test_the_functional_is_the_coenergy_up_to_a_constant(order):
    """Its change by a function is that of ``int mu |Hs - grad phi|^2 / 2``, without integrals over faces."""
    field, magnet = uniform((300.0, -200.0, 500.0)), Material(1.5, remanence=(0.1, 0.3, -0.2))
    mesh = block_mesh(1)
    materials = {"iron": Material(80.0), "block": magnet, "air": AIR}
    problem = MagneticScalarPotential(materials, {}, applied_field=field, order=order)
    ritz, rng = problem.ritz(mesh, problem.solve(mesh)), np.random.default_rng(0)
    u, offset = np.asarray(ritz.values), ritz.surface.nodal[:, 0]
    energies = []
    for values in (u, u + rng.normal(size=u.size)):
        there = replace(ritz, values=values)
        energies.append((functional_value(mesh, there), coenergy(mesh, values, offset, order)))
    (one, same), (other, also) = energies
    assert other - one == pytest.approx(also - same, rel=1e-9)


def coenergy(mesh, values, offset, order):
    """By the definition of B and H, in elements."""
    total, hs, element = 0.0, np.array([300.0, -200.0, 500.0]), (ElementTetP1, ElementTetP2)[order - 1]()
    parts = {"iron": (80.0, 0.0, 0.0), "block": (1.5, 1.0, (0.1, 0.3, -0.2)), "air": (1.0, 1.0, 0.0)}
    for name, (mu, reduced, remanence) in parts.items():
        basis, mu = Basis(mesh, element, elements=mesh.subdomains[name]), mu * 4e-7 * np.pi
        slope = basis.interpolate(values - reduced * offset).grad
        h = reduced * hs[:, None, None] - slope
        constant = np.broadcast_to(np.array(remanence), 3)[:, None, None] / mu
        total += 0.5 * mu * np.sum(basis.dx * np.sum((h + constant) ** 2, axis=0))
    return total


@both_orders
def test_nodes_on_driven_faces_stay_and_others_move(order):
    mesh, applied = block_mesh(0), loop(1e5, 0.8, (0.1, 0.3, 1.2))
    materials = {"iron": Material(bh=STEEL), "block": Material(remanence=(0.0, 0.0, 1.0)), "air": AIR}
    problem = MagneticScalarPotential(materials, {"outer": 0.0}, applied_field=applied, order=order)
    after = ka.polish(mesh, problem, sweeps=1, topology="fixed")
    of_iron = np.unique(mesh.t[:, mesh.subdomains["iron"]])
    of_rest = np.unique(mesh.t[:, np.concatenate([mesh.subdomains[name] for name in ("block", "air")])])
    surface, moved = np.intersect1d(of_iron, of_rest), np.any(after.p != mesh.p, axis=0)
    assert not moved[surface].any()
    assert moved[np.setdiff1d(of_iron, of_rest)].any() and moved[np.setdiff1d(of_rest, of_iron)].any()
    outer = np.unique(mesh.facets[:, mesh.boundaries["outer"]])
    block = np.unique(mesh.t[:, mesh.subdomains["block"]])
    assert moved[outer].any() and moved[np.setdiff1d(block, surface)].any()  # a potential of 0 takes no load
    reasons = ka.why_held(mesh, problem=problem)
    assert all(reasons[surface])
    assert sum("on which an applied field drives the potential" in reason for reason in reasons[surface]) > 50


@both_orders
def test_a_solution_is_carried_to_a_moved_mesh(order):
    mesh, applied = block_mesh(0), uniform((300.0, -200.0, 500.0))
    problem = MagneticScalarPotential(IRON, {"outer": 0.0}, applied_field=applied, order=order)
    _, movable, functional, _ = solved(mesh, problem)
    rng, finer = np.random.default_rng(0), lambda x: 1.0 + 4.0 * (x[2] > 0.0)
    moved = move_in_space(movable, finer, None, "recycle", rng, mesh.nvertices)
    trial = transferred_in_space(functional, moved.before, movable, moved.recycled.start_element)
    after = movable.mesh()
    field, carried = problem.solve(after), functional.value(movable.tetrahedralization, trial)
    air = np.unique(after.t[:, after.subdomains["air"]])
    difference, size = (
        (trial.values - trial.surface[:, 0] - field.potential[: after.nvertices])[air],
        field.potential[air],
    )
    assert np.linalg.norm(difference) < 0.2 * np.linalg.norm(size) and not np.array_equal(after.p, mesh.p)
    if order == 1:
        assert functional_value(after, problem.ritz(after, field)) < carried
    else:
        own = SolidFunctional.of(problem.ritz(after, field), movable, after).solution.modes.side
        assert np.linalg.norm(trial.modes.side - own) < 0.3 * np.linalg.norm(own)
