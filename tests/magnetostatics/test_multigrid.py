"""Large systems by multigrid: the same solutions as the direct ones, and what happens without it."""

import importlib.util
import sys
from dataclasses import dataclass, field, fields, replace

import numpy as np
import pytest
from helpers.devices import actuator, machine, plunger
from helpers.magnet_solids import blocks
from helpers.tensor_meshes import box
from scipy.sparse import csc_array
from scipy.sparse.linalg import spsolve
from skfem import MeshTet

from kohonen_adapt.magnetostatics import Froehlich, MagneticScalarPotential, Magnetostatics, Material
from kohonen_adapt.magnetostatics.equations.newton import Newton
from kohonen_adapt.magnetostatics.equations.system import Solver
from kohonen_adapt.mesh.elements.space import Space

needs_pyamg = pytest.mark.skipif(importlib.util.find_spec("pyamg") is None, reason="pyamg is not installed")


def magnet_over_iron(order):
    """Permeabilities 1 : 10 000, a magnet and currents, elements 20 times longer than high in places."""
    sides = {"magnet": (-0.005, 0.005, 0.001, 0.006), "iron": (-0.01, 0.01, -0.006, -0.001)}
    rows = np.r_[np.linspace(-0.02, -0.001, 20)[:-1], np.linspace(-0.001, 0.001, 41), np.linspace(0.001, 0.02, 20)[1:]]
    parts = {"magnet": Material(1.05, remanence=(0.3, 1.2)), "iron": Material(1e4), "air": Material(1.0)}
    return box(np.linspace(-0.02, 0.02, 41), rows, sides), Magnetostatics(parts, {"outer": 0.0}, order=order)


@dataclass(frozen=True)
class Watched(Solver):
    """Takes every system for a large one, and notes whether multigrid solved it."""

    large: int = 0
    used: list = field(default_factory=list)

    def by_multigrid(self, matrix, right, prolongation=None):
        solution = super().by_multigrid(matrix, right, prolongation)
        self.used.append(solution is not None)
        return solution


def solved_by(problem, solver):
    """The problem with another solver of its linear systems."""

    class Other(type(problem)):
        method = Newton(solver=solver)

    return Other(**{each.name: getattr(problem, each.name) for each in fields(problem)})


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
def test_multigrid_finds_the_solution_of_the_direct_solver(make):
    mesh, problem = make()
    wanted, solver = problem.solve(mesh), Watched()
    problem = solved_by(problem, solver)
    found = problem.solve(mesh)
    assert solver.used and all(solver.used)
    assert len(found.newton) == len(wanted.newton)
    np.testing.assert_allclose(found.potential, wanted.potential, rtol=0, atol=1e-8 * np.abs(wanted.potential).max())
    assert np.array_equal(problem.solve(mesh).potential, found.potential)


@needs_pyamg
@pytest.mark.parametrize("iron", [Material(1e4), Material(bh=Froehlich(500.0, 1.6))], ids=["iron", "steel"])
def test_two_levels_in_space_find_the_solution_of_the_direct_solver(iron):
    axes = [np.linspace(-1.0, 1.0, 7), np.linspace(-1.0, 1.0, 7), np.geomspace(1.0, 20.0, 7)]
    mesh = blocks(axes, {"magnet": ((-0.5, -0.5, 2.0), (0.5, 0.5, 6.0)), "iron": ((-0.5, -0.5, 8.0), (0.5, 0.5, 12.0))})
    materials = {"magnet": Material(1.05, remanence=(0.3, 0.0, 1.2)), "iron": iron, "air": Material()}
    problem, solver = MagneticScalarPotential(materials, {"outer": 0.0}, order=2), Watched()
    wanted, found = problem.solve(mesh), solved_by(problem, solver).solve(mesh)
    assert solver.used and all(solver.used) and len(found.newton) == len(wanted.newton)
    np.testing.assert_allclose(found.potential, wanted.potential, rtol=0, atol=1e-8 * np.abs(wanted.potential).max())


def test_small_systems_and_those_without_pyamg_are_solved_directly(monkeypatch):
    matrix, right, watched = csc_array(np.diag([1.0, 2.0])), np.ones(2), Watched(large=2)
    np.testing.assert_array_equal(watched.solve(matrix, right), [1.0, 0.5])
    assert watched.used == []
    monkeypatch.setitem(sys.modules, "pyamg", None)
    np.testing.assert_array_equal(replace(watched, large=0).solve(matrix, right), [1.0, 0.5])
    assert watched.used == [False]


@needs_pyamg
def test_what_multigrid_cannot_solve_is_left_to_the_direct_solver():
    solver, (mesh, problem) = Watched(most_iterations=1), magnet_over_iron(1)
    assert np.isfinite(solved_by(problem, solver).solve(mesh).energy)
    assert solver.used == [False]
    assert solver.by_multigrid(csc_array(np.diag([np.nan, 2.0])), np.ones(2)) is None


@pytest.mark.parametrize("order", [3, 4, 6])
def test_stars_precondition_every_order_alike(order):
    """Also on layers of .15 and between permeabilities 1 : 1000 the solution is that of direct factors."""
    axis = np.array([0.0, 0.15**2, 0.15, 0.5, 1.0])
    mesh = MeshTet.init_tensor(axis, axis, np.linspace(0.0, 1.0, 3))
    space = Space(mesh, order)
    free = np.setdiff1d(np.arange(space.doflocs.shape[1]), space.on_facets(mesh.boundary_facets()).ravel())
    contrast = np.where(mesh.p[0, mesh.t].mean(axis=0) < 0.15, 1000.0, 1.0)[space.element]
    reduced = space.stiffness(contrast, free)
    right = np.random.default_rng(order).normal(size=reduced.matrix.shape[0])
    found = Solver(large=0).by_stars(reduced.matrix, right, *reduced.subspaces)
    np.testing.assert_allclose(found, spsolve(reduced.matrix, right), atol=1e-7 * np.abs(found).max())
    # A tolerance below rounding errors does not lead to factors, which take minutes.
    assert Solver(large=0, rtol=1e-17).by_stars(reduced.matrix, right, *reduced.subspaces) is not None
