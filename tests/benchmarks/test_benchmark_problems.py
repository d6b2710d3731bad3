"""The benchmark problems reproduce the published figures, and adaptation lowers their errors."""

from itertools import islice

import numpy as np
import pytest

import kohonen_adapt as ka
from benchmarks.peers.methods import DEFAULT, FLIP, POLISHED, REFINED, Ours
from benchmarks.problems import c_core, published, square_magnet
from benchmarks.problems.c_core import c_core_mesh
from benchmarks.problems.cases import CASES
from benchmarks.problems.square_magnet import magnet_mesh
from benchmarks.table import markdown
from kohonen_adapt.magnetostatics import Magnetostatics, Material


def error(given, mesh):
    """Of a problem or a case."""
    return given.error(mesh, getattr(given, "problem", given).solve(mesh))


UNIFORM = {  # the published error of every case on its start mesh
    "L": (0.123909, 0.079118, 0.050276, 0.031848),
    "H": (0.010234,),
    "M": (21.94, 12.29, 16.88, 9.67),
    "C": (8.256, 5.557),
    "F": (0.0862, 0.0476, 0.0269),
}


@pytest.mark.parametrize("letter", UNIFORM)
def test_uniform_errors_are_those_published(letter):
    assert [error(case, case.start()) for case in CASES[letter]] == pytest.approx(UNIFORM[letter], rel=2e-3)


@pytest.mark.parametrize("name", published.COSINES)
def test_published_problems_converge_in_l2(name):
    errors = [error(*published.cosines(name, squares)) for squares in (20, 40)]
    assert 3.8 < errors[0] / errors[1] < 4.1


@pytest.mark.parametrize("number", range(3))
def test_published_gaussians_converge_in_l2(number):
    problem, mesh = published.gaussians(number)
    errors = [error(problem, each) for each in (mesh, mesh.refined())]
    assert 3.6 < errors[0] / errors[1] < 4.1


def test_refinement_of_the_l_shape_with_unsquared_indicators():
    found = {found.nodes: found.error for found in islice(REFINED.loop(CASES["L"][0]), 13)}
    published = {236: 0.06392, 952: 0.03063, 3643: 0.01544}
    assert {nodes: round(found[nodes], 5) for nodes in published} == published


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
