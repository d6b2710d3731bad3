"""The benchmark problems reproduce the published figures, and adaptation lowers their errors."""

import runpy
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.checks.reference_round import reference_round
from benchmarks.peers.methods import DEFAULT, FLIP, POLISHED, REFINED, Ours
from benchmarks.problems import c_core, l_shape, published, square_magnet
from benchmarks.problems.c_core import CCore, c_core_mesh
from benchmarks.problems.cases import CASES
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.problems.poisson_l import PoissonL
from benchmarks.problems.square_magnet import SquareMagnet, magnet_mesh
from benchmarks.table import markdown
from kohonen_adapt.magnetostatics import Magnetostatics, Material


def error(given, mesh):
    """Of a problem or a case."""
    return given.error(mesh, getattr(given, "problem", given).solve(mesh))


@pytest.mark.parametrize(
    ("n", "nodes", "published"), [(8, 225, 0.123909), (16, 833, 0.079118), (32, 3201, 0.050276), (64, 12545, 0.031848)]
)
def test_uniform_error_of_the_l_shape(n, nodes, published):
    mesh = l_shaped_mesh(n)
    assert mesh.p.shape[1] == nodes
    assert error(LShape(), mesh) == pytest.approx(published, abs=5e-7)


def test_uniform_error_of_helmholtz():
    (case,) = CASES["H"]
    mesh = case.start()
    assert mesh.nvertices == 441
    assert error(case, mesh) == pytest.approx(0.010234, abs=5e-7)


@pytest.mark.parametrize("name", published.COSINES)
def test_published_problems_converge_in_l2(name):
    errors = [error(*published.cosines(name, squares)) for squares in (20, 40)]
    assert 3.8 < errors[0] / errors[1] < 4.1


@pytest.mark.parametrize("number", range(3))
def test_published_gaussians_converge_in_l2(number):
    problem, mesh = published.gaussians(number)
    errors = [error(problem, each) for each in (mesh, mesh.refined())]
    assert 3.6 < errors[0] / errors[1] < 4.1


@pytest.mark.parametrize(
    ("iron", "n", "percent"),
    [(False, 20, 21.94), (False, 40, 12.29), (False, 80, 6.74), (True, 20, 16.88), (True, 40, 9.67), (True, 80, 5.51)],
)
def test_uniform_error_of_the_square_magnet(iron, n, percent):
    assert 100 * error(SquareMagnet(iron), magnet_mesh(n, iron)) == pytest.approx(percent, abs=5.5e-3)


@pytest.mark.parametrize(("name", "nodes", "percent"), [("c_core.msh", 899, 8.256), ("c_core_fine.msh", 2983, 5.557)])
def test_uniform_error_of_the_c_core(name, nodes, percent):
    mesh = c_core_mesh(name)
    assert mesh.p.shape[1] == nodes
    assert 100 * error(CCore(), mesh) == pytest.approx(percent, abs=5e-4)


def test_the_c_core_is_that_of_the_example():
    example = runpy.run_path(str(c_core.EXAMPLES / "magnet.py"))
    mesh = c_core_mesh("c_core.msh")
    field = replace(example["PROBLEM"], order=1).solve(mesh)
    np.testing.assert_allclose(CCore().solve(mesh), field.potential, atol=1e-12 * abs(field.potential).max())


@pytest.mark.parametrize(("n", "published"), [(8, 0.0862), (16, 0.0476), (32, 0.0269)])
def test_uniform_error_of_example_22(n, published):
    assert error(PoissonL(), l_shaped_mesh(n)) == pytest.approx(published, abs=5e-5)


def test_refinement_of_the_l_shape_with_unsquared_indicators():
    found = {found.nodes: found.error for found in islice(REFINED.loop(CASES["L"][0]), 13)}
    published = {236: 0.06392, 952: 0.03063, 3643: 0.01544}
    assert {nodes: round(found[nodes], 5) for nodes in published} == published


def test_refinement_of_helmholtz_with_squared_indicators():
    found = next(found for found in REFINED.loop(CASES["H"][0]) if found.nodes > 400)
    assert found.nodes == 422
    assert found.error == pytest.approx(0.00188, abs=5e-6)


def test_the_yardstick_solves_and_estimates_the_same_problem():
    mesh = l_shaped_mesh(8)
    solution, indicators = reference_round(mesh)
    problem = LShape()
    np.testing.assert_allclose(solution, problem.solve(mesh), atol=1e-13)
    np.testing.assert_allclose(indicators, problem.indicators(mesh, solution), rtol=1e-10)


def test_the_indicators_of_the_problems_are_those_of_the_package():
    problem, mesh = SquareMagnet(iron=True), magnet_mesh(20, iron=True)
    solution = problem.solve(mesh)
    reluctivity, flux = np.ones(mesh.t.shape[1]), np.zeros((2, mesh.t.shape[1]))
    reluctivity[mesh.subdomains["iron"]] = 1e-3
    flux[0, mesh.subdomains["magnet"]] = -1.0
    package = ka.estimators.residual(mesh, solution, reluctivity, flux=flux)
    np.testing.assert_allclose(problem.indicators(mesh, solution), package, atol=1e-12)


def test_exact_error_does_not_depend_on_the_order_of_nodes_and_elements():
    mesh = l_shaped_mesh(4)
    rng = np.random.default_rng(1)
    number = rng.permutation(mesh.p.shape[1])
    p = np.empty_like(mesh.p)
    p[:, number] = mesh.p
    shuffled = MeshTri(p, number[mesh.t[:, rng.permutation(mesh.t.shape[1])]])
    assert error(LShape(), shuffled) == pytest.approx(error(LShape(), mesh), rel=1e-12)


def test_exact_solution_vanishes_on_both_sides_of_the_corner_in_spite_of_rounding():
    x = np.array([[0.5, 0.5, 1e-17, -1e-17], [1e-17, -1e-17, -0.5, -0.5]])
    np.testing.assert_allclose(l_shape.exact(x), 0.0, atol=1e-15)


def test_table_is_aligned():
    table = markdown(["name", "x"], [["a", 1.0], ["long name", None]]).splitlines()
    assert table == ["| name      |     x |", "| --------- | ----: |", "| a         | 1.000 |", "| long name |       |"]


@pytest.mark.parametrize("name", ["C", "M", "M over iron"])
def test_reference_energies_are_those_of_order_8(name):
    if name == "C":
        parts = {"iron": Material(1000.0), "magnet": Material(1.05, remanence=(0.0, 1.2)), "air": Material()}
        mesh, problem = c_core_mesh("c_core_coarse.msh"), Magnetostatics(parts, {"outer": 0.0}, order=8)
        exact = c_core.REFERENCE_ENERGY
    else:
        iron = name.endswith("iron")
        mesh, problem = square_magnet.named(magnet_mesh(20, iron)), square_magnet.MagnetOfOrder.of(8, iron)
        exact = square_magnet.REFERENCE_ENERGY[iron]
    result = ka.adapt(mesh, problem, passes=2)
    found = 4e-7 * np.pi * (result.best.energy_norm**2 + result.estimate**2)
    assert found == pytest.approx(exact, rel=1e-8)


FIXED = Ours("map only, fixed", 3, {"topology": "fixed", "polish": False})
BANDS = [  # letter, which of its cases, variant, and the band of the ratio of the error to the uniform mesh
    ("L", 0, FIXED, 0.40, 0.75),
    ("L", 0, FLIP, 0.38, 0.55),
    ("L", 0, POLISHED, 0.38, 0.47),
    ("L", 0, DEFAULT, 0.36, 0.45),
    ("L", 1, FIXED, 0.40, 0.60),
    ("L", 1, FLIP, 0.30, 0.40),
    ("H", 0, FIXED, 0.12, 0.35),
    ("H", 0, FLIP, 0.08, 0.18),
    ("H", 0, DEFAULT, 0.08, 0.18),
    ("M", 0, FIXED, 0.60, 0.90),
    ("M", 0, FLIP, 0.45, 0.75),
    ("M", 0, POLISHED, 0.50, 0.67),
    ("M", 0, DEFAULT, 0.42, 0.52),
    ("M", 2, FIXED, 0.55, 0.90),
    ("M", 2, FLIP, 0.45, 0.75),
    ("M", 2, POLISHED, 0.45, 0.62),
    ("M", 2, DEFAULT, 0.40, 0.52),
    ("C", 0, POLISHED, 0.45, 0.70),
    ("C", 0, DEFAULT, 0.32, 0.42),
    ("F", 0, POLISHED, 0.45, 0.62),
    ("F", 0, DEFAULT, 0.40, 0.55),
]


@pytest.mark.parametrize(
    ("letter", "number", "way", "low", "high"), BANDS, ids=lambda value: getattr(value, "name", None)
)
def test_adaptation_lowers_the_error(letter, number, way, low, high):
    case = CASES[letter][number]
    start, found = case.start(), way.run(case)
    assert low < found.error / error(case, start) < high
    assert found.nodes == start.nvertices
    assert ka.quality(found.mesh).min() > (0.0 if way is FIXED else 0.02)  # in a metric
