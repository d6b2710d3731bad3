"""Large systems by multigrid: the same solutions as the direct ones, and what happens without it."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from helpers.tensor_meshes import box
from scipy.sparse import csc_array
from test_goals import actuator, machine, plunger

from kohonen_adapt.magnetostatics import FluxLinkage, Magnetostatics, Material
from kohonen_adapt.magnetostatics.equations import multigrid

needs_pyamg = pytest.mark.skipif(importlib.util.find_spec("pyamg") is None, reason="pyamg is not installed")


def magnet_over_iron(order):
    """Permeabilities 1 : 10 000, a magnet and currents, elements 20 times longer than high in places."""
    sides = {"magnet": (-0.005, 0.005, 0.001, 0.006), "iron": (-0.01, 0.01, -0.006, -0.001)}
    rows = np.r_[np.linspace(-0.02, -0.001, 20)[:-1], np.linspace(-0.001, 0.001, 41), np.linspace(0.001, 0.02, 20)[1:]]
    parts = {"magnet": Material(1.05, remanence=(0.3, 1.2)), "iron": Material(1e4), "air": Material(1.0)}
    return box(np.linspace(-0.02, 0.02, 41), rows, sides), Magnetostatics(parts, {"outer": 0.0}, order=order)


@needs_pyamg
@pytest.mark.parametrize(
    "make",
    [
        lambda: magnet_over_iron(1),
        lambda: magnet_over_iron(2),
        lambda: actuator(40),
        lambda: actuator(order=2),
        plunger,
        machine,
    ],
    ids=["iron", "iron, order 2", "steel", "steel, order 2", "around an axis", "antiperiodic sides"],
)
def test_multigrid_finds_the_solution_of_the_direct_solver(make, monkeypatch):
    mesh, problem = make()
    wanted = problem.solve(mesh)
    monkeypatch.setattr(multigrid, "LARGE", 0)
    used = counted(monkeypatch)
    found = problem.solve(mesh)
    assert used and all(used)
    assert len(found.newton) == len(wanted.newton)
    np.testing.assert_allclose(found.potential, wanted.potential, rtol=0, atol=1e-8 * np.abs(wanted.potential).max())
    assert np.array_equal(problem.solve(mesh).potential, found.potential)


def counted(monkeypatch):
    """Whether every system was solved by multigrid, in a list that grows."""
    from kohonen_adapt.magnetostatics.equations import system

    used, solve = [], multigrid.by_multigrid

    def watched(matrix, right):
        solution = solve(matrix, right)
        used.append(solution is not None)
        return solution

    monkeypatch.setattr(system, "by_multigrid", watched)
    return used


@needs_pyamg
def test_a_dual_problem_by_multigrid(monkeypatch):
    mesh, problem = actuator(40)
    problem = replace(problem, goal=FluxLinkage({"go": 1, "back": -1}))
    field = problem.solve(mesh)
    wanted = problem.indicators(mesh, field)
    monkeypatch.setattr(multigrid, "LARGE", 0)
    np.testing.assert_allclose(problem.indicators(mesh, field), wanted, rtol=1e-5, atol=1e-7 * wanted.max())


def test_small_systems_and_those_without_pyamg_are_solved_directly(monkeypatch):
    matrix, right = csc_array(np.diag([1.0, 2.0])), np.ones(2)
    assert multigrid.by_multigrid(matrix, right) is None
    monkeypatch.setattr(multigrid, "LARGE", 0)
    monkeypatch.setattr(multigrid, "find_spec", lambda name: None)
    assert multigrid.by_multigrid(matrix, right) is None


@needs_pyamg
def test_what_multigrid_cannot_solve_is_left_to_the_direct_solver(monkeypatch):
    monkeypatch.setattr(multigrid, "LARGE", 0)
    monkeypatch.setattr(multigrid, "MOST_ITERATIONS", 1)
    mesh, problem = magnet_over_iron(1)
    used = counted(monkeypatch)
    assert np.isfinite(problem.solve(mesh).energy)
    assert used == [False]
    assert multigrid.by_multigrid(csc_array(np.diag([np.nan, 2.0])), np.ones(2)) is None
