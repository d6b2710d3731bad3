"""Parts of the benchmark `hp` on tiny settings."""

import pytest

from benchmarks.checks import hp_lines, hp_steel
from benchmarks.peers import hp, ngsolve_hp
from benchmarks.peers.contest import Run, best_of, quickest
from benchmarks.problems.corner_models import STEEL, c_core, l_model, magnet_over_iron

TINY = hp.Grid(sizes=(0.5,), levels=(2,), factors=(0.15,), their_orders=(4,), passes=(0,), nodes=1, orders=(4,))


def cells(table):
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def test_ngsolve_and_this_package_are_compared():
    pytest.importorskip("ngsolve")
    (row,) = cells(hp.against_hp([magnet_over_iron()], TINY, [3.0]))
    assert row[0] == "M over iron" and float(row[8]) > 0.0 and float(row[10]) > 0.0


def test_energies_agree_on_the_same_mesh():
    pytest.importorskip("ngsolve")
    rows = cells(hp.on_same_meshes([magnet_over_iron()], [2, 5], repeats=1))
    assert [row[2] for row in rows] == ["2", "5"] and all(float(row[-1]) < 1e-9 for row in rows)


def test_the_loop_of_ngsolve_refines():
    pytest.importorskip("ngsolve")
    runs = ngsolve_hp.loop(magnet_over_iron(), 1.0, 3)
    first, second = next(runs), next(runs)
    assert second.unknowns > first.unknowns and second.error < first.error


def test_the_quickest_run_that_reaches_an_error_is_repeated():
    times = {"a": iter([4.0]), "b": iter([2.0, 1.0]), "c": iter([1.0])}
    errors = {"a": 0.1, "b": 0.2, "c": 2.0}
    calls = [lambda name=name: Run(name, 1, errors[name], next(times[name])) for name in times]
    (runs,) = best_of([calls], [0.5], repeats=2)
    assert [run.seconds for run in runs] == [4.0, 1.0, 1.0]
    assert quickest(runs, 0.5) is runs[1] and quickest(runs, 0.01) is None


@pytest.mark.parametrize("model", [l_model(), c_core(), magnet_over_iron()], ids=lambda model: model.name)
def test_errors_fall_with_order_and_layers(model):
    row = hp_lines.line(model, "start", model.start(), (2, 3, 4))
    assert float(row[3]) > 2.0 * float(row[4]) > 3.0 * float(row[5])
    assert float(row[7]) > 0.98


def test_steel():
    model = c_core(STEEL)
    exact = hp_steel.Exact(model, 211, 2, 5)
    (row,) = cells(hp_steel.to_errors(model, exact, [4.0], [4], [211], repeats=1))
    assert float(row[8]) > 0.0
