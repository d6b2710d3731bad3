"""Parts of the benchmark `hp` on tiny settings."""

import pytest

from benchmarks.checks import hp_steel
from benchmarks.peers import hp, ngsolve_hp
from benchmarks.peers.contest import Run, best_of, quickest
from benchmarks.peers.ngsolve_mesh import netgen_mesh
from benchmarks.problems.corner_models import STEEL, VACUUM_PERMEABILITY, c_core, magnet_over_iron

TINY = hp.Grid(sizes=(0.5,), levels=(2,), factors=(0.15,), their_orders=(4,), passes=(0,), nodes=1, orders=(4,))


def cells(table):
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def test_ngsolve_and_this_package_are_compared():
    pytest.importorskip("ngsolve")
    (row,) = cells(hp.against_hp([magnet_over_iron()], TINY, [3.0]))
    assert row[0] == "M over iron" and float(row[8]) > 0.0 and float(row[9]) > 0.0


@pytest.mark.parametrize("order", [2, 5])
def test_energies_agree_on_the_same_mesh(order):
    pytest.importorskip("ngsolve")
    model, problem = magnet_over_iron(), magnet_over_iron().problem(order)
    mesh = model.with_layers(model.start(), 3)
    discrete = ngsolve_hp.Discrete(model, netgen_mesh(mesh, problem), order)
    discrete.solve()
    found = problem.solve(mesh).squared_norm * VACUUM_PERMEABILITY
    assert found == pytest.approx(discrete.squared_norm, rel=1e-9)


def test_the_quickest_run_that_reaches_an_error_is_repeated():
    times = {"a": iter([4.0]), "b": iter([2.0, 1.0]), "c": iter([1.0])}
    errors = {"a": 0.1, "b": 0.2, "c": 2.0}
    calls = [lambda name=name: Run(name, 1, errors[name], next(times[name])) for name in times]
    (runs,) = best_of([calls], [0.5], repeats=2)
    assert [run.seconds for run in runs] == [4.0, 1.0, 1.0]
    assert quickest(runs, 0.5) is runs[1] and quickest(runs, 0.01) is None


def test_steel():
    model = c_core(STEEL)
    exact = hp_steel.Exact(model, 211, 2, 5)
    (row,) = cells(hp_steel.to_errors(model, exact, [4.0], [4], [211], repeats=1))
    assert float(row[7]) > 0.0
